//! Limits the penetration recovered per step by contacts that are deep inside a body.

use crate::contact::{Candidates, ContactJacobian, ContactLaw, kept_depth};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::rows::constraints::Constraints;
use crate::state::Motion;

impl<T: Real> Constraints<'_, T> {
    /// [`search`](Self::search) at the start of a step, then [`keep_depths`](Self::keep_depths) with the recovery of
    /// each [contact](crate::contact::Contact::recovery). `share` is the step size over the size of a whole step:
    /// without it, halved steps would recover penetration too fast.
    pub(crate) fn search_for_step(
        &mut self,
        motion: &Motion<T>,
        (ahead, share): (f64, f64),
        jacobian: &mut ContactJacobian<T>,
    ) -> Result<Candidates> {
        let found = self.search(motion, ahead, jacobian)?;
        self.keep_depths(motion, share)?;
        Ok(found)
    }

    /// Offsets each gap by the penetration at `motion` that exceeds `share` times the recovery of a whole step. A
    /// share of 0 keeps the penetration that the last step has left.
    pub(crate) fn keep_depths(&mut self, motion: &Motion<T>, share: f64) -> Result<()> {
        self.kept.clear();
        if self.recoveries.iter().all(|recovery| recovery.is_infinite()) {
            return Ok(());
        }
        let mut kept = std::mem::take(&mut self.kept);
        kept.reserve(self.room());
        kept.resize(self.len(), T::zero());
        let evaluated = self.finite_gaps(motion.t, &motion.u, &mut kept);
        for (kept, &recovery) in kept.iter_mut().zip(&self.recoveries) {
            *kept = if recovery.is_infinite() { T::zero() } else { kept_depth(*kept, T::of(share) * recovery) };
        }
        self.kept = kept;
        evaluated.inspect_err(|_| self.kept.clear())
    }

    /// Converts gaps of a state to the offset gaps that the current step measures.
    pub(crate) fn measure_from_kept(&self, gaps: &mut [T]) {
        for (gap, &kept) in gaps.iter_mut().zip(&self.kept).filter(|(_, kept)| **kept > T::zero()) {
            *gap += kept;
        }
    }

    /// Converts the offset gaps of the step to gaps of a state.
    pub(crate) fn measure_from_surfaces(&self, gaps: &mut [T]) {
        for (gap, &kept) in gaps.iter_mut().zip(&self.kept).filter(|(_, kept)| **kept > T::zero()) {
            *gap -= kept;
        }
    }
}

/// The penetration that a row may recover in a step: as its constraint gives it, or infinite if its law needs no
/// limit.
pub(crate) fn recovery_of<T: Real>(said: T, law: ContactLaw) -> Result<T> {
    if said.is_nan() || said < T::zero() {
        let (name, range) = ("the depth by which a contact comes out in a step", "from 0");
        return Err(Error::Parameter { name, value: said.value(), range });
    }
    Ok(law.recovery(said))
}
