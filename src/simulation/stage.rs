//! The data with which a stage is solved, and its contact.
//!
//! In the order of execution:
//!
//! - `supports`, `vectors`: prescribed motions, the predicted motion and its residual.
//! - `massless`, `massless_step`: dofs without mass.
//! - `linear`, or `newton_step` with the settings in `newton` and the force in `path`: solve the stage.
//! - `contact`: solves its contact.

pub(super) mod contact;
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
use crate::simulation::rows::contact_rows::Part;
use crate::simulation::rows::curved_rows::{CurvedRowsWork, FOLLOWED, Worst};
use crate::simulation::run::results::Statistics;
use crate::simulation::stage::contact::{ContactStep, ContactWork};
use crate::simulation::stage::vectors::StageVectors;
use crate::state::{Clock, Motion};
use crate::system::System;

/// The data with which a stage is solved.
pub(crate) struct StageSolve<'s, 'a, T: Real> {
    pub(crate) stage: &'s CompiledStage<T>,
    pub(crate) clock: Clock,
    pub(crate) system: &'s mut dyn System<T>,
    pub(crate) together: &'s Together<T>,
    pub(crate) operator: &'s mut Operator<T>,
    pub(crate) constraints: &'s mut Constraints<'a, T>,
    pub(crate) g: &'s mut ContactJacobian<T>,
    pub(crate) solver: &'s mut dyn ContactSolver<T>,
    pub(crate) statistics: &'s mut Statistics,
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Adds the response to contact to the increment on the interface; `iterate` is the part of the unknown that
    /// motions contain already. Returns whether curved rows fit the result.
    pub(crate) fn contact(
        &mut self,
        part: Part,
        iterate: Option<&[T]>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        work: &mut ContactWork<T>,
    ) -> Result<bool> {
        let Self { stage, clock, system, operator, constraints, g, solver, statistics, .. } = self;
        let mut contact =
            ContactStep { stage, clock: *clock, constraints, g, solver: &mut **solver, statistics, iterate, part };
        contact.solve(&mut **system, operator, new, past, vectors, work)
    }

    /// Refuses contact whose curved rows have not converged.
    pub(crate) fn refuse_unsettled(&self, settled: bool, t: f64, rows: &CurvedRowsWork<T>) -> Result<()> {
        if settled {
            return Ok(());
        }
        let Worst { row, what, change, tolerance } = rows.worst;
        let (iterations, contact) = (FOLLOWED, self.constraints.ids[row]);
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
