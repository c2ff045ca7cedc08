//! Offsets of gaps: overlaps at the start of a run, and penetration that a step may not recover at once.

use crate::contact::{Candidates, ContactId, ContactJacobian, ContactLaw, GapRates, kept_depth};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::start::overclosures::Overclosures;
use crate::state::Motion;

/// Values added to the gaps of all rows.
#[derive(Default)]
pub(crate) struct GapOffsets<T> {
    /// Depths of overlaps at the start of the run, by feature, and by row.
    overclosures: Option<Overclosures<T>>,
    depths: Vec<T>,
    /// The penetration that each row may recover in a step.
    recoveries: Vec<T>,
    /// Penetration beyond it in the present step; empty if there is none.
    kept: Vec<T>,
}

impl<T: Real> GapOffsets<T> {
    /// Memory for `rows` rows.
    pub(crate) fn with_capacity(rows: usize) -> Self {
        Self { overclosures: None, depths: Vec::new(), recoveries: Vec::with_capacity(rows), kept: Vec::new() }
    }

    /// Forgets all rows.
    pub(crate) fn clear_rows(&mut self) {
        self.recoveries.clear();
    }

    /// Forgets the penetration kept in the last step.
    pub(crate) fn clear_kept(&mut self) {
        self.kept.clear();
    }

    /// Appends a row with the penetration that it may recover in a step.
    pub(crate) fn push(&mut self, recovery: T, law: ContactLaw) -> Result<()> {
        if recovery.is_nan() || recovery < T::zero() {
            let (name, range) = ("the penetration that a contact may recover in a step", "from 0");
            return Err(Error::Parameter { name, value: recovery.value(), range });
        }
        self.recoveries.push(law.recovery(recovery));
        Ok(())
    }

    /// Finds the overlap of each row.
    pub(crate) fn distribute(&mut self, ids: &[ContactId]) {
        if let Some(overclosures) = &self.overclosures {
            self.depths.clear();
            self.depths.extend(ids.iter().map(|&id| overclosures.of(id)));
        }
    }

    /// Adds the offsets to gaps, or to their derivatives.
    pub(crate) fn add_to(&self, t: f64, derivative: usize, out: &mut [T]) {
        if let Some(overclosures) = &self.overclosures {
            let share = T::of(overclosures.share(t)[derivative]);
            for (out, &depth) in out.iter_mut().zip(&self.depths) {
                *out += share * depth;
            }
        }
        if derivative == 0 {
            for (gap, &kept) in out.iter_mut().zip(&self.kept) {
                *gap += kept;
            }
        }
    }

    /// Adds the derivatives of the offsets to rates of gaps.
    pub(crate) fn add_to_rates(&self, t: f64, out: &mut [GapRates<T>]) {
        if let Some(overclosures) = self.overclosures.as_ref().filter(|overclosures| overclosures.vary()) {
            let [_, rate, acceleration] = overclosures.share(t).map(T::of);
            for (rates, &depth) in out.iter_mut().zip(&self.depths) {
                rates.rate += rate * depth;
                rates.acceleration += acceleration * depth;
            }
        }
    }
}

impl<T: Real> Constraints<'_, T> {
    /// Adds the overlaps at the start to the gaps from now on.
    pub(crate) fn adjust(&mut self, overclosures: Overclosures<T>) {
        self.offsets.overclosures = Some(overclosures);
        self.offsets.distribute(&self.ids);
    }

    /// The overlaps given to [`adjust`](Self::adjust).
    pub(crate) fn overclosures(&self) -> Option<&Overclosures<T>> {
        self.offsets.overclosures.as_ref()
    }

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
        self.offsets.kept.clear();
        if self.offsets.recoveries.iter().all(|recovery| recovery.is_infinite()) {
            return Ok(());
        }
        let mut kept = std::mem::take(&mut self.offsets.kept);
        kept.reserve(self.room());
        kept.resize(self.len(), T::zero());
        let evaluated = self.finite_gaps(motion.t, &motion.u, &mut kept);
        for (kept, &recovery) in kept.iter_mut().zip(&self.offsets.recoveries) {
            *kept = if recovery.is_infinite() { T::zero() } else { kept_depth(*kept, T::of(share) * recovery) };
        }
        self.offsets.kept = kept;
        evaluated.inspect_err(|_| self.offsets.kept.clear())
    }

    /// Converts gaps of a state to the offset gaps that the current step measures.
    pub(crate) fn add_kept(&self, gaps: &mut [T]) {
        for (gap, &kept) in gaps.iter_mut().zip(&self.offsets.kept).filter(|(_, kept)| **kept > T::zero()) {
            *gap += kept;
        }
    }

    /// Converts the offset gaps of the step to gaps of a state.
    pub(crate) fn subtract_kept(&self, gaps: &mut [T]) {
        for (gap, &kept) in gaps.iter_mut().zip(&self.offsets.kept).filter(|(_, kept)| **kept > T::zero()) {
            *gap -= kept;
        }
    }
}
