//! What nodes of a surface do not meet of their own surface: the facets around them, and the far side of the material.
//! Parts of the surface that share no node are other bodies.

use super::Surface;
use super::search::{Bounds, Neighborhood};
use super::shape::{Point, dot};

/// Cosine of the angle between the normals of a node and a facet beside it up to which they face each other (102°):
/// across a convex edge of a right angle they do not.
pub(crate) const FACING: f64 = -0.2;

/// The same up to which a facet that a node is behind of in the reference configuration tells how much material is
/// there: sides across a right angle among them, which face the node once the body bends.
const INSIDE: f64 = 0.5;

/// Share of the thickness of the material behind a node that its own body may be inside of it.
const DEPTH: f64 = 0.5;

/// How far from a node, in shares of the reach or of a facet, whichever is longer, the facets are that are beside it.
const BESIDE: f64 = 2.0;

/// By place of the node among those of the surface.
#[derive(Debug)]
pub(crate) struct Kin {
    /// The facets within some rings around each node.
    own: Neighborhood,
    /// The facets that are near each node in the reference configuration.
    beside: Neighborhood,
    /// The part of the surface that each facet and each node belongs to.
    parts: Vec<usize>,
    parts_of_nodes: Vec<usize>,
    /// How deep a facet that is met may be behind each node.
    depths: Vec<f64>,
}

impl Kin {
    /// Finds the facets within `rings` of each node (none: those that have it), and how thick the material is behind
    /// it, as far as `reach`. Surfaces with offsets below zero may lie in each other by an `overlap`, and just touch.
    pub(crate) fn new(surface: &Surface, rings: usize, positions: &[Point], (reach, overlap): (f64, f64)) -> Self {
        let parts = parts(surface);
        let part_of = |&node: &usize| surface.facets_around(node).next().map_or(usize::MAX, |facet| parts[facet]);
        let parts_of_nodes = surface.nodes().iter().map(part_of).collect();
        let mut beside = Neighborhood::default();
        let points = surface.nodes().iter().map(|&node| Bounds::of_points([positions[node]]));
        beside.build(points, surface.boxes(positions), BESIDE * reach.max(surface.typical()));
        let own = around(surface, rings);
        let mut kin = Self { own, beside, parts, parts_of_nodes, depths: Vec::new() };
        kin.depths = kin.depths(surface, positions, (reach, overlap));
        kin
    }

    /// Whether a node never meets a facet.
    pub(crate) fn keeps_apart(&self, place: usize, facet: usize) -> bool {
        self.own.holds(place, facet)
    }

    /// Whether a facet is one of the own body that is beside a node.
    pub(crate) fn is_beside(&self, place: usize, facet: usize) -> bool {
        self.is_of_part(place, facet) && self.beside.holds(place, facet)
    }

    fn is_of_part(&self, place: usize, facet: usize) -> bool {
        self.parts_of_nodes[place] == self.parts[facet]
    }

    /// How deep behind a node a facet may be: one of another body at any depth.
    pub(crate) fn depth(&self, place: usize, facet: usize) -> f64 {
        if self.is_of_part(place, facet) { self.depths[place] } else { f64::INFINITY }
    }

    /// Behind a node, as far as a facet that it is behind of, there is material, as nothing is inside of itself in the
    /// reference configuration: a share of the least distance.
    fn depths(&self, surface: &Surface, positions: &[Point], (reach, overlap): (f64, f64)) -> Vec<f64> {
        /// Shares of an overlap that are rounding.
        const ROUNDING: f64 = 1e-6;
        let depth = |(place, &node): (usize, &usize)| {
            let Some(own) = surface.node_normal(node, positions) else { return reach };
            let is_met = |facet: usize| self.is_of_part(place, facet) && !self.keeps_apart(place, facet);
            let behind = self.beside.of(place).iter().filter(|&&facet| is_met(facet)).filter_map(|&facet| {
                let projected = surface.project(facet, positions[node], positions)?;
                let (shape, foot) = &projected;
                let normal = shape.normal(&foot.weights)?;
                // (Beside a side or a vertex a node may be behind the plane of a facet, and outside.)
                let counts = (ROUNDING, &|_| true);
                let (_, height) = surface.direction(facet, positions[node], &projected, counts, positions)?;
                let is_behind = height < 0.0 && foot.distance > (1.0 + ROUNDING) * overlap;
                (is_behind && dot(own, normal) <= INSIDE).then_some(foot.distance)
            });
            DEPTH * behind.fold(reach / DEPTH, f64::min)
        };
        surface.nodes().iter().enumerate().map(depth).collect()
    }
}

/// The parts of a surface that share no node, by facet.
fn parts(surface: &Surface) -> Vec<usize> {
    let mut parts = vec![usize::MAX; surface.facets().len()];
    let mut reached = Vec::new();
    for first in 0..parts.len() {
        if parts[first] != usize::MAX {
            continue;
        }
        parts[first] = first;
        reached.push(first);
        while let Some(facet) = reached.pop() {
            for k in 0..surface.facets()[facet].nodes().len() {
                for other in surface.facets_at(facet, k) {
                    if parts[other] == usize::MAX {
                        parts[other] = first;
                        reached.push(other);
                    }
                }
            }
        }
    }
    parts
}

/// The facets within some rings around each node: those that have it first.
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
