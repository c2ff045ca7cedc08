//! Problems with cones, block by block: when they count as solved, and sweeps over their blocks.

use super::cone::Cone;
use super::{AdmissibleSet, ContactFailure, ContactProblem};
use crate::real::Real;
use std::ops::Range;

/// When a problem with cones counts as solved: every block misses its conditions by no more than rounding, or than a
/// share of the largest |q|.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockAcceptance<T> {
    accepted: T,
}

impl<T: Real> BlockAcceptance<T> {
    /// Begins at zero: where there are several solutions the guess must not choose. Refuses what no iteration could
    /// mend, as that of the other sets does.
    pub(super) fn begin(
        problem: &ContactProblem<'_, T>,
        tolerance: T,
        multipliers: &mut [T],
    ) -> Result<Self, ContactFailure<T>> {
        multipliers.fill(T::zero());
        problem.check_finite(false)?;
        let Self { accepted } = Self::of(problem, tolerance);
        for (rows, set) in problem.blocks() {
            let row = rows.start;
            let q = problem.offset[row];
            let miss = if set.is_bilateral() { q.abs() } else { -q };
            if problem.delassus(row, row) <= T::zero() && miss > accepted.max(problem.tolerance[row]) {
                return Err(ContactFailure::NotConverged { iterations: 0, row, residual: miss });
            }
        }
        Ok(Self { accepted })
    }

    /// The rule for a problem, whose rest is known to be sound.
    pub(super) fn of(problem: &ContactProblem<'_, T>, tolerance: T) -> Self {
        Self { accepted: tolerance * T::largest(problem.offset) }
    }

    /// Whether every block is solved.
    pub(super) fn accepts(&self, problem: &ContactProblem<'_, T>, multipliers: &[T]) -> bool {
        problem.blocks().all(|(rows, set)| {
            let miss = problem.block_miss(rows.clone(), set, multipliers);
            // NaN fails both.
            miss <= self.accepted || {
                let rounding = |row: usize| problem.rounding(row, multipliers);
                miss <= T::of(2.0) * rows.map(rounding).fold(T::zero(), T::max)
            }
        })
    }

    /// Sweeps until the problem is solved, or so many; says whether it is, and counts them. An `impatient` one ends too
    /// where sweeps hardly change less than those before.
    pub(super) fn sweep(
        &self,
        problem: &ContactProblem<'_, T>,
        omega: T,
        sweeps: usize,
        impatient: bool,
        (spent, multipliers): (&mut usize, &mut [T]),
    ) -> bool {
        /// Sweeps after which the problem is looked at, whatever they have changed; an impatient caller wants the
        /// change halved by then.
        const LOOK: usize = 8;
        /// Growth of the change at which sweeps diverge, as they may where W is not symmetric: what they have made is
        /// then nothing to go on from.
        const DIVERGES: f64 = 1e3;
        let (mut before, mut least) = (T::infinity(), T::infinity());
        for sweep in 0..sweeps {
            if sweep % LOOK == 0 && self.accepts(problem, multipliers) {
                return true;
            }
            let change = sweep_blocks(problem, omega, multipliers);
            *spent += 1;
            least = least.min(change);
            let bounded = change <= T::of(DIVERGES) * least && change.is_finite();
            if !bounded {
                multipliers.fill(T::zero());
                break;
            }
            if change <= self.accepted && self.accepts(problem, multipliers) {
                return true;
            }
            if sweep % LOOK == LOOK - 1 {
                if impatient && change > T::of(0.5) * before {
                    break;
                }
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
    if let Some(jammed) = jammed(problem) {
        return jammed;
    }
    let (row, residual) = problem.residual(multipliers);
    ContactFailure::NotConverged { iterations, row, residual }
}

/// The contact whose friction moves its own gap most, if by more than the normal multiplier does: with it the problem
/// may have no solution.
fn jammed<T: Real>(problem: &ContactProblem<'_, T>) -> Option<ContactFailure<T>> {
    let excess = |(rows, set): (Range<usize>, AdmissibleSet)| {
        let (row, friction) = (rows.start, set.friction()?);
        let normal = problem.delassus(row, row);
        let coupling = rows.skip(1).fold(T::zero(), |size, k| size.hypot(problem.delassus(row, k)));
        let jams = T::of(friction) * coupling >= normal && coupling > T::zero();
        let excess = T::of(friction) * coupling / normal;
        jams.then_some((excess, ContactFailure::Jammed { row, friction, normal, coupling }))
    };
    let worst =
        problem.blocks().filter_map(excess).reduce(|worst, other| if other.0 > worst.0 { other } else { worst });
    worst.map(|(_, failure)| failure)
}

/// One sweep: each block in turn takes the multipliers that solve it while the others keep theirs, relaxed by `omega`.
/// Returns the largest change of a multiplier, times its own compliance.
fn sweep_blocks<T: Real>(problem: &ContactProblem<'_, T>, omega: T, multipliers: &mut [T]) -> T {
    let mut largest = T::zero();
    for (rows, set) in problem.blocks() {
        let mut before = [T::zero(); 3];
        before[..rows.len()].copy_from_slice(&multipliers[rows.clone()]);
        let own = rows.clone();
        if set.friction().is_none() {
            relax_row(problem, (rows.start, set), omega, multipliers);
        } else {
            let solved = alone(problem, rows.clone(), set, multipliers).solve();
            for (multiplier, solved) in multipliers[rows.clone()].iter_mut().zip(solved) {
                *multiplier += omega * (solved - *multiplier);
            }
            // (Relaxed beyond its solution a block may leave its cone.)
            if omega > T::one() {
                set.project(&mut multipliers[rows]);
            }
        }
        for (row, before) in own.zip(before) {
            largest = largest.max(problem.delassus(row, row) * (multipliers[row] - before).abs());
        }
    }
    largest
}

/// A row without friction closes its gap, as far as its multiplier may; without W_ii it is left out.
pub(super) fn relax_row<T: Real>(
    problem: &ContactProblem<'_, T>,
    (row, set): (usize, AdmissibleSet),
    omega: T,
    multipliers: &mut [T],
) {
    let diagonal = problem.delassus(row, row);
    if diagonal > T::zero() {
        let correction = omega * problem.gap(row, multipliers) / diagonal;
        multipliers[row] = set.nearest(multipliers[row] - correction);
    }
}

/// A block while the others keep their multipliers.
fn alone<T: Real>(
    problem: &ContactProblem<'_, T>,
    rows: Range<usize>,
    set: AdmissibleSet,
    multipliers: &[T],
) -> Cone<T> {
    let (mut delassus, mut offset, mut noise) = ([[T::zero(); 3]; 3], [T::zero(); 3], T::zero());
    for (i, row) in rows.clone().enumerate() {
        offset[i] = problem.gap(row, multipliers);
        if i > 0 {
            noise = noise.max(problem.tolerance[row] + T::epsilon() * problem.offset[row].abs());
        }
        for (j, other) in rows.clone().enumerate() {
            delassus[i][j] = problem.delassus(row, other);
            offset[i] -= delassus[i][j] * multipliers[other];
        }
    }
    let friction = T::of(set.friction().unwrap_or(0.0));
    Cone { delassus, offset, friction, tangents: rows.len() - 1, is_bilateral: set.is_bilateral(), noise }
}
