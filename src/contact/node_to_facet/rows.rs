//! The rows of nodes on facets: entries of G, where the nodes stand, and the gaps there.

use crate::contact::ContactJacobian;
use crate::contact::surface::Stand;
use crate::real::Real;

/// The rows that a search found, where they are linearized.
#[derive(Debug)]
pub(super) struct Rows<T> {
    pub(super) jacobian: ContactJacobian<T>,
    /// (node, pass)
    pub(super) identities: Vec<(usize, usize)>,
    pub(super) stands: Vec<Stand>,
    /// Displacements there, one an entry of G.
    displacements: Vec<T>,
}

impl<T: Real> Rows<T> {
    pub(super) fn with_capacity(rows: usize, entries: usize) -> Self {
        Self {
            jacobian: ContactJacobian::with_capacity(rows, entries),
            identities: Vec::with_capacity(rows),
            stands: Vec::with_capacity(rows),
            displacements: Vec::with_capacity(entries),
        }
    }

    pub(super) fn clear(&mut self) {
        self.jacobian.clear();
        self.identities.clear();
        self.stands.clear();
        self.displacements.clear();
    }

    /// Appends the row of a node on the vertices of a facet.
    pub(super) fn push<'a>(
        &mut self,
        (node, pass): (usize, usize),
        stand: Stand,
        vertices: &[usize],
        dofs: impl Fn(usize) -> &'a [usize],
        u: &[T],
    ) {
        let entries = std::iter::once((node, 1.0)).chain(vertices.iter().copied().zip(stand.weights.map(|w| -w)));
        for (node, share) in entries {
            for (&dof, &component) in dofs(node).iter().zip(&stand.normal) {
                let weight = T::of(share * component);
                if weight != T::zero() {
                    self.jacobian.dofs.push(dof);
                    self.jacobian.weights.push(weight);
                    self.displacements.push(u[dof]);
                }
            }
        }
        self.jacobian.pointers.push(self.jacobian.dofs.len());
        self.identities.push((node, pass));
        self.stands.push(stand);
    }

    /// Appends a row as another list has it.
    pub(super) fn keep(&mut self, other: &Self, row: usize) {
        let range = other.jacobian.pointers[row]..other.jacobian.pointers[row + 1];
        self.jacobian.dofs.extend_from_slice(&other.jacobian.dofs[range.clone()]);
        self.jacobian.weights.extend_from_slice(&other.jacobian.weights[range.clone()]);
        self.displacements.extend_from_slice(&other.displacements[range]);
        self.jacobian.pointers.push(self.jacobian.dofs.len());
        self.identities.push(other.identities[row]);
        self.stands.push(other.stands[row]);
    }

    /// The gap of a row at u.
    pub(super) fn gap(&self, row: usize, u: &[T]) -> T {
        let Self { jacobian, stands, displacements, .. } = self;
        let start = &displacements[jacobian.pointers[row]..jacobian.pointers[row + 1]];
        let moved = jacobian.row(row).zip(start).map(|((dof, weight), &start)| weight * (u[dof] - start));
        T::of(stands[row].gap) + moved.sum()
    }
}
