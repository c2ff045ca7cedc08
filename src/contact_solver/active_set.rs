//! Primal–dual active set with a finite safeguard: exact up to rounding.

use super::acceptance::{Acceptance, Gaps, Settings};
use super::cone_newton::ConeNewton;
use super::equations::Equations;
use super::structure::Structure;
use super::{AdmissibleSet, Assembly, ContactFailure, ContactProblem, ContactSolver, Pivoting};
use crate::real::Real;
use crate::rounding::half_digits;

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
/// its neighbors; otherwise by the factor. Where forming W would be more work than the whole solution without it, a
/// run solves without W ([`Assembly`]).
///
/// Redundant rows (the same contact twice, four contacts on a rigid face) leave W semidefinite. If active rows depend
/// on one another, the same exchanges solve a sequence of proximal problems with W + d I, each positive definite
/// (Rockafellar, SIAM J. Control Optim. 14, 1976), with a shift d of ε^¼, later √ε, of the largest W_ii. They start at
/// zero and so find the multipliers of least norm, which share a force evenly. The fallback, if the steps stop to
/// converge, is [`Pivoting`]; if this fails too, the rows contradict each other: an error names them.
///
/// Nearly dependent rows may leave pivots of W that are rounding; multipliers could then grow without bound and seem to
/// solve an infeasible problem. Therefore a pivot must exceed the rounding of the combination of rows that it measures,
/// and in an accepted solution every row misses complementarity by less than a small share of its motion without
/// contact, whatever the multipliers. Rows that differ by a small angle and contradict each other by at most √ε of that
/// motion get the result of the proximal steps.
///
/// An unsymmetric W, from an unsymmetric effective matrix, is factorized by LU, which costs twice the work.
///
/// Problems with friction ([`AdmissibleSet::Cone2`], [`AdmissibleSet::Cone3`]) are solved by semismooth Newton
/// iterations on the conditions of Alart and Curnier (Comput. Methods Appl. Mech. Eng. 92, 1991), with the states
/// open, stick and slip. They start where sweeps over the contacts ([`GaussSeidel`](super::GaussSeidel)) stop
/// converging. If they do not end, as on redundant rows, proximal steps follow, with a shrinking share of the
/// diagonal. All start at zero: large coefficients may allow several solutions, and the guess must not select one.
#[derive(Clone, Debug, Default)]
pub struct ActiveSet<T = f64> {
    equations: Equations<T>,
    assembly: Assembly,
    structure: Structure,
    active: Vec<bool>,
    /// The active rows, and their multipliers.
    rows: Vec<usize>,
    solution: Vec<T>,
    violating: Vec<usize>,
    gaps: Gaps<T>,
    /// The multipliers from which a proximal step starts.
    center: Vec<T>,
    /// Solver for problems with friction.
    cones: ConeNewton<T>,
    /// The fallback for nearly dependent rows.
    pivoting: Pivoting<T>,
}

/// Block exchanges allowed without progress before single exchanges begin.
const BLOCK_TRIES: usize = 3;
/// Proximal steps; each reduces the error by an order of magnitude, or is the last.
const PROXIMAL_STEPS: usize = 60;

impl<T: Real> ActiveSet<T> {
    /// Sets whether W is formed. Default: whichever is less work.
    #[must_use]
    pub fn with_assembly(self, assembly: Assembly) -> Self {
        Self { assembly, ..self }
    }

    /// Solves a proximal step by exchanges of rows: 0 ≤ y + d (λ − c) ⊥ λ ≥ 0 with the shift d of the diagonal of W and
    /// the center c. With a shift of zero this is the problem itself. Returns the number of iterations, and whether the
    /// step is solved; if not, the shift is zero and some active rows depend on one another.
    fn exchange(
        &mut self,
        problem: &ContactProblem<'_, T>,
        shift: T,
        multipliers: &mut [T],
    ) -> Result<(usize, bool), ContactFailure<T>> {
        let size = problem.size();
        let Self { equations, structure, active, rows, solution, violating, gaps, center, .. } = self;
        let own = |i: usize| problem.delassus(i, i);
        let centered = |i: usize| shift * center[i];
        // A row without W_ii stays at λ = 0.
        let starts =
            |i: usize| own(i) > T::zero() && (problem.sets[i] == AdmissibleSet::Free || multipliers[i] > T::zero());
        active.clear();
        active.extend((0..size).map(starts));
        let (mut fewest, mut tries) = (usize::MAX, BLOCK_TRIES);
        // Single exchanges end but may be many; this bound is far above any observed count.
        let limit = 100 + 20 * size;
        for iteration in 1..=limit {
            let not_finite = |row| ContactFailure::NotConverged { iterations: iteration, row, residual: T::nan() };
            rows.clear();
            rows.extend((0..size).filter(|&i| active[i]));
            solution.clear();
            solution.extend(rows.iter().map(|&i| centered(i) - problem.offset[i]));
            if !equations.solve(problem, structure, (rows, shift), solution).map_err(not_finite)? {
                return Ok((iteration, false));
            }
            multipliers.fill(T::zero());
            for (&i, &lambda) in rows.iter().zip(solution.iter()) {
                multipliers[i] = lambda;
            }
            if let Some(row) = multipliers.iter().position(|lambda| !lambda.is_finite()) {
                return Err(not_finite(row));
            }
            gaps.evaluate(problem, structure, (rows, solution));
            let violates = |i: usize| match problem.sets[i] {
                AdmissibleSet::NonNegative if active[i] => gaps.exceeds(problem, i, -own(i) * multipliers[i]),
                AdmissibleSet::NonNegative => own(i) > T::zero() && gaps.exceeds(problem, i, centered(i) - gaps.y[i]),
                _ => false,
            };
            violating.clear();
            violating.extend((0..size).filter(|&i| violates(i)));
            let Some(&last) = violating.last() else {
                // Negative multipliers that remain are rounding in each row, but perhaps not together.
                let is_pulling = |i: usize| problem.sets[i] == AdmissibleSet::NonNegative && multipliers[i] < T::zero();
                if rows.iter().any(|&i| is_pulling(i)) {
                    for (&i, solution) in rows.iter().zip(solution.iter_mut()) {
                        *solution = problem.sets[i].nearest(*solution);
                        multipliers[i] = *solution;
                    }
                    gaps.evaluate(problem, structure, (rows, solution));
                }
                return Ok((iteration, true));
            };
            if violating.len() < fewest {
                (fewest, tries) = (violating.len(), BLOCK_TRIES);
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

    /// Solves a problem whose active rows depend on one another by proximal steps: each solves the problem with W + d I
    /// and q − d c, starting at c = 0, so that the first one gives the least-norm solution up to d.
    ///
    /// If the steps stop to converge, the problem is solved by pivoting. If this fails too, the result of the steps is
    /// accepted if the residual of every row is negligible: if two nodes face each other and each lies on the facets
    /// of the other, their rows differ by the angle between these facets, even if only 1e-8, and their gaps differ as
    /// much; no bearable force closes both exactly.
    fn proximal(
        &mut self,
        acceptance: &Acceptance<'_, T>,
        mut iterations: usize,
        multipliers: &mut [T],
    ) -> Result<usize, ContactFailure<T>> {
        let problem = acceptance.problem();
        let largest = (0..problem.size()).fold(T::zero(), |largest, i| largest.max(problem.delassus(i, i)));
        // Rounding of q, over the share, is how evenly a force is shared. The least share resolves rows that are nearly
        // dependent, and is large enough for a stable factorization.
        let least = half_digits::<T>();
        let (mut share, mut before) = (least.sqrt(), T::infinity());
        for _ in 0..PROXIMAL_STEPS {
            let (count, is_solved) = self.exchange(problem, share * largest, multipliers)?;
            iterations += count;
            if !is_solved {
                break;
            }
            let residual = acceptance.misses(&self.gaps, multipliers).fold(T::zero(), T::max);
            let converges = residual < T::of(0.1) * before;
            if !converges && acceptance.accepts_gaps(&self.gaps, multipliers) {
                return Ok(iterations);
            }
            if !converges && share <= least {
                break;
            }
            if !converges {
                share = least;
            }
            before = residual;
            self.center.copy_from_slice(multipliers);
        }
        self.center.copy_from_slice(multipliers);
        if let Ok(pivots) = self.pivoting.solve(problem, multipliers) {
            return Ok(iterations + pivots);
        }
        // For a contradiction the proximal steps have found the least violation.
        multipliers.copy_from_slice(&self.center);
        if acceptance.is_negligible(multipliers) { Ok(iterations) } else { Err(acceptance.contradiction(multipliers)) }
    }
}

impl<T: Real> ContactSolver<T> for ActiveSet<T> {
    /// All sets are supported.
    fn admits(&self, _set: AdmissibleSet) -> bool {
        true
    }

    fn assembly(&self) -> Assembly {
        self.assembly
    }

    fn solve(&mut self, problem: &ContactProblem<'_, T>, multipliers: &mut [T]) -> Result<usize, ContactFailure<T>> {
        if problem.size() == 0 {
            return Ok(0);
        }
        let known = self.structure.is_known(problem);
        let acceptance = Settings::default().begin(problem, known, multipliers)?;
        if !known {
            self.structure.find(problem);
            self.equations.forget();
        }
        if problem.has_cones() {
            return self.cones.solve(&acceptance, self.structure.symmetry(), multipliers);
        }
        self.center.clear();
        self.center.resize(problem.size(), T::zero());
        let (iterations, is_solved) = self.exchange(problem, T::zero(), multipliers)?;
        if is_solved && acceptance.accepts_gaps(&self.gaps, multipliers) {
            return Ok(iterations);
        }
        self.proximal(&acceptance, iterations, multipliers)
    }
}

#[cfg(test)]
mod tests;
