//! The material behind the nodes and facets of a surface: how deep behind a facet a point can be in contact with it.
//!
//! A point x of one body that is at depth d behind a facet of another body is in contact only if the bodies penetrate
//! each other there. If they do not, all of their material lies between x and the facet: d ≥ t₁ + t₂, with the
//! thicknesses t₁ behind x and t₂ behind the facet. A facet of the same body is the other side of the wall: d = t₁.
//! So contact ends at half of this material in the reference configuration: at (t₁ + t₂)/2 between two bodies, at
//! t₁/2 within one. The other half is the margin for deformation.

use super::Surface;
use super::search::{Bounds, Neighborhood};
use super::shape::{Point, dot};
use crate::rounding::ROUNDED_SHARE;

/// Largest cosine between the normal of a node and the normal of a facet that bounds the material behind it. Sides
/// across a right angle count, because they face the node once the body bends.
const INSIDE: f64 = 0.5;

/// Share of the material between a point and a facet up to which the point is in contact.
const DEPTH: f64 = 0.5;

/// Range in which the thickness is measured, in multiples of the reach or of a typical facet, whichever is longer.
const RANGE: f64 = 2.0;

/// The body of each facet, and the largest depth of contact from the material behind each node.
#[derive(Debug)]
pub(crate) struct Material {
    bodies: Vec<usize>,
    /// Largest depth of contact, by place of the node in the surface.
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
    /// Measures the thickness at a node as its distance to the closest facet of the same body that it is behind, of
    /// the facets `near` it. A body must not penetrate itself, except by the `overlap` of negative offsets.
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
                // Beside a side or a vertex a node may be behind the plane of a facet and still outside the body.
                let counts = (ROUNDED_SHARE, &|_| true);
                let (_, height) = surface.direction(facet, positions[node], &projected, counts, positions)?;
                let is_behind = height < 0.0 && foot.distance > (1.0 + ROUNDED_SHARE) * overlap;
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

    /// The largest depth of contact from the material behind the node at a place of the surface.
    pub(crate) fn behind(&self, place: usize) -> f64 {
        self.depths[place]
    }

    /// As [`behind`](Self::behind), for a facet: the least of its nodes.
    pub(crate) fn behind_facet(&self, surface: &Surface, facet: usize) -> f64 {
        let places = &surface.places(facet)[..surface.facets()[facet].nodes().len()];
        places.iter().map(|&place| self.depths[place]).fold(f64::INFINITY, f64::min)
    }
}

fn first_facet(surface: &Surface, place: usize) -> usize {
    surface.corners_at(place)[0].0
}
