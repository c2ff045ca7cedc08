//! The edges of a surface: convex sides between facets that turn, and the normals of the body there.

use crate::contact::surface::{Bounds, Facet, Point, Shape, Surface, add_scaled, cross, dot, norm, sub, unit};
use crate::rounding::ROUNDED_SHARE;

/// A side that two facets share; an edge of the body where the surface turns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    /// Its two nodes, the smaller one first.
    pub(super) nodes: [usize; 2],
    /// Its length in the reference coordinates.
    pub(super) length: f64,
    /// The facet that has the nodes in this order, and the index of its side; then the facet that has them in reverse
    /// order.
    sides: [(usize, usize); 2],
}

/// The direction of an edge and the normals of its facets, at given positions of the nodes.
struct Wedge {
    along: Point,
    normals: [Point; 2],
}

impl Wedge {
    /// Sine of the angle by which a normal across the edge lies outside the range of normals between the two facets;
    /// 1 if it points the other way, or if the edge is not convex.
    fn miss(&self, normal: Point) -> f64 {
        let [left, right] = self.normals;
        if dot(self.along, cross(left, right)) <= 0.0 || dot(normal, left) + dot(normal, right) <= 0.0 {
            return 1.0;
        }
        let beyond = [cross(normal, left), cross(right, normal)].map(|turn| dot(self.along, turn));
        beyond[0].max(beyond[1]).max(0.0)
    }

    /// Whether the reversed normal points into the body.
    fn holds_behind(&self, normal: Point, margin: f64) -> bool {
        self.normals.iter().all(|side| dot(normal, *side) >= -margin)
    }
}

impl Edge {
    /// The sides of a surface that two facets share, in the order of their nodes.
    pub(super) fn of(surface: &Surface, coordinates: &[Point]) -> Vec<Self> {
        let mut edges = Vec::new();
        for (facet, nodes) in surface.facets().iter().map(Facet::nodes).enumerate() {
            for (side, &first) in nodes.iter().enumerate() {
                let second = nodes[(side + 1) % nodes.len()];
                let Some(across) = surface.neighbor(facet, side).filter(|_| first < second) else { continue };
                let length = norm(sub(coordinates[second], coordinates[first]));
                edges.push(Self { nodes: [first, second], length, sides: [(facet, side), across] });
            }
        }
        edges.sort_unstable_by_key(|edge| edge.nodes);
        edges
    }

    /// Whether the surface is convex there, and turns by more than the angle with these sine and cosine.
    pub(super) fn is_sharp(&self, surface: &Surface, sine_and_cosine: [f64; 2], positions: &[Point]) -> bool {
        let [(facet, side), _] = self.sides;
        surface.turns(facet, side, sine_and_cosine, positions)
    }

    pub(super) fn facets(&self) -> [usize; 2] {
        self.sides.map(|(facet, _)| facet)
    }

    /// Nodes of the two adjacent facets.
    pub(super) fn around<'a>(&self, surface: &'a Surface) -> impl Iterator<Item = usize> + use<'a> {
        self.sides.into_iter().flat_map(|(facet, _)| surface.facets()[facet].nodes().iter().copied())
    }

    /// Its ends, with the nodes at these positions.
    pub(super) fn ends(&self, at: &impl Fn(usize) -> Point) -> [Point; 2] {
        self.nodes.map(at)
    }

    /// Its box, with the nodes at these positions.
    pub(super) fn bounds(&self, positions: &[Point]) -> Bounds {
        Bounds::of_points(self.nodes.map(|node| positions[node]))
    }

    fn wedge(&self, share: f64, surface: &Surface, at: &impl Fn(usize) -> Point) -> Option<Wedge> {
        let normal = |(facet, side): (usize, usize), share: f64| {
            let facet = &surface.facets()[facet];
            let shape = Shape::new(facet.nodes.map(at), facet.count);
            shape.normal(&shape.on_side(side, share))
        };
        let share = share.clamp(0.0, 1.0);
        let [from, to] = self.ends(at);
        Some(Wedge {
            along: unit(sub(to, from))?,
            normals: [normal(self.sides[0], share)?, normal(self.sides[1], 1.0 - share)?],
        })
    }

    /// Sine of the angle by which a normal lies outside the normals of the body at a share of the edge.
    pub(super) fn miss(&self, normal: Point, share: f64, surface: &Surface, at: &impl Fn(usize) -> Point) -> f64 {
        self.wedge(share, surface, at).map_or(1.0, |wedge| wedge.miss(normal))
    }

    /// Whether the reversed normal points into the body at a share of the edge.
    pub(super) fn is_behind(&self, normal: Point, share: f64, surface: &Surface, at: &impl Fn(usize) -> Point) -> bool {
        self.wedge(share, surface, at).is_some_and(|wedge| wedge.holds_behind(normal, ROUNDED_SHARE))
    }

    /// The point at a share of the edge between these ends.
    pub(super) fn point([from, to]: [Point; 2], share: f64) -> Point {
        add_scaled(from, share, sub(to, from))
    }
}
