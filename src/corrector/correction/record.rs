//! The changes of a stage on the tape of a recorded run.

use super::Correction;
use crate::corrector::JumpProblem;
use crate::real::Real;
use crate::state::{Change, NoDerivative, Rule};

impl<T: Real> Correction<'_, T> {
    /// Records the solved jumps of field 1 or 2 (v or a); raw multipliers contribute `share` to the totals.
    pub(super) fn record_solution(&mut self, field: usize, share: T) {
        if self.buffers.changes.is_none() {
            return;
        }
        let change = Change {
            force: if field == 2 { T::of(self.scheme.balance / self.scheme.acceleration) } else { T::zero() },
            impulse: T::of(self.scheme.covector[0][field] * if field == 2 { self.scheme.h } else { 1.0 }),
            damps: field == 1 && self.buffers.spreads(),
            share,
            ..self.solution(0, field)
        };
        if let Some(changes) = &mut self.buffers.changes {
            changes.solved[field - 1] = Some(change);
        }
    }

    /// Records that the solved jumps of field 1 or 2 are removed.
    pub(super) fn record_removal(&mut self, field: usize) {
        if let Some(changes) = &mut self.buffers.changes {
            let solved = changes.solved[field - 1].take();
            changes.list.extend(solved);
        }
    }

    /// Records that a field of past state k is projected, with the impulse of a unit multiplier.
    pub(super) fn record_past(&mut self, k: usize, field: usize, impulse: T) {
        if self.constraints.0.turn() {
            let reason =
                "the derivative of its projection is not implemented: choose a scheme that reads no past state";
            self.refuse_gradient("a projected past along rows that turn", reason);
        }
        if self.buffers.changes.is_some() {
            let change = Change { impulse, ..self.solution(k, field) };
            self.buffers.changes.iter_mut().for_each(|changes| changes.list.push(change.clone()));
        }
    }

    /// The solution of the present problem, for a field of a state, without what is reported of it.
    fn solution(&mut self, state: usize, field: usize) -> Change<T> {
        let Self { buffers, constraints, .. } = self;
        let JumpProblem { blocks, rows, totals, increments, left, .. } = &*buffers.problem;
        let impulse = |row: usize| buffers.changes.as_ref().map_or(T::zero(), |changes| changes.impulse(row));
        let mut change = Change::new(state, field);
        for block in blocks {
            let (normal, total) = (change.rows.len(), totals[block.place]);
            let closes = block.set.is_bilateral() || total != T::zero();
            // A touching contact without friction that separates has no multiplier before and after.
            if !closes && block.tangents == 0 {
                continue;
            }
            let tangential = block.places().start + 1..block.places().end;
            change.rules.push(if closes { Rule::Closed } else { Rule::Unloaded });
            if let Some(direction) = block.direction {
                let direction = &direction[..block.tangents];
                change.rules.extend(Rule::along(normal, total, direction, impulse(block.row)));
            } else {
                let bound = T::of(constraints.0.tangents().friction(block.row)) * total;
                let slip = left[tangential.clone()].iter().fold(T::zero(), |size, &slip| size.hypot(slip));
                change.rules.extend(Rule::of_friction(normal, total, &totals[tangential], (bound, slip)));
            }
            for place in block.places() {
                change.rows.push(rows[place]);
                change.multipliers.push(increments[place]);
                change.totals.push(totals[place]);
            }
        }
        change
    }

    /// Records that this run has no gradient.
    pub(super) fn refuse_gradient(&mut self, what: &'static str, reason: &'static str) {
        if let Some(changes) = &mut self.buffers.changes {
            changes.refusal.get_or_insert(NoDerivative { what, reason });
        }
    }
}
