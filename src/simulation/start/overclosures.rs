//! Contacts that touch when a run starts, and bodies that overlap then.

use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::{rounding_of_input, touching};
use crate::simulation::start::{InitialOverclosure, Origin, Start};
use crate::state::{ContactState, Motion, Overclosures};

impl<T: Real> Start<'_, '_, T> {
    /// Evaluates the gaps, returns which rigid contacts touch, and refuses or adjusts overlaps. `tolerance` is an
    /// additional tolerance of the gaps.
    pub(super) fn touching(
        &mut self,
        motion: &Motion<T>,
        tolerance: T,
        contacts: &mut ContactState<T>,
    ) -> Result<Vec<bool>> {
        let rates = self.rates(motion.t, motion)?;
        let Self { constraints, g, h, origin, .. } = self;
        constraints.finite_gaps(motion.t, &motion.u, &mut contacts.gap)?;
        let (mut overclosures, mut closed) = (Vec::new(), Vec::with_capacity(constraints.len()));
        for (row, &gap) in contacts.gap.iter().enumerate() {
            let (law, contact) = (constraints.law(row), constraints.ids[row]);
            let moved = T::of(*h) * (g.product(row, &motion.v) + rates[row].rate).abs();
            let rounded = constraints.gap_rounding(row, g.magnitude(row, &motion.u), gap);
            let tolerance = rounding_of_input(rounded) + tolerance + touching(moved);
            let is_violated = !law.may_penetrate() && gap < -tolerance || law.is_equality() && gap > tolerance;
            match origin {
                Origin::Initial { overclosure: InitialOverclosure::Refused, .. } if is_violated => {
                    let (gap, tolerance) = (gap.value(), tolerance.value());
                    return Err(Error::InitialViolation { contact, gap, tolerance });
                }
                Origin::Initial { .. } if is_violated => overclosures.push((contact, gap)),
                Origin::Initial { .. } | Origin::Restart => {}
            }
            closed.push(gap <= tolerance && !law.is_compliant());
        }
        if !overclosures.is_empty() {
            let over = match origin {
                Origin::Initial { overclosure: InitialOverclosure::RemovedOver(time), .. } => Some(*time),
                Origin::Initial { .. } | Origin::Restart => None,
            };
            constraints.offsets.adjust(Overclosures::new(&overclosures, motion.t, over), &constraints.ids);
            constraints.finite_gaps(motion.t, &motion.u, &mut contacts.gap)?;
        }
        Ok(closed)
    }
}
