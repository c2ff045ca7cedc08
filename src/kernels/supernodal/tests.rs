//! Factors compared with those of faer: random forests, dense blocks with several tiles, failing pivots.

use super::*;
use faer::Side;
use faer::dyn_stack::MemStack;
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMat, Triplet};

/// Pseudo-random numbers in [0, 1).
struct Numbers(u64);

impl Numbers {
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u32::try_from(self.0 >> 33).unwrap()
    }

    fn next(&mut self) -> f64 {
        f64::from(self.bits()) / f64::from(1_u32 << 31)
    }

    /// A whole number below `n`.
    fn below(&mut self, n: usize) -> usize {
        self.bits() as usize % n
    }
}

/// A positive definite matrix with these entries below the diagonal; its diagonal exceeds dominance by `shift`.
fn matrix(n: usize, below: &[(usize, usize)], shift: f64) -> SparseColMat<usize, f64> {
    let mut numbers = Numbers(n as u64);
    let mut diagonal = vec![shift; n];
    let mut entries = Vec::new();
    for &(i, j) in below {
        let x = numbers.next() - 0.5;
        entries.extend([Triplet::new(i, j, x), Triplet::new(j, i, x)]);
        diagonal[i] += x.abs();
        diagonal[j] += x.abs();
    }
    entries.extend(diagonal.iter().enumerate().map(|(i, &x)| Triplet::new(i, i, x)));
    SparseColMat::try_new_from_triplets(n, n, &entries).unwrap()
}

fn analyzed(a: &SparseColMat<usize, f64>, ordering: SymmetricOrdering<'_, usize>) -> SymbolicCholesky<usize> {
    let supernodal_flop_ratio_threshold = SupernodalThreshold::FORCE_SUPERNODAL;
    let parameters = CholeskySymbolicParams { supernodal_flop_ratio_threshold, ..Default::default() };
    factorize_symbolic_cholesky(a.symbolic(), Side::Lower, ordering, parameters).unwrap()
}

/// Values and pivots of this crate.
fn ours(symbolic: &SymbolicCholesky<usize>, a: &SparseColMat<usize, f64>) -> Result<(Vec<f64>, Vec<f64>), usize> {
    let SymbolicCholeskyRaw::Supernodal(raw) = symbolic.raw() else { panic!("a supernodal factor") };
    let n = a.ncols();
    let workspaces = PerThread::new(|| workspace::<f64>(n)).unwrap();
    let order = symbolic.perm().map(PermRef::arrays);
    let elimination = &Elimination::new(raw).unwrap();
    let problem = Problem { symbolic: raw, elimination, a: a.as_ref(), order, workspaces: &workspaces };
    let (mut values, mut pivots) = (vec![f64::NAN; raw.len_val()], vec![0.0; n]);
    factorize(&problem, &mut values, &mut pivots).map(|()| (values, pivots))
}

/// Values of faer, or the dof of the failing pivot.
fn faers(symbolic: &SymbolicCholesky<usize>, a: &SparseColMat<usize, f64>) -> Result<Vec<f64>, usize> {
    let mut values = vec![0.0; symbolic.len_val()];
    let (seq, spec) = (Par::Seq, Spec::default());
    let mut memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(seq, spec));
    let (regularization, stack) = (LltRegularization::default(), MemStack::new(&mut memory));
    match symbolic.factorize_numeric_llt(&mut values, a.as_ref(), Side::Lower, regularization, seq, stack, spec) {
        Ok(_) => Ok(values),
        Err(LltError::NonPositivePivot { index }) => Err(symbolic.perm().map_or(index, |perm| perm.arrays().0[index])),
    }
}

fn check(a: &SparseColMat<usize, f64>, symbolic: &SymbolicCholesky<usize>) {
    // A diagonal matrix has a simplicial factor.
    if matches!(symbolic.raw(), SymbolicCholeskyRaw::Simplicial(_)) {
        return assert_eq!(symbolic.len_val(), a.ncols());
    }
    let (values, pivots) = ours(symbolic, a).unwrap();
    let expected = faers(symbolic, a).unwrap();
    let largest = expected.iter().fold(0.0, |largest, x: &f64| x.abs().max(largest));
    let worst = values.iter().zip(&expected).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-13 * largest, "{worst:e} of {largest:e}");
    assert!(values.iter().all(|x| x.is_finite()));
    assert!(pivots.iter().all(|&pivot| pivot > 0.0));
}

#[test]
fn factors_of_random_matrices_are_those_of_faer() {
    let mut numbers = Numbers(1);
    for n in [1, 2, 3, 7, 20, 61, 150, 400] {
        for density in [0, 1, 4, 12] {
            let count = n * density / 2;
            // Half of the entries are far from the diagonal: forests with several trees, wide and narrow supernodes.
            let mut below: Vec<_> = (0..count)
                .map(|k| {
                    let i = numbers.below(n);
                    let reach = if k % 2 == 0 { i } else { i.min(4) };
                    (i, i - numbers.below(reach + 1))
                })
                .filter(|(i, j)| i != j)
                .collect();
            below.sort_unstable();
            below.dedup();
            let a = matrix(n, &below, 0.1);
            check(&a, &analyzed(&a, SymmetricOrdering::Amd));
            check(&a, &analyzed(&a, SymmetricOrdering::Identity));
        }
    }
}

/// Two dense blocks that only a third one connects, in this order: supernodes with several tiles, panels, chunks of
/// rows and slabs, updated from two branches.
fn blocks(sizes: [usize; 3]) -> SparseColMat<usize, f64> {
    let n: usize = sizes.iter().sum();
    let block = |i: usize| usize::from(i >= sizes[0]) + usize::from(i >= sizes[0] + sizes[1]);
    // Each is coupled with two thirds of the third one, so that they are separate supernodes.
    let (third, part) = (sizes[0] + sizes[1], sizes[2] / 3);
    let coupled = |i: usize, j: usize| match (block(i), block(j)) {
        (2, 0) => i < third + 2 * part,
        (2, 1) => i >= third + part,
        (one, other) => one == other,
    };
    let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
    let below: Vec<_> = pairs.filter(|&(i, j)| coupled(i, j)).collect();
    matrix(n, &below, 1.0)
}

#[test]
fn factors_with_several_tiles_are_those_of_faer() {
    for sizes in [[300, 280, 330], [0, 0, 2 * PANEL + 1], [DEPTH + 1, TRIANGLE, ROWS + 7]] {
        let a = blocks(sizes);
        let symbolic = analyzed(&a, SymmetricOrdering::Identity);
        let SymbolicCholeskyRaw::Supernodal(raw) = symbolic.raw() else { panic!("a supernodal factor") };
        let elimination = Elimination::new(raw).unwrap();
        assert!((0..raw.n_supernodes()).any(|s| elimination.is_heavy(s)), "{sizes:?}");
        check(&a, &symbolic);
    }
    let forked = blocks([300, 280, 330]);
    let symbolic = analyzed(&forked, SymmetricOrdering::Identity);
    let SymbolicCholeskyRaw::Supernodal(raw) = symbolic.raw() else { panic!("a supernodal factor") };
    assert!(
        matches!(&Elimination::new(raw).unwrap().plan, Plan::Stem(branch, _) if matches!(**branch, Plan::Fork(..)))
    );
}

/// The error names the first failing pivot in the order of elimination, whichever branch finds one first.
#[test]
fn pivots_that_fail_are_those_of_faer() {
    let a = blocks([300, 280, 330]);
    let broken = |dofs: &[usize]| {
        let mut values = a.val().to_vec();
        for &dof in dofs {
            let k = a.as_ref().row_idx_of_col_raw(dof).iter().position(|&row| row == dof).unwrap();
            values[a.as_ref().col_range(dof).start + k] = -1.0;
        }
        SparseColMat::new(a.symbolic().to_owned().unwrap(), values)
    };
    for dofs in [&[0][..], &[299], &[300], &[130, 10], &[310, 20], &[579, 580], &[580], &[909], &[700, 905]] {
        let broken = broken(dofs);
        for ordering in [SymmetricOrdering::Identity, SymmetricOrdering::Amd] {
            let symbolic = analyzed(&broken, ordering);
            let (found, expected) = (ours(&symbolic, &broken), faers(&symbolic, &broken));
            assert!(expected.is_err());
            assert_eq!(found.err(), expected.err(), "{dofs:?}");
        }
    }
}
