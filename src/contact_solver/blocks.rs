//! Problems with cones, block by block: acceptance, sweeps, and failures.

use super::acceptance::nothing;
use super::sweeps::{self, Sweeps};
use super::{AdmissibleSet, ContactFailure, ContactProblem};
use crate::real::Real;
use std::ops::Range;

/// Acceptance rule of a problem with cones: every block misses its conditions at most by rounding, or by a share of
/// the largest |q|.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockAcceptance<T> {
    accepted: T,
    /// Upper bound of rounding, for any multipliers: a small share of a multiple of the largest |q|. Without a
    /// solution the multipliers grow without bound, and their rounding with them.
    largest: T,
}

impl<T: Real> BlockAcceptance<T> {
    /// Starts at zero: if there are several solutions the guess must not select one. Rejects the same defects as the
    /// rule for the other sets. A non-finite W is detected from the result.
    pub(super) fn begin(
        problem: &ContactProblem<'_, T>,
        tolerance: T,
        multipliers: &mut [T],
    ) -> Result<Self, ContactFailure<T>> {
        multipliers.fill(T::zero());
        problem.check_finite(true)?;
        let acceptance = Self::of(problem, tolerance);
        for (rows, set) in problem.blocks() {
            let row = rows.start;
            let q = problem.offset[row];
            let miss = if set.is_bilateral() { q.abs() } else { -q };
            if problem.delassus(row, row) <= T::zero() && miss > acceptance.accepted.max(problem.tolerance[row]) {
                return Err(ContactFailure::NotConverged { iterations: 0, row, residual: miss });
            }
        }
        Ok(acceptance)
    }

    /// The rule for a problem that is already checked.
    pub(super) fn of(problem: &ContactProblem<'_, T>, tolerance: T) -> Self {
        /// Bound of the share in single precision, where ε^0.4 is too large.
        const SHARE: f64 = 3e-3;
        let scale = T::largest(problem.offset);
        let accepted = (tolerance * scale).max(nothing());
        let share = (T::epsilon().powf(T::of(0.4)) * T::of(32.0)).min(T::of(SHARE));
        Self { accepted, largest: share * scale }
    }

    /// Whether every block is solved.
    pub(super) fn accepts(&self, problem: &ContactProblem<'_, T>, multipliers: &[T]) -> bool {
        problem.blocks().all(|(rows, set)| {
            let misses = problem.block_misses(rows.clone(), set, multipliers);
            // NaN fails both comparisons.
            misses.iter().all(|&miss| miss <= self.accepted) || {
                // Slips may be known less accurately than gaps; whether a contact pulls depends on the gap only.
                let known = |row: usize| problem.rounding(row, multipliers).min(problem.tolerance[row] + self.largest);
                let first = known(rows.start);
                let bounds = [first, rows.skip(1).map(known).fold(first, T::max)];
                misses.iter().zip(bounds).all(|(&miss, bound)| miss <= T::of(2.0) * bound)
            }
        })
    }

    /// Whether all multipliers are zero and solve the problem, so that y = q.
    fn accepts_idle(&self, problem: &ContactProblem<'_, T>, multipliers: &[T]) -> bool {
        multipliers.iter().all(|&multiplier| multiplier == T::zero())
            && problem.blocks().all(|(rows, set)| {
                let mut compliance = [T::zero(); 3];
                for (compliance, row) in compliance.iter_mut().zip(rows.clone()) {
                    *compliance = problem.delassus(row, row);
                }
                // Without a normal force the tangential rows have no condition; their rounding may be much larger.
                let noise = problem.rounding_idle(rows.start);
                let (q, none) = (&problem.offset[rows.clone()], &multipliers[rows.clone()]);
                set.residual(q, none, &compliance[..rows.len()]) <= self.accepted.max(T::of(2.0) * noise)
            })
    }

    /// Sweeps until the problem is solved, at most `sweeps` times; returns whether it is solved and counts the
    /// sweeps. If `impatient`, it also stops once the change per sweep hardly decreases.
    pub(super) fn sweep(
        &self,
        problem: &ContactProblem<'_, T>,
        (memory, omega): (&mut Sweeps<T>, T),
        sweeps: usize,
        impatient: bool,
        (spent, multipliers): (&mut usize, &mut [T]),
    ) -> bool {
        /// Interval of sweeps in which the change must halve; otherwise it may be rounding already.
        const LOOK: usize = 8;
        /// Growth of the change that counts as divergence, possible for an unsymmetric W; the multipliers are then
        /// discarded.
        const DIVERGES: f64 = 1e3;
        // If zero forces solve the problem within rounding, they are kept: a force due to rounding would select a
        // friction.
        if self.accepts_idle(problem, multipliers) {
            return true;
        }
        let (mut before, mut least) = (T::infinity(), T::infinity());
        memory.begin(problem, multipliers);
        let mut left = sweeps;
        while left > 0 {
            left -= 1;
            let change = memory.sweep(problem, omega, multipliers);
            *spent += 1;
            least = least.min(change);
            let diverges = !(change <= T::of(DIVERGES) * least && change.is_finite());
            let looks = (sweeps - left).is_multiple_of(LOOK);
            let stalls = looks && change > T::of(0.5) * before;
            let converges = change <= self.accepted;
            if !diverges && (converges || stalls) && self.accepts(problem, multipliers) {
                return true;
            }
            let ends = diverges || stalls && impatient || left == 0;
            if (ends || stalls || converges) && memory.is_mistaken(problem) {
                // Start again: all sweeps used a wrong W.
                multipliers.fill(T::zero());
                memory.begin(problem, multipliers);
                (before, least, left) = (T::infinity(), T::infinity(), sweeps);
                continue;
            }
            if converges {
                // The residual is too large although sweeps converged: W is asymmetric by rounding.
                memory.read_all();
            }
            if diverges {
                multipliers.fill(T::zero());
            }
            if ends {
                break;
            }
            if looks {
                before = change;
            }
        }
        self.accepts(problem, multipliers)
    }
}

/// The failure with the worst block.
pub(super) fn failure<T: Real>(
    problem: &ContactProblem<'_, T>,
    iterations: usize,
    multipliers: &[T],
) -> ContactFailure<T> {
    if let Err(failure) = problem.check_finite(false) {
        return failure;
    }
    if let Some(jammed) = jammed(problem) {
        return jammed;
    }
    let (row, residual) = problem.residual(multipliers);
    ContactFailure::NotConverged { iterations, row, residual }
}

/// A contact without solution that no other contact affects, neither its gap nor its slip. A contact affected by
/// others is not proven to jam: they may push it open.
fn jammed<T: Real>(problem: &ContactProblem<'_, T>) -> Option<ContactFailure<T>> {
    let failure = |(rows, set): (Range<usize>, AdmissibleSet)| {
        let (row, friction) = (rows.start, set.friction()?);
        let is_apart = |i: usize| {
            let mut others = problem.row(i).iter().enumerate().filter(|(j, _)| !rows.contains(j));
            others.all(|(_, &w)| w == T::zero())
        };
        let jams = rows.clone().all(is_apart) && sweeps::free_block(problem, rows.clone(), set).jams();
        let normal = problem.delassus(row, row);
        let coupling = rows.skip(1).fold(T::zero(), |size, k| size.hypot(problem.delassus(row, k)));
        jams.then_some(ContactFailure::Jammed { row, friction, normal, coupling })
    };
    problem.blocks().find_map(failure)
}
