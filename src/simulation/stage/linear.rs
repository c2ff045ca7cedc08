//! A stage that is linear in its unknown, solved directly.

use crate::error::Result;
use crate::kernels::vector::Accumulate;
use crate::real::Real;
use crate::simulation::rows::contact_rows::Part;
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::stage::massless::MasslessBlock;
use crate::simulation::stage::vectors::{StageVectors, residual};
use crate::simulation::step::finite::{Extent, check_motion};
use crate::state::Motion;

impl<T: Real> StageSolve<'_, '_, T> {
    /// Moves the predicted motion of a linear system to where the balance and the contact conditions hold.
    pub(crate) fn directly(
        &mut self,
        block: Option<&mut MasslessBlock<T>>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        residual(self.stage, self.clock.at(self.stage.load), self.system, new, vectors)?;
        let part = if block.is_some() { Part::Massive } else { Part::All };
        if let Some(block) = block {
            self.settle(block, new, past, vectors, contact)?;
        }
        self.operator.begin(&mut vectors.increment, &mut contact.interface.increment)?;
        contact.interface.forces.fill(T::zero());
        self.statistics.linear_solves += 1;
        if self.constraints.len() > 0 && T::all_finite(&contact.interface.increment) {
            let settled = self.contact(part, None, new, past, vectors, contact)?;
            self.refuse_unsettled(settled, new.t, &contact.rows.curved)?;
        }
        self.operator.finish(&mut vectors.increment, &contact.interface.increment, &contact.interface.forces)?;
        let recovery = &self.stage.recovery;
        let accumulate = if recovery.reads_past(2) { Accumulate::Add } else { Accumulate::Replace };
        if T::recover(recovery.weights(), &vectors.increment, [&mut new.u, &mut new.v, &mut new.a], accumulate) {
            return Ok(());
        }
        // The step is undone, and with it the values written.
        self.refuse_nan(&vectors.increment, "the increment")?;
        check_motion(self.clock.at(0.0), self.clock.h, [&new.u, &new.v, &new.a], Extent::All)
    }
}
