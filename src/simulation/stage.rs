//! What a stage is solved with, and its contact.

use super::constraints::Constraints;
use super::contact_rows::Part;
use super::contact_step::{ContactStep, ContactWork};
use super::curved_rows::{CurvedRowsWork, FOLLOWED, Worst};
use super::operator::Operator;
use super::program::CompiledStage;
use super::results::Statistics;
use super::stage_vectors::StageVectors;
use crate::contact::ContactJacobian;
use crate::contact_solver::ContactSolver;
use crate::error::{Error, Result};
use crate::ranks::Together;
use crate::real::Real;
use crate::state::{Clock, Motion};
use crate::system::System;

/// What a stage is solved with.
pub(super) struct StageSolve<'s, 'a, T: Real> {
    pub(super) stage: &'s CompiledStage<T>,
    pub(super) clock: Clock,
    pub(super) system: &'s mut dyn System<T>,
    pub(super) together: &'s Together<T>,
    pub(super) operator: &'s mut Operator<T>,
    pub(super) constraints: &'s mut Constraints<'a, T>,
    pub(super) g: &'s mut ContactJacobian<T>,
    pub(super) solver: &'s mut dyn ContactSolver<T>,
    pub(super) statistics: &'s mut Statistics,
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Adds the response to contact to the increment on the interface; `iterate` is the part of the unknown that
    /// motions contain already. Says whether curved rows fit the result.
    pub(super) fn contact(
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

    /// Refuses contact whose curved rows do not fit its result.
    pub(super) fn refuse_unsettled(&self, settled: bool, t: f64, rows: &CurvedRowsWork<T>) -> Result<()> {
        if settled {
            return Ok(());
        }
        let Worst { row, what, change, tolerance } = rows.worst;
        let (iterations, contact) = (FOLLOWED, self.constraints.ids[row]);
        Err(Error::ContactUnsettled { t, iterations, contact, what, change, tolerance })
    }

    pub(super) fn refuse_nan(&self, values: &[T], what: &'static str) -> Result<()> {
        if T::all_finite(values) {
            return Ok(());
        }
        let dof = values.iter().position(|x| !x.is_finite()).unwrap_or(0);
        let value = values[dof].value();
        Err(Error::StepNotFinite { t: self.clock.at(0.0), h: self.clock.h, what, dof, value })
    }
}
