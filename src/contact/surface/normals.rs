//! Normals at sides and vertices of a surface, and the direction of the gap of a node.

use super::Surface;
use super::shape::{Foot, Location, Point, Shape, add_scaled, dot, sub, unit};
use crate::rounding::ROUNDED_SHARE;

/// Least height of a point in front of a facet at an edge, as a share of the facet, at which it is outside in any case.
/// Nearly flush edges count as one surface.
const FLUSH: f64 = 0.02;

impl Surface {
    /// Normalized sum of the normals on both sides of a side, at its share `s`. The far one is added only if it
    /// `counts`.
    fn side_normal(
        &self,
        facet: usize,
        (k, s): (usize, f64),
        counts: &impl Fn(Point) -> bool,
        positions: &[Point],
    ) -> Option<Point> {
        let shape = self.facets[facet].shape(positions);
        let own = shape.normal(&shape.on_side(k, s))?;
        let Some((neighbor, l)) = self.neighbors[facet][k] else { return Some(own) };
        let shape = self.facets[neighbor].shape(positions);
        let across = shape.normal(&shape.on_side(l, 1.0 - s))?;
        if counts(across) { unit(add_scaled(own, 1.0, across)).or(Some(own)) } else { Some(own) }
    }

    /// Mean of the normals of the facets around a node, weighted by their angles there; none if the node has no facet.
    pub(crate) fn node_normal(&self, node: usize, positions: &[Point]) -> Option<Point> {
        self.node_normal_of(node, &|_| true, positions)
    }

    /// As [`node_normal`](Self::node_normal), with the normals that satisfy `counts`.
    fn node_normal_of(&self, node: usize, counts: &impl Fn(Point) -> bool, positions: &[Point]) -> Option<Point> {
        let sum = self.corners_around(node).fold([0.0; 3], |sum, (facet, k)| {
            let shape = self.facets[facet].shape(positions);
            match shape.normal(&shape.on_side(k, 0.0)).filter(|normal| counts(*normal)) {
                Some(normal) => add_scaled(sum, shape.angle(k), normal),
                None => sum,
            }
        });
        unit(sum)
    }

    /// How steeply the sides around a node rise above the plane normal to its mean normal: the mean of the sines,
    /// negative at a convex corner, positive in a dent.
    pub(crate) fn rise(&self, node: usize, positions: &[Point]) -> f64 {
        let Some(normal) = self.node_normal(node, positions) else { return 0.0 };
        let at = positions[node];
        let mut mean = (0.0, 0.0);
        for (facet, k) in self.corners_around(node) {
            let nodes = self.facets[facet].nodes();
            for next in [(k + 1) % nodes.len(), (k + nodes.len() - 1) % nodes.len()] {
                if let Some(along) = unit(sub(positions[nodes[next]], at)) {
                    mean = (mean.0 + dot(normal, along), mean.1 + 1.0);
                }
            }
        }
        if mean.1 > 0.0 { mean.0 / mean.1 } else { 0.0 }
    }

    /// The side or vertex within `share` of the facet from one of its points.
    fn near(&self, facet: usize, shape: &Shape, foot: &Foot, share: f64) -> Location {
        let (count, rim) = (self.facets[facet].nodes().len(), &self.rims[facet]);
        let close = |k: usize| shape.inset(&foot.weights, k) <= share;
        let mut found = Location::Inside;
        for k in (0..count).filter(|&k| !rim.sides[k] && close(k)) {
            let vertex = if count == 2 || close((k + count - 1) % count) {
                Some(k)
            } else if close((k + 1) % count) {
                Some((k + 1) % count)
            } else {
                None
            };
            found = match vertex {
                Some(vertex) if !rim.vertices[vertex] => return Location::Vertex(vertex),
                _ => Location::Side(k),
            };
        }
        found
    }

    /// Whether a point at `arm` from a side or a vertex of a facet is in front of one of the facets there, by this
    /// share of it, while the others lie behind that facet. Then it is outside even if it is behind the mean normal.
    /// Such points occur because facets with nearer closest points may be excluded for the node.
    pub(super) fn is_outside(
        &self,
        facet: usize,
        location: Location,
        (arm, share): (Point, f64),
        positions: &[Point],
    ) -> bool {
        let (corner, neighbor) = match location {
            Location::Side(k) => (k, self.neighbors[facet][k].map(|(neighbor, _)| neighbor)),
            Location::Vertex(k) => (k, None),
            Location::Inside | Location::Beyond => return false,
        };
        let at = positions[self.facets[facet].nodes[corner]];
        let is_there = |other: usize| match location {
            Location::Side(_) => other == facet || Some(other) == neighbor,
            _ => true,
        };
        let there = || self.facets_at(facet, corner).filter(|&other| is_there(other));
        there().any(|one| {
            let Some(normal) = self.facets[one].normal(positions) else { return false };
            let is_behind = |other: usize| {
                let shape = self.facets[other].shape(positions);
                dot(normal, sub(shape.middle(), at)) <= ROUNDED_SHARE * shape.size()
            };
            dot(normal, arm) > share * self.facets[one].shape(positions).size()
                && there().all(|other| other == one || is_behind(other))
        })
    }

    /// The normal of the gap between a facet and a node at p, and the signed distance along it.
    ///
    /// Inside of a facet it is the facet's own normal. On a side or a vertex it is the direction from the foot to the
    /// node, reversed if the node is behind the mean normal of the facets there. The sign is right on any surface
    /// that does not intersect itself (Bærentzen and Aanæs, 2005, doi:10.1109/TVCG.2005.49). Closer than `share` of
    /// the facet, where rounding hides that direction, it is the mean of the normals that the node `meets`. So a
    /// corner on a corner of a body below is above it, not beside it.
    pub(crate) fn direction(
        &self,
        facet: usize,
        p: Point,
        (shape, foot): &(Shape, Foot),
        (share, meets): (f64, &impl Fn(Point) -> bool),
        positions: &[Point],
    ) -> Option<(Point, f64)> {
        let arm = sub(p, foot.point);
        let touching = foot.distance <= share * shape.size();
        let location = match foot.location {
            Location::Inside if touching => self.near(facet, shape, foot, share),
            location => location,
        };
        let nodes = self.facets[facet].nodes();
        let counts = |normal: Point| !touching || meets(normal);
        let mean = match location {
            Location::Inside | Location::Beyond => shape.normal(&foot.weights),
            Location::Vertex(k) => {
                let of_some = self.node_normal_of(nodes[k], &counts, positions);
                of_some.or_else(|| self.node_normal(nodes[k], positions))
            }
            Location::Side(k) => {
                let next = foot.weights[(k + 1) % nodes.len()];
                let total = foot.weights[k] + next;
                let share = if total > 0.0 { next / total } else { 0.5 };
                self.side_normal(facet, (k, share), &counts, positions)
            }
        }?;
        if touching || foot.location == Location::Inside {
            return Some((mean, dot(mean, arm)));
        }
        let is_behind = dot(mean, arm) < 0.0 && !self.is_outside(facet, location, (arm, FLUSH), positions);
        let side = if is_behind { -1.0 } else { 1.0 };
        Some((unit(arm)?.map(|x| side * x), side * foot.distance))
    }
}
