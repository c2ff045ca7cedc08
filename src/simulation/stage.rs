//! A stage of a step: its unknown is solved for together with contact.
//!
//! In the order of execution:
//!
//! - `supports`, `vectors`: prescribed motions, the predicted motion and its residual.
//! - `massless`, `massless_step`: dofs without mass of explicit stages.
//! - `linear`, or `newton_step` with the settings in `newton` and the force in `path`: solve the stage.
//! - `contact`: solves its contact.
//! - `excess_forces`: contacts on dofs without mass that exert a force for a part of the stage.

pub(super) mod contact;
pub(super) mod excess_forces;
pub(super) mod linear;
pub(super) mod massless;
pub(super) mod massless_step;
pub(super) mod newton;
pub(super) mod newton_step;
pub(super) mod path;
pub(super) mod supports;
pub(super) mod vectors;

use crate::contact::ContactJacobian;
use crate::contact_solver::ContactSolver;
use crate::error::{Error, Result};
use crate::ranks::Together;
use crate::real::Real;
use crate::simulation::build::program::CompiledStage;
use crate::simulation::operator::Operator;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::rows::curved_rows::{LINEARIZATIONS, Worst};
use crate::simulation::run::results::Statistics;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::stage::massless::MasslessBlock;
use crate::simulation::stage::newton::NewtonWork;
use crate::simulation::stage::vectors::StageVectors;
use crate::state::{Clock, Motion};
use crate::system::System;

/// The parts that the host gives.
pub(crate) struct Host<'s, T: Real> {
    pub(crate) system: &'s mut dyn System<T>,
    pub(crate) together: &'s Together<T>,
}

/// A stage that is being solved.
pub(crate) struct StageSolve<'s, 'a, T: Real> {
    pub(crate) stage: &'s CompiledStage<T>,
    pub(crate) clock: Clock,
    pub(crate) host: Host<'s, T>,
    pub(crate) operator: &'s mut Operator<T>,
    pub(crate) constraints: &'s mut Constraints<'a, T>,
    /// The rows of the gaps, linearized where contact is imposed.
    pub(crate) g: &'s mut ContactJacobian<T>,
    pub(crate) solver: &'s mut dyn ContactSolver<T>,
    pub(crate) statistics: &'s mut Statistics,
    /// The motion at the end of the stage: predicted, then solved for.
    pub(crate) new: &'s mut Motion<T>,
    pub(crate) past: &'s mut [Motion<T>],
    pub(crate) vectors: &'s mut StageVectors<T>,
    pub(crate) contact: &'s mut ContactWork<T>,
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Moves the predicted motion to where the balance and the contact conditions hold.
    pub(crate) fn solve(
        &mut self,
        newton: Option<&mut NewtonWork<T>>,
        block: Option<&mut MasslessBlock<T>>,
    ) -> Result<()> {
        match (newton, block) {
            (Some(newton), None) => self.solve_nonlinear(newton),
            (_, block) => self.solve_linear(block),
        }
    }

    /// Solves the linear equations of the stage for the residual in `vectors.increment`, together with contact, and
    /// leaves the increment there. Returns whether curved rows fit it. All kinds of stages are solved by this: linear
    /// ones, the iterations of nonlinear ones, and the static balance of dofs without mass.
    pub(crate) fn solve_linearized(&mut self) -> Result<bool> {
        let Self { operator, vectors, contact, statistics, .. } = self;
        operator.begin(&mut vectors.increment, &mut contact.interface.increment)?;
        contact.interface.forces.fill(T::zero());
        statistics.linear_solves += 1;
        let finite = T::all_finite(&contact.interface.increment);
        let converged = self.constraints.len() == 0 || !finite || self.solve_contact()?;
        let Self { operator, vectors, contact, .. } = self;
        operator.finish(&mut vectors.increment, &contact.interface.increment, &contact.interface.forces)?;
        Ok(converged)
    }

    /// Refuses contact whose curved rows have not converged.
    pub(crate) fn refuse_not_converged(&self, converged: bool) -> Result<()> {
        let Worst { row, what, change, tolerance, is_bearable } = self.contact.rows.curved.worst;
        if converged || is_bearable {
            return Ok(());
        }
        let (t, iterations, contact) = (self.new.t, LINEARIZATIONS, self.constraints.ids[row]);
        Err(Error::ContactUnsettled { t, iterations, contact, what, change, tolerance })
    }

    pub(crate) fn refuse_nan(&self, values: &[T], what: &'static str) -> Result<()> {
        if T::all_finite(values) {
            return Ok(());
        }
        let dof = values.iter().position(|x| !x.is_finite()).unwrap_or(0);
        let value = values[dof].value();
        Err(Error::StepNotFinite { t: self.clock.at(0.0), h: self.clock.h, what, dof, value })
    }
}
