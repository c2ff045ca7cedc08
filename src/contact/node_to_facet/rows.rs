//! The rows of nodes on facets: entries of G, projections of the nodes, and gaps there.

use crate::contact::affine_rows;
use crate::contact::surface::{Point, Stand, add_scaled};
use crate::real::Real;

/// Rows by (node, pass).
pub(super) type Rows<T> = affine_rows::Rows<T, (usize, usize), Stand>;

impl<T: Real> Rows<T> {
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
        self.describe((node, pass), *stand, (stand.offset, stand.factor));
    }
}
