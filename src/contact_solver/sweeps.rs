//! Sweeps over the blocks of a problem with cones: each block in turn is solved while the others keep their
//! multipliers.

use super::cone::Cone;
use super::{AdmissibleSet, ContactProblem};
use crate::real::Real;
use std::ops::Range;

/// The memory of sweeps. A symmetric W is read once per sweep, row by row up to the diagonal: the contributions of
/// later blocks to a row were summed when their rows were read, in the previous sweep. W is taken as symmetric until
/// a result shows that it is not.
#[derive(Clone, Debug, Default)]
pub(super) struct Sweeps<T> {
    /// Whether W is symmetric, if known.
    is_symmetric: Option<bool>,
    /// Σ W λ over the blocks after each row: with their present multipliers, and with the ones from this sweep.
    behind: Vec<T>,
    next: Vec<T>,
}

impl<T: Real> Sweeps<T> {
    /// Discards the symmetry of another problem.
    pub(super) fn reset(&mut self) {
        self.is_symmetric = None;
    }

    /// Whether W was taken as symmetric but is not; from then on all of it is read.
    pub(super) fn is_mistaken(&mut self, problem: &ContactProblem<'_, T>) -> bool {
        /// Roundings by which a symmetric W may differ across its diagonal.
        const ROUNDED: f64 = 64.0;
        if self.is_symmetric.is_some() {
            return false;
        }
        let symmetric = problem.asymmetry(T::of(ROUNDED) * T::epsilon()).is_none();
        self.is_symmetric = Some(symmetric);
        !symmetric
    }

    /// Reads all of W from the next sweep on.
    pub(super) fn read_all(&mut self) {
        self.is_symmetric = Some(false);
    }

    /// Whether W is read up to its diagonal only.
    fn reads_half(&self) -> bool {
        self.is_symmetric != Some(false)
    }

    /// Starts with these multipliers.
    pub(super) fn begin(&mut self, problem: &ContactProblem<'_, T>, multipliers: &[T]) {
        if self.reads_half() {
            for values in [&mut self.behind, &mut self.next] {
                values.clear();
                values.resize(problem.size(), T::zero());
            }
            if multipliers.iter().any(|&multiplier| multiplier != T::zero()) {
                for (rows, _) in problem.blocks() {
                    spread(problem, rows, multipliers, &mut self.behind);
                }
            }
        }
    }

    /// One sweep, relaxed by `omega`. Returns the largest change of a multiplier times its own compliance; NaN if one
    /// is NaN.
    pub(super) fn sweep(&mut self, problem: &ContactProblem<'_, T>, omega: T, multipliers: &mut [T]) -> T {
        let mut largest = T::zero();
        for (rows, set) in problem.blocks() {
            let block = self.alone(problem, rows.clone(), set, multipliers);
            let own = &mut multipliers[rows.clone()];
            let mut solved = [T::zero(); 3];
            if set.friction().is_some() {
                solved = block.solve();
            } else if block.delassus[0][0] > T::zero() {
                solved[0] = -block.offset[0] / block.delassus[0][0];
            } else {
                // No multiplier changes its gap.
                solved[0] = own[0];
            }
            for (k, (multiplier, solved)) in own.iter_mut().zip(solved).enumerate() {
                let before = *multiplier;
                *multiplier += omega * (solved - before);
                if set.friction().is_none() {
                    *multiplier = set.nearest(*multiplier);
                }
                let change = block.delassus[k][k] * (*multiplier - before).abs();
                // `max` would ignore NaN.
                if change > largest || change.is_nan() {
                    largest = change;
                }
            }
            // An over-relaxed block may leave its cone.
            if omega > T::one() && set.friction().is_some() {
                set.project(own);
            }
            if self.reads_half() {
                spread(problem, rows, multipliers, &mut self.next);
            }
        }
        if self.reads_half() {
            std::mem::swap(&mut self.behind, &mut self.next);
            self.next.fill(T::zero());
        }
        largest
    }

    /// A block with the others at their present multipliers.
    fn alone(
        &self,
        problem: &ContactProblem<'_, T>,
        rows: Range<usize>,
        set: AdmissibleSet,
        multipliers: &[T],
    ) -> Cone<T> {
        let (first, size) = (rows.start, rows.len());
        let reads = if self.reads_half() { first } else { problem.size() };
        let others = products(problem, rows.clone(), &multipliers[..reads]);
        let mut block = free_block(problem, rows.clone(), set);
        for (i, row) in rows.enumerate() {
            block.offset[i] += others[i];
            if self.reads_half() {
                block.offset[i] += self.behind[row];
            } else {
                for (&w, &multiplier) in block.delassus[i].iter().zip(&multipliers[first..first + size]) {
                    block.offset[i] -= w * multiplier;
                }
            }
            if i > 0 {
                block.guess[i - 1] = multipliers[row];
            }
        }
        block
    }
}

/// A block with the others at zero.
pub(super) fn free_block<T: Real>(problem: &ContactProblem<'_, T>, rows: Range<usize>, set: AdmissibleSet) -> Cone<T> {
    let (size, friction) = (rows.len(), T::of(set.friction().unwrap_or(0.0)));
    let (mut delassus, mut offset, mut noise) = ([[T::zero(); 3]; 3], [T::zero(); 3], T::zero());
    for (i, row) in rows.clone().enumerate() {
        delassus[i][..size].copy_from_slice(&problem.row(row)[rows.clone()]);
        offset[i] = problem.offset[row];
        if i > 0 {
            noise = noise.max(problem.tolerance[row] + T::epsilon() * problem.offset[row].abs());
        }
    }
    let guess = [T::zero(); 2];
    Cone { delassus, offset, friction, tangents: size - 1, is_bilateral: set.is_bilateral(), noise, guess }
}

/// Rows of W times the multipliers of the first rows.
fn products<T: Real>(problem: &ContactProblem<'_, T>, rows: Range<usize>, multipliers: &[T]) -> [T; 3] {
    let (row, mut sums) = (|k: usize| &problem.row(rows.start + k)[..multipliers.len()], [T::zero(); 3]);
    match rows.len() {
        1 => sums[..1].copy_from_slice(&T::products([row(0)], multipliers)),
        2 => sums[..2].copy_from_slice(&T::products([row(0), row(1)], multipliers)),
        _ => sums = T::products([row(0), row(1), row(2)], multipliers),
    }
    sums
}

/// Adds the contributions of the multipliers of a block to the rows before it.
fn spread<T: Real>(problem: &ContactProblem<'_, T>, rows: Range<usize>, multipliers: &[T], sums: &mut [T]) {
    let own = &multipliers[rows.clone()];
    if own.iter().all(|&multiplier| multiplier == T::zero()) {
        return;
    }
    let (row, sums) = (|k: usize| &problem.row(rows.start + k)[..rows.start], &mut sums[..rows.start]);
    match *own {
        [a] => T::add_all([a], [row(0)], sums),
        [a, b] => T::add_all([a, b], [row(0), row(1)], sums),
        [a, b, c, ..] => T::add_all([a, b, c], [row(0), row(1), row(2)], sums),
        [] => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The change returned by a sweep is the actual change, and NaN if that is NaN.
    #[test]
    fn a_sweep_says_its_largest_change() {
        let (w, tolerance) = ([2.0, 1.0, 1.0, 4.0], [1e-14; 2]);
        let sets = [AdmissibleSet::NonNegative; 2];
        for (offset, most) in [([-2.0, -5.0], 4.0), ([-8.0, -5.0], 8.0), ([1.0, 2.0], 0.0)] {
            let problem = ContactProblem::of(&w, &offset, &sets, &tolerance, 0);
            let (mut sweeps, mut multipliers) = (Sweeps::default(), [0.0; 2]);
            sweeps.begin(&problem, &multipliers);
            // The second row is solved with the multiplier of the first one: 1 or 4.
            let change: f64 = sweeps.sweep(&problem, 1.0, &mut multipliers);
            assert!((change - most).abs() < 1e-15, "{offset:?}: {change}");
        }
        let (offset, sets) = ([f64::NAN, -5.0], [AdmissibleSet::Free; 2]);
        let problem = ContactProblem::of(&w, &offset, &sets, &tolerance, 0);
        let (mut sweeps, mut multipliers) = (Sweeps::default(), [0.0; 2]);
        sweeps.begin(&problem, &multipliers);
        assert!(sweeps.sweep(&problem, 1.0, &mut multipliers).is_nan());
    }
}
