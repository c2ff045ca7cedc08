//! A facet, given by the indices of its nodes.

use super::second_order::{ByNode, Kind, Whole};
use super::shape::{Point, Shape, add_scaled, middle, sub};

/// A facet of a surface: the indices of its 2, 3 or 4 nodes.
///
/// Its normal points out of the body. A segment (two dimensions) runs with the body on its left; the nodes of a
/// triangle or a bilinear quadrilateral (three dimensions) are in counter-clockwise order seen from outside.
///
/// ```
/// use contact_dynamics::contact::Facet;
/// let mixed = [Facet::from([0, 1, 2]), Facet::from([1, 3, 4, 2])];
/// assert_eq!(mixed[1].nodes(), [1, 3, 4, 2]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Facet {
    /// The nodes; if there are fewer than four, the last one fills the rest.
    pub(crate) nodes: [usize; 4],
    pub(crate) count: usize,
    /// The facet of second order whose part it is.
    pub(crate) whole: Option<Whole>,
}

impl From<[usize; 2]> for Facet {
    fn from([i, j]: [usize; 2]) -> Self {
        Self { nodes: [i, j, j, j], count: 2, whole: None }
    }
}

impl From<[usize; 3]> for Facet {
    fn from([i, j, k]: [usize; 3]) -> Self {
        Self { nodes: [i, j, k, k], count: 3, whole: None }
    }
}

impl From<[usize; 4]> for Facet {
    fn from(nodes: [usize; 4]) -> Self {
        Self { nodes, count: 4, whole: None }
    }
}

/// A facet of second order is a set of facets of first order with the same nodes, each linked to the whole.
/// [`Mortar`](crate::contact::Mortar) and [`Tie`](crate::contact::Tie) interpolate positions with the shape functions
/// of second order; other constraints use the linear parts.
///
/// ```
/// use contact_dynamics::contact::Facet;
/// let parts = Facet::of_quadratic_segment([0, 2, 1]); // from node 0 to node 2, node 1 in the middle
/// assert_eq!(parts.map(|part| [part.nodes()[0], part.nodes()[1]]), [[0, 1], [1, 2]]);
/// ```
impl Facet {
    /// The halves of a segment of three nodes: its ends, and the node between them.
    pub fn of_quadratic_segment(nodes: [usize; 3]) -> [Self; 2] {
        Self::parts(Kind::Segment, &nodes)
    }

    /// The parts of a triangle of six nodes: its corners, and the nodes on its sides, the first between the first two
    /// corners.
    pub fn of_quadratic_triangle(nodes: [usize; 6]) -> [Self; 4] {
        Self::parts(Kind::Triangle, &nodes)
    }

    /// The parts of a quadrilateral of eight nodes: its corners, and the nodes on its sides, the first between the
    /// first two corners. They are four triangles and a quadrilateral.
    pub fn of_quadratic_quadrilateral(nodes: [usize; 8]) -> [Self; 5] {
        Self::parts(Kind::Serendipity, &nodes)
    }

    /// The parts of a quadrilateral of nine nodes: as of eight, and the node in the middle.
    pub fn of_biquadratic_quadrilateral(nodes: [usize; 9]) -> [Self; 4] {
        Self::parts(Kind::Biquadratic, &nodes)
    }

    fn parts<const N: usize>(kind: Kind, nodes: &[usize]) -> [Self; N] {
        std::array::from_fn(|part| {
            let (nodes, count, whole) = Whole::part(kind, part, nodes);
            Self { nodes, count, whole: Some(whole) }
        })
    }

    /// The nodes in the order given.
    #[inline]
    pub fn nodes(&self) -> &[usize] {
        &self.nodes[..self.count]
    }

    #[inline]
    pub(crate) fn shape(&self, positions: &[Point]) -> Shape {
        let [a, b, c, d] = self.nodes;
        Shape::new([positions[a], positions[b], positions[c], positions[d]], self.count)
    }

    /// The outward unit normal at its middle; none if it is degenerate there.
    #[inline]
    pub(crate) fn normal(&self, positions: &[Point]) -> Option<Point> {
        self.shape(positions).normal(&middle(self.count))
    }

    /// Its nodes, followed by the other nodes of its facet of second order.
    pub(crate) fn all_nodes(&self) -> impl Iterator<Item = usize> + '_ {
        let others = self.whole.as_ref().map_or(&[][..], Whole::others);
        self.nodes().iter().chain(others).copied()
    }

    /// The shape functions of the positions, by all its nodes, where its own shape functions are `weights`.
    pub(crate) fn shapes(&self, weights: &[f64; 4]) -> ByNode {
        self.whole.map_or_else(
            || std::array::from_fn(|k| weights.get(k).copied().unwrap_or(0.0)),
            |whole| whole.shapes(weights),
        )
    }

    /// Σ of the positions of all its nodes with coefficients whose sum is zero.
    pub(crate) fn combine(&self, coefficients: &ByNode, positions: &[Point]) -> Point {
        // Differences from the first node: far from the origin the sum would lose digits.
        let first = positions[self.nodes[0]];
        let term = |sum, (node, &share): (usize, &f64)| add_scaled(sum, share, sub(positions[node], first));
        self.all_nodes().zip(coefficients).fold([0.0; 3], term)
    }
}
