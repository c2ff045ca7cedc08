//! The rows of nodes on facets: entries of G, projections of the nodes, and gaps there.

use crate::contact::affine_rows::AffineRows;
use crate::contact::surface::{Point, Stand, add_scaled};
use crate::real::Real;

/// The rows of a search, at their point of linearization.
#[derive(Debug, Default)]
pub(super) struct Rows<T> {
    pub(super) affine: AffineRows<T>,
    /// (node, pass)
    pub(super) identities: Vec<(usize, usize)>,
    pub(super) stands: Vec<Stand>,
}

impl<T: Real> Rows<T> {
    pub(super) fn clear(&mut self) {
        self.affine.clear();
        self.identities.clear();
        self.stands.clear();
    }

    /// Appends the row of a node on the vertices of a facet, with the derivatives of their offsets, if any.
    pub(super) fn push<'a>(
        &mut self,
        (node, pass): (usize, usize),
        (stand, slope): (&Stand, Option<[Point; 5]>),
        vertices: &[usize],
        dofs: impl Fn(usize) -> &'a [usize],
        u: &[T],
    ) {
        let shares = std::iter::once((node, 1.0)).chain(vertices.iter().copied().zip(stand.weights.map(|w| -w)));
        let vectors = shares.enumerate().map(|(k, (node, share))| {
            let along = stand.normal.map(|component| share * component);
            (dofs(node), slope.map_or(along, |slope| add_scaled(along, -stand.factor, slope[k])))
        });
        self.affine.push_vectors(stand.gap, vectors, u);
        self.identities.push((node, pass));
        self.stands.push(*stand);
    }

    /// Appends a copy of a row of another list.
    pub(super) fn keep(&mut self, other: &Self, row: usize) {
        self.affine.keep(&other.affine, row);
        self.identities.push(other.identities[row]);
        self.stands.push(other.stands[row]);
    }
}
