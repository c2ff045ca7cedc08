//! The rows of edges on edges: entries of G, closest points of the edges, and gaps there.

use super::lines::Crossing;
use crate::contact::affine_rows::AffineRows;
use crate::contact::surface::Point;
use crate::real::Real;

/// The rows of a search, at their point of linearization.
#[derive(Debug)]
pub(super) struct Rows<T> {
    pub(super) affine: AffineRows<T>,
    /// The edges of the two surfaces.
    pub(super) pairs: Vec<[usize; 2]>,
    /// The sum of their radii at full size, and its factor in the gap.
    pub(super) rounding: Vec<(f64, f64)>,
    /// The lines through them, with the normal along which the first edge opens.
    pub(super) crossings: Vec<Crossing>,
}

impl<T: Real> Rows<T> {
    pub(super) fn new() -> Self {
        Self { affine: AffineRows::default(), pairs: Vec::new(), rounding: Vec::new(), crossings: Vec::new() }
    }

    pub(super) fn clear(&mut self) {
        self.affine.clear();
        self.pairs.clear();
        self.rounding.clear();
        self.crossings.clear();
    }

    /// Appends the row of two edges: their four nodes, and the gap with its derivatives by the positions of these.
    pub(super) fn push<'a>(
        &mut self,
        (pair, crossing): ([usize; 2], Crossing),
        rounding: (f64, f64),
        (gap, row): (f64, [Point; 4]),
        (nodes, places): ([usize; 4], impl Fn(usize) -> &'a [usize]),
        u: &[T],
    ) {
        let entries = nodes.into_iter().zip(row).flat_map(|(node, weights)| places(node).iter().copied().zip(weights));
        self.affine.push(gap, entries, u);
        self.rounding.push(rounding);
        self.pairs.push(pair);
        self.crossings.push(crossing);
    }

    /// Appends a copy of a row of another list.
    pub(super) fn keep(&mut self, other: &Self, row: usize) {
        self.affine.keep(&other.affine, row);
        self.pairs.push(other.pairs[row]);
        self.rounding.push(other.rounding[row]);
        self.crossings.push(other.crossings[row]);
    }
}
