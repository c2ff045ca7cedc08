//! Problems with cones, block by block: when they count as solved, sweeps until they are, and why they are not.

use super::acceptance::nothing;
use super::sweeps::{self, Sweeps};
use super::{AdmissibleSet, ContactFailure, ContactProblem};
use crate::real::Real;
use std::ops::Range;

/// When a problem with cones counts as solved: every block misses its conditions by no more than rounding, or than a
/// share of the largest |q|.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockAcceptance<T> {
    accepted: T,
    /// What may be rounding at most, whatever the multipliers are: a small share of many times the largest |q|. (Where
    /// there is no solution they grow beyond all bounds, and their rounding with them.)
    largest: T,
}

impl<T: Real> BlockAcceptance<T> {
    /// Begins at zero: where there are several solutions the guess must not choose. Refuses what no iteration could
    /// mend, as that of the other sets does. (That W is finite shows in the result.)
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

    /// The rule for a problem, whose rest is known to be sound.
    pub(super) fn of(problem: &ContactProblem<'_, T>, tolerance: T) -> Self {
        /// What in single precision, of which little would be left, may be rounding at most.
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
            // NaN fails both.
            misses.iter().all(|&miss| miss <= self.accepted) || {
                // (Slips may be known much less than gaps, and that nothing pulls is a matter of the gap.)
                let known = |row: usize| problem.rounding(row, multipliers).min(problem.tolerance[row] + self.largest);
                let first = known(rows.start);
                let bounds = [first, rows.skip(1).map(known).fold(first, T::max)];
                misses.iter().zip(bounds).all(|(&miss, bound)| miss <= T::of(2.0) * bound)
            }
        })
    }

    /// Whether multipliers that are all zero solve the problem: y is q then.
    fn accepts_idle(&self, problem: &ContactProblem<'_, T>, multipliers: &[T]) -> bool {
        multipliers.iter().all(|&multiplier| multiplier == T::zero())
            && problem.blocks().all(|(rows, set)| {
                let mut compliance = [T::zero(); 3];
                for (compliance, row) in compliance.iter_mut().zip(rows.clone()) {
                    *compliance = problem.delassus(row, row);
                }
                // (Without a normal force nothing is asked of the tangential rows, whose rounding may be much larger.)
                let noise = problem.rounding_idle(rows.start);
                let (q, none) = (&problem.offset[rows.clone()], &multipliers[rows.clone()]);
                set.residual(q, none, &compliance[..rows.len()]) <= self.accepted.max(T::of(2.0) * noise)
            })
    }

    /// Sweeps until the problem is solved, or so many; says whether it is, and counts them. An `impatient` one ends too
    /// where sweeps hardly change less than those before.
    pub(super) fn sweep(
        &self,
        problem: &ContactProblem<'_, T>,
        (memory, omega): (&mut Sweeps<T>, T),
        sweeps: usize,
        impatient: bool,
        (spent, multipliers): (&mut usize, &mut [T]),
    ) -> bool {
        /// Sweeps after which the change has to be half of what it was; else it may be all rounding already.
        const LOOK: usize = 8;
        /// Growth of the change at which sweeps diverge, as they may where W is not symmetric: what they have made is
        /// then nothing to go on from.
        const DIVERGES: f64 = 1e3;
        // Where no force is needed but for rounding there is none: one that rounding asks for would choose a friction.
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
                // All of it was wrong.
                multipliers.fill(T::zero());
                memory.begin(problem, multipliers);
                (before, least, left) = (T::infinity(), T::infinity(), sweeps);
                continue;
            }
            if converges {
                // It is not accepted: rounding of W across its diagonal.
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

/// The failure that names the worst block.
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

/// A contact that has no solution, whatever the others do: these move neither its gap nor its slip. (Of one that they
/// move nothing is proven: they may push it open.)
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
