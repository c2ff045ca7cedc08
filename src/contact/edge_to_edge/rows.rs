//! The rows of edges on edges: entries of G, closest points of the edges, and gaps there.

use super::lines::Crossing;
use crate::contact::affine_rows;
use crate::contact::surface::Point;
use crate::real::Real;

/// Rows by the edges of the two surfaces, with the lines through them; their offset is the sum of their radii.
pub(super) type Rows<T> = affine_rows::Rows<T, [usize; 2], Crossing>;

impl<T: Real> Rows<T> {
    /// Appends the row of two edges: their four nodes, and the gap with its derivatives by the positions of these.
    pub(super) fn push<'a>(
        &mut self,
        (pair, crossing): ([usize; 2], Crossing),
        offset: (f64, f64),
        (gap, row): (f64, [Point; 4]),
        (nodes, places): ([usize; 4], impl Fn(usize) -> &'a [usize]),
        u: &[T],
    ) {
        let entries = nodes.into_iter().zip(row).flat_map(|(node, weights)| places(node).iter().copied().zip(weights));
        self.affine.push(gap, entries, u);
        self.describe(pair, crossing, offset);
    }
}
