//! Lists of the facets near each node, nearest first, so that the search for the closest facet ends early.

use super::reach::Reach;
use super::search::{Bounds, Lists, each_near, overhang_of};
use super::shape::Point;

/// For each node of a list the facets near it, and the distances of their boxes when the lists were built, ascending.
#[derive(Debug, Default)]
pub(crate) struct NearestFirst {
    lists: Lists<(f64, usize)>,
    /// The longest side of the boxes when the lists were built.
    extent: f64,
}

impl NearestFirst {
    /// Rebuilds the lists of the facets whose boxes are within `range` of each node.
    pub(crate) fn build(&mut self, nodes: &[usize], positions: &[Point], boxes: &[Bounds], range: f64) {
        self.lists.clear();
        self.extent = boxes.iter().map(Bounds::extent).fold(0.0, f64::max);
        let points = nodes.iter().map(|&node| positions[node]);
        let mut places = points.clone();
        each_near(points.map(|x| Bounds::of_points([x])), boxes.iter().copied(), range, |near| {
            let x = places.next().unwrap_or_default();
            let list = self.lists.push(near.iter().map(|&facet| (boxes[facet].distance(x), facet)));
            list.sort_unstable_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        });
    }

    /// The list of the k-th node: distances of boxes when the lists were built, and facets.
    pub(crate) fn of(&self, k: usize) -> &[(f64, usize)] {
        self.lists.of(k)
    }
}

/// Data that bound how far facets have approached since the lists were built.
#[derive(Clone, Copy)]
pub(crate) struct Kept<'a> {
    pub(crate) reach: &'a Reach,
    /// The box of the motions of the facets' nodes since the lists were built.
    pub(crate) motion: Bounds,
    /// A bound of the sum of offsets of a node and a facet.
    pub(crate) thick: f64,
}

impl Kept<'_> {
    /// A bound of how much nearer to a node the surface of a facet may be than the listed distance of its box: by
    /// motions, by offsets, and by the extension of facets beyond the rim.
    pub(super) fn slack(&self, lists: &NearestFirst, node: usize, position: Point) -> f64 {
        let stretched = lists.extent + self.motion.extent();
        self.reach.moved(node, position, &self.motion) + self.thick + overhang_of(stretched)
    }
}
