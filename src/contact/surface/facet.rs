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

impl Facet {
    /// The nodes in the order given.
    pub fn nodes(&self) -> &[usize] {
        &self.nodes[..self.count]
    }

    /// The facet with its vertices at the positions of its nodes.
    pub(crate) fn shape(&self, positions: &[Point]) -> Shape {
        Shape::new(self.nodes.map(|node| positions[node]), self.count)
    }
}
