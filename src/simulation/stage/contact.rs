//! The contact of a stage before its problem is solved: where it is imposed, the quantities that rows constrain
//! there, and the forces of compliant laws that do not depend on the unknown.
//!
//! In the order of execution:
//!
//! - `multipliers`, `applied_rows`: the contact problem of the rows that carry forces.
//! - `solve`: solves the problem, and solves it again with rows linearized at its result.
//! - `curved`, `mixing`: rows that turn within the stage, and acceleration of linearizations that converge slowly.
//! - `closing`: which contacts are closed at the end, their forces and impulses.

pub(in crate::simulation) mod applied_rows;
pub(in crate::simulation) mod closing;
pub(in crate::simulation) mod curved;
pub(in crate::simulation) mod mixing;
pub(in crate::simulation) mod multipliers;
pub(in crate::simulation) mod solve;

use crate::contact::{ContactJacobian, ContactLaw, Course};
use crate::contact_solver::ContactSolver;
use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::build::program::CompiledStage;
use crate::simulation::operator::Operator;
use crate::simulation::operator::interface::{InterfaceWork, advance, keep};
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::rows::contact_rows::{ContactRowsWork, Level, Part};
use crate::simulation::run::impulses::Impulses;
use crate::simulation::run::results::Statistics;
use crate::simulation::stage::supports::{Supports, finite_supports};
use crate::simulation::stage::vectors::StageVectors;
use crate::state::{Clock, ContactState, Motion};
use crate::system::System;

/// Memory of the contact of a step.
pub(crate) struct ContactWork<T> {
    pub(crate) interface: InterfaceWork<T>,
    pub(crate) rows: ContactRowsWork<T>,
    /// The contacts of the step that is being tried.
    pub(crate) trial: ContactState<T>,
    pub(crate) impulses: Impulses<T>,
    /// Closed flags at the start of the step.
    pub(crate) closed_at_start: Vec<bool>,
    /// Which contacts exerted a force at the start of the step.
    pub(crate) exerting_at_start: Vec<bool>,
    /// Forces of all rows at the start of the step, and which contacts slid there; empty without friction.
    pub(crate) forces_at_start: Vec<T>,
    pub(crate) sliding_at_start: Vec<bool>,
    /// Closed flags before the present stage.
    pub(crate) was_closed: Vec<bool>,
    /// Which contacts stuck before the present stage; empty without friction.
    pub(crate) was_sticking: Vec<bool>,
}

/// The data with which the contact of a stage is solved.
pub(crate) struct ContactStep<'s, 'a, T: Real> {
    pub(crate) stage: &'s CompiledStage<T>,
    pub(crate) clock: Clock,
    pub(crate) constraints: &'s mut Constraints<'a, T>,
    /// The rows of the gaps, linearized where contact is imposed.
    pub(crate) g: &'s mut ContactJacobian<T>,
    pub(crate) solver: &'s mut dyn ContactSolver<T>,
    pub(crate) statistics: &'s mut Statistics,
    /// In Newton's method the part of the unknown that motions contain already: d is then measured from there, and the
    /// accelerations contain all of it.
    pub(crate) iterate: Option<&'s [T]>,
    pub(crate) part: Part,
}

/// How depth and approach of a compliant row depend on its y: both change with d by the weights of the balance.
pub(crate) fn course<T: Real>(stage: &CompiledStage<T>, h: f64, [gap, approach]: [T; 2]) -> Course<T> {
    let [by_u, by_v, _] = stage.balanced().weights();
    if by_u > T::zero() {
        let slope = by_v / by_u;
        return Course { depth: [T::zero(), T::one()], approach: [approach + slope * gap, slope] };
    }
    Course { depth: [-gap, T::zero()], approach: [T::zero(), T::of(h.recip())] }
}

impl<T: Real> ContactStep<'_, '_, T> {
    /// Evaluates the target of contact without contact forces, and decides which rows may carry a force.
    pub(crate) fn aim(
        &mut self,
        system: &mut dyn System<T>,
        new: &Motion<T>,
        past: &[Motion<T>],
        prescribed: &[usize],
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        let Self { clock, constraints, g, .. } = self;
        let ContactWork { rows, interface, .. } = contact;
        let ContactRowsWork { y, enabled, hover, target, forecast, supports, rates, .. } = rows;
        enabled.fill(true);
        let Some(aim) = &self.stage.contact else { return Ok(()) };
        let h = T::of(clock.h);
        let t = clock.at(aim.at);
        // Only on the interface: no other dofs are read.
        aim.row.predict_at(past, constraints.interface(), target);
        if let Some(d) = self.iterate {
            for &dof in constraints.interface() {
                target[dof] += aim.row.weight * d[dof];
            }
        }
        keep(constraints.interface(), target, &mut interface.target);
        // Displacements of supports, or h times their velocities.
        let mut support = |t: f64, values: &mut [T], what: fn(&[T; 3], T) -> T| {
            if !prescribed.is_empty() {
                system.prescribed_motion(t, supports)?;
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
        advance(constraints.interface(), &interface.target, aim.row.weight, &interface.increment, target);
        let t_forecast = clock.at(*at);
        row.predict_at(past, constraints.interface(), forecast);
        support(t_forecast, forecast, |support, _| support[0])?;
        constraints.finite_gaps(t_forecast, forecast, y)?;
        constraints.finite_rates(t, &new.u, &new.v, rates)?;
        for row in 0..constraints.len() {
            // As at position level, a gap of 1e-10 of the displacement in the step counts as touching.
            let approach = (g.product(row, target) + h * rates[row].rate).abs();
            let rounded = constraints.gap_rounding(row, g.magnitude(row, forecast), y[row]);
            let law = constraints.law(row);
            let always = law.is_equality() || law.is_compliant();
            enabled[row] = y[row] <= rounded + T::of(1e-10) * approach || always;
            hover[row] = if enabled[row] && !always { (y[row] - rounded).max(T::zero()) } else { T::zero() };
        }
        Ok(())
    }

    /// Weights of d in y of rigid rows, and in the displacements and accelerations of the balance.
    pub(crate) fn weights(&self) -> [T; 3] {
        let rigid = self.stage.contact.as_ref().map_or(self.stage.recovery.weights()[0], |target| target.row.weight);
        let [balance_u, _, balance_a] = self.stage.balanced().weights();
        [rigid, balance_u, balance_a]
    }

    /// Whether the unknown changes the rate of a damped row but not its gap. This holds in explicit schemes whose
    /// velocities contain the unknown.
    pub(crate) fn slows(&self, law: &ContactLaw) -> bool {
        let [by_u, by_v, _] = self.stage.balanced().weights();
        law.is_damped() && by_u == T::zero() && by_v > T::zero()
    }

    /// Sets the weights of d in y, from the scheme and from compliant laws.
    pub(crate) fn weigh(&self, rows: &mut ContactRowsWork<T>) {
        let ([rigid, balance_u, balance_a], Self { stage, clock, .. }) = (self.weights(), self);
        if self.constraints.laws().are_uniform() && self.part == Part::All {
            rows.weight.fill(rigid);
            self.weigh_slips(rows);
            return;
        }
        for (row, law) in self.constraints.laws().iter().enumerate() {
            let weight = match (law.is_compliant(), law.is_predictive()) {
                (false, _) => rigid,
                (true, false) if self.slows(law) => T::of(clock.h) * stage.balanced().weights()[1],
                (true, false) => balance_u + T::of(law.inertia()) * balance_a,
                (true, true) => T::of(0.5) * rigid,
            };
            rows.weight[row] = if self.part.takes(&rows.on_massless, row) { weight } else { T::zero() };
        }
        self.weigh_slips(rows);
    }

    /// Whether the displacements of the state contain d. Explicit schemes know them before d.
    pub(crate) fn moves_state(&self) -> bool {
        self.stage.recovery.weights()[0] != T::zero()
    }

    /// Adds d on the interface to the displacements of the state and of the balance, and to the target of contact.
    pub(crate) fn place(&mut self, new: &mut Motion<T>, vectors: &mut StageVectors<T>, contact: &mut ContactWork<T>) {
        let dofs = self.constraints.interface();
        let ContactWork { interface, rows, .. } = contact;
        let InterfaceWork { increment, displacement, balance, target, .. } = interface;
        if self.moves_state() {
            advance(dofs, displacement, self.stage.recovery.weights()[0], increment, &mut new.u);
        }
        if let (Some(balanced), Some(motion)) = (&self.stage.balance, &mut vectors.balance) {
            advance(dofs, balance, balanced.weights()[0], increment, &mut motion.u);
        }
        if let Some(aim) = &self.stage.contact {
            advance(dofs, target, aim.row.weight, increment, &mut rows.target);
        }
    }

    /// Time and motion of the balance.
    pub(crate) fn balanced<'m>(&self, new: &'m Motion<T>, balance: Option<&'m Motion<T>>) -> (f64, &'m Motion<T>) {
        let motion = match (&self.stage.balance, balance) {
            (Some(_), Some(balance)) => balance,
            _ => new,
        };
        (self.clock.at(self.stage.load), motion)
    }

    /// Evaluates y of all rows, as the scheme and their laws define it, at the d that was [placed](Self::place).
    pub(crate) fn evaluate(&mut self, new: &Motion<T>, contact: &mut ContactWork<T>) -> Result<()> {
        let Self { stage, clock, constraints, g, .. } = self;
        let ContactWork { rows, interface, .. } = contact;
        rows.evaluate(&Level { target: stage.contact.as_ref(), clock: *clock }, constraints, g, new, 0.0)?;
        rows.decide(constraints);
        rows.measure(stage, clock.h, constraints, g, new, Some(&interface.increment))
    }

    /// Evaluates the gaps where the balance holds.
    pub(crate) fn balance_gaps(
        &mut self,
        new: &Motion<T>,
        vectors: &StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        let (t, motion) = self.balanced(new, vectors.balance.as_ref());
        self.constraints.finite_gaps(t, &motion.u, &mut contact.rows.balance_gap)?;
        contact.rows.keep_balance_gaps();
        Ok(())
    }

    /// Adds the inertia of compliant laws to the gaps of the balance.
    pub(crate) fn add_inertia(
        &mut self,
        new: &Motion<T>,
        vectors: &StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        if !self.constraints.laws().inertial {
            return Ok(());
        }
        let [_, _, balance_a] = self.weights();
        let (t, motion) = self.balanced(new, vectors.balance.as_ref());
        let Self { stage, constraints, g, .. } = self;
        let ContactWork { interface, rows, .. } = contact;
        let known = self.iterate.is_some() || stage.balanced().reads_past(2);
        // g̈ at ā: the predicted part, and the part that depends on d.
        let InterfaceWork { response, increment, .. } = interface;
        for ((&dof, a), &d) in constraints.interface().iter().zip(response.iter_mut()).zip(increment.iter()) {
            *a = if known { motion.a[dof] } else { T::zero() } + balance_a * d;
        }
        constraints.finite_rates(t, &motion.u, &motion.v, &mut rows.rates)?;
        let forces = rows.curved.forces(g);
        // Prescribed dofs are not on the interface.
        let Supports { dofs: prescribed, state, balance, .. } = &vectors.supports;
        let supports = if stage.balance.is_some() { balance } else { state };
        let driven = |dof: usize| prescribed.binary_search(&dof).map_or(T::zero(), |place| supports[place][2]);
        for row in 0..constraints.len() {
            let inertia = T::of(constraints.law(row).inertia());
            let mut acceleration = forces.interface_product(row, response) + rows.rates[row].acceleration;
            if inertia > T::zero() && !prescribed.is_empty() {
                acceleration += forces.row(row).map(|(dof, weight)| weight * driven(dof)).sum::<T>();
            }
            rows.balance_gap[row] += inertia * acceleration;
        }
        Ok(())
    }

    /// Evaluates the closing rates of damped rows where the balance holds, at the d of their gaps.
    pub(crate) fn approach(
        &mut self,
        new: &Motion<T>,
        vectors: &StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        if !self.constraints.laws().damped {
            return Ok(());
        }
        let [by_u, by_v, _] = self.stage.balanced().weights();
        let (t, motion) = self.balanced(new, vectors.balance.as_ref());
        let Self { constraints, g, .. } = self;
        let ContactWork { interface, rows, .. } = contact;
        constraints.finite_rates(t, &motion.u, &motion.v, &mut rows.rates)?;
        let forces = rows.curved.forces(g);
        for row in (0..constraints.len()).filter(|&row| constraints.law(row).is_damped()) {
            let moved = by_v * forces.interface_product(row, &interface.increment);
            let gap = rows.balance_gap[row];
            if by_u == T::zero() && -gap <= constraints.gap_rounding(row, g.magnitude(row, &motion.u), gap) {
                // A dashpot begins with all of its force, so rounding must not count as depth.
                rows.balance_gap[row] = gap.max(T::zero());
            }
            rows.approach[row] = -(forces.product(row, &motion.v) + moved + rows.rates[row].rate);
        }
        Ok(())
    }

    /// Applies the forces of compliant rows whose gap does not depend on d (explicit schemes). Returns whether there
    /// are any.
    pub(crate) fn press_without_coupling(
        &mut self,
        operator: &mut Operator<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<bool> {
        let Self { constraints, g, part, .. } = self;
        let ContactWork { interface, rows, trial, .. } = contact;
        let forces = rows.curved.forces(g);
        let mut pressed = false;
        for row in (0..constraints.len()).filter(|&row| part.takes(&rows.on_massless, row)) {
            let law = constraints.law(row);
            if law.is_compliant() && rows.weight[row] == T::zero() {
                let force = law.force(rows.balance_gap[row], rows.approach[row]);
                trial.lambda_raw[row] = force;
                forces.interface_scatter(row, force, &mut interface.forces);
                pressed |= force > T::zero();
            }
        }
        if pressed {
            interface.response.copy_from_slice(&interface.forces);
            operator.respond(&mut interface.response)?;
            T::axpy(T::one(), &interface.response, &mut interface.increment);
        }
        Ok(pressed)
    }

    /// Adds e times the rate at the start of the stage to the rows under Newton's impact law.
    pub(crate) fn restitution(&mut self, past: &[Motion<T>], rows: &mut ContactRowsWork<T>) -> Result<()> {
        let Self { stage, clock, constraints, g, .. } = self;
        let lead = stage.contact.as_ref().map_or(0.0, |target| target.at - stage.end);
        // Where the gap is constrained, the correction of velocities makes contacts rebound.
        let at_velocities = stage.contact.as_ref().is_some_and(|target| target.forecast.is_some());
        let (Some(start), true) = (past.first(), constraints.laws().rebound && at_velocities) else {
            return Ok(());
        };
        let h = T::of(clock.h);
        constraints.finite_rates(start.t, &start.u, &start.v, &mut rows.rates)?;
        for row in 0..constraints.len() {
            if let Some(coefficient) = constraints.law(row).restitution() {
                let rate = g.product(row, &start.v) + T::of(lead) * h * g.product(row, &start.a) + rows.rates[row].rate;
                rows.y[row] += T::of(coefficient) * h * rate;
                rows.tolerance[row] += rounding(h * g.magnitude(row, &start.v));
            }
        }
        Ok(())
    }
}
