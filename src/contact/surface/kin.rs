//! What nodes of a surface do not meet of their own surface: the facets around them, and the far side of the material.

use super::Surface;
use super::search::{Bounds, Neighborhood};
use super::shape::{Point, dot};

/// Cosine of the angle between the normals of a node and a facet of its own surface up to which they face each other
/// (102°): across a convex edge of a right angle they do not.
pub(crate) const FACING: f64 = -0.2;

/// The same up to which a facet that a node is behind of in the reference configuration tells how much material is
/// there: sides across a right angle among them, which face the node once the body bends.
const INSIDE: f64 = 0.5;

/// Share of the thickness of the material behind a node that another part of the surface may be inside of it.
const DEPTH: f64 = 0.5;

/// By place of the node among those of the surface.
#[derive(Debug)]
pub(crate) struct Kin {
    starts: Vec<usize>,
    /// The facets within some rings around each node, ascending.
    facets: Vec<usize>,
    /// How deep a facet that is met may be behind each node.
    depths: Vec<f64>,
}

impl Kin {
    /// Finds the facets within `rings` of each node (none: those that have it), and how thick the material is behind
    /// it, as far as `reach`. Surfaces with offsets below zero may lie in each other by an `overlap`, and just touch.
    pub(crate) fn new(surface: &Surface, rings: usize, positions: &[Point], (reach, overlap): (f64, f64)) -> Self {
        let mut kin = Self { starts: vec![0], facets: Vec::new(), depths: Vec::new() };
        let mut own: Vec<usize> = Vec::new();
        for &node in surface.nodes() {
            own.clear();
            own.extend(surface.facets_around(node));
            for _ in 0..rings {
                let nodes = own.iter().flat_map(|&facet| surface.facets()[facet].nodes());
                let mut wider: Vec<usize> = nodes.flat_map(|&node| surface.facets_around(node)).collect();
                wider.sort_unstable();
                wider.dedup();
                own = wider;
            }
            own.sort_unstable();
            kin.facets.extend(&own);
            kin.starts.push(kin.facets.len());
        }
        kin.depths = kin.depths(surface, positions, (reach, overlap));
        kin
    }

    /// Whether a node never meets a facet.
    pub(crate) fn keeps_apart(&self, place: usize, facet: usize) -> bool {
        self.facets[self.starts[place]..self.starts[place + 1]].binary_search(&facet).is_ok()
    }

    /// How deep behind a node a facet may be.
    pub(crate) fn depth(&self, place: usize) -> f64 {
        self.depths[place]
    }

    /// Behind a node, as far as a facet that it is behind of, there is material, as nothing is inside of itself in the
    /// reference configuration: a share of the least distance.
    fn depths(&self, surface: &Surface, positions: &[Point], (reach, overlap): (f64, f64)) -> Vec<f64> {
        /// Shares of an overlap that are rounding.
        const ROUNDING: f64 = 1e-6;
        let mut lists = Neighborhood::default();
        let points = surface.nodes().iter().map(|&node| Bounds::of_points([positions[node]]));
        lists.build(points, surface.boxes(positions), reach);
        let depth = |(place, &node): (usize, &usize)| {
            let Some(own) = surface.node_normal(node, positions) else { return reach };
            let behind =
                lists.of(place).iter().filter(|&&facet| !self.keeps_apart(place, facet)).filter_map(|&facet| {
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
