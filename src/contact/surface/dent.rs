//! Nodes in a dent of a surface: a node that presses on one facet there may press on the adjacent facets as well.

use super::projection::{Ground, Stand};
use super::shape::{Location, Point, Rim, Shape, cross, dot, norm, sub};

/// Distance from the sides of a dent, as a share of the facet and beyond the node's displacement, within which a node
/// may come to press on them in a step.
const NEAR: f64 = 0.25;

/// Extension of the facets of a dent as planes beyond their sides within a step, as a share of the facet.
const BEYOND: f64 = 1.0;

/// Sine of the smallest angle between two sides of a dent. In a flatter dent, a sliding node penetrates by at most
/// its displacement times this sine, and two nearly parallel rows would not determine their forces.
const LEAST_SINE: f64 = 0.05;

impl Ground<'_> {
    /// The projections of a node onto the other sides of the dent in which it is, or which it may enter by a
    /// displacement of length `way`. These sides share a vertex with its facet and rise from there. Each has its own
    /// normal.
    pub(crate) fn beside<'a>(&'a self, stand: &'a Stand, way: f64) -> impl Iterator<Item = Stand> + 'a {
        let Self { surface, positions, .. } = *self;
        let nodes = surface.facets()[stand.facet].nodes();
        let shape = surface.facets()[stand.facet].shape(positions);
        let normal = shape.normal(&stand.weights);
        let [cones, _] = self.cones;
        let is_even = || cones.is_some_and(|cones| cones.is_even(surface, stand.facet, LEAST_SINE, (NEAR, way)));
        let near = stand.gap.abs() <= way + NEAR * shape.size() && !self.is_around(stand) && !is_even();
        let corners = if near { nodes } else { &[] };
        corners.iter().enumerate().flat_map(move |(k, &vertex)| {
            // A facet that shares a side is found at the first of the two vertices.
            let is_new = move |facet: usize| {
                let others = surface.facets()[facet].nodes();
                facet != stand.facet && !nodes[..k].iter().any(|earlier| others.contains(earlier))
            };
            let met = move |facet: usize| self.may_meet(stand.place, facet);
            surface.facets_at(stand.facet, k).filter(move |&facet| is_new(facet) && met(facet)).filter_map(
                move |facet| {
                    let other = surface.facets()[facet].shape(positions);
                    let normal = normal.filter(|n| dot(*n, sub(other.middle(), positions[vertex])) >= 0.0)?;
                    let beside = self.on_plane(stand.place, facet, NEAR + way / other.size())?;
                    let is_dent = self.is_dent((stand, normal), &shape, &beside, &other, positions[vertex]);
                    let is_met = || self.meets((stand.place, facet), beside.normal, self.own_normal(stand.place));
                    (is_dent && is_met()).then_some(beside)
                },
            )
        })
    }

    /// Whether a node is outside over a side or a vertex that facets share. They form no dent for it.
    fn is_around(&self, stand: &Stand) -> bool {
        !stand.is_inside() && stand.distance > 0.0 && !self.is_rounding(stand.distance, stand.facet)
    }

    /// Whether the gap of a node is zero up to rounding.
    fn touches(&self, stand: &Stand) -> bool {
        self.is_rounding(stand.gap, stand.facet)
    }

    fn is_rounding(&self, length: f64, facet: usize) -> bool {
        length.abs() <= self.rounding * self.surface.facets()[facet].shape(self.positions).size()
    }

    /// Whether a facet that rises from a vertex of the node's facet forms a dent with it: the node's facet, with this
    /// normal, must rise from the other facet too, and so must the node's closest point.
    fn is_dent(
        &self,
        (stand, normal): (&Stand, Point),
        shape: &Shape,
        beside: &Stand,
        other: &Shape,
        vertex: Point,
    ) -> bool {
        let height = |normal: Point, x: Point| dot(normal, sub(x, vertex));
        norm(cross(normal, beside.normal)) >= LEAST_SINE
            && height(beside.normal, shape.middle()) >= 0.0
            && height(beside.normal, shape.point(&stand.weights)) >= -self.rounding * other.size()
    }

    /// The projection onto the first facet, by index, among the sides of a dent that a node touches. Rounding decides
    /// which of them is the closest, and the closest one would change from step to step.
    pub(crate) fn first_side(&self, stand: Stand, way: f64) -> Stand {
        let comes_first = |beside: &Stand| {
            let is_on = beside.weights.iter().all(|&weight| weight >= -self.rounding);
            beside.facet < stand.facet && is_on && self.touches(beside)
        };
        let sides = self.touches(&stand).then(|| self.beside(&stand, way));
        let first = sides.into_iter().flatten().filter(comes_first).min_by_key(|beside| beside.facet);
        first.unwrap_or(stand)
    }

    /// The projection of a node in a dent onto its closest facet; if the node touches it, along the normal of this
    /// facet alone.
    pub(crate) fn first_in_dent(&self, stand: Stand) -> Stand {
        if self.touches(&stand) { self.in_dent(&stand).unwrap_or(stand) } else { stand }
    }

    /// The projection of a node in a dent onto its facet, extended as a plane.
    fn in_dent(&self, stand: &Stand) -> Option<Stand> {
        self.on_plane(stand.place, stand.facet, BEYOND)
    }

    /// The update of the k-th projection of a node, whose closest projection is now `closest`. A single projection
    /// moves there. Of several in a dent, the one on the closest facet or else the nearest one moves there; the
    /// others stay on their facets.
    pub(crate) fn followed(&self, stands: &[Stand], k: usize, closest: Option<Stand>) -> Option<Stand> {
        let stand = &stands[k];
        if stands.len() == 1 {
            return closest;
        }
        let own = || self.in_dent(stand);
        match closest.filter(|closest| self.closest_of(stands, closest) == Some(k)) {
            Some(closest) if closest.facet != stand.facet || self.is_around(&closest) => Some(closest),
            Some(closest) => own().or(Some(closest)),
            None => own(),
        }
    }

    /// Which of the projections of a node is on the closest facet, or else nearest.
    fn closest_of(&self, stands: &[Stand], closest: &Stand) -> Option<usize> {
        let p = self.positions[self.nodes[closest.place]];
        let distance = |stand: &Stand| {
            let projected = self.surface.project(stand.facet, p, self.positions);
            projected.map_or(f64::INFINITY, |(_, foot)| foot.distance)
        };
        let there = stands.iter().position(|stand| stand.facet == closest.facet);
        there.or_else(|| (0..stands.len()).min_by(|&i, &j| distance(&stands[i]).total_cmp(&distance(&stands[j]))))
    }

    /// The projection of a node onto a facet extended by a share of itself; none farther out.
    fn on_plane(&self, place: usize, facet: usize, beyond: f64) -> Option<Stand> {
        let p = self.positions[self.nodes[place]];
        let shape = self.surface.facets()[facet].shape(self.positions);
        let foot = shape.project(p, Rim::all_around(beyond))?;
        let normal = shape.normal(&foot.weights).filter(|_| foot.location != Location::Beyond)?;
        let distance = dot(normal, sub(p, foot.point));
        Some(self.stand((place, facet), Location::Inside, foot.weights, normal, distance))
    }
}
