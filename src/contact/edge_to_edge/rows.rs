//! The rows of edges on edges: entries of G, where the edges are closest, and the gaps there.

use super::lines::Crossing;
use crate::contact::affine_rows::AffineRows;
use crate::contact::surface::Point;
use crate::real::Real;

/// The rows that a search found, where they are linearized.
#[derive(Debug)]
pub(super) struct Rows<T> {
    pub(super) affine: AffineRows<T>,
    /// The edges of the two surfaces.
    pub(super) pairs: Vec<[usize; 2]>,
    /// The sum of their radii in full size, and the factor that the gap was made with.
    pub(super) rounding: Vec<(f64, f64)>,
    /// The lines through them, with the normal along which the first edge opens.
    pub(super) crossings: Vec<Crossing>,
}

impl<T: Real> Rows<T> {
    pub(super) fn new() -> Self {
        Self { affine: AffineRows::with_capacity(0, 0), pairs: Vec::new(), rounding: Vec::new(), crossings: Vec::new() }
    }

    pub(super) fn clear(&mut self) {
        self.affine.clear();
        self.pairs.clear();
        self.rounding.clear();
        self.crossings.clear();
    }

    /// Appends the row of two edges: their four nodes, the gap and its derivatives by the positions of these.
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

    /// Appends a row as another list has it.
    pub(super) fn keep(&mut self, other: &Self, row: usize) {
        self.affine.keep(&other.affine, row);
        self.pairs.push(other.pairs[row]);
        self.rounding.push(other.rounding[row]);
        self.crossings.push(other.crossings[row]);
    }
}
