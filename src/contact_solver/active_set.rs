//! Primal–dual active set with a finite safeguard: exact up to rounding.

use super::acceptance::{Acceptance, Settings};
use super::applied::{AppliedProblem, AppliedSet};
use super::cone_newton::ConeNewton;
use super::equations::{Equations, Solved, Symmetry};
use super::extents::Extents;
use super::{AdmissibleSet, ContactFailure, ContactProblem, ContactSolver, FORESEEN, Pivoting};
use crate::real::Real;

/// Primal–dual active set (semismooth Newton) on the Delassus operator, safeguarded by Murty's least-index rule.
///
/// Every iteration solves the equality problem of the active rows and exchanges all rows that violate a sign. Alone,
/// this can cycle. Following Júdice and Pires (Computers & Operations Research 21, 1994), whole blocks are exchanged
/// only while the number of violations falls; otherwise a single row, the last one, is exchanged until the number
/// falls again. This terminates for every positive definite W, symmetric or not (Murty's rule: for every matrix with
/// positive principal minors). Steady contact takes one iteration, without factorization while W and the active rows
/// stay the same.
///
/// From 256 active rows on, the equations are solved by conjugate gradients with a factorized sparse approximate
/// inverse (Kolotilin and Yeremin, SIAM J. Matrix Anal. Appl. 14, 1993), each to its rounding, if no row depends on
/// its neighbors; otherwise by the factor. Problems with a matrix-free W
/// ([`solve_applied`](ContactSolver::solve_applied)) use block exchanges only and return an error if these do not
/// end.
///
/// Redundant rows (the same contact twice, four contacts on a rigid face) leave W semidefinite: the active rows then
/// get the multipliers of least norm, which share a force evenly. If the exchanges do not end on such a W, the
/// problem is solved by proximal steps, each a positive definite problem (Rockafellar, SIAM J. Control Optim. 14,
/// 1976), and if these do not end, by [`Pivoting`]. Contradictory rows are an error that names them. Nearly dependent
/// rows may leave pivots of W that are rounding; multipliers could then grow without bound and seem to solve an
/// infeasible problem. Therefore a pivot must exceed the rounding of the combination of rows that it measures, and in
/// an accepted solution every row misses complementarity by less than a small share of its motion without contact,
/// whatever the multipliers. If neither the proximal steps nor pivoting solve rows that differ by a small angle, the
/// result of the steps is accepted if no row misses more than √ε of that motion.
///
/// An unsymmetric W, from an unsymmetric effective matrix, is factorized by LU: this costs twice the work, and
/// redundant rows always need proximal steps.
///
/// Problems with friction ([`AdmissibleSet::Cone2`], [`AdmissibleSet::Cone3`]) are solved by semismooth Newton
/// iterations on the conditions of Alart and Curnier (Comput. Methods Appl. Mech. Eng. 92, 1991), with the states
/// open, stick and slip. They start where sweeps over the contacts ([`GaussSeidel`](super::GaussSeidel)) stop
/// converging. If they do not end, as on redundant rows, proximal steps follow, with a shrinking share of the
/// diagonal. All start at zero: large coefficients may allow several solutions, and the guess must not select one.
#[derive(Clone, Debug, Default)]
pub struct ActiveSet<T = f64> {
    equations: Equations<T>,
    applied: AppliedSet<T>,
    /// Whether W is symmetric, and the version of W for which this is known; the entries of that W are finite.
    symmetry: (u64, Symmetry),
    /// The nonzero range of each row of W.
    extents: Extents,
    active: Vec<bool>,
    rows: Vec<usize>,
    solution: Vec<T>,
    violating: Vec<usize>,
    /// y, and the rounding of each row's own sum.
    y: Vec<T>,
    own: Vec<T>,
    /// A proximal problem: its diagonal shift, offset and center.
    shift: Vec<T>,
    offset: Vec<T>,
    center: Vec<T>,
    /// Solver for problems with friction.
    cones: ConeNewton<T>,
    /// The last resort for nearly dependent rows.
    pivoting: Pivoting<T>,
}

/// Share of √(W_ii W_jj), over ε, by which W_ij and W_ji of a symmetric W may differ. With a larger difference W is
/// treated as unsymmetric.
const ROUNDED: f64 = 4096.0;

/// Block exchanges allowed without progress before single exchanges begin.
const BLOCK_TRIES: usize = 3;
/// Proximal steps; each reduces the error by orders of magnitude.
const PROXIMAL_STEPS: usize = 60;
/// Exchanges allowed on a semidefinite W, for which they may not end.
const SEMIDEFINITE_TRIES: usize = 30;

/// Result of a sequence of exchanges.
enum Exchanges {
    Solved(usize),
    /// Semidefinite W: no progress after so many iterations.
    Stuck(usize),
}

/// Which problem the exchanges solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// W λ + q.
    Given,
    /// (W + shift) λ + offset.
    Proximal,
}

/// Computes y of all rows for the multipliers `solution` of the active `rows`, and the rounding of each row's own
/// sum. `column` returns the first stored row of a column of W and its entries from there on.
fn judge<'p, T: Real, C: Iterator<Item = &'p T>>(
    problem: &ContactProblem<'_, T>,
    column: impl Fn(usize) -> (usize, C),
    (offset, shift, form): (&[T], &[T], Form),
    (rows, solution): (&[usize], &[T]),
    y: &mut Vec<T>,
    own: &mut Vec<T>,
) {
    // y = W λ + q and Σ |W λ|, column by column.
    y.clear();
    y.extend_from_slice(offset);
    own.clear();
    own.extend(offset.iter().map(|q| q.abs()));
    for (&j, &lambda) in rows.iter().zip(solution) {
        let (first, column) = column(j);
        for ((&w, y), own) in column.zip(&mut y[first..]).zip(&mut own[first..]) {
            *y += w * lambda;
            *own += (w * lambda).abs();
        }
        if form == Form::Proximal {
            y[j] += shift[j] * lambda;
        }
    }
    for (own, &tolerance) in own.iter_mut().zip(problem.tolerance) {
        *own = tolerance + T::of(32.0) * T::epsilon() * *own;
    }
}

/// Whether a miss of row i exceeds the rounding of its own sum and of the multipliers coupled to it.
///
/// A multiplier is known to the rounding of its own row and carries it into coupled rows: a row of a body at rest
/// next to a loaded body must not be judged by its own small values. Over many rows rounding adds up like a random
/// walk. The plain sum would hide real violations among hundreds of rows in single precision.
fn exceeds_rounding<T: Real>(problem: &ContactProblem<'_, T>, own: &[T], i: usize, miss: T) -> bool {
    // Most rows have no miss and need no look at other rows.
    miss > own[i] && {
        let carried = |j: usize| own[j] / problem.delassus(j, j);
        let others = problem.row(i).iter().enumerate().filter(|&(j, _)| j != i);
        let largest = others.fold(T::zero(), |largest, (j, &w)| {
            let carried = carried(j);
            let counts = carried > T::zero() && carried.is_finite();
            if counts { largest.max(w.abs() * carried) } else { largest }
        });
        miss > own[i] + T::of(own.len() as f64).sqrt() * largest
    }
}

impl<T: Real> ActiveSet<T> {
    /// Exchanges rows until no sign is violated.
    fn exchange(
        &mut self,
        problem: &ContactProblem<'_, T>,
        multipliers: &mut [T],
        form: Form,
        acceptance: &mut Acceptance<'_, T>,
    ) -> Result<Exchanges, ContactFailure<T>> {
        let size = problem.size();
        let Self { equations, symmetry, extents, active, rows, violating, solution, y, own, shift, offset, .. } = self;
        let (_, symmetry) = *symmetry;
        active.clear();
        active.extend(multipliers.iter().zip(problem.sets).map(|(&l, &b)| b == AdmissibleSet::Free || l > T::zero()));
        let proximal = form == Form::Proximal;
        let offset: &[T] = if proximal { offset } else { problem.offset };
        let (mut fewest, mut tries) = (usize::MAX, BLOCK_TRIES);
        // Single exchanges end but may be many; this bound is far above any observed count.
        let limit = 100 + 20 * size;
        for iteration in 1..=limit {
            rows.clear();
            rows.extend((0..size).filter(|&i| active[i]));
            solution.clear();
            solution.extend(rows.iter().map(|&i| -offset[i]));
            let solved = equations.solve((problem, extents), (rows, symmetry), proximal.then_some(shift), solution);
            let not_finite = |row| ContactFailure::NotConverged { iterations: iteration, row, residual: T::nan() };
            let singular = match solved.map_err(not_finite)? {
                Solved::Once => false,
                Solved::LeastNorm => true,
                Solved::Not => return Ok(Exchanges::Stuck(iteration)),
            };
            multipliers.fill(T::zero());
            for (&i, &lambda) in rows.iter().zip(solution.iter()) {
                multipliers[i] = lambda;
            }
            if let Some(row) = multipliers.iter().position(|lambda| !lambda.is_finite()) {
                return Err(ContactFailure::NotConverged { iterations: iteration, row, residual: T::nan() });
            }
            let (given, solved, size) = ((offset, &shift[..], form), (&rows[..], &solution[..]), size.max(1));
            match symmetry {
                // Rows are contiguous in memory.
                Symmetry::Symmetric => {
                    let column = |j| (extents.of(j).start, problem.row(j)[extents.of(j)].iter());
                    judge(problem, column, given, solved, y, own);
                }
                Symmetry::General => {
                    let column = |j: usize| (0, problem.delassus[j..].iter().step_by(size));
                    judge(problem, column, given, solved, y, own);
                }
            }
            // Equations of dependent active rows may contradict each other: an active row left with a positive gap is
            // dropped, a violated one stays.
            let exceeds = |i: usize, miss: T| exceeds_rounding(problem, own, i, miss);
            let open = |i: usize| singular && exceeds(i, y[i]);
            let violates = |i: usize| match problem.sets[i] {
                AdmissibleSet::NonNegative if active[i] => {
                    exceeds(i, -problem.delassus(i, i) * multipliers[i]) || open(i)
                }
                AdmissibleSet::NonNegative => exceeds(i, -y[i]),
                _ => false,
            };
            violating.clear();
            violating.extend((0..size).filter(|&i| violates(i)));
            let (count, last) = (violating.len(), violating.last().copied().unwrap_or(0));
            if count == 0 {
                // A y that grows with unbounded multipliers is no rounding.
                let held = |i: usize| match (problem.sets[i], active[i]) {
                    _ if active[i] && singular && exceeds(i, y[i].abs()) => false,
                    (AdmissibleSet::Free, _) => acceptance.bears(i, y[i].abs()),
                    (_, true) => acceptance.bears(i, y[i].abs().max(-problem.delassus(i, i) * multipliers[i])),
                    (_, false) => acceptance.bears(i, -y[i]),
                };
                if !(0..size).all(held) {
                    return Ok(Exchanges::Stuck(iteration));
                }
                let mut dropped = false;
                for (i, lambda) in multipliers.iter_mut().enumerate() {
                    if problem.sets[i] == AdmissibleSet::NonNegative && *lambda < T::zero() {
                        dropped |= problem.delassus(i, i) * -*lambda > own[i];
                        *lambda = T::zero();
                    }
                }
                // The dropped multipliers are rounding in each row, but perhaps not together.
                if dropped && !proximal && !acceptance.accepts(multipliers) {
                    return Ok(Exchanges::Stuck(iteration));
                }
                return Ok(Exchanges::Solved(iteration));
            }
            if singular && iteration > SEMIDEFINITE_TRIES {
                return Ok(Exchanges::Stuck(iteration));
            }
            if count < fewest {
                (fewest, tries) = (count, BLOCK_TRIES);
            } else {
                tries = tries.saturating_sub(1);
            }
            match tries {
                0 => active[last] = !active[last],
                _ => violating.iter().for_each(|&i| active[i] = !active[i]),
            }
        }
        let (row, residual) = problem.residual(multipliers);
        Err(ContactFailure::NotConverged { iterations: limit, row, residual })
    }

    /// Proximal steps: λ' solves the problem with W + D and q − D λ, D a small share of the diagonal of W.
    fn proximal(
        &mut self,
        problem: &ContactProblem<'_, T>,
        multipliers: &mut [T],
        acceptance: &mut Acceptance<'_, T>,
        iterations: &mut usize,
    ) -> Result<(), ContactFailure<T>> {
        let size = problem.size();
        let largest = (0..size).fold(T::zero(), |m, i| m.max(problem.delassus(i, i)));
        // Small enough to converge in a few steps, large enough for a stable factorization.
        let share = T::epsilon().sqrt();
        self.shift.clear();
        self.shift.extend(
            (0..size)
                .map(|i| share * if problem.delassus(i, i) > T::zero() { problem.delassus(i, i) } else { largest }),
        );
        // From zero, the first step gives the least-norm solution up to D.
        self.center.clear();
        self.center.resize(size, T::zero());
        let mut before = T::infinity();
        for step in 0..PROXIMAL_STEPS {
            self.offset.clear();
            let pulled = problem.offset.iter().zip(&self.shift).zip(&self.center);
            self.offset.extend(pulled.map(|((&q, &d), &c)| q - d * c));
            match self.exchange(problem, multipliers, Form::Proximal, acceptance)? {
                Exchanges::Solved(count) | Exchanges::Stuck(count) => *iterations += count,
            }
            if acceptance.is_exact(multipliers) {
                return Ok(());
            }
            let (row, residual) = problem.residual(multipliers);
            // The residual no longer falls: it is rounding, or there is no solution.
            if step >= 3 && residual > T::of(0.5) * before {
                if acceptance.accepts(multipliers) {
                    return Ok(());
                }
                let push = |i: usize| (problem.delassus(row, i) * multipliers[i]).abs();
                let other = (0..size).filter(|&i| i != row).fold(row, |o, i| match o != row && push(o) >= push(i) {
                    true => o,
                    false => i,
                });
                return Err(ContactFailure::Contradictory { row, other, residual });
            }
            before = residual;
            self.center.copy_from_slice(multipliers);
        }
        let (row, residual) = problem.residual(multipliers);
        Err(ContactFailure::NotConverged { iterations: *iterations, row, residual })
    }

    /// Solves a problem on which proximal steps failed: exactly by pivoting, or with the result of the steps if the
    /// residual of every row is negligible.
    ///
    /// If two nodes face each other and each lies on the facets of the other, their rows differ by the angle between
    /// these facets, even if only 1e-8, and their gaps differ as much: no bearable force closes both exactly.
    fn settle(
        &mut self,
        problem: &ContactProblem<'_, T>,
        multipliers: &mut [T],
        acceptance: &Acceptance<'_, T>,
        (failure, iterations): (ContactFailure<T>, usize),
    ) -> Result<usize, ContactFailure<T>> {
        self.center.clear();
        self.center.extend_from_slice(multipliers);
        if self.symmetry.1 == Symmetry::Symmetric
            && let Ok(iterations) = self.pivoting.solve(problem, multipliers)
        {
            return Ok(iterations);
        }
        // For a contradiction the proximal steps have found the least violation.
        multipliers.copy_from_slice(&self.center);
        match failure {
            ContactFailure::Contradictory { .. } if acceptance.is_negligible(multipliers) => Ok(iterations),
            failure => Err(failure),
        }
    }
}

impl<T: Real> ContactSolver<T> for ActiveSet<T> {
    /// All sets are supported.
    fn admits(&self, _set: AdmissibleSet) -> bool {
        true
    }

    fn reserve(&mut self, size: usize) {
        let reals = || Vec::with_capacity(size);
        let mut pivoting = Pivoting::default();
        pivoting.reserve(size.min(FORESEEN));
        *self = Self {
            equations: Equations::with_capacity(size),
            applied: AppliedSet::default(),
            symmetry: (0, Symmetry::Symmetric),
            extents: Extents::with_capacity(size),
            active: Vec::with_capacity(size),
            rows: Vec::with_capacity(size),
            violating: Vec::with_capacity(size),
            solution: reals(),
            y: reals(),
            own: reals(),
            shift: reals(),
            offset: reals(),
            center: reals(),
            cones: ConeNewton::default(),
            pivoting,
        };
    }

    fn solve_applied(
        &mut self,
        problem: &mut AppliedProblem<'_, T>,
        multipliers: &mut [T],
    ) -> Option<Result<usize, ContactFailure<T>>> {
        Some(self.applied.solve(problem, multipliers))
    }

    fn solve(&mut self, problem: &ContactProblem<'_, T>, multipliers: &mut [T]) -> Result<usize, ContactFailure<T>> {
        if problem.size() == 0 {
            return Ok(0);
        }
        if problem.has_cones() {
            return self.cones.solve(problem, Settings::default().tolerance(), multipliers);
        }
        let known = problem.version != 0 && self.symmetry.0 == problem.version;
        let mut acceptance = Settings::default().begin_with(problem, known, multipliers)?;
        if !known {
            let symmetry = match problem.asymmetry(T::of(ROUNDED) * T::epsilon()) {
                None => Symmetry::Symmetric,
                Some(_) => Symmetry::General,
            };
            self.symmetry = (problem.version, symmetry);
            self.extents.find(problem);
        }
        match self.exchange(problem, multipliers, Form::Given, &mut acceptance)? {
            Exchanges::Solved(iterations) => Ok(iterations),
            Exchanges::Stuck(mut iterations) => {
                match self.proximal(problem, multipliers, &mut acceptance, &mut iterations) {
                    Err(failure) => self.settle(problem, multipliers, &acceptance, (failure, iterations)),
                    Ok(()) => Ok(iterations),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
