//! What is known of W while it stays the same: that its entries are finite, whether it is symmetric, and the nonzero
//! range of each row. In a row of bodies, the contacts of one joint move only the next joints, so the zeros beyond need
//! not be read.

use super::{ContactFailure, ContactProblem};
use crate::real::Real;
use crate::rounding;
use std::ops::Range;

/// Whether W is symmetric to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Symmetry {
    #[default]
    Symmetric,
    General,
}

/// The symmetry of one version of W, and the range from the first to the last nonzero entry of each row.
#[derive(Clone, Debug, Default)]
pub(super) struct Structure {
    version: u64,
    symmetry: Symmetry,
    ranges: Vec<(usize, usize)>,
}

/// Ranges begin and end at multiples of this number, the number of partial sums of a [`dot`](crate::dense::dot), so
/// that products are bitwise equal to those over whole rows.
const LANES: usize = 4;

impl Structure {
    /// Whether this is the structure of the problem's W, by its version.
    pub(super) fn is_known<T: Real>(&self, problem: &ContactProblem<'_, T>) -> bool {
        problem.version != 0 && self.version == problem.version
    }

    /// Finds the structure of another W. NaN counts as nonzero.
    pub(super) fn find<T: Real>(&mut self, problem: &ContactProblem<'_, T>) {
        self.version = problem.version;
        self.symmetry = match problem.asymmetry(rounding::asymmetry()) {
            None => Symmetry::Symmetric,
            Some(_) => Symmetry::General,
        };
        self.ranges.clear();
        self.ranges.extend((0..problem.size()).map(|i| {
            let row = problem.row(i);
            let begin = row.iter().position(|w| *w != T::zero()).unwrap_or(i).min(i);
            let last = row.iter().rposition(|w| *w != T::zero()).unwrap_or(i).max(i);
            let end = (last + 1).next_multiple_of(LANES);
            (begin - begin % LANES, if end > row.len() - row.len() % LANES { row.len() } else { end })
        }));
    }

    pub(super) fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    /// The nonzero range of row i; it always includes the diagonal.
    pub(super) fn range(&self, i: usize) -> Range<usize> {
        let (begin, end) = self.ranges[i];
        begin..end
    }
}

impl<T: Real> ContactProblem<'_, T> {
    /// Rejects values that are not finite; W is skipped if it is `known` to be finite.
    pub(super) fn check_finite(&self, known: bool) -> Result<(), ContactFailure<T>> {
        let finite = |i: &usize| self.offset[*i].is_finite() && (known || T::all_finite(self.row(*i)));
        match (0..self.size()).find(|i| !finite(i)) {
            Some(row) => Err(ContactFailure::NotConverged { iterations: 0, row, residual: T::nan() }),
            None => Ok(()),
        }
    }

    /// Rejects what a solver for symmetric W without friction cannot solve. Asymmetry from rounding of badly
    /// conditioned responses is tolerated here; the acceptance rule judges its effect.
    pub(super) fn check_symmetric(&self) -> Result<(), ContactFailure<T>> {
        if let Some((rows, _)) = self.blocks().find(|(_, set)| set.friction().is_some()) {
            return Err(ContactFailure::Friction { row: rows.start });
        }
        match self.asymmetry(rounding::half_digits()) {
            Some((row, other)) => Err(ContactFailure::Unsymmetric { row, other }),
            None => Ok(()),
        }
    }

    /// The row and column of the largest asymmetry of W, if it exceeds a share of √(W_ii W_jj).
    fn asymmetry(&self, share: T) -> Option<(usize, usize)> {
        /// Size of the tiles in which W is compared: columns of a large W map to cache lines that evict each other.
        const TILE: usize = 8;
        let (size, mut worst) = (self.size(), (share, None));
        let root = |i: usize| self.delassus(i, i).abs().sqrt();
        for (first, columns) in (0..size).step_by(TILE).flat_map(|i| (0..=i).step_by(TILE).map(move |j| (i, j))) {
            for i in first..(first + TILE).min(size) {
                for j in columns..(columns + TILE).min(i) {
                    let (w, mirrored) = (self.delassus(i, j), self.delassus(j, i));
                    let (difference, sum) = ((w - mirrored).abs(), w.abs() + mirrored.abs());
                    if difference > worst.0 * sum {
                        let scale = sum.max(root(i) * root(j));
                        if difference > worst.0 * scale {
                            worst = (difference / scale, Some((i, j)));
                        }
                    }
                }
            }
        }
        worst.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact_solver::AdmissibleSet;
    use crate::dense::dot;

    #[test]
    fn products_over_nonzero_ranges_are_those_of_whole_rows() {
        for size in [1, 3, 8, 29] {
            let entry = |e: usize| {
                let (i, j) = (e / size, e % size);
                if i.abs_diff(j) <= i % 7 && i % 5 != 4 { ((e * e) as f64).sin() } else { 0.0 }
            };
            let w: Vec<f64> = (0..size * size).map(entry).collect();
            let (x, sets) = ((0..size).map(|i| (i as f64).cos()).collect::<Vec<_>>(), vec![AdmissibleSet::Free; size]);
            let problem = ContactProblem::new(&w, &x, &sets, &x).unwrap();
            let mut structure = Structure::default();
            structure.find(&problem);
            for i in 0..size {
                let range = structure.range(i);
                assert!(range.contains(&i) && range.end <= size);
                assert!(problem.row(i)[..range.start].iter().chain(&problem.row(i)[range.end..]).all(|w| *w == 0.0));
                for end in [i + 1, size] {
                    let part = range.start..range.end.min(end);
                    let whole = dot(&problem.row(i)[..end], &x[..end]);
                    assert_eq!(dot(&problem.row(i)[part.clone()], &x[part]).to_bits(), whole.to_bits(), "{size} {i}");
                }
            }
        }
    }
}
