//! Which pairs of edges press on each other, and which may come to within a step.

use super::edges::Edge;
use super::lines::Crossing;
use crate::contact::surface::{Bounds, Point, Surface, norm, sub};

/// Sine of the smallest angle between two edges that have a row. Nodes on facets cannot keep edges apart that cross
/// between nodes at an angle φ, but let them in by half an edge times sin φ at most: here by 2.5 % of an edge. And
/// normals of edges that are parallel but for φ turn 1/sin φ times as fast as the edges.
pub(super) const LEAST_SINE: f64 = 0.05;

/// Shares of an edge, and sines, that are rounding.
const ROUNDING: f64 = 1e-9;

/// Depth, in shares of the shorter edge, up to which a pair is kept whatever the shape of the bodies behind.
const SHALLOW: f64 = 1e-3;

/// How steeply the gap opens where edges miss each other.
const STEEP: f64 = 4.0;

/// Depth in shares of the shorter edge, beside the way of a step, beyond which two lines are far sides of bodies, not edges that
/// have crossed.
const DEEPEST: f64 = 0.25;

/// What a step may change beside the way of its velocities, in shares of an edge; the sine by which normals may turn
/// within it at most.
const UNFORESEEN: f64 = 0.1;
const LARGEST_TURN: f64 = 0.5;

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

    /// By how much edges miss each other at their closest points, zero if they meet there: shares of the edges beyond
    /// their ends, and sines by which the normal, turned, is none of the first body, or as it is none of the second.
    fn miss(&self, crossing: &Crossing, at: &impl Fn(usize) -> Point) -> f64 {
        let ([first, second], [s, t]) = (self.edges, crossing.shares);
        let turned = first.miss(crossing.normal.map(|x| -x), s, self.surfaces[0], at);
        let miss = turned.max(second.miss(crossing.normal, t, self.surfaces[1], at));
        crossing.excess().into_iter().fold(miss, f64::max)
    }

    /// The gap of the edges: that of the lines where they meet. Where they miss each other it opens by so many times
    /// what they miss, so that it is continuous; lines that cross behind acute edges, outside of the bodies, are open.
    pub(super) fn gap(&self, crossing: &Crossing, at: &impl Fn(usize) -> Point) -> f64 {
        let shorter = self.shorter(at);
        let open = crossing.gap + STEEP * shorter * self.miss(crossing, at);
        let outside = open < -SHALLOW * shorter && !self.is_inside(crossing, at);
        if outside { -open } else { open }
    }

    /// Whether each edge is in the body of the other, if the gap is negative.
    fn is_inside(&self, crossing: &Crossing, at: &impl Fn(usize) -> Point) -> bool {
        let [first, second] = self.edges;
        let back = crossing.normal.map(|x| -x);
        second.is_behind(crossing.normal, crossing.shares[1], self.surfaces[1], at)
            && first.is_behind(back, crossing.shares[0], self.surfaces[0], at)
    }

    /// Whether edges that press on each other are where they may.
    pub(super) fn is_about(&self, crossing: &Crossing, at: &impl Fn(usize) -> Point) -> bool {
        const ABOUT: f64 = 0.25;
        self.miss(crossing, at) <= ABOUT
    }

    /// Where the edges meet, seen so that the gap is positive outside.
    pub(super) fn meeting(&self, at: &impl Fn(usize) -> Point) -> Option<Crossing> {
        let crossing = Crossing::of(self.ends(at)).filter(|crossing| crossing.sine >= LEAST_SINE)?;
        [crossing, crossing.turned()].into_iter().find(|crossing| self.miss(crossing, at) <= ROUNDING)
    }

    /// The lines through edges that meet within a distance of `reach` and the way, or that may come to meet
    /// within a step in which they move against each other by a way of about this length.
    pub(super) fn near(&self, reach: f64, way: f64, at: &impl Fn(usize) -> Point) -> Option<Crossing> {
        let ends = self.ends(at);
        let lengths = ends.map(|[from, to]| norm(sub(to, from)));
        let crossing = Crossing::of(ends).filter(|crossing| {
            let mut excess = crossing.excess().into_iter().zip(lengths);
            crossing.sine >= LEAST_SINE
                && crossing.gap.abs() <= reach + way
                && excess.all(|(excess, length)| excess * length <= UNFORESEEN * length + 2.0 * way)
        })?;
        let shorter = lengths[0].min(lengths[1]);
        let turn = (UNFORESEEN + 2.0 * way / shorter).min(LARGEST_TURN);
        let deepest = reach.min(DEEPEST * shorter) + way;
        let [first, second] = self.edges;
        let is_near = |crossing: &Crossing| {
            let (normal, back, [s, t]) = (crossing.normal, crossing.normal.map(|x| -x), crossing.shares);
            crossing.gap >= -deepest
                && first.miss(back, s, self.surfaces[0], at) <= turn
                && second.miss(normal, t, self.surfaces[1], at) <= turn
        };
        [crossing, crossing.turned()].into_iter().find(is_near)
    }
}

/// The vector by which the points at shares of two edges move against each other, by those of their ends.
pub(super) fn motion([e, f]: [[Point; 2]; 2], [s, t]: [f64; 2]) -> Point {
    sub(Edge::point(e, s), Edge::point(f, t))
}
