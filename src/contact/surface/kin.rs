//! Facets of the same surface that a node cannot be in contact with: the facets around it.

use super::Surface;
use super::search::Neighborhood;

/// Largest cosine between the normals of a node and of a facet beside it at which they face each other (an angle of
/// 102°). Across a convex right angle they do not face each other.
pub(crate) const FACING: f64 = -0.2;

/// Lists by place of the node in the surface.
#[derive(Debug)]
pub(crate) struct Kin {
    /// The facets within some rings around each node.
    own: Neighborhood,
    /// The facets near each node in the reference configuration.
    beside: Neighborhood,
}

impl Kin {
    /// Finds the facets within `rings` of each node (zero: the facets that have the node); those `beside` it are
    /// given.
    pub(crate) fn new(surface: &Surface, rings: usize, beside: Neighborhood) -> Self {
        Self { own: around(surface, rings), beside }
    }

    pub(crate) fn keeps_apart(&self, place: usize, facet: usize) -> bool {
        self.own.holds(place, facet)
    }

    /// Whether a facet is beside a node in the reference configuration.
    pub(crate) fn is_beside(&self, place: usize, facet: usize) -> bool {
        self.beside.holds(place, facet)
    }
}

/// The facets within `rings` rings around each node; ring zero are the facets that have the node.
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
