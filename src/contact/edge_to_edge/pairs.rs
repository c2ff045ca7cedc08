//! Two edges and the bodies behind them: whether they meet, whether they may come to within a step, and their gap.

use super::edges::Edge;
use super::lines::{Crossing, Ways};
use crate::contact::surface::{Bounds, Point, Surface, add_scaled, sub};

/// Sine of the smallest angle between two edges that have a row. Nodes on facets cannot keep edges apart that cross
/// between nodes at an angle φ, but let them in by half an edge times sin φ at most: here by 2.5 % of an edge. And
/// normals of edges that are parallel but for φ turn 1/sin φ times as fast as the edges.
pub(super) const LEAST_SINE: f64 = 0.05;

/// Shares of an edge, and sines, that are rounding.
const ROUNDING: f64 = 1e-9;

/// Depth, in shares of the shorter edge, up to which a pair is kept whatever the shape of the bodies behind, and by
/// which edges that are in each other come out in a step: all at once would throw them.
const SHALLOW: f64 = 1e-3;

/// Shares of an edge, of the gap and beyond the ends, within which edges touch: beside a dent, where the normal may be
/// none of the facets there, they are in contact all the same.
const TOUCH: f64 = 0.02;

/// How steeply the gap opens beyond the end of an edge, and the share of the edge in which it comes to.
const STEEP: f64 = 2.0;
const WIDTH: f64 = 0.1;

/// Depth in shares of the shorter edge, beside the way of a step, beyond which two lines are far sides of bodies, not
/// edges that have crossed.
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

    fn shorter(&self) -> f64 {
        self.edges[0].length.min(self.edges[1].length)
    }

    /// Sine of the angle by which the normal, turned, is none of the first body, or as it is none of the second.
    fn misses_normal(&self, crossing: &Crossing, at: &impl Fn(usize) -> Point) -> f64 {
        let ([first, second], [s, t]) = (self.edges, crossing.shares);
        let turned = first.miss(crossing.normal.map(|x| -x), s, self.surfaces[0], at);
        turned.max(second.miss(crossing.normal, t, self.surfaces[1], at))
    }

    /// By how much edges miss each other at their closest points, zero if they meet there: shares of the edges beyond
    /// their ends, and that sine.
    fn miss(&self, crossing: &Crossing, at: &impl Fn(usize) -> Point) -> f64 {
        crossing.excess().into_iter().fold(self.misses_normal(crossing, at), f64::max)
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
        self.miss(crossing, at) <= LARGEST_TURN + UNFORESEEN
    }

    /// Where the edges meet, seen so that the gap is positive outside.
    pub(super) fn meeting(&self, at: &impl Fn(usize) -> Point) -> Option<Crossing> {
        let crossing = Crossing::of(self.ends(at)).filter(|crossing| crossing.sine >= LEAST_SINE)?;
        [crossing, crossing.turned()].into_iter().find(|crossing| self.miss(crossing, at) <= ROUNDING)
    }

    /// The lines through edges that meet within a distance of `reach` and the way, or that may come to meet within a
    /// step in which they move against each other by a way of about this length.
    pub(super) fn near(&self, reach: f64, way: f64, at: &impl Fn(usize) -> Point) -> Option<Crossing> {
        let crossing = Crossing::of(self.ends(at)).filter(|crossing| {
            let mut excess = crossing.excess().into_iter().zip(self.edges);
            // Where lines meet at an angle φ their closest points move 1/sin φ times as fast as they do.
            crossing.sine >= LEAST_SINE
                && crossing.gap.abs() <= reach + way
                && excess.all(|(x, edge)| x * edge.length <= UNFORESEEN * edge.length + 2.0 * way / crossing.sine)
        })?;
        let shorter = self.shorter();
        let touches = crossing.gap.abs() <= TOUCH * shorter && crossing.excess().into_iter().all(|x| x <= TOUCH);
        let turn = if touches { LARGEST_TURN } else { (UNFORESEEN + 2.0 * way / shorter).min(LARGEST_TURN) };
        let deepest = reach.min(DEEPEST * shorter) + way;
        let is_near = |crossing: &Crossing| {
            let misses = self.misses_normal(crossing, at);
            // What is in already must be in the bodies, and meet; what comes must come from outside.
            let inside = || misses <= ROUNDING && crossing.gap >= -deepest && self.is_inside(crossing, at);
            misses <= turn && (touches || crossing.gap >= -SHALLOW * shorter || inside())
        };
        [crossing, crossing.turned()].into_iter().find(is_near)
    }

    /// The depth that edges found inside keep for a step: all but what comes out in one.
    pub(super) fn kept_inside(&self, gap: f64) -> f64 {
        (-gap - SHALLOW * self.shorter()).max(0.0)
    }

    /// The edge beyond whose end the closest points lie, if any, and the opening of the gap for it with its derivatives
    /// by the share of that edge: a x²/(x + w) in lengths of the edge, x being what they are beyond.
    fn opening(&self, crossing: &Crossing) -> Option<(usize, [f64; 3])> {
        let excess = crossing.excess();
        let [one, other] = [0, 1].map(|edge| excess[edge] * self.edges[edge].length);
        let edge = usize::from(one < other);
        let (x, w) = (excess[edge], WIDTH);
        let size = STEEP * self.edges[edge].length;
        let outward = if crossing.shares[edge] < 0.0 { -size } else { size };
        let value = [size * x * x / (x + w), outward * x * (x + 2.0 * w), size * 2.0 * w * w];
        (x > 0.0).then(|| (edge, [value[0], value[1] / (x + w).powi(2), value[2] / (x + w).powi(3)]))
    }

    /// The gap of the edges, and its derivatives by the positions of the four ends: those of the lines where closest
    /// points are on the edges. Beyond an end the gap opens, slowly at first, so that both are continuous.
    pub(super) fn row(&self, crossing: &Crossing, at: &impl Fn(usize) -> Point) -> (f64, [Point; 4]) {
        let row = crossing.weights().map(|weight| crossing.normal.map(|x| weight * x));
        let Some((edge, [opening, slope, _])) = self.opening(crossing) else { return (crossing.gap, row) };
        let gradient = crossing.share_gradient(edge, self.ends(at));
        (crossing.gap + opening, [0, 1, 2, 3].map(|k| add_scaled(row[k], slope, gradient[k])))
    }

    /// d²g/dτ² of that gap along straight ways at some velocities. (Shares beyond an end from differences.)
    pub(super) fn acceleration(
        &self,
        crossing: &Crossing,
        at: &impl Fn(usize) -> Point,
        velocity: &impl Fn(usize) -> Point,
    ) -> f64 {
        const STEP: f64 = 1e-3;
        let (ends, speeds) = (self.ends(at), self.ends(velocity));
        let lines = crossing.acceleration(ends, speeds);
        let way = self.way(velocity);
        let Some((edge, [_, slope, bend])) = self.opening(crossing).filter(|_| way > 0.0) else { return lines };
        let time = STEP * self.shorter() / way;
        let ways = Ways::new(ends, speeds);
        let share = |time: f64| Crossing::of(ways.at(time)).map_or(crossing.shares[edge], |then| then.shares[edge]);
        let [before, now, after] = [-time, 0.0, time].map(share);
        let (first, second) = ((after - before) / (2.0 * time), (after - 2.0 * now + before) / (time * time));
        lines + slope * second + bend * first * first
    }
}

/// The vector by which the points at shares of two edges move against each other, by those of their ends.
pub(super) fn motion([e, f]: [[Point; 2]; 2], [s, t]: [f64; 2]) -> Point {
    sub(Edge::point(e, s), Edge::point(f, t))
}
