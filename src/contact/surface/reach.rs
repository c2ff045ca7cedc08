//! How far a search of two surfaces looks, and how long what it has listed holds.

use super::nodes::Nodes;
use super::search::Bounds;
use super::shape::{Point, sub};
use crate::error::{Result, positive};
use crate::real::Real;

/// The least distance at which surfaces are found, and where they were when lists of what is near were built.
#[derive(Debug)]
pub(crate) struct Reach {
    least: f64,
    /// How far surfaces may move against each other before lists are built anew; if none, half of what is searched.
    skin: Option<f64>,
    /// Up to which distance the lists hold all, where they were built.
    listed: f64,
    /// Positions there, by node; none without lists.
    built_at: Vec<Point>,
}

impl Reach {
    pub(crate) fn new(least: f64) -> Self {
        Self { least, skin: None, listed: 0.0, built_at: Vec::new() }
    }

    /// The least distance at which surfaces are found.
    pub(crate) fn least(&self) -> f64 {
        self.least
    }

    pub(crate) fn set_least<T: Real>(&mut self, reach: T) -> Result<()> {
        self.least = positive("the reach of a contact search", reach.value())?;
        self.forget();
        Ok(())
    }

    pub(crate) fn set_skin<T: Real>(&mut self, skin: T) -> Result<()> {
        self.skin = Some(positive("the skin of a contact search", skin.value())?);
        self.forget();
        Ok(())
    }

    /// Lists are no longer valid.
    pub(crate) fn forget(&mut self) {
        self.built_at.clear();
    }

    /// Up to which distance lists hold all, where they were built.
    pub(crate) fn listed(&self) -> f64 {
        self.listed
    }

    /// The boxes of what the nodes of either body have moved since lists were built; empty without lists.
    pub(crate) fn motions(&self, nodes: &Nodes) -> [Bounds; 2] {
        nodes.bodies().each_ref().map(|body| {
            let moved = |&node: &usize| Some(sub(nodes.positions[node], *self.built_at.get(node)?));
            Bounds::of_points(body.iter().filter_map(moved))
        })
    }

    /// The range within which lists must be built anew to hold all within `range`; none if they do, after those
    /// motions. They are taken as built where the nodes are now.
    pub(crate) fn renew(&mut self, [one, other]: &[Bounds; 2], range: f64, positions: &[Point]) -> Option<f64> {
        if !self.built_at.is_empty() && range + one.spread(other) <= self.listed {
            return None;
        }
        self.listed = range + self.skin.unwrap_or(0.5 * range);
        self.built_at.clear();
        self.built_at.extend_from_slice(positions);
        Some(self.listed)
    }

    /// Up to which distance from a node lists hold all now, with the motion of the other body; below zero without
    /// lists.
    pub(crate) fn known_around(&self, node: usize, position: Point, other: &Bounds) -> f64 {
        self.listed - self.moved(node, position, other)
    }

    /// How far a node has moved since lists were built against the other body, of which this is the box of motions, in
    /// any coordinate; infinite without lists.
    pub(crate) fn moved(&self, node: usize, position: Point, other: &Bounds) -> f64 {
        let before = self.built_at.get(node);
        before.map_or(f64::INFINITY, |&before| Bounds::of_points([sub(position, before)]).spread(other))
    }
}
