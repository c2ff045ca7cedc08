//! Analyses shared by several factorizations: finding the elimination order dominates the cost of a small
//! factorization.

use super::Fingerprint;
use super::ordering::{self, Ordering};
use crate::error::Result;
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::cholesky::SymbolicCholesky;
use std::sync::{Arc, Mutex, PoisonError};

/// The last analyses of a solver and of its clones, for any thread.
#[derive(Clone, Debug, Default)]
pub(super) struct Analyses(Arc<Mutex<Vec<Analysis>>>);

#[derive(Debug)]
struct Analysis {
    pattern: Fingerprint,
    last: Vec<usize>,
    symbolic: Arc<SymbolicCholesky<usize>>,
}

impl Analyses {
    /// A run needs two for each effective matrix of its stages; this is more than any scheme needs.
    const MOST: usize = 16;

    /// The analysis of a pattern with `last` eliminated last, from the cache or computed and cached.
    ///
    /// The lock is not held during the computation: the threads of a pool may share an analysis, and each may be
    /// waiting for the lock. Two threads that need the same analysis at the same time both compute it, with the same
    /// result.
    pub(super) fn symbolic(
        &self,
        ordering: &Ordering,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Arc<SymbolicCholesky<usize>>> {
        let fingerprint = Fingerprint::of(pattern);
        let known = |analysis: &&Analysis| analysis.pattern == fingerprint && analysis.last == last;
        let remembered = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(analysis) = remembered().iter().find(known) {
            return Ok(analysis.symbolic.clone());
        }
        let symbolic = Arc::new(ordering::symbolic_cholesky(ordering, pattern, last)?);
        let mut analyses = remembered();
        if analyses.len() == Self::MOST {
            analyses.remove(0);
        }
        analyses.push(Analysis { pattern: fingerprint, last: last.to_vec(), symbolic: symbolic.clone() });
        Ok(symbolic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::sparse::{SparseColMat, Triplet};

    fn tied(n: usize, pairs: impl Iterator<Item = (usize, usize)>) -> SparseColMat<usize, f64> {
        let diagonal = (0..n).map(|i| Triplet::new(i, i, 1.0));
        let beside = pairs.flat_map(|(i, j)| [Triplet::new(i, j, 1.0), Triplet::new(j, i, 1.0)]);
        SparseColMat::try_new_from_triplets(n, n, &diagonal.chain(beside).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn analyses_are_made_once_and_not_mixed_up() {
        let analyses = Analyses::default();
        let [ring, star] = [tied(9, (0..9).map(|i| (i, (i + 1) % 9))), tied(9, (1..9).map(|i| (0, i)))];
        let of = |a: &SparseColMat<usize, f64>, last: &[usize]| {
            analyses.symbolic(&Ordering::Automatic, a.symbolic(), last).unwrap()
        };
        let first = of(&ring, &[]);
        for (a, last) in [(&star, &[][..]), (&ring, &[3]), (&ring, &[4])] {
            let other = of(a, last);
            assert!(!Arc::ptr_eq(&first, &other));
            assert!(Arc::ptr_eq(&other, &of(a, last)));
            let alone = ordering::symbolic_cholesky(&Ordering::Automatic, a.symbolic(), last).unwrap();
            assert_eq!(alone.perm().unwrap().arrays(), other.perm().unwrap().arrays());
        }
        assert!(Arc::ptr_eq(&first, &of(&ring, &[])));
    }

    #[test]
    fn the_oldest_makes_room() {
        let analyses = Analyses::default();
        let chain = |n: usize| tied(n, (1..n).map(|i| (i - 1, i)));
        let of = |n: usize| analyses.symbolic(&Ordering::Automatic, chain(n).symbolic(), &[]).unwrap();
        let (first, second) = (of(2), of(3));
        for n in 4..Analyses::MOST + 3 {
            of(n);
        }
        assert!(!Arc::ptr_eq(&first, &of(2)) && !Arc::ptr_eq(&second, &of(3)));
        assert_eq!(analyses.0.lock().unwrap().len(), Analyses::MOST);
    }
}
