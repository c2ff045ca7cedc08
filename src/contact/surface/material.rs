//! The material behind the nodes and facets of a surface: how deep in contact a point may be behind a facet.
//!
//! A point x of one body that is d behind a facet of another one is in contact with it only if the bodies are in each
//! other there. Bodies that are apart have all of their material between x and the facet: d ≥ t₁ + t₂, with their
//! thicknesses t₁ behind x and t₂ behind the facet. A facet of the same body is the other side of its wall: d = t₁.
//! So contact ends at half of the material that may lie between, in the reference configuration: (t₁ + t₂)/2 between
//! two bodies, t₁/2 within one. The other half is the margin for bodies that deform.

use super::Surface;
use super::search::{Bounds, Neighborhood};
use super::shape::{Point, dot};

/// Greatest cosine between the normal of a node and that of a facet behind it that bounds the material there: sides
/// across a right angle do, for they face the node once the body bends.
const INSIDE: f64 = 0.5;

/// Share of the material that may lie between a point and a facet behind which it is in contact.
const DEPTH: f64 = 0.5;

/// How far, in shares of the reach or of a facet, whichever is longer, the material is looked at.
const RANGE: f64 = 2.0;

/// Shares of a depth that are rounding.
const ROUNDING: f64 = 1e-6;

/// Which facets belong to one body, and how deep contact may be behind each node for the material there.
#[derive(Debug)]
pub(crate) struct Material {
    /// The body of each facet.
    bodies: Vec<usize>,
    /// By place of the node among those of the surface.
    depths: Vec<f64>,
}

/// The facets near each node in the reference configuration.
pub(super) fn near(surface: &Surface, positions: &[Point], reach: f64) -> Neighborhood {
    let mut near = Neighborhood::default();
    let points = surface.nodes().iter().map(|&node| Bounds::of_points([positions[node]]));
    near.build(points, surface.boxes(positions), RANGE * reach.max(surface.typical()));
    near
}

impl Material {
    /// As [`new`](Self::new), of the facets that are near.
    pub(crate) fn of(surface: &Surface, positions: &[Point], known: (f64, f64)) -> Self {
        Self::new(surface, &near(surface, positions, known.0), positions, known)
    }

    /// Measures the thickness by the closest facet of the same body that a node is behind of, of those `near` it. No
    /// body may be inside of itself, but by the `overlap` of surfaces with negative offsets.
    pub(super) fn new(
        surface: &Surface,
        near: &Neighborhood,
        positions: &[Point],
        (reach, overlap): (f64, f64),
    ) -> Self {
        let bodies = surface.bodies(positions);
        let most = reach.max(surface.typical());
        let depth = |(place, &node): (usize, &usize)| {
            let Some(own) = surface.node_normal(node, positions) else { return most };
            let body = bodies[first_facet(surface, place)];
            let is_other = |&&facet: &&usize| bodies[facet] == body && !surface.facets()[facet].nodes().contains(&node);
            let behind = near.of(place).iter().filter(is_other).filter_map(|&facet| {
                let projected = surface.project(facet, positions[node], positions)?;
                let (shape, foot) = &projected;
                let normal = shape.normal(&foot.weights).filter(|normal| dot(own, *normal) <= INSIDE);
                // (Beside a side or a vertex a node may be behind the plane of a facet, and outside.)
                let counts = (ROUNDING, &|_| true);
                let (_, height) = surface.direction(facet, positions[node], &projected, counts, positions)?;
                let is_behind = height < 0.0 && foot.distance > (1.0 + ROUNDING) * overlap;
                (is_behind && normal.is_some()).then_some(DEPTH * foot.distance)
            });
            behind.fold(most, f64::min)
        };
        let depths = surface.nodes().iter().enumerate().map(depth).collect();
        Self { bodies, depths }
    }

    /// Whether the node at a place of the surface belongs to the body of a facet.
    pub(crate) fn is_of_one_body(&self, surface: &Surface, place: usize, facet: usize) -> bool {
        self.bodies[first_facet(surface, place)] == self.bodies[facet]
    }

    /// How deep contact may be for the material behind the node at a place of the surface.
    pub(crate) fn behind(&self, place: usize) -> f64 {
        self.depths[place]
    }

    /// The same behind a facet.
    pub(crate) fn behind_facet(&self, surface: &Surface, facet: usize) -> f64 {
        let places = &surface.places(facet)[..surface.facets()[facet].nodes().len()];
        places.iter().map(|&place| self.depths[place]).fold(f64::INFINITY, f64::min)
    }
}

fn first_facet(surface: &Surface, place: usize) -> usize {
    surface.corners_at(place)[0].0
}
