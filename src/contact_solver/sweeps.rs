//! Sweeps over the blocks of a problem with cones: each block in turn is solved while the others keep their
//! multipliers.

use super::acceptance::Acceptance;
use super::cone::Cone;
use super::structure::Symmetry;
use super::{AdmissibleSet, ContactProblem};
use crate::real::Real;
use std::ops::Range;

/// The memory of sweeps. A symmetric W is read once per sweep, row by row up to the diagonal: the contributions of
/// later blocks to a row were summed when their rows were read, in the previous sweep.
#[derive(Clone, Debug, Default)]
pub(super) struct Sweeps<T> {
    symmetry: Symmetry,
    /// Σ W λ over the blocks after each row: with their present multipliers, and with the ones from this sweep.
    behind: Vec<T>,
    next: Vec<T>,
}

/// Relaxation factor and limit of sweeps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Schedule<T> {
    pub(super) omega: T,
    pub(super) sweeps: usize,
    /// Whether sweeps end once the change per sweep hardly decreases.
    pub(super) impatient: bool,
}

impl<T: Real> Sweeps<T> {
    /// Sweeps until the problem is solved; returns whether it is solved and counts the sweeps.
    pub(super) fn solve(
        &mut self,
        acceptance: &Acceptance<'_, T>,
        symmetry: Symmetry,
        schedule: Schedule<T>,
        spent: &mut usize,
        multipliers: &mut [T],
    ) -> bool {
        /// Interval of sweeps in which the change must halve; otherwise it may be rounding already.
        const LOOK: usize = 8;
        /// Growth of the change that counts as divergence, possible for an unsymmetric W; the multipliers are then
        /// discarded.
        const DIVERGES: f64 = 1e3;
        // If zero forces solve the problem within rounding, they are kept: a force due to rounding would select a
        // friction.
        if acceptance.accepts(multipliers) {
            return true;
        }
        let problem = acceptance.problem();
        self.symmetry = symmetry;
        self.begin(problem, multipliers);
        let (mut before, mut least) = (T::infinity(), T::infinity());
        for sweep in 1..=schedule.sweeps {
            let change = self.sweep(problem, schedule.omega, multipliers);
            *spent += 1;
            least = least.min(change);
            // NaN diverges.
            let bounded = change <= T::of(DIVERGES) * least && change.is_finite();
            if !bounded {
                multipliers.fill(T::zero());
                return false;
            }
            let looks = sweep.is_multiple_of(LOOK);
            let stalls = looks && change > T::of(0.5) * before;
            if (stalls || change <= acceptance.accepted() || sweep == schedule.sweeps)
                && acceptance.accepts(multipliers)
            {
                return true;
            }
            if stalls && schedule.impatient {
                break;
            }
            if looks {
                before = change;
            }
        }
        false
    }

    /// Starts with these multipliers.
    fn begin(&mut self, problem: &ContactProblem<'_, T>, multipliers: &[T]) {
        if self.reads_half() {
            for values in [&mut self.behind, &mut self.next] {
                values.clear();
                values.resize(problem.size(), T::zero());
            }
            for (rows, _) in problem.blocks() {
                spread(problem, rows, multipliers, &mut self.behind);
            }
        }
    }

    /// Whether W is read up to its diagonal only.
    fn reads_half(&self) -> bool {
        self.symmetry == Symmetry::Symmetric
    }

    /// One sweep, relaxed by `omega`. Returns the largest change of a multiplier times its own compliance; NaN if one
    /// is NaN.
    fn sweep(&mut self, problem: &ContactProblem<'_, T>, omega: T, multipliers: &mut [T]) -> T {
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
        let mut block = problem.block(rows.clone(), set);
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
