//! A facet by the numbers of its nodes.

use super::shape::{Point, Shape};

/// A facet of a surface: the numbers of its 2, 3 or 4 nodes.
///
/// Its normal points out of the body: a segment (two dimensions) is walked with the body on the left, a triangle or a
/// bilinear quadrilateral (three dimensions) goes counter-clockwise if seen from outside.
///
/// ```
/// use contact_dynamics::contact::Facet;
/// let mixed = [Facet::from([0, 1, 2]), Facet::from([1, 3, 4, 2])];
/// assert_eq!(mixed[1].nodes(), [1, 3, 4, 2]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Facet {
    /// The nodes; of less than four the last one fills the rest.
    pub(crate) nodes: [usize; 4],
    pub(crate) count: usize,
}

impl From<[usize; 2]> for Facet {
    fn from([i, j]: [usize; 2]) -> Self {
        Self { nodes: [i, j, j, j], count: 2 }
    }
}

impl From<[usize; 3]> for Facet {
    fn from([i, j, k]: [usize; 3]) -> Self {
        Self { nodes: [i, j, k, k], count: 3 }
    }
}

impl From<[usize; 4]> for Facet {
    fn from(nodes: [usize; 4]) -> Self {
        Self { nodes, count: 4 }
    }
}

/// Facets of higher order are taken as several of first order, with the same nodes.
///
/// ```
/// use contact_dynamics::contact::Facet;
/// let parts = Facet::of_quadratic_segment([0, 2, 1]); // from node 0 to node 2, node 1 in the middle
/// assert_eq!(parts.map(|part| [part.nodes()[0], part.nodes()[1]]), [[0, 1], [1, 2]]);
/// ```
impl Facet {
    /// The halves of a segment of three nodes: its ends, and the node between them.
    pub fn of_quadratic_segment([a, b, middle]: [usize; 3]) -> [Self; 2] {
        [Self::from([a, middle]), Self::from([middle, b])]
    }

    /// The parts of a triangle of six nodes: its corners, and the nodes on its sides, the first between the first two
    /// corners.
    pub fn of_quadratic_triangle([a, b, c, ab, bc, ca]: [usize; 6]) -> [Self; 4] {
        [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]].map(Self::from)
    }

    /// The parts of a quadrilateral of eight nodes: its corners, and the nodes on its sides, the first between the
    /// first two corners. They are four triangles and a quadrilateral.
    pub fn of_quadratic_quadrilateral([a, b, c, d, ab, bc, cd, da]: [usize; 8]) -> [Self; 5] {
        let [w, x, y, z] = [[a, ab, da], [b, bc, ab], [c, cd, bc], [d, da, cd]].map(Self::from);
        [w, x, y, z, Self::from([ab, bc, cd, da])]
    }

    /// The parts of a quadrilateral of nine nodes: as of eight, and the node in the middle.
    pub fn of_biquadratic_quadrilateral([a, b, c, d, ab, bc, cd, da, middle]: [usize; 9]) -> [Self; 4] {
        [[a, ab, middle, da], [b, bc, middle, ab], [c, cd, middle, bc], [d, da, middle, cd]].map(Self::from)
    }

    /// The nodes in the order given.
    pub fn nodes(&self) -> &[usize] {
        &self.nodes[..self.count]
    }

    /// The facet with its vertices at the positions of its nodes.
    pub(crate) fn shape(&self, positions: &[Point]) -> Shape {
        Shape::new(self.nodes.map(|node| positions[node]), self.count)
    }
}
