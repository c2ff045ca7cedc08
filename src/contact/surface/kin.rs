//! What nodes of a surface do not meet of their own surface: the facets around them.

use super::Surface;
use super::search::Neighborhood;

/// Cosine of the angle between the normals of a node and a facet beside it up to which they face each other (102°):
/// across a convex edge of a right angle they do not.
pub(crate) const FACING: f64 = -0.2;

/// By place of the node among those of the surface.
#[derive(Debug)]
pub(crate) struct Kin {
    /// The facets within some rings around each node.
    own: Neighborhood,
    /// The facets that are near each node in the reference configuration.
    beside: Neighborhood,
}

impl Kin {
    /// Finds the facets within `rings` of each node (none: those that have it); those `beside` it are given.
    pub(crate) fn new(surface: &Surface, rings: usize, beside: Neighborhood) -> Self {
        Self { own: around(surface, rings), beside }
    }

    /// Whether a node never meets a facet.
    pub(crate) fn keeps_apart(&self, place: usize, facet: usize) -> bool {
        self.own.holds(place, facet)
    }

    /// Whether a facet is beside a node in the reference configuration.
    pub(crate) fn is_beside(&self, place: usize, facet: usize) -> bool {
        self.beside.holds(place, facet)
    }
}

/// The facets within some rings around each node: those that have it first.
fn around(surface: &Surface, rings: usize) -> Neighborhood {
    let lists = surface.nodes().iter().map(|&node| {
        let mut own: Vec<usize> = surface.facets_around(node).collect();
        for _ in 0..rings {
            let nodes = own.iter().flat_map(|&facet| surface.facets()[facet].nodes());
            own = nodes.flat_map(|&node| surface.facets_around(node)).collect();
            own.sort_unstable();
            own.dedup();
        }
        own.sort_unstable();
        own
    });
    Neighborhood::of_lists(lists)
}
