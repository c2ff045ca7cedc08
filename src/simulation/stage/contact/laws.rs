//! The quantities that laws read where the balance holds: gaps, inertia and closing rates of compliant contacts, and
//! the rebound of Newton's impact law.

use crate::contact::{ContactLaw, Course};
use crate::corrector::Gaps;
use crate::error::Result;
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::build::program::CompiledStage;
use crate::simulation::operator::interface::InterfaceWork;
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::stage::supports::Supports;

/// How depth and approach of a compliant row depend on its y: both change with d by the weights of the balance.
pub(crate) fn course<T: Real>(stage: &CompiledStage<T>, h: f64, [gap, approach]: [T; 2]) -> Course<T> {
    let [by_u, by_v, _] = stage.balanced().weights();
    if by_u > T::zero() {
        let slope = by_v / by_u;
        return Course { depth: [T::zero(), T::one()], approach: [approach + slope * gap, slope] };
    }
    Course { depth: [-gap, T::zero()], approach: [T::zero(), T::of(h.recip())] }
}

/// Whether the unknown changes the rate of a damped row but not its gap. This holds in explicit schemes whose
/// velocities contain the unknown.
pub(crate) fn slows<T: Real>(stage: &CompiledStage<T>, law: &ContactLaw) -> bool {
    let [by_u, by_v, _] = stage.balanced().weights();
    law.is_damped() && by_u == T::zero() && by_v > T::zero()
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Applies the forces of compliant rows that do not depend on d, and evaluates the gaps and rates that compliant
    /// laws read at the resulting d without contact. `gaps` evaluates the gaps of the balance there.
    pub(crate) fn evaluate_laws(&mut self, gaps: impl Fn(&mut Self) -> Result<()>) -> Result<()> {
        if !self.constraints.laws().compliant {
            return Ok(());
        }
        for is_first in [true, false] {
            gaps(self)?;
            self.contact.rows.keep_balance_gaps();
            self.add_inertia()?;
            self.evaluate_approach()?;
            if !is_first || !self.apply_known_forces()? {
                break;
            }
        }
        Ok(())
    }

    /// Evaluates the gaps where the balance holds.
    pub(crate) fn evaluate_balance_gaps(&mut self) -> Result<()> {
        self.add_increment();
        let t = self.clock.at(self.stage.load);
        let motion = self.vectors.balanced(self.stage, self.new);
        self.constraints.finite_gaps(t, &motion.u, &mut self.contact.rows.laws.balance_gap)
    }

    /// Adds the inertia of compliant laws to the gaps of the balance.
    fn add_inertia(&mut self) -> Result<()> {
        if !self.constraints.laws().inertial {
            return Ok(());
        }
        let [_, _, balance_a] = self.weights();
        let Self { stage, clock, constraints, g, new, vectors, contact, .. } = self;
        let (t, motion) = (clock.at(stage.load), vectors.balanced(stage, new));
        let ContactWork { interface, rows, .. } = &mut **contact;
        let known = vectors.iterate().is_some() || stage.balanced().reads_past(2);
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
            rows.laws.balance_gap[row] += inertia * acceleration;
        }
        Ok(())
    }

    /// Evaluates the closing rates of damped rows where the balance holds, at the d of their gaps.
    fn evaluate_approach(&mut self) -> Result<()> {
        if !self.constraints.laws().damped {
            return Ok(());
        }
        let [by_u, by_v, _] = self.stage.balanced().weights();
        let Self { stage, clock, constraints, g, new, vectors, contact, .. } = self;
        let (t, motion) = (clock.at(stage.load), vectors.balanced(stage, new));
        let ContactWork { interface, rows, .. } = &mut **contact;
        constraints.finite_rates(t, &motion.u, &motion.v, &mut rows.rates)?;
        let forces = rows.curved.forces(g);
        for row in (0..constraints.len()).filter(|&row| constraints.law(row).is_damped()) {
            let moved = by_v * forces.interface_product(row, &interface.increment);
            let gap = rows.laws.balance_gap[row];
            if by_u == T::zero() && -gap <= constraints.gap_rounding(row, g.magnitude(row, &motion.u), gap) {
                // A dashpot begins with all of its force, so rounding must not count as depth.
                rows.laws.balance_gap[row] = gap.max(T::zero());
            }
            rows.laws.approach[row] = -(forces.product(row, &motion.v) + moved + rows.rates[row].rate);
        }
        Ok(())
    }

    /// Applies the forces of compliant rows whose gap does not depend on d (explicit schemes). Returns whether there
    /// are any.
    fn apply_known_forces(&mut self) -> Result<bool> {
        let Self { constraints, g, operator, contact, .. } = self;
        let ContactWork { interface, rows, trial, .. } = &mut **contact;
        let forces = rows.curved.forces(g);
        let mut any = false;
        for row in (0..constraints.len()).filter(|&row| rows.massless.contains(row)) {
            let law = constraints.law(row);
            if law.is_compliant() && rows.weight[row] == T::zero() {
                let force = law.force(rows.laws.balance_gap[row], rows.laws.approach[row]);
                trial.lambda_raw[row] = force;
                forces.interface_scatter(row, force, &mut interface.forces);
                any |= force > T::zero();
            }
        }
        if any {
            interface.response.copy_from_slice(&interface.forces);
            operator.respond(&mut interface.response)?;
            T::axpy(T::one(), &interface.response, &mut interface.increment);
        }
        Ok(any)
    }

    /// Adds e times the rate at the start of the stage to the rows under Newton's impact law.
    pub(crate) fn add_restitution(&mut self) -> Result<()> {
        let Self { stage, clock, constraints, g, past, contact, .. } = self;
        let rows = &mut contact.rows;
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
