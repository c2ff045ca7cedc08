//! The contact problem of a stage: which rows take part, their multipliers, and which contacts are closed afterwards.

use super::program::Operator;
use super::{Constraints, Statistics, Workspace};
use crate::contact::{ContactJacobian, ContactLaw, GapRates};
use crate::contact_solver::{Bound, ContactProblem, ContactSolver};
use crate::corrector::{Gaps, contact_error, rounding};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::state::Motion;

/// Buffers of the contact problem, one entry a candidate unless said otherwise.
pub(super) struct ContactRowsWork<T> {
    pub(super) rates: Vec<GapRates<T>>,
    pub(super) tolerance: Vec<T>,
    pub(super) in_problem: Vec<bool>,
    /// Rows of the problem, and its data, one entry a row of the problem.
    pub(super) problem: Vec<usize>,
    pub(super) delassus: Vec<T>,
    pub(super) offset: Vec<T>,
    pub(super) problem_tolerance: Vec<T>,
    pub(super) bounds: Vec<Bound>,
    pub(super) multipliers: Vec<T>,
}

impl<T: Real> ContactRowsWork<T> {
    pub(super) fn new(rows: usize) -> Self {
        let reals = || Vec::with_capacity(rows);
        Self {
            rates: vec![GapRates::default(); rows],
            tolerance: vec![T::zero(); rows],
            in_problem: vec![false; rows],
            problem: Vec::with_capacity(rows),
            delassus: Vec::with_capacity(rows * rows),
            offset: reals(),
            problem_tolerance: reals(),
            bounds: Vec::with_capacity(rows),
            multipliers: reals(),
        }
    }
}

/// What the contact of a stage is solved with.
pub(super) struct ContactStep<'s, 'a, T: Real> {
    pub(super) constraints: &'s mut Constraints<'a, T>,
    pub(super) g: &'s ContactJacobian<T>,
    pub(super) solver: &'s mut dyn ContactSolver<T>,
    pub(super) statistics: &'s mut Statistics,
}

impl<T: Real> ContactStep<'_, '_, T> {
    /// Finds the multipliers of the stage and adds their response to d and u.
    pub(super) fn solve(
        &mut self,
        operator: &mut Operator<T>,
        w_u: T,
        new: &mut Motion<T>,
        work: &mut Workspace<T>,
    ) -> Result<()> {
        let Self { constraints, g, solver, statistics } = self;
        let Workspace { increment, prescribed, trial, rows, .. } = work;
        let ContactRowsWork { tolerance, in_problem, problem, delassus, offset, problem_tolerance, .. } = rows;
        let (bounds, multipliers) = (&mut rows.bounds, &mut rows.multipliers);
        let gaps = &mut trial.gap;
        let count = constraints.len();
        constraints.finite_gaps(new.t, &new.u, gaps)?;
        let mut needed = false;
        for row in 0..count {
            tolerance[row] = rounding(g.magnitude(row, &new.u) + gaps[row].abs());
            let violated = gaps[row] < -tolerance[row] || constraints.law(row) == ContactLaw::Equality;
            in_problem[row] = violated || trial.lambda_raw[row] > T::zero();
            needed |= violated;
        }
        if !needed {
            trial.lambda_raw.fill(T::zero());
            return Ok(());
        }
        // Solve on the rows that may be active; whoever is pushed in by that joins. The set only grows: this ends.
        loop {
            problem.clear();
            problem.extend((0..count).filter(|&row| in_problem[row]));
            for &row in problem.iter() {
                operator.prepare(g, row, prescribed);
            }
            for buffer in [&mut *delassus, &mut *offset, &mut *problem_tolerance, &mut *multipliers] {
                buffer.clear();
            }
            bounds.clear();
            for &j in problem.iter() {
                delassus.extend(problem.iter().map(|&i| w_u * g.product(i, operator.response(j))));
                offset.push(gaps[j]);
                problem_tolerance.push(tolerance[j]);
                multipliers.push(trial.lambda_raw[j]);
                bounds.push(match constraints.law(j) {
                    ContactLaw::Equality => Bound::Free,
                    ContactLaw::Rigid => Bound::NonNegative,
                });
            }
            let data = ContactProblem { delassus, offset, bounds, tolerance: problem_tolerance };
            let solved = solver.solve(&data, multipliers);
            statistics.contact_solves += 1;
            statistics.contact_iterations +=
                solved.map_err(|failure| contact_error(new.t, failure, |i| constraints.ids[problem[i]]))? as u64;
            let mut grown = false;
            for row in 0..count {
                if !in_problem[row] {
                    let push = |(&j, &lambda): (&usize, &T)| w_u * lambda * g.product(row, operator.response(j));
                    let gap = gaps[row] + problem.iter().zip(multipliers.iter()).map(push).sum::<T>();
                    if gap < -tolerance[row] {
                        (in_problem[row], grown) = (true, true);
                    }
                }
            }
            if !grown {
                break;
            }
        }
        trial.lambda_raw.fill(T::zero());
        for (&row, &lambda) in problem.iter().zip(multipliers.iter()) {
            if !lambda.is_finite() {
                let contact = constraints.ids[row];
                return Err(Error::ContactNotFinite {
                    t: new.t,
                    what: "the multiplier",
                    contact,
                    value: lambda.value(),
                });
            }
            if lambda != T::zero() {
                trial.lambda_raw[row] = lambda;
                T::axpy(lambda, operator.response(row), increment);
                T::axpy(w_u * lambda, operator.response(row), &mut new.u);
            }
        }
        Ok(())
    }

    /// Decides which contacts are closed, and starts the books of the stage: reported force, impulse, corrections.
    pub(super) fn close(
        &mut self,
        h: f64,
        new: &Motion<T>,
        impulse_weight: f64,
        work: &mut Workspace<T>,
    ) -> Result<()> {
        let Self { constraints, g, .. } = self;
        let first = work.backup.rotations == 1;
        let Workspace { trial, rows, buffers, was_closed, .. } = work;
        constraints.finite_gaps(new.t, &new.u, &mut trial.gap)?;
        constraints.rates(new.t, &new.u, &new.v, &mut rows.rates);
        was_closed.clear();
        was_closed.extend_from_slice(&trial.closed);
        buffers.closed.clear();
        let impulse_weight = T::of(h * impulse_weight);
        for row in 0..constraints.len() {
            let (gap, raw) = (trial.gap[row], trial.lambda_raw[row]);
            let rate = g.product(row, &new.v) + rows.rates[row].rate;
            let tolerance = rounding(g.magnitude(row, &new.u) + gap.abs()) + T::of(1e-10 * h) * rate.abs();
            let closed = raw > T::zero() || gap <= tolerance || constraints.law(row) == ContactLaw::Equality;
            trial.closed[row] = closed;
            if closed {
                buffers.closed.push(row);
            }
            trial.lambda[row] = raw;
            (trial.lambda_v[row], trial.lambda_a[row]) = (T::zero(), T::zero());
            let before = if first { T::zero() } else { trial.impulse[row] };
            trial.impulse[row] = before + impulse_weight * raw;
        }
        Ok(())
    }
}
