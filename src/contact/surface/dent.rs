//! Nodes in a dent of a surface: what stands on one facet there may press on those beside it as well.

use super::projection::{Ground, Stand};
use super::shape::{Location, Point, Shape, cross, dot, norm, sub};

/// How near to the sides of a dent a node is that may come to press on them within a step, in shares of the facet,
/// beside its way.
const NEAR: f64 = 0.25;

/// How far facets of a dent go on as planes beyond their sides for a node within a step, in shares of the facet.
const BEYOND: f64 = 1.0;

/// Sine of the smallest angle between two sides of a dent. A node that slides over the bottom of a flatter one sinks in
/// by no more than its way times this; and forces of rows that are nearly the same would be anyone's.
const LEAST_SINE: f64 = 0.05;

impl Ground<'_> {
    /// Where a node that stands like this stands on the other sides of the dent that it is in, or may come to on a way
    /// of this length: on facets that share a vertex with its own and rise from there, each along its own normal.
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
            // (What shares a side is met at the first of its two vertices.)
            let is_new = move |facet: usize| {
                let others = surface.facets()[facet].nodes();
                facet != stand.facet && !nodes[..k].iter().any(|earlier| others.contains(earlier))
            };
            let met = move |facet: usize| self.kin.is_none_or(|kin| !kin.keeps_apart(stand.place, facet));
            surface.facets_at(stand.facet, k).filter(move |&facet| is_new(facet) && met(facet)).filter_map(
                move |facet| {
                    let other = surface.facets()[facet].shape(positions);
                    let (normal, beyond) = (normal?, NEAR + way / other.size());
                    let rises = dot(normal, sub(other.middle(), positions[vertex])) >= 0.0;
                    if !rises || other.is_turned_less(normal, LEAST_SINE, beyond) {
                        return None;
                    }
                    let beside = self.on_plane(stand.place, facet, beyond)?;
                    let is_dent = self.is_dent((stand, normal), &shape, &beside, &other, positions[vertex]);
                    let is_met = || self.meets((stand.place, facet), beside.normal, self.own_normal(stand.place));
                    (is_dent && is_met()).then_some(beside)
                },
            )
        })
    }

    /// Whether a node is outside over a side or a vertex that facets share: they make no dent there.
    fn is_around(&self, stand: &Stand) -> bool {
        !stand.is_inside() && stand.distance > 0.0 && !self.is_rounding(stand.distance, stand.facet)
    }

    /// Whether the surfaces of a node and of its facet touch.
    fn touches(&self, stand: &Stand) -> bool {
        self.is_rounding(stand.gap, stand.facet)
    }

    fn is_rounding(&self, length: f64, facet: usize) -> bool {
        length.abs() <= self.rounding * self.surface.facets()[facet].shape(self.positions).size()
    }

    /// Whether a facet that rises from a vertex of that of a stand makes a dent with it: that one rises from it too,
    /// and so does the point that the node stands on, where its facet has this normal.
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

    /// Of the sides of a dent that a node touches the one that comes first among the facets: which is the closest is
    /// anyone's, and would change from step to step.
    pub(crate) fn first_side(&self, stand: Stand, way: f64) -> Stand {
        let comes_first = |beside: &Stand| {
            let is_on = beside.weights.iter().all(|&weight| weight >= -self.rounding);
            beside.facet < stand.facet && is_on && self.touches(beside)
        };
        let sides = self.touches(&stand).then(|| self.beside(&stand, way));
        let first = sides.into_iter().flatten().filter(comes_first).min_by_key(|beside| beside.facet);
        first.unwrap_or(stand)
    }

    /// The stand of a node in a dent on its closest facet: where it touches that, along the normal of the facet alone.
    pub(crate) fn first_in_dent(&self, stand: Stand) -> Stand {
        if self.touches(&stand) { self.in_dent(&stand).unwrap_or(stand) } else { stand }
    }

    /// The stand of a node in a dent on the facet where it is, as far as that goes on as a plane.
    fn in_dent(&self, stand: &Stand) -> Option<Stand> {
        self.on_plane(stand.place, stand.facet, BEYOND)
    }

    /// Where the k-th stand of a node goes, whose closest facet now is that of `closest`. A single one goes there; of
    /// those in a dent one does, if there is none yet, and the others stay on their facets.
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

    /// Which of the stands of a node is on the closest facet, or else nearest.
    fn closest_of(&self, stands: &[Stand], closest: &Stand) -> Option<usize> {
        let p = self.positions[self.nodes[closest.place]];
        let distance = |stand: &Stand| {
            let projected = self.surface.project(stand.facet, p, self.positions);
            projected.map_or(f64::INFINITY, |(_, foot)| foot.distance)
        };
        let there = stands.iter().position(|stand| stand.facet == closest.facet);
        there.or_else(|| (0..stands.len()).min_by(|&i, &j| distance(&stands[i]).total_cmp(&distance(&stands[j]))))
    }

    /// Where a node stands on a facet that goes on beyond its sides by a share of itself; none farther out.
    fn on_plane(&self, place: usize, facet: usize, beyond: f64) -> Option<Stand> {
        let p = self.positions[self.nodes[place]];
        let (shape, foot) = self.surface.project_on_plane(facet, p, beyond, self.positions)?;
        let normal = shape.normal(&foot.weights).filter(|_| foot.location != Location::Beyond)?;
        let distance = dot(normal, sub(p, foot.point));
        Some(self.stand((place, facet), Location::Inside, foot.weights, normal, distance))
    }
}
