//! Offsets of gaps: overlaps at the start of a run, and penetration that a step may not recover at once.

use crate::contact::{ContactId, ContactLaw, GapRates};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::state::Overclosures;

/// Values added to the gaps of all rows.
#[derive(Default)]
pub(crate) struct GapOffsets<T> {
    /// Depths of overlaps at the start of the run, by feature, and by row.
    overclosures: Option<Overclosures<T>>,
    depths: Vec<T>,
    /// The penetration that each row may recover in a step.
    pub(super) recoveries: Vec<T>,
    /// Penetration beyond it in the present step; empty if there is none.
    pub(super) kept: Vec<T>,
}

impl<T: Real> GapOffsets<T> {
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

    /// Adds the overlaps at the start to the gaps of the contacts from now on.
    pub(crate) fn adjust(&mut self, overclosures: Overclosures<T>, ids: &[ContactId]) {
        self.overclosures = Some(overclosures);
        self.distribute(ids);
    }

    /// The overlaps given to [`adjust`](Self::adjust).
    pub(crate) fn overclosures(&self) -> Option<&Overclosures<T>> {
        self.overclosures.as_ref()
    }

    /// Whether the present step leaves a part of the penetration of a row.
    pub(crate) fn keeps(&self, row: usize) -> bool {
        self.kept.get(row).is_some_and(|&kept| kept > T::zero())
    }

    /// Converts gaps of a state to the offset gaps that the current step measures.
    pub(crate) fn add_kept(&self, gaps: &mut [T]) {
        for (gap, &kept) in gaps.iter_mut().zip(&self.kept).filter(|(_, kept)| **kept > T::zero()) {
            *gap += kept;
        }
    }

    /// Converts the offset gaps of the step to gaps of a state.
    pub(crate) fn subtract_kept(&self, gaps: &mut [T]) {
        for (gap, &kept) in gaps.iter_mut().zip(&self.kept).filter(|(_, kept)| **kept > T::zero()) {
            *gap -= kept;
        }
    }
}
