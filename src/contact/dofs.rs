//! The dofs of a constraint as a list without repetitions, and the places of dofs in it.

use std::collections::HashMap;

/// Dofs in the order in which they were first added.
#[derive(Clone, Debug, Default)]
pub(super) struct DofList {
    dofs: Vec<usize>,
    places: HashMap<usize, usize>,
}

impl DofList {
    /// The place of a dof, which is appended if it is new.
    pub(super) fn place(&mut self, dof: usize) -> usize {
        let next = self.dofs.len();
        let place = *self.places.entry(dof).or_insert(next);
        if place == next {
            self.dofs.push(dof);
        }
        place
    }

    pub(super) fn as_slice(&self) -> &[usize] {
        &self.dofs
    }
}
