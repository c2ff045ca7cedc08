//! Contact problems with friction by a semismooth Newton method on the block states open, stick and slip.

use super::blocks::{BlockAcceptance, failure};
use super::sweeps::Sweeps;
use super::{AdmissibleSet, ContactFailure, ContactProblem};
use crate::dense::DenseCholesky;
use crate::real::Real;

/// Newton's method on the conditions of [`AdmissibleSet::residual`] (Alart and Curnier 1991), started from sweeps
/// over the blocks, and restarted from more sweeps if it does not end. On redundant rows neither may end; the problem
/// is then solved by proximal steps, each with a positive definite W.
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
    /// A proximal problem: its W, offset and center.
    shifted: Vec<T>,
    offset: Vec<T>,
    center: Vec<T>,
}

/// Sweeps before Newton's method: before the first attempt, and before each later one.
const FIRST_SWEEPS: usize = 3;
const MORE_SWEEPS: usize = 50;

/// Newton iterations per attempt, and number of attempts.
const ITERATIONS: usize = 20;
const ROUNDS: usize = 4;

/// Proximal steps: the initial share of the diagonal added to W, its shrink factor, and its minimum. Nearly redundant
/// rows are resolved only with a share below their difference relative to the diagonal.
const PROXIMAL_STEPS: usize = 300;
const FIRST_SHARE: f64 = 1.0;
const SHRINK: f64 = 0.3;
const LEAST_SHARE: f64 = 1e-13;

/// Final sweeps without Newton's method.
const LAST_SWEEPS: usize = 20_000;

/// Iterations in which blocks that pull by rounding are open.
const LETS_GO: usize = 3;

/// Treatment of a unilateral block that pulls in an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pulled {
    /// Its conditions decide.
    AsItIs,
    /// It is open.
    LetsGo,
}

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
    /// Solves; the guess is not used.
    pub(super) fn solve(
        &mut self,
        problem: &ContactProblem<'_, T>,
        tolerance: T,
        multipliers: &mut [T],
    ) -> Result<usize, ContactFailure<T>> {
        let acceptance = BlockAcceptance::begin(problem, tolerance, multipliers)?;
        self.make_room(problem.size());
        self.sweeps.reset();
        let mut spent = 0;
        for round in 0..ROUNDS {
            // A sweep costs about 3/n of an iteration: first up to half an iteration's worth of sweeps, as long as
            // they converge.
            let sweeps = if round == 0 { FIRST_SWEEPS.max(problem.size() / 6) } else { MORE_SWEEPS };
            if acceptance.sweep(problem, (&mut self.sweeps, T::one()), sweeps, true, (&mut spent, multipliers)) {
                return Ok(spent);
            }
            if round == 0 {
                // A problem solved by sweeps is finite.
                problem.check_finite(false)?;
            }
            if self.newton(problem, &acceptance, &mut spent, multipliers) {
                return Ok(spent);
            }
        }
        if self.proximal(problem, (&acceptance, tolerance), &mut spent, multipliers)
            || acceptance.sweep(problem, (&mut self.sweeps, T::one()), LAST_SWEEPS, false, (&mut spent, multipliers))
        {
            return Ok(spent);
        }
        Err(failure(problem, spent, multipliers))
    }

    /// Grows the memory to at least this many rows.
    fn make_room(&mut self, size: usize) {
        let Self { factor, statuses, rows, matrix, right, y, tried, found, .. } = self;
        if matrix.capacity() < size * size {
            factor.reserve_general(size);
            matrix.reserve(size * size - matrix.len());
        }
        statuses.reserve(size.saturating_sub(statuses.len()));
        rows.reserve(size.saturating_sub(rows.len()));
        for values in [right, y, tried, found] {
            values.reserve(size.saturating_sub(values.len()));
        }
    }

    /// Newton iterations; returns whether they have converged without pulling contacts. If not, the multipliers are
    /// unchanged.
    fn newton(
        &mut self,
        problem: &ContactProblem<'_, T>,
        acceptance: &BlockAcceptance<T>,
        spent: &mut usize,
        multipliers: &mut [T],
    ) -> bool {
        let [mut tried, mut found] = [&mut self.tried, &mut self.found].map(std::mem::take);
        tried.clear();
        tried.extend_from_slice(multipliers);
        let mut solved = false;
        for _ in 0..ITERATIONS {
            *spent += 1;
            let sound = self.iterate(problem, Pulled::AsItIs, &mut tried);
            solved = sound && acceptance.accepts(problem, &tried);
            if solved || !sound {
                break;
            }
        }
        if solved {
            found.clear();
            found.extend_from_slice(&tried);
            self.let_go(problem, acceptance, &mut tried, &mut found);
            solved = !pulls_beyond_rounding(problem, &found);
        }
        if solved {
            multipliers.copy_from_slice(&found);
        }
        (self.tried, self.found) = (tried, found);
        solved
    }

    /// A closed contact without force may pull by rounding: it is opened if the result is still accepted. First all
    /// such contacts are opened with the others unchanged, then with the others solved again; otherwise one by one,
    /// as far as the result is accepted.
    fn let_go(
        &mut self,
        problem: &ContactProblem<'_, T>,
        acceptance: &BlockAcceptance<T>,
        tried: &mut [T],
        multipliers: &mut [T],
    ) {
        let pulls = |multipliers: &[T]| problem.blocks().any(|(rows, set)| is_pulled(rows.start, set, multipliers));
        if !pulls(multipliers) {
            return;
        }
        for (rows, set) in problem.blocks() {
            if is_pulled(rows.start, set, multipliers) {
                tried[rows].fill(T::zero());
            }
        }
        if acceptance.accepts(problem, tried) {
            multipliers.copy_from_slice(tried);
            return;
        }
        tried.copy_from_slice(multipliers);
        for _ in 0..LETS_GO {
            if !self.iterate(problem, Pulled::LetsGo, tried) {
                break;
            }
            if !pulls(tried) {
                if acceptance.accepts(problem, tried) {
                    multipliers.copy_from_slice(tried);
                    return;
                }
                break;
            }
        }
        for (rows, set) in problem.blocks() {
            if is_pulled(rows.start, set, multipliers) {
                let kept: [T; 3] = std::array::from_fn(|k| multipliers[(rows.start + k).min(rows.end - 1)]);
                multipliers[rows.clone()].fill(T::zero());
                if !acceptance.accepts(problem, multipliers) {
                    multipliers[rows.clone()].copy_from_slice(&kept[..rows.len()]);
                }
            }
        }
    }

    /// Proximal steps: λ' solves the problem with W + D and q − D λ, with D a shrinking share of the diagonal of W.
    fn proximal(
        &mut self,
        problem: &ContactProblem<'_, T>,
        (acceptance, tolerance): (&BlockAcceptance<T>, T),
        spent: &mut usize,
        multipliers: &mut [T],
    ) -> bool {
        let size = problem.size();
        let [mut shifted, mut offset, mut center] =
            [&mut self.shifted, &mut self.offset, &mut self.center].map(std::mem::take);
        let (mut share, mut solved) = (T::of(FIRST_SHARE), false);
        for _ in 0..PROXIMAL_STEPS {
            center.clear();
            center.extend_from_slice(multipliers);
            shifted.clear();
            shifted.extend_from_slice(problem.delassus);
            offset.clear();
            offset.extend_from_slice(problem.offset);
            for (rows, _) in problem.blocks() {
                // One value per block, so that tangential directions stay equivalent.
                let own = rows.clone().map(|row| problem.delassus(row, row)).fold(T::zero(), T::max);
                for row in rows {
                    shifted[row * size + row] += share * own;
                    offset[row] -= share * own * center[row];
                }
            }
            let step = ContactProblem::of(&shifted, &offset, problem.sets, problem.tolerance, 0);
            let own = BlockAcceptance::of(&step, tolerance);
            let ended = self.newton(&step, &own, spent, multipliers)
                || own.sweep(&step, (&mut self.sweeps, T::one()), MORE_SWEEPS, false, (&mut *spent, multipliers))
                || self.newton(&step, &own, spent, multipliers);
            solved = acceptance.accepts(problem, multipliers);
            if solved {
                break;
            }
            // A step that cannot be solved was too large.
            share = match ended {
                true => (share * T::of(SHRINK)).max(T::of(LEAST_SHARE)),
                false => share / T::of(SHRINK * SHRINK),
            };
        }
        (self.shifted, self.offset, self.center) = (shifted, offset, center);
        solved
    }

    /// One iteration; returns whether its equations were solvable.
    fn iterate(&mut self, problem: &ContactProblem<'_, T>, pulled: Pulled, multipliers: &mut [T]) -> bool {
        let Self { factor, statuses, rows, matrix, right, y, .. } = self;
        y.clear();
        y.extend((0..problem.size()).map(|row| problem.gap(row, multipliers)));
        rows.clear();
        statuses.clear();
        for (block, set) in problem.blocks() {
            let status = match pulled == Pulled::LetsGo && is_pulled(block.start, set, multipliers) {
                true => Status::Open,
                false => status(problem, block.start, set, multipliers, y),
            };
            statuses.push(status);
            if !matches!(status, Status::Open) {
                rows.extend(block);
            }
        }
        let size = rows.len();
        matrix.clear();
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
                        let pushed = tangents.clone().map(|i| across(i) * problem.offset[first + i]).sum::<T>();
                        right.push(-pushed);
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

/// Whether a unilateral block has a pulling force.
fn is_pulled<T: Real>(first: usize, set: AdmissibleSet, multipliers: &[T]) -> bool {
    !set.is_bilateral() && multipliers[first] < T::zero()
}

/// Whether a contact pulls by more than the rounding of the largest multiplier, with rows scaled by √W_ii.
fn pulls_beyond_rounding<T: Real>(problem: &ContactProblem<'_, T>, multipliers: &[T]) -> bool {
    /// Roundings by which a contact may pull.
    const ROUNDINGS: f64 = 16.0;
    let measured = |row: usize| multipliers[row] * problem.delassus(row, row).max(T::zero()).sqrt();
    let largest = (0..problem.size()).map(|row| measured(row).abs()).fold(T::zero(), T::max);
    let least = T::of(-ROUNDINGS) * T::epsilon() * largest;
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
    if own * multipliers[first] <= y[first] && !set.is_bilateral() {
        return Status::Open;
    }
    let Some(friction) = set.friction() else { return Status::Held };
    let tangents = first + 1..first + set.rows();
    let compliance = tangents.clone().map(|row| problem.delassus(row, row)).fold(T::zero(), T::max);
    if multipliers[first] <= T::zero() && set.is_bilateral() {
        // A pulling bilateral contact has no friction.
        return Status::Slides { direction: [T::zero(); 2], share: T::zero(), compliance };
    }
    let mut aim = [T::zero(); 2];
    for (aim, row) in aim.iter_mut().zip(tangents) {
        *aim = compliance * multipliers[row] - y[row];
    }
    let (size, radius) = (aim[0].hypot(aim[1]), compliance * T::of(friction) * multipliers[first].max(T::zero()));
    match size > radius {
        false => Status::Held,
        true => Status::Slides { direction: aim.map(|aim| aim / size), share: radius / size, compliance },
    }
}
