//! Depths that contacts keep for a step: what a search finds far inside of a body comes out slowly.

use crate::contact::{Candidates, ContactJacobian, ContactLaw, kept_depth};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::rows::constraints::Constraints;
use crate::state::Motion;

impl<T: Real> Constraints<'_, T> {
    /// [`search`](Self::search) at the start of a step, which measures gaps from where it finds the contacts that are
    /// deeper than they may come out by ([`Contact::recovery`](crate::contact::Contact::recovery)), times the `share`
    /// that the step is of a whole one: halves of a step would throw them out.
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

    /// Measures gaps from where contacts are in a motion, as far as they are deeper than what they come out by, times
    /// the share. (Of no share, as the step has left them that made the motion.)
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

    /// Makes gaps of a state those that the step under way measures.
    pub(crate) fn measure_from_kept(&self, gaps: &mut [T]) {
        for (gap, &kept) in gaps.iter_mut().zip(&self.kept).filter(|(_, kept)| **kept > T::zero()) {
            *gap += kept;
        }
    }

    /// Makes gaps that the step has measured those of a state.
    pub(crate) fn measure_from_surfaces(&self, gaps: &mut [T]) {
        for (gap, &kept) in gaps.iter_mut().zip(&self.kept).filter(|(_, kept)| **kept > T::zero()) {
            *gap -= kept;
        }
    }
}

/// How far a row comes out in a step, as its constraint says; all of it if what is deep presses as it is deep.
pub(crate) fn recovery_of<T: Real>(said: T, law: ContactLaw) -> Result<T> {
    if said.is_nan() || said < T::zero() {
        let (name, range) = ("the depth by which a contact comes out in a step", "from 0");
        return Err(Error::Parameter { name, value: said.value(), range });
    }
    Ok(if law.keeps_depths() { said } else { T::infinity() })
}
