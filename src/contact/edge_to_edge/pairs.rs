//! Pairs of edges and the bodies behind them: whether they meet, or may meet within a step, and their gap.

use super::edges::Edge;
use super::lines::{Crossing, Ways};
use crate::contact::surface::{Bounds, Offsets, Point, RECOVERY, Surface, add_scaled, dot, sub};
use crate::rounding::{NEAR_SHARE, ROUNDED_SHARE, half_digits};

/// Sine of the smallest angle between two edges with a row. If edges cross between nodes at an angle φ, nodes on
/// facets let them penetrate by at most half an edge times sin φ: here by 2.5 % of an edge. The normal of two edges
/// at an angle φ turns 1/sin φ times as fast as the edges.
pub(super) const LEAST_SINE: f64 = 0.05;

/// Gap and distance beyond the ends, as shares of an edge, within which edges touch. Beside a dent they are in
/// contact then even if the normal lies outside the normals of the facets.
const TOUCH: f64 = 0.02;

/// The slope of the gap beyond the end of an edge, and the share of the edge over which it grows to that slope.
const STEEP: f64 = 2.0;
const WIDTH: f64 = 0.1;

/// Depth, as a share of the shorter edge and beyond the motion of a step, beyond which two lines are far sides of the
/// bodies and not edges that have crossed.
const DEEPEST: f64 = 0.25;

/// Motion within a step in addition to the velocities, as a share of an edge; and the largest sine by which normals
/// turn within a step.
const UNFORESEEN: f64 = 0.1;
const LARGEST_TURN: f64 = 0.5;

#[derive(Clone, Copy)]
pub(super) struct Pair<'a> {
    pub(super) edges: [&'a Edge; 2],
    pub(super) surfaces: [&'a Surface; 2],
    /// The radii of the edges.
    pub(super) offsets: Offsets<'a>,
    /// The largest penetration of the edges in contact.
    pub(super) depth: f64,
}

impl Pair<'_> {
    /// The four nodes, starting with the first edge.
    pub(super) fn nodes(&self) -> [usize; 4] {
        let [[a, b], [c, d]] = self.edges.map(|edge| edge.nodes);
        [a, b, c, d]
    }

    pub(super) fn ends(&self, at: &impl Fn(usize) -> Point) -> [[Point; 2]; 2] {
        self.edges.map(|edge| edge.ends(at))
    }

    /// A bound of the relative motion of the edges, by a vector per node.
    pub(super) fn way(&self, vector: &impl Fn(usize) -> Point) -> f64 {
        let [one, other] = self.edges.map(|edge| Bounds::of_points(edge.ends(vector)));
        one.farthest(&other)
    }

    /// The radii of the edges at their ends, without their factor.
    fn radii(&self) -> [[f64; 2]; 2] {
        self.edges.map(|edge| edge.nodes.map(|node| self.offsets.of(node)))
    }

    /// The sum of the radii of both edges at their closest points, without its factor.
    pub(super) fn radius(&self, crossing: &Crossing) -> f64 {
        let between = |([from, to], share): ([f64; 2], f64)| from + share * (to - from);
        self.radii().into_iter().zip(crossing.shares).map(between).sum()
    }

    pub(super) fn clear(&self, crossing: &Crossing) -> f64 {
        crossing.gap - self.offsets.factor * self.radius(crossing)
    }

    fn shorter(&self) -> f64 {
        self.edges[0].length.min(self.edges[1].length)
    }

    /// Sine of the angle by which the normal lies outside the normals of the second body, or the reversed normal
    /// outside the normals of the first; the larger one.
    fn misses_normal(&self, crossing: &Crossing, at: &impl Fn(usize) -> Point) -> f64 {
        let ([first, second], [s, t]) = (self.edges, crossing.shares);
        let turned = first.miss(crossing.normal.map(|x| -x), s, self.surfaces[0], at);
        turned.max(second.miss(crossing.normal, t, self.surfaces[1], at))
    }

    /// By how much edges miss each other at their closest points: that sine, or the share of an edge beyond its ends.
    /// Zero if they meet.
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

    /// Whether two closed edges still meet, within a tolerance.
    pub(super) fn is_about(&self, crossing: &Crossing, at: &impl Fn(usize) -> Point) -> bool {
        self.miss(crossing, at) <= LARGEST_TURN + UNFORESEEN
    }

    /// The closest points of edges that meet, oriented so that the gap is positive outside.
    pub(super) fn meeting(&self, at: &impl Fn(usize) -> Point) -> Option<Crossing> {
        let crossing = Crossing::of(self.ends(at)).filter(|crossing| crossing.sine >= LEAST_SINE)?;
        [crossing, crossing.turned()].into_iter().find(|crossing| self.miss(crossing, at) <= ROUNDED_SHARE)
    }

    /// The closest points of edges that meet within a distance of `reach` plus `way`, or that may meet within a step
    /// with a relative motion of about the length `way`.
    pub(super) fn near(&self, reach: f64, way: f64, at: &impl Fn(usize) -> Point) -> Option<Crossing> {
        let crossing = Crossing::of(self.ends(at)).filter(|crossing| {
            let rounded = (self.offsets.factor * self.radius(crossing)).abs();
            let mut excess = crossing.excess().into_iter().zip(self.edges);
            // If lines meet at an angle φ, their closest points move 1/sin φ times as fast as the lines.
            crossing.sine >= LEAST_SINE
                && crossing.gap.abs() <= reach + rounded + way
                && excess.all(|(x, edge)| x * edge.length <= UNFORESEEN * edge.length + 2.0 * way / crossing.sine)
        })?;
        let shorter = self.shorter();
        let turn = (UNFORESEEN + 2.0 * way / shorter).min(LARGEST_TURN);
        let deepest = reach.min(DEEPEST * shorter) + way;
        let is_near = |crossing: &Crossing| {
            let (misses, gap) = (self.misses_normal(crossing, at), self.clear(crossing));
            let touches = gap.abs() <= TOUCH * shorter && crossing.excess().into_iter().all(|x| x <= TOUCH);
            // Edges that already penetrate must lie in the bodies, and meet; others must approach from outside.
            // Beyond an end the lines of closed edges penetrate by at most the opening of the gap.
            let on_edges = crossing.excess().into_iter().all(|x| x <= ROUNDED_SHARE);
            let meets = || on_edges || gap + self.by_shares(crossing).0 >= -NEAR_SHARE * shorter;
            let inside = || misses <= ROUNDED_SHARE && gap >= -deepest && meets() && self.is_inside(crossing, at);
            let is_met = misses <= if touches { LARGEST_TURN } else { turn };
            is_met && crossing.gap >= -self.depth && (touches || gap >= -NEAR_SHARE * shorter || inside())
        };
        [crossing, crossing.turned()].into_iter().find(is_near)
    }

    /// Largest penetration that is recovered in a step.
    pub(super) fn recovery(&self) -> f64 {
        RECOVERY * self.shorter()
    }

    /// The edge beyond whose end the closest points lie, if any, and the opening of the gap with its derivative by
    /// the share of that edge: a x²/(x + w) in lengths of the edge, at the share x beyond the end.
    fn opening(&self, crossing: &Crossing) -> Option<(usize, [f64; 2])> {
        let excess = crossing.excess();
        let [one, other] = [0, 1].map(|edge| excess[edge] * self.edges[edge].length);
        let edge = usize::from(one < other);
        let (x, w) = (excess[edge], WIDTH);
        let size = STEEP * self.edges[edge].length;
        let outward = if crossing.shares[edge] < 0.0 { -size } else { size };
        (x > 0.0).then(|| (edge, [size * x * x / (x + w), outward * x * (x + 2.0 * w) / (x + w).powi(2)]))
    }

    /// The gap of the edges, and its derivatives with respect to the positions of the four ends. If the closest
    /// points are on the edges, both equal the values of the lines. Beyond an end the gap opens, slowly at first, so
    /// that both are continuous.
    pub(super) fn row(&self, crossing: &Crossing, at: &impl Fn(usize) -> Point) -> (f64, [Point; 4]) {
        let mut row = crossing.weights().map(|weight| crossing.normal.map(|x| weight * x));
        let (opening, slopes) = self.by_shares(crossing);
        for (edge, slope) in slopes.into_iter().enumerate().filter(|&(_, slope)| slope != 0.0) {
            let gradient = crossing.share_gradient(edge, self.ends(at));
            row = [0, 1, 2, 3].map(|k| add_scaled(row[k], slope, gradient[k]));
        }
        (self.clear(crossing) + opening, row)
    }

    /// The opening of the gap beyond an end, and the derivatives of the gap with respect to the shares along both
    /// edges, from the opening and from the radii.
    fn by_shares(&self, crossing: &Crossing) -> (f64, [f64; 2]) {
        let mut slopes = self.radii().map(|[from, to]| -self.offsets.factor * (to - from));
        let Some((edge, [opening, slope])) = self.opening(crossing) else { return (0.0, slopes) };
        slopes[edge] += slope;
        (opening, slopes)
    }

    /// The rate of the sum of the radii, at full size, for straight motions at these velocities.
    pub(super) fn sliding(
        &self,
        crossing: &Crossing,
        at: &impl Fn(usize) -> Point,
        velocity: &impl Fn(usize) -> Point,
    ) -> f64 {
        let of_edge = |edge: usize, [from, to]: [f64; 2]| {
            let gradient = crossing.share_gradient(edge, self.ends(at));
            let speeds = self.nodes().map(velocity);
            (to - from) * gradient.into_iter().zip(speeds).map(|(weight, speed)| dot(weight, speed)).sum::<f64>()
        };
        self.radii().into_iter().enumerate().map(|(edge, radii)| of_edge(edge, radii)).sum()
    }

    /// d²g/dτ² of that gap for straight motions at these velocities, by second differences.
    pub(super) fn acceleration(
        &self,
        crossing: &Crossing,
        at: &impl Fn(usize) -> Point,
        velocity: &impl Fn(usize) -> Point,
    ) -> f64 {
        let way = self.way(velocity);
        if way <= 0.0 {
            return 0.0;
        }
        // A motion by ε^¼ of an edge: rounding and the fourth derivative contribute alike.
        let time = half_digits::<f64>().sqrt() * self.shorter() / way;
        let ways = Ways::new(self.ends(at), self.ends(velocity));
        let gap = |time: f64| {
            let then = Crossing::of(ways.at(time)).unwrap_or(*crossing).as_seen_along(crossing.normal);
            self.clear(&then) + self.opening(&then).map_or(0.0, |(_, [opening, _])| opening)
        };
        (gap(time) - 2.0 * gap(0.0) + gap(-time)) / (time * time)
    }
}

/// The relative motion of the points at shares of two edges, from the motions of their ends.
pub(super) fn motion([e, f]: [[Point; 2]; 2], [s, t]: [f64; 2]) -> Point {
    sub(Edge::point(e, s), Edge::point(f, t))
}
