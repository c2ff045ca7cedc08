//! The range of a search between two surfaces, and how long its lists are valid.

use super::nodes::Nodes;
use super::search::Bounds;
use super::shape::{Point, sub};

/// The least distance at which surfaces are found, and the nodal positions when the lists of near facets were built.
#[derive(Debug)]
pub(crate) struct Reach {
    least: f64,
    /// Relative motion of the surfaces after which lists are rebuilt; if none, half of the search range.
    skin: Option<f64>,
    /// Distance up to which the lists were complete when they were built.
    listed: f64,
    /// Nodal positions when the lists were built; empty without lists.
    built_at: Vec<Point>,
}

impl Reach {
    pub(crate) fn new(least: f64, skin: Option<f64>) -> Self {
        Self { least, skin, listed: 0.0, built_at: Vec::new() }
    }

    pub(crate) fn least(&self) -> f64 {
        self.least
    }

    pub(crate) fn forget(&mut self) {
        self.built_at.clear();
    }

    /// Distance up to which the lists were complete when they were built.
    pub(crate) fn listed(&self) -> f64 {
        self.listed
    }

    /// The boxes of the motions of the nodes of either body since the lists were built; empty without lists.
    pub(crate) fn motions(&self, nodes: &Nodes) -> [Bounds; 2] {
        nodes.bodies().each_ref().map(|body| {
            let moved = |&node: &usize| Some(sub(nodes.positions[node], *self.built_at.get(node)?));
            Bounds::of_points(body.iter().filter_map(moved))
        })
    }

    /// If the lists are not complete within `range` after these motions, the range for new ones, which the caller
    /// builds at the current positions; otherwise none.
    pub(crate) fn renew(&mut self, [one, other]: &[Bounds; 2], range: f64, positions: &[Point]) -> Option<f64> {
        if !self.built_at.is_empty() && range + one.spread(other) <= self.listed {
            return None;
        }
        self.listed = range + self.skin.unwrap_or(0.5 * range);
        self.built_at.clear();
        self.built_at.extend_from_slice(positions);
        Some(self.listed)
    }

    /// Distance from a node up to which the lists are complete now, given the motion of the other body; negative
    /// without lists.
    pub(crate) fn known_around(&self, node: usize, position: Point, other: &Bounds) -> f64 {
        self.listed - self.moved(node, position, other)
    }

    /// The largest component of a node's motion relative to the other body since the lists were built; `other` is the
    /// box of that body's motions. Infinite without lists.
    pub(crate) fn moved(&self, node: usize, position: Point, other: &Bounds) -> f64 {
        let before = self.built_at.get(node);
        before.map_or(f64::INFINITY, |&before| Bounds::of_points([sub(position, before)]).spread(other))
    }
}
