//! Which pairs of edges may press on each other: found where they are, and where their velocities bring them together.

use super::edges::Edge;
use super::lines::{Crossing, Ways};
use crate::contact::surface::{Bounds, Point, Surface, add_scaled, dot, norm, sub};

/// Sine of the smallest angle between two edges that have a row. Nodes on facets cannot keep edges apart that cross
/// between nodes at an angle φ, but let them in by half an edge times sin φ at most: here by 2.5 % of an edge. And
/// normals of edges that are parallel but for φ turn 1/sin φ times as fast as the edges.
pub(super) const LEAST_SINE: f64 = 0.05;

/// Shares of an edge, and sines, that are rounding.
const ROUNDING: f64 = 1e-9;

/// Depth, in shares of the shorter edge, up to which a pair is kept whatever the shape of the bodies behind.
const SHALLOW: f64 = 1e-3;

/// How far, in shares of an edge, the line through it stands for an edge that the closest point leaves within a step;
/// and by which sine the normal may leave the bodies' own.
const BEYOND: f64 = 0.25;

/// How far outside of an edge the closest point may be where a search begins to look where velocities lead.
const AHEAD: f64 = 1.0;

/// Edges of two surfaces.
#[derive(Clone, Copy)]
pub(super) struct Pair<'a> {
    pub(super) edges: [&'a Edge; 2],
    pub(super) surfaces: [&'a Surface; 2],
}

impl Pair<'_> {
    /// The four nodes: those of the first edge come first.
    pub(super) fn nodes(&self) -> [usize; 4] {
        let [[a, b], [c, d]] = self.edges.map(|edge| edge.nodes);
        [a, b, c, d]
    }

    pub(super) fn ends(&self, at: &impl Fn(usize) -> Point) -> [[Point; 2]; 2] {
        self.edges.map(|edge| edge.ends(at))
    }

    /// A bound of the motion of the edges against each other, by a vector a node.
    pub(super) fn way(&self, vector: &impl Fn(usize) -> Point) -> f64 {
        let [one, other] = self.edges.map(|edge| Bounds::of_points(edge.ends(vector)));
        one.farthest(&other)
    }

    fn shorter(&self, at: &impl Fn(usize) -> Point) -> f64 {
        let [one, other] = self.ends(at).map(|[from, to]| norm(sub(to, from)));
        one.min(other)
    }

    /// Whether the normal, turned, is one of the first body, and as it is one of the second.
    fn has_normal(&self, crossing: &Crossing, margin: f64, at: &impl Fn(usize) -> Point) -> bool {
        let [first, second] = self.edges;
        let back = crossing.normal.map(|x| -x);
        second.has_normal(crossing.normal, (crossing.shares[1], margin), self.surfaces[1], at)
            && first.has_normal(back, (crossing.shares[0], margin), self.surfaces[0], at)
    }

    /// Whether each edge is in the body of the other, if the gap is negative.
    fn is_inside(&self, crossing: &Crossing, at: &impl Fn(usize) -> Point) -> bool {
        let [first, second] = self.edges;
        let back = crossing.normal.map(|x| -x);
        second.is_behind(crossing.normal, crossing.shares[1], self.surfaces[1], at)
            && first.is_behind(back, crossing.shares[0], self.surfaces[0], at)
    }

    /// The closest points, if they are on both edges and the normal between them is one of both bodies: seen so that the
    /// gap is positive outside.
    pub(super) fn meet(&self, at: &impl Fn(usize) -> Point) -> Option<Crossing> {
        let crossing = Crossing::of(self.ends(at)).filter(|crossing| {
            crossing.sine >= LEAST_SINE && crossing.excess().iter().all(|&excess| excess <= ROUNDING)
        })?;
        [crossing, crossing.turned()].into_iter().find(|crossing| self.has_normal(crossing, ROUNDING, at))
    }

    /// The same within a distance and a depth of `range`.
    pub(super) fn meet_within(&self, range: f64, at: &impl Fn(usize) -> Point) -> Option<Crossing> {
        let crossing = self.meet(at).filter(|crossing| crossing.gap.abs() <= range)?;
        let deep = crossing.gap < -SHALLOW * self.shorter(at);
        (!deep || self.is_inside(&crossing, at)).then_some(crossing)
    }

    /// The lines as they are now, if velocities bring the edges on each other within the time `ahead`.
    pub(super) fn meet_ahead(
        &self,
        ahead: f64,
        at: &impl Fn(usize) -> Point,
        velocity: &impl Fn(usize) -> Point,
    ) -> Option<Crossing> {
        let by = self.ends(velocity).map(|ends| ends.map(|v| v.map(|v| ahead * v)));
        let ways = Ways::new(self.ends(at), by);
        let entry = ways.meetings().find_map(|share| {
            let then = |node: usize| add_scaled(at(node), share * ahead, velocity(node));
            let crossing = self.meet(&then)?;
            (dot(crossing.normal, motion(by, crossing.shares)) < 0.0).then_some(crossing)
        })?;
        let now = Crossing::of(ways.at(0.0)).filter(|now| now.sine >= LEAST_SINE)?;
        let now = now.as_seen_along(entry.normal);
        (now.gap >= 0.0 && now.excess().iter().all(|&excess| excess <= AHEAD)).then_some(now)
    }

    /// Whether edges that a search has found, held or ahead, can press on each other there.
    pub(super) fn stays(&self, crossing: &Crossing, held: bool, at: &impl Fn(usize) -> Point) -> bool {
        let beyond = if held { BEYOND } else { ROUNDING };
        crossing.excess().iter().all(|&excess| excess <= beyond) && self.has_normal(crossing, BEYOND, at)
    }
}

/// The vector by which the points at shares of two edges move against each other, by those of their ends.
pub(super) fn motion([e, f]: [[Point; 2]; 2], [s, t]: [f64; 2]) -> Point {
    sub(Edge::point(e, s), Edge::point(f, t))
}
