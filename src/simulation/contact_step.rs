//! The contact problem of a stage: which rows take part, their multipliers, and which contacts are closed afterwards.

use super::operator::Operator;
use super::program::{CompiledStage, ContactTarget};
use super::step::finite_supports;
use super::{Constraints, Statistics, Workspace};
use crate::contact::{ContactJacobian, ContactLaw, GapRates};
use crate::contact_solver::{Bound, ContactProblem, ContactSolver};
use crate::corrector::{Gaps, contact_error, rounding};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::state::{Clock, Motion};
use crate::system::System;

/// Buffers of the contact problem, one entry a candidate unless said otherwise.
pub(super) struct ContactRowsWork<T> {
    pub(super) rates: Vec<GapRates<T>>,
    /// What complementarity holds for, as a length: gaps, or h times gap rates at velocity level.
    pub(super) y: Vec<T>,
    pub(super) tolerance: Vec<T>,
    /// Rows that may press in this stage; at velocity level those whose gap is forecast to be closed.
    pub(super) enabled: Vec<bool>,
    pub(super) in_problem: Vec<bool>,
    /// Rows of the problem, and its data, one entry a row of the problem.
    pub(super) problem: Vec<usize>,
    pub(super) delassus: Vec<T>,
    pub(super) offset: Vec<T>,
    pub(super) problem_tolerance: Vec<T>,
    pub(super) bounds: Vec<Bound>,
    pub(super) multipliers: Vec<T>,
    /// What contact constrains, and where the gap is forecast, one entry a dof; empty for schemes that impose contact
    /// on the displacements of the new state.
    pub(super) target: Vec<T>,
    pub(super) forecast: Vec<T>,
    /// Prescribed motions at the time of either.
    pub(super) supports: Vec<[T; 3]>,
}

impl<T: Real> ContactRowsWork<T> {
    /// Buffers for `rows` contacts, and for targets of `target_dofs` and forecasts of `forecast_dofs` dofs (0 if the
    /// scheme has none) with `supports` prescribed ones.
    pub(super) fn new(rows: usize, target_dofs: usize, forecast_dofs: usize, supports: usize) -> Self {
        let reals = || Vec::with_capacity(rows);
        Self {
            rates: vec![GapRates::default(); rows],
            y: vec![T::zero(); rows],
            tolerance: vec![T::zero(); rows],
            enabled: vec![true; rows],
            in_problem: vec![false; rows],
            problem: Vec::with_capacity(rows),
            delassus: Vec::with_capacity(rows * rows),
            offset: reals(),
            problem_tolerance: reals(),
            bounds: Vec::with_capacity(rows),
            multipliers: reals(),
            target: vec![T::zero(); target_dofs],
            forecast: vec![T::zero(); forecast_dofs],
            supports: vec![[T::zero(); 3]; supports],
        }
    }

    /// Evaluates y of all rows at the target, and the tolerance for what rounding makes of it plus `approach` (a
    /// fraction of the approach in one step).
    fn evaluate(
        &mut self,
        level: &Level<'_, T>,
        constraints: &mut Constraints<'_, T>,
        g: &ContactJacobian<T>,
        new: &Motion<T>,
        approach: f64,
    ) -> Result<()> {
        let Self { rates, y, tolerance, target, .. } = self;
        let h = level.clock.h;
        let (t, values) = level.place(new, target);
        if level.is_velocity() {
            constraints.rates(t, &new.u, &new.v, rates);
            for row in 0..constraints.len() {
                y[row] = g.product(row, values) + T::of(h) * rates[row].rate;
                if !y[row].is_finite() {
                    let (contact, value) = (constraints.ids[row], y[row].value());
                    return Err(Error::ContactNotFinite { t, what: "the gap rate", contact, value });
                }
            }
        } else {
            constraints.finite_gaps(t, values, y)?;
        }
        for row in 0..constraints.len() {
            tolerance[row] = rounding(g.magnitude(row, values) + y[row].abs());
        }
        if approach > 0.0 {
            constraints.rates(new.t, &new.u, &new.v, rates);
            for row in 0..constraints.len() {
                let rate = g.product(row, &new.v) + rates[row].rate;
                tolerance[row] += T::of(approach * h) * rate.abs();
            }
        }
        Ok(())
    }
}

/// Where a stage imposes contact.
struct Level<'s, T> {
    target: Option<&'s ContactTarget<T>>,
    clock: Clock,
}

impl<T: Real> Level<'_, T> {
    fn is_velocity(&self) -> bool {
        self.target.is_some_and(|target| target.forecast.is_some())
    }

    /// Time and values that contact constrains.
    fn place<'v>(&self, new: &'v Motion<T>, target: &'v [T]) -> (f64, &'v [T]) {
        match self.target {
            None => (new.t, &new.u),
            Some(rows) => (self.clock.at(rows.at), target),
        }
    }
}

/// What the contact of a stage is solved with.
pub(super) struct ContactStep<'s, 'a, T: Real> {
    pub(super) stage: &'s CompiledStage<T>,
    pub(super) clock: Clock,
    pub(super) constraints: &'s mut Constraints<'a, T>,
    pub(super) g: &'s ContactJacobian<T>,
    pub(super) solver: &'s mut dyn ContactSolver<T>,
    pub(super) statistics: &'s mut Statistics,
}

impl<T: Real> ContactStep<'_, '_, T> {
    /// Finds the multipliers of the stage and adds their response to d and u.
    pub(super) fn solve(
        &mut self,
        system: &mut dyn System<T>,
        operator: &mut Operator<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        work: &mut Workspace<T>,
    ) -> Result<()> {
        self.aim(system, new, past, work)?;
        let Self { stage, clock, constraints, g, solver, statistics } = self;
        let level = Level { target: stage.contact.as_ref(), clock: *clock };
        let [w_u, ..] = stage.recovery.weights();
        let weight = level.target.map_or(w_u, |target| target.row.weight);
        let Workspace { increment, prescribed, trial, rows, .. } = work;
        rows.evaluate(&level, constraints, g, new, 0.0)?;
        let ContactRowsWork { y, tolerance, enabled, in_problem, problem, delassus, offset, .. } = rows;
        let (bounds, multipliers, problem_tolerance) =
            (&mut rows.bounds, &mut rows.multipliers, &mut rows.problem_tolerance);
        let count = constraints.len();
        let mut needed = false;
        for row in 0..count {
            let violated = enabled[row] && y[row] < -tolerance[row] || constraints.law(row) == ContactLaw::Equality;
            in_problem[row] = violated || enabled[row] && trial.lambda_raw[row] > T::zero();
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
                delassus.extend(problem.iter().map(|&i| weight * g.product(i, operator.response(j))));
                offset.push(y[j]);
                problem_tolerance.push(tolerance[j]);
                multipliers.push(trial.lambda_raw[j]);
                bounds.push(constraints.law(j).into());
            }
            let data = ContactProblem { delassus, offset, bounds, tolerance: problem_tolerance };
            let solved = solver.solve(&data, multipliers);
            statistics.contact_solves += 1;
            statistics.contact_iterations +=
                solved.map_err(|failure| contact_error(new.t, failure, |i| constraints.ids[problem[i]]))? as u64;
            let mut grown = false;
            for row in 0..count {
                if enabled[row] && !in_problem[row] {
                    let push = |(&j, &lambda): (&usize, &T)| weight * lambda * g.product(row, operator.response(j));
                    let pushed = y[row] + problem.iter().zip(multipliers.iter()).map(push).sum::<T>();
                    if pushed < -tolerance[row] {
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
                T::axpy(weight * lambda, operator.response(row), &mut rows.target);
            }
        }
        Ok(())
    }

    /// Forms what contact constrains without multipliers, and decides which rows may press.
    fn aim(
        &mut self,
        system: &mut dyn System<T>,
        new: &Motion<T>,
        past: &[Motion<T>],
        work: &mut Workspace<T>,
    ) -> Result<()> {
        let Self { clock, constraints, g, .. } = self;
        let Workspace { increment, prescribed, rows, .. } = work;
        let ContactRowsWork { y, enabled, target, forecast, supports, rates, .. } = rows;
        enabled.fill(true);
        let Some(aim) = &self.stage.contact else { return Ok(()) };
        let h = T::of(clock.h);
        let t = clock.at(aim.at);
        aim.row.predict(past, target);
        T::axpy(aim.row.weight, increment, target);
        // Displacements of supports, or h times their velocities.
        let mut support = |t: f64, values: &mut [T], what: fn(&[T; 3], T) -> T| {
            if !prescribed.is_empty() {
                system.prescribed_motion(t, supports);
                finite_supports(t, prescribed, supports)?;
                for (&dof, support) in prescribed.iter().zip(supports.iter()) {
                    values[dof] = what(support, h);
                }
            }
            Ok::<(), Error>(())
        };
        let Some((row, at)) = &aim.forecast else {
            return support(t, target, |support, _| support[0]);
        };
        support(t, target, |support, h| h * support[1])?;
        let t_forecast = clock.at(*at);
        row.predict(past, forecast);
        support(t_forecast, forecast, |support, _| support[0])?;
        constraints.finite_gaps(t_forecast, forecast, y)?;
        constraints.rates(t, &new.u, &new.v, rates);
        for row in 0..constraints.len() {
            // A sliver of one step's approach counts as touching, as at position level.
            let approach = (g.product(row, target) + h * rates[row].rate).abs();
            let touching = rounding(g.magnitude(row, forecast) + y[row].abs()) + T::of(1e-10) * approach;
            enabled[row] = y[row] <= touching || constraints.law(row) == ContactLaw::Equality;
        }
        Ok(())
    }

    /// Decides which contacts are closed, and starts the books of the stage: reported force, impulse, corrections.
    pub(super) fn close(&mut self, new: &Motion<T>, impulse_weight: f64, work: &mut Workspace<T>) -> Result<()> {
        let Self { stage, clock, constraints, g, .. } = self;
        let first = work.backup.rotations == 1;
        let Workspace { trial, rows, buffers, was_closed, .. } = work;
        let level = Level { target: stage.contact.as_ref(), clock: *clock };
        rows.evaluate(&level, constraints, g, new, 1e-10)?;
        match level.target {
            None => trial.gap.copy_from_slice(&rows.y[..constraints.len()]),
            Some(_) => constraints.finite_gaps(new.t, &new.u, &mut trial.gap)?,
        }
        was_closed.clear();
        was_closed.extend_from_slice(&trial.closed);
        buffers.closed.clear();
        let impulse_weight = T::of(clock.h * impulse_weight);
        for row in 0..constraints.len() {
            let raw = trial.lambda_raw[row];
            let touching = rows.enabled[row] && rows.y[row] <= rows.tolerance[row];
            let closed = raw > T::zero() || touching || constraints.law(row) == ContactLaw::Equality;
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
