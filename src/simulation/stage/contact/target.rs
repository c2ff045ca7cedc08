//! Where a stage imposes contact: the values constrained there, without contact forces, and their weights of d.

use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::operator::interface::{InterfaceWork, advance, keep};
use crate::simulation::rows::contact_rows::Level;
use crate::simulation::rows::contact_rows::RowState;
use crate::simulation::rows::row_state::{decide_measures, state_of_forecast};
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::stage::contact::laws::slows;
use crate::simulation::stage::supports::finite_supports;

impl<T: Real> StageSolve<'_, '_, T> {
    /// Evaluates the target of contact without contact forces, and decides which rows may carry a force.
    pub(crate) fn predict_target(&mut self) -> Result<()> {
        self.contact.rows.state.fill(RowState::Open);
        let Some(aim) = &self.stage.contact else { return Ok(()) };
        let (clock, iterate) = (self.clock, self.vectors.iterate());
        let ContactWork { rows, interface, .. } = &mut *self.contact;
        let (constraints, target) = (&mut *self.constraints, &mut rows.target);
        let (t, h) = (clock.at(aim.at), T::of(clock.h));
        // Only on the interface: no other dofs are read.
        aim.row.predict_at(self.past, constraints.interface(), &mut target.values);
        if let Some(d) = iterate {
            for &dof in constraints.interface() {
                target.values[dof] += aim.row.weight * d[dof];
            }
        }
        keep(constraints.interface(), &target.values, &mut interface.target);
        // Displacements of supports, or h times their velocities.
        let (system, prescribed, supports) =
            (&mut *self.host.system, &self.vectors.supports.dofs, &mut target.supports);
        let mut support = |t: f64, values: &mut [T], value: fn(&[T; 3], T) -> T| {
            if !prescribed.is_empty() {
                system.prescribed_motion(t, supports)?;
                finite_supports(t, prescribed, supports)?;
                for (&dof, support) in prescribed.iter().zip(supports.iter()) {
                    values[dof] = value(support, h);
                }
            }
            Ok::<(), Error>(())
        };
        let Some((row, at)) = &aim.forecast else {
            return support(t, &mut target.values, |support, _| support[0]);
        };
        support(t, &mut target.values, |support, h| h * support[1])?;
        advance(constraints.interface(), &interface.target, aim.row.weight, &interface.increment, &mut target.values);
        let t_forecast = clock.at(*at);
        row.predict_at(self.past, constraints.interface(), &mut target.forecast);
        support(t_forecast, &mut target.forecast, |support, _| support[0])?;
        constraints.finite_gaps(t_forecast, &target.forecast, &mut rows.y)?;
        constraints.finite_rates(t, &self.new.u, &self.new.v, &mut rows.rates)?;
        for row in 0..constraints.len() {
            let approach = (self.g.product(row, &target.values) + h * rows.rates[row].rate).abs();
            let gap = rows.y[row];
            let rounded = constraints.gap_rounding(row, self.g.magnitude(row, &target.forecast), gap);
            let law = constraints.law(row);
            (rows.state[row], rows.start.closed_slack[row]) = state_of_forecast(&law, gap, rounded, approach);
        }
        Ok(())
    }

    /// Weights of d in y of rigid rows, and in the displacements and accelerations of the balance.
    pub(crate) fn weights(&self) -> [T; 3] {
        let rigid = self.stage.contact.as_ref().map_or(self.stage.recovery.weights()[0], |target| target.row.weight);
        let [balance_u, _, balance_a] = self.stage.balanced().weights();
        [rigid, balance_u, balance_a]
    }

    /// Sets the weights of d in y of all rows, from the scheme and from compliant laws.
    pub(crate) fn set_weights(&mut self) {
        let ([rigid, balance_u, balance_a], h) = (self.weights(), T::of(self.clock.h));
        let (uniform, whole) = (self.constraints.laws().are_uniform(), self.contact.rows.massless.is_whole());
        if uniform && whole {
            self.contact.rows.weight.fill(rigid);
        } else {
            for row in 0..self.constraints.len() {
                let law = self.constraints.law(row);
                let weight = match (law.is_compliant(), law.is_predictive()) {
                    (false, _) => rigid,
                    (true, false) if slows(self.stage, &law) => h * self.stage.balanced().weights()[1],
                    (true, false) => balance_u + T::of(law.inertia()) * balance_a,
                    (true, true) => T::of(0.5) * rigid,
                };
                let rows = &mut self.contact.rows;
                rows.weight[row] = if rows.massless.contains(row) { weight } else { T::zero() };
            }
        }
        self.set_slip_weights();
    }

    /// Whether the displacements of the state contain d. Explicit schemes know them before d.
    pub(crate) fn moves_state(&self) -> bool {
        self.stage.recovery.weights()[0] != T::zero()
    }

    /// Adds d on the interface to the displacements of the state and of the balance, and to the target of contact.
    pub(crate) fn add_increment(&mut self) {
        let (moves_state, dofs) = (self.moves_state(), self.constraints.interface());
        let ContactWork { interface, rows, .. } = &mut *self.contact;
        let InterfaceWork { increment, displacement, balance, target, .. } = interface;
        if moves_state {
            advance(dofs, displacement, self.stage.recovery.weights()[0], increment, &mut self.new.u);
        }
        if let (Some(balanced), Some(motion)) = (&self.stage.balance, &mut self.vectors.balance) {
            advance(dofs, balance, balanced.weights()[0], increment, &mut motion.u);
        }
        if let Some(aim) = &self.stage.contact {
            advance(dofs, target, aim.row.weight, increment, &mut rows.target.values);
        }
    }

    /// Where the stage imposes contact.
    pub(crate) fn level(&self) -> Level<'_, T> {
        Level { target: self.stage.contact.as_ref(), clock: self.clock }
    }

    /// Evaluates y of all rows, as the scheme and their laws define it, at the d that was
    /// [added](Self::add_increment).
    pub(crate) fn evaluate_rows(&mut self) -> Result<()> {
        let Self { stage, clock, constraints, g, new, .. } = self;
        let ContactWork { rows, interface, .. } = &mut *self.contact;
        let level = Level { target: stage.contact.as_ref(), clock: *clock };
        rows.evaluate(&level, constraints, g, new, false)?;
        decide_measures(rows, constraints);
        rows.measure(stage, clock.h, constraints, g, new, Some(&interface.increment))?;
        self.evaluate_slips()
    }
}
