//! Contact problems with friction by a semismooth Newton method on the block states open, stick and slip.

use super::acceptance::{Acceptance, Settings};
use super::structure::Symmetry;
use super::sweeps::{Schedule, Sweeps};
use super::{AdmissibleSet, ContactFailure, ContactProblem};
use crate::dense::DenseCholesky;
use crate::real::Real;
use crate::rounding::rounding;

/// Newton's method on the conditions of [`AdmissibleSet::residual`] (Alart and Curnier 1991), started from sweeps
/// over the blocks, and started again from more sweeps if it does not end. On redundant rows neither may end; the
/// problem is then solved by proximal steps, each with a positive definite W.
#[derive(Clone, Debug, Default)]
pub(super) struct ConeNewton<T> {
    sweeps: Sweeps<T>,
    factor: DenseCholesky<T>,
    /// The state of each block, and the rows of blocks that are not open.
    statuses: Vec<Status<T>>,
    rows: Vec<usize>,
    matrix: Vec<T>,
    right: Vec<T>,
    y: Vec<T>,
    tried: Vec<T>,
    found: Vec<T>,
    /// A proximal problem: its W and offset.
    shifted: Vec<T>,
    offset: Vec<T>,
}

/// Sweeps before the first attempt of Newton's method, at least and at most, and before later ones. More than these
/// cost more than the iteration that they save.
const FIRST_SWEEPS: [usize; 2] = [3, 20];
const MORE_SWEEPS: usize = 50;

/// Newton iterations of an attempt, and the number of attempts, each from more sweeps.
const ITERATIONS: usize = 20;
const ROUNDS: usize = 4;

/// Proximal steps: the initial share of the diagonal added to W, and its shrink factor. Nearly redundant rows are
/// resolved only with a share below their difference relative to the diagonal.
const PROXIMAL_STEPS: usize = 300;
const FIRST_SHARE: f64 = 1.0;
const SHRINK: f64 = 0.3;

/// State of a block in an iteration.
#[derive(Clone, Copy, Debug)]
enum Status<T> {
    /// λ = 0.
    Open,
    /// y = 0.
    Held,
    /// Slides: the friction is μ p times `direction`. `share` is κ, the radius of the disc divided by the length of
    /// the point projected onto it; `compliance` is the larger diagonal entry of the tangential rows.
    Slides { direction: [T; 2], share: T, compliance: T },
}

impl<T: Real> ConeNewton<T> {
    /// Solves from zero multipliers.
    pub(super) fn solve(
        &mut self,
        acceptance: &Acceptance<'_, T>,
        symmetry: Symmetry,
        multipliers: &mut [T],
    ) -> Result<usize, ContactFailure<T>> {
        let size = acceptance.problem().size();
        let mut spent = 0;
        // A sweep costs about 3/n of an iteration with few rows: first up to half of an iteration's worth of sweeps, as
        // long as they converge.
        let [least, most] = FIRST_SWEEPS;
        for round in 0..ROUNDS {
            let sweeps = if round == 0 { (size / 6).clamp(least, most) } else { MORE_SWEEPS };
            let schedule = Schedule { omega: T::one(), sweeps, impatient: true };
            if self.sweeps.solve(acceptance, symmetry, schedule, &mut spent, multipliers)
                || self.newton(acceptance, &mut spent, multipliers)
            {
                return Ok(spent);
            }
        }
        if self.proximal(acceptance, symmetry, &mut spent, multipliers) {
            return Ok(spent);
        }
        Err(acceptance.failure(spent, multipliers))
    }

    /// Newton iterations; returns whether they have converged without pulling contacts. If not, the multipliers are
    /// unchanged.
    fn newton(&mut self, acceptance: &Acceptance<'_, T>, spent: &mut usize, multipliers: &mut [T]) -> bool {
        let problem = acceptance.problem();
        let [mut tried, mut found] = [&mut self.tried, &mut self.found].map(std::mem::take);
        tried.clear();
        tried.extend_from_slice(multipliers);
        let mut solved = false;
        for _ in 0..ITERATIONS {
            *spent += 1;
            let sound = self.iterate(problem, &mut tried);
            solved = sound && acceptance.accepts(&tried);
            if solved || !sound {
                break;
            }
        }
        if solved {
            // A closed contact without force may pull by rounding: it is opened if the result is still accepted.
            found.clear();
            found.extend_from_slice(&tried);
            for (rows, set) in problem.blocks() {
                if !set.is_bilateral() && found[rows.start] < T::zero() {
                    found[rows].fill(T::zero());
                }
            }
            if !acceptance.accepts(&found) {
                std::mem::swap(&mut tried, &mut found);
                solved = !pulls_beyond_rounding(problem, &found);
            }
        }
        if solved {
            multipliers.copy_from_slice(&found);
        }
        (self.tried, self.found) = (tried, found);
        solved
    }

    /// Proximal steps: λ' solves the problem with W + D and q − D λ, with D a shrinking share of the diagonal of W.
    fn proximal(
        &mut self,
        acceptance: &Acceptance<'_, T>,
        symmetry: Symmetry,
        spent: &mut usize,
        multipliers: &mut [T],
    ) -> bool {
        let problem = acceptance.problem();
        let size = problem.size();
        let [mut shifted, mut offset] = [&mut self.shifted, &mut self.offset].map(std::mem::take);
        let (mut share, mut solved) = (T::of(FIRST_SHARE), false);
        for _ in 0..PROXIMAL_STEPS {
            shifted.clear();
            shifted.reserve_exact(size * size);
            shifted.extend_from_slice(problem.delassus);
            offset.clear();
            offset.extend_from_slice(problem.offset);
            for (rows, _) in problem.blocks() {
                // One value per block, so that tangential directions stay equivalent.
                let own = rows.clone().map(|row| problem.delassus(row, row)).fold(T::zero(), T::max);
                for row in rows {
                    shifted[row * size + row] += share * own;
                    offset[row] -= share * own * multipliers[row];
                }
            }
            let step = ContactProblem::of(&shifted, &offset, problem.sets, problem.tolerance, 0);
            let own = Settings::default().rule(&step);
            let schedule = Schedule { omega: T::one(), sweeps: MORE_SWEEPS, impatient: false };
            let ended = self.newton(&own, spent, multipliers)
                || self.sweeps.solve(&own, symmetry, schedule, spent, multipliers)
                || self.newton(&own, spent, multipliers);
            solved = acceptance.accepts(multipliers);
            if solved {
                break;
            }
            // A step that cannot be solved was too large.
            share = match ended {
                true => (share * T::of(SHRINK)).max(rounding(T::one())),
                false => share / T::of(SHRINK * SHRINK),
            };
        }
        (self.shifted, self.offset) = (shifted, offset);
        solved
    }

    /// One iteration; returns whether its equations were solvable.
    fn iterate(&mut self, problem: &ContactProblem<'_, T>, multipliers: &mut [T]) -> bool {
        let Self { factor, statuses, rows, matrix, right, y, .. } = self;
        y.clear();
        y.extend((0..problem.size()).map(|row| problem.gap(row, multipliers)));
        rows.clear();
        statuses.clear();
        for (block, set) in problem.blocks() {
            let status = status(problem, block.start, set, multipliers, y);
            statuses.push(status);
            if !matches!(status, Status::Open) {
                rows.extend(block);
            }
        }
        let size = rows.len();
        matrix.clear();
        matrix.reserve_exact(size * size);
        right.clear();
        for ((block, set), &status) in problem.blocks().zip(statuses.iter()) {
            if matches!(status, Status::Open) {
                continue;
            }
            let first = block.start;
            // The normal row, or the only row: y = 0.
            matrix.extend(rows.iter().map(|&j| problem.delassus(first, j)));
            right.push(-problem.offset[first]);
            for (k, row) in block.clone().enumerate().skip(1) {
                match status {
                    Status::Slides { direction, share, compliance } => {
                        let friction = T::of(set.friction().unwrap_or(0.0));
                        // W_t f − μ W_t p n − κ (1 − n nᵀ) (W_t f − y_t) = 0, with κ and n fixed, and κ |…| = μ W_t
                        // p.
                        let across = |i: usize| {
                            let own = if i == k { T::one() } else { T::zero() };
                            share * (own - direction[k - 1] * direction[i - 1])
                        };
                        let tangents = 1..block.len();
                        let entry = |j: usize| {
                            let mut sum = T::zero();
                            for i in tangents.clone() {
                                let other = first + i;
                                sum += across(i) * problem.delassus(other, j);
                                if other == j {
                                    let own = if other == row { T::one() } else { T::zero() };
                                    sum += compliance * (own - across(i));
                                }
                            }
                            if j == first { sum - friction * compliance * direction[k - 1] } else { sum }
                        };
                        matrix.extend(rows.iter().map(|&j| entry(j)));
                        let constant = tangents.clone().map(|i| across(i) * problem.offset[first + i]).sum::<T>();
                        right.push(-constant);
                    }
                    Status::Held | Status::Open => {
                        matrix.extend(rows.iter().map(|&j| problem.delassus(row, j)));
                        right.push(-problem.offset[row]);
                    }
                }
            }
        }
        let solvable = factor.factorize_general(size, |i, j| matrix[i * size + j]).is_ok() && !factor.is_singular();
        if !solvable {
            return false;
        }
        factor.solve(right);
        multipliers.fill(T::zero());
        for (&row, &value) in rows.iter().zip(right.iter()) {
            multipliers[row] = value;
        }
        T::all_finite(multipliers)
    }
}

/// Whether a contact pulls by more than the rounding of the largest multiplier, with rows scaled by √W_ii.
fn pulls_beyond_rounding<T: Real>(problem: &ContactProblem<'_, T>, multipliers: &[T]) -> bool {
    let measured = |row: usize| multipliers[row] * problem.delassus(row, row).max(T::zero()).sqrt();
    let largest = (0..problem.size()).map(|row| measured(row).abs()).fold(T::zero(), T::max);
    let least = -rounding(largest);
    problem.blocks().any(|(rows, set)| !set.is_bilateral() && measured(rows.start) < least)
}

/// The state of a block at these multipliers and y.
fn status<T: Real>(
    problem: &ContactProblem<'_, T>,
    first: usize,
    set: AdmissibleSet,
    multipliers: &[T],
    y: &[T],
) -> Status<T> {
    let own = problem.delassus(first, first);
    if set == AdmissibleSet::Free {
        return if own > T::zero() { Status::Held } else { Status::Open };
    }
    if own * multipliers[first] <= y[first] {
        return Status::Open;
    }
    let Some(friction) = set.friction() else { return Status::Held };
    let tangents = first + 1..first + set.rows();
    let compliance = tangents.clone().map(|row| problem.delassus(row, row)).fold(T::zero(), T::max);
    let mut augmented = [T::zero(); 2];
    for (augmented, row) in augmented.iter_mut().zip(tangents) {
        *augmented = compliance * multipliers[row] - y[row];
    }
    let (size, radius) =
        (augmented[0].hypot(augmented[1]), compliance * T::of(friction) * multipliers[first].max(T::zero()));
    match size > radius {
        false => Status::Held,
        true => {
            Status::Slides { direction: augmented.map(|augmented| augmented / size), share: radius / size, compliance }
        }
    }
}
