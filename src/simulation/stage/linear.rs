//! A stage that is linear in its unknown, solved directly.

use crate::error::Result;
use crate::kernels::vector::Accumulate;
use crate::real::Real;
use crate::simulation::rows::massless_rows::Problem;
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::massless::MasslessBlock;
use crate::simulation::stage::vectors::residual;
use crate::simulation::step::finite::{Extent, check_motion};

impl<T: Real> StageSolve<'_, '_, T> {
    /// Solves a stage of a linear system; dofs without mass of an explicit stage are solved first, with their `block`.
    pub(crate) fn solve_linear(&mut self, block: Option<&mut MasslessBlock<T>>) -> Result<()> {
        residual(self.stage, self.clock.at(self.stage.load), self.host.system, self.new, self.vectors)?;
        if let Some(block) = block {
            self.balance_massless(block)?;
            self.contact.rows.massless.problem = Problem::Dynamic;
        }
        let converged = self.solve_linearized()?;
        self.refuse_not_converged(converged)?;
        self.recover()
    }

    /// Adds the increment to the predicted motion.
    fn recover(&mut self) -> Result<()> {
        let Self { stage, new, vectors, .. } = self;
        let rows = &stage.recovery;
        let accumulate = if rows.reads_past(2) { Accumulate::Add } else { Accumulate::Replace };
        if T::recover(rows.weights(), &vectors.increment, [&mut new.u, &mut new.v, &mut new.a], accumulate) {
            return Ok(());
        }
        // The step is undone, and with it the values written.
        self.refuse_nan(&self.vectors.increment, "the increment")?;
        check_motion(self.clock.at(0.0), self.clock.h, [&self.new.u, &self.new.v, &self.new.a], Extent::All)
    }
}
