//! A surface of facets: its facets and nodes, their neighbors, and closest points.

mod closed;
mod closest_point;
mod cones;
mod connect;
mod dent;
mod exact;
mod facet;
mod flat;
mod material;
mod nearest_first;
mod nodes;
mod normals;
mod offsets;
mod outer;
mod output;
mod overlap;
mod own_facets;
mod polygon;
mod projection;
mod ramp;
mod reach;
mod search;
mod second_difference;
mod second_order;
mod separation;
mod shape;
mod sharp;
mod vicinity;

pub(crate) use cones::Cones;
pub use facet::Facet;
pub(crate) use material::Material;
pub(crate) use nearest_first::{Kept, NearestFirst};
pub(crate) use nodes::Nodes;
pub(crate) use offsets::Offsets;
pub(crate) use overlap::{Base, RimSample, Sample};
pub(crate) use projection::{Ground, Stand};
pub(crate) use ramp::Ramp;
pub(crate) use search::{Bounds, Neighborhood, overhang};
pub(crate) use second_difference::SecondDifference;
pub(crate) use second_order::ByNode;
pub(crate) use separation::{Corners, distance_in_motion};
pub(crate) use shape::{Foot, Location, Point, Shape, add_scaled, cross, dot, middle, norm, sub, unit};
pub(crate) use vicinity::Vicinity;

use shape::{RIM, Rim};

/// Largest penetration that is recovered in a step, as a share of the smallest facet or edge. A body at a typical
/// impact speed, a thousandth of the wave speed, moves ten times as far in a step. Faster recovery would throw it.
pub(crate) const RECOVERY: f64 = 1e-4;

/// A surface of one or more parts, made of facets: the input of constraints between surfaces and of output.
///
/// It is built from facets ([`new`](Self::new)) or from the outer sides of a mesh of cells
/// ([`of_cells`](Self::of_cells)). Both check the sides, the orientation and the areas of the facets. Constraints
/// accept `&surface` wherever they accept facets, so that one surface serves all constraints and the output.
///
/// ```
/// use contact_dynamics::contact::{BodyContact, Surface};
///
/// // Two unit squares, the second one 0.1 above the first.
/// let coordinates = [[0., 0.], [1., 0.], [1., 1.], [0., 1.], [0., 1.1], [1., 1.1], [1., 2.1], [0., 2.1]];
/// let dofs: Vec<[usize; 2]> = (0..8).map(|node| [2 * node, 2 * node + 1]).collect();
/// let lower = Surface::of_cells(&coordinates, [[0, 1, 2, 3]])?;
/// let upper = Surface::of_cells(&coordinates, [[4, 5, 6, 7]])?;
/// let contact = BodyContact::new(&coordinates, &dofs, &upper, &lower)?;
///
/// // The upper side of the lower square bears 3 on each of its nodes, downward; half of the side belongs to each.
/// let mut forces = [[0.0; 2]; 8];
/// (forces[2], forces[3]) = ([0.0, -3.0], [0.0, -3.0]);
/// let pressures = lower.pressures(&coordinates, &forces)?;
/// let corner = lower.nodes().iter().position(|&node| node == 2).ok_or("a node of the surface")?;
/// assert!((pressures[corner] - 6.0_f64).abs() < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Surface {
    dimension: usize,
    facets: Vec<Facet>,
    rims: Vec<Rim>,
    /// The facet across each side, and the index of the side there.
    neighbors: Vec<[Option<(usize, usize)>; 4]>,
    /// Nodes of the facets, sorted.
    nodes: Vec<usize>,
    /// The places among them of the vertices of each facet.
    places: Vec<[usize; 4]>,
    /// (facet, vertex of the facet) for each node, and the first entry of each node in this list.
    around: Vec<(usize, usize)>,
    starts: Vec<usize>,
    /// The longest side of the smallest facet, in the reference configuration.
    finest: f64,
    /// The mean of the longest sides of all facets, in the reference configuration.
    typical: f64,
}

impl Surface {
    /// The facets, in the order of the given facets or cells.
    pub fn facets(&self) -> &[Facet] {
        &self.facets
    }

    /// The longest side of the smallest facet, in the reference coordinates.
    pub(crate) fn finest(&self) -> f64 {
        self.finest
    }

    /// The mean of the longest sides of the facets, in the reference coordinates.
    pub(crate) fn typical(&self) -> f64 {
        self.typical
    }

    pub(crate) fn boxes(&self, positions: &[Point]) -> impl Iterator<Item = Bounds> + Clone {
        self.facets.iter().map(|facet| Bounds::of_corners(&facet.shape(positions)))
    }

    /// The nodes of its facets, ascending.
    pub fn nodes(&self) -> &[usize] {
        &self.nodes
    }

    /// The nodes that move the surface, ascending: its own nodes, and the other nodes of facets of second order.
    pub(crate) fn moved_by(&self) -> Vec<usize> {
        let others = self.facets.iter().filter(|facet| facet.whole.is_some()).flat_map(Facet::all_nodes);
        let mut nodes = self.nodes.clone();
        nodes.extend(others);
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// The place of a node in [`nodes`](Self::nodes).
    pub(crate) fn place(&self, node: usize) -> usize {
        self.nodes.partition_point(|&other| other < node)
    }

    /// The places of the vertices of a facet in [`nodes`](Self::nodes); later entries have no meaning.
    pub(crate) fn places(&self, facet: usize) -> &[usize; 4] {
        &self.places[facet]
    }

    /// Whether the surface ends at each side of a facet.
    pub(crate) fn open_sides(&self, facet: usize) -> [bool; 4] {
        self.rims[facet].sides
    }

    /// The facet across a side of a facet, and the index of the side there; none where the surface ends.
    pub(crate) fn neighbor(&self, facet: usize, side: usize) -> Option<(usize, usize)> {
        self.neighbors[facet][side]
    }

    /// The closest point of a facet, with the shape of the facet.
    pub(crate) fn project(&self, facet: usize, p: Point, positions: &[Point]) -> Option<(Shape, Foot)> {
        self.project_beyond(facet, p, RIM, positions)
    }

    /// As `project`, on a surface extended beyond its rim by `beyond` times the size of the facet.
    pub(crate) fn project_beyond(
        &self,
        facet: usize,
        p: Point,
        beyond: f64,
        positions: &[Point],
    ) -> Option<(Shape, Foot)> {
        let shape = self.facets[facet].shape(positions);
        shape.project(p, Rim { beyond, ..self.rims[facet] }).map(|foot| (shape, foot))
    }

    /// The facets around a node, with the vertex of each that is this node; none if the node is not on the surface.
    fn corners_around(&self, node: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let found = self.nodes.binary_search(&node);
        found.into_iter().flat_map(|place| self.corners_at(place).iter().copied())
    }

    /// As `corners_around`, for the node at a place in [`nodes`](Self::nodes).
    #[inline]
    pub(crate) fn corners_at(&self, place: usize) -> &[(usize, usize)] {
        &self.around[self.starts[place]..self.starts[place + 1]]
    }

    /// The facets around the k-th vertex of a facet, including this facet.
    pub(crate) fn facets_at(&self, facet: usize, k: usize) -> impl Iterator<Item = usize> + '_ {
        self.corners_at(self.places[facet][k]).iter().map(|&(facet, _)| facet)
    }

    pub(crate) fn facets_around(&self, node: usize) -> impl Iterator<Item = usize> + '_ {
        self.corners_around(node).map(|(facet, _)| facet)
    }
}

#[allow(clippy::into_iter_without_iter)] // `facets` gives them to look at
impl<'s> IntoIterator for &'s Surface {
    type Item = Facet;
    type IntoIter = std::iter::Copied<std::slice::Iter<'s, Facet>>;

    fn into_iter(self) -> Self::IntoIter {
        self.facets.iter().copied()
    }
}
