//! The changes of a stage on the tape of a recorded run.

use super::Correction;
use crate::corrector::buffers::Removal;
use crate::real::Real;
use crate::state::Change;

impl<T: Real> Correction<'_, T> {
    /// Records that the jumps of field 1 or 2 (v or a) of the state are removed.
    pub(super) fn record_removal(&mut self, field: usize, removal: &Removal<T>) {
        let Self { buffers, scheme, .. } = self;
        let damps = field == 1 && buffers.spreads();
        let Some(changes) = &mut buffers.changes else { return };
        let held = || removal.held.iter().zip(&removal.rows).zip(&removal.multipliers).filter(|((held, _), _)| **held);
        changes.list.push(Change {
            state: 0,
            field,
            rows: held().map(|((_, &row), _)| row).collect(),
            multipliers: held().map(|(_, &multiplier)| multiplier).collect(),
            force: if field == 2 { T::of(scheme.balance / scheme.acceleration) } else { T::zero() },
            impulse: T::of(scheme.covector[0][field] * if field == 2 { scheme.h } else { 1.0 }),
            damps,
        });
    }

    /// Records that a field of past state k is projected, with the impulse of a unit multiplier.
    pub(super) fn record_past(&mut self, k: usize, field: usize, impulse: T) {
        let problem = &self.buffers.problem;
        let (rows, multipliers) = (&problem.rows, &problem.increments);
        let Some(changes) = &mut self.buffers.changes else { return };
        let (rows, multipliers) = (rows.clone(), multipliers.clone());
        changes.list.push(Change { state: k, field, rows, multipliers, force: T::zero(), impulse, damps: false });
    }

    /// Records that this run has no gradient.
    pub(super) fn refuse_gradient(&mut self, what: &'static str, reason: &'static str) {
        if let Some(changes) = &mut self.buffers.changes {
            changes.refuse(what, reason);
        }
    }
}
