//! Facets of the same surface that a node cannot be in contact with: the facets around it.

use super::Surface;
use super::search::Neighborhood;

/// For a surface against itself, lists of facets by place of the node in the surface.
#[derive(Debug)]
pub(crate) struct OwnFacets {
    /// The facets within some rings around each node, which are not in contact with it.
    pub(crate) adjacent: Neighborhood,
    /// The facets near each node in the reference configuration.
    pub(super) nearby: Neighborhood,
}

/// The facets within `rings` rings around each node; ring zero are the facets that have the node.
pub(super) fn around(surface: &Surface, rings: usize) -> Neighborhood {
    let mut lists = Neighborhood::default();
    for &node in surface.nodes() {
        let mut own: Vec<usize> = surface.facets_around(node).collect();
        for _ in 0..rings {
            let nodes = own.iter().flat_map(|&facet| surface.facets()[facet].nodes());
            own = nodes.flat_map(|&node| surface.facets_around(node)).collect();
            own.sort_unstable();
            own.dedup();
        }
        lists.push(own).sort_unstable();
    }
    lists
}
