//! Projection of a node onto a surface, in the search and within a step, and the gap acceleration along a motion.

use super::Surface;
use super::cones::Cones;
use super::material::Material;
use super::nearest_first::{Kept, NearestFirst};
use super::offsets::Offsets;
use super::own_facets::OwnFacets;
use super::search::{Bounds, overhang};
use super::shape::{Foot, Location, Point, Shape, add_scaled, dot, sub};
use crate::rounding::ROUNDED_SHARE;
use std::cell::OnceCell;

/// Cosine of the angle between the normals of a node and a facet above which they are not in contact: both point to
/// the same side.
const SAME_SIDE: f64 = 0.5;

/// Largest cosine between the normals of a node and of a facet beside it on its own body at which they face each other
/// (an angle of 102°). Across a convex right angle they do not face each other.
const FACING: f64 = -0.2;

/// The same limit for the facet that a node is already projected on, within a step.
const SAME_SIDE_OF_LAST: f64 = 0.75;

/// The same limit for such a facet that is beside the node on its own body.
const FACING_OF_LAST: f64 = 0.25;

/// Extension of the surface beyond its rim for a node that leaves it within a step, as a share of the facet.
const RIM_OF_LAST: f64 = 0.25;

/// The projection of a node at some time.
#[derive(Clone, Copy, Debug)]
struct Seen {
    t: f64,
    normal: Point,
    facet: usize,
}

/// The projection of a node onto a surface: the facet and its closest point, the normal and the gap there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stand {
    /// Index of the node in the list of the slave nodes.
    pub(crate) place: usize,
    pub(crate) facet: usize,
    pub(super) location: Location,
    /// Shape functions of the facet's vertices at the closest point.
    pub(crate) weights: [f64; 4],
    pub(crate) normal: Point,
    /// The distance from that point along the normal, and the gap: this distance less the offsets of both surfaces.
    pub(super) distance: f64,
    pub(crate) gap: f64,
    /// The sum of these offsets at full size, and their factor in the gap.
    pub(crate) offset: f64,
    pub(crate) factor: f64,
    /// How often the node has changed its facet or normal since the search.
    jumps: u8,
    /// The last projections at the two times at which a step evaluates rows (where the gap is zero, where the balance
    /// holds), the latest evaluation first.
    seen: [Option<Seen>; 2],
}

/// Slave nodes and a surface, at given positions of both.
#[derive(Clone, Copy)]
pub(crate) struct Ground<'a> {
    pub(crate) nodes: &'a [usize],
    /// The facets near each node, if known; otherwise all facets are tried.
    pub(crate) lists: Option<&'a NearestFirst>,
    /// The motions since the lists were built, if known; they end the search of a list early.
    pub(crate) kept: Option<Kept<'a>>,
    pub(crate) surface: &'a Surface,
    pub(crate) boxes: Option<&'a [Bounds]>,
    /// The cones of the normals of this surface and of the nodes' own surface, if known.
    pub(crate) cones: [Option<&'a Cones>; 2],
    pub(crate) own: Option<&'a Surface>,
    /// The facets excluded for each node, if the nodes are on this same surface.
    pub(crate) own_facets: Option<&'a OwnFacets>,
    /// The material behind the nodes' own surface and behind this one, if both are known.
    pub(crate) material: Option<[&'a Material; 2]>,
    pub(crate) positions: &'a [Point],
    pub(crate) offsets: Offsets<'a>,
    /// Distance from a side or a vertex, as a share of a facet, below which it counts as rounding.
    pub(crate) rounding: f64,
}

impl Ground<'_> {
    /// Candidate facets for the node at a place of the list.
    pub(crate) fn near(&self, place: usize) -> impl Iterator<Item = usize> {
        self.by_distance(place).map(|(_, facet)| facet).filter(move |&facet| self.may_meet(place, facet))
    }

    /// Facets in the order of the list, with their listed distances.
    fn by_distance(&self, place: usize) -> impl Iterator<Item = (f64, usize)> + use<'_> {
        let list = self.lists.map(|lists| lists.of(place));
        let count = list.map_or(self.surface.facets().len(), <[_]>::len);
        (0..count).map(move |k| list.map_or((0.0, k), |list| list[k]))
    }

    pub(super) fn may_meet(&self, place: usize, facet: usize) -> bool {
        self.own_facets.is_none_or(|own| !own.adjacent.holds(place, facet))
    }

    /// The corners of a facet moved along its normal by the offsets of the node and the facet, and the facet itself
    /// if it lies behind these.
    pub(crate) fn layers(&self, place: usize, facet: usize) -> impl Iterator<Item = [Point; 4]> + use<> {
        let facet = &self.surface.facets()[facet];
        let corners = facet.nodes.map(|vertex| self.positions[vertex]);
        let own = self.offsets.of(self.nodes[place]);
        let offsets = self.offsets.at_corners(facet).map(|offset| self.offsets.factor * (own + offset));
        let normal = facet.normal(self.positions).filter(|_| !self.offsets.is_none());
        let outer = normal.map(|normal| std::array::from_fn(|k| add_scaled(corners[k], offsets[k], normal)));
        let is_behind = outer.is_none() || offsets[..facet.nodes().len()].iter().all(|offset| *offset > 0.0);
        outer.into_iter().chain(is_behind.then_some(corners))
    }

    /// Whether a node with `own_normal`, if it has one, can be in contact with the front of a facet with `normal`.
    pub(crate) fn meets(&self, (place, facet): (usize, usize), normal: Point, own_normal: Option<Point>) -> bool {
        own_normal.is_none_or(|own| dot(own, normal) <= self.limit(place, facet))
    }

    /// The largest cosine between the normals of a node and a facet in contact.
    fn limit(&self, place: usize, facet: usize) -> f64 {
        if self.is_nearby(place, facet) { FACING } else { SAME_SIDE }
    }

    /// Whether a facet is beside a node on its own body.
    fn is_nearby(&self, place: usize, facet: usize) -> bool {
        self.is_of_one_body(place, facet) && self.own_facets.is_some_and(|own| own.nearby.holds(place, facet))
    }

    fn is_of_one_body(&self, place: usize, facet: usize) -> bool {
        let of_own = |[own, _]: [&Material; 2]| own.is_of_one_body(self.surface, place, facet);
        self.own_facets.is_some() && self.material.is_some_and(of_own)
    }

    /// The largest depth behind a facet at which a node is in contact with it; none if the node's own surface is not
    /// known.
    fn depth(&self, place: usize, facet: usize) -> Option<f64> {
        let ([own, other], surface) = self.material.zip(self.own)?;
        let own_place = surface.nodes().binary_search(&self.nodes[place]).ok()?;
        let behind = if self.is_of_one_body(place, facet) { 0.0 } else { other.behind_facet(self.surface, facet) };
        Some(own.behind(own_place) + behind)
    }

    /// Whether a node is so deep behind a facet that material of both bodies, or of its own body, lies between them.
    ///
    /// The sign is taken along the normal of the gap, because over a side or a vertex a node may be in front of one
    /// facet and behind the other. If the node's own normal points along that normal, its own body lies between,
    /// whose flanks bulge.
    fn is_beyond(
        &self,
        place: usize,
        facet: usize,
        projected: &(Shape, Foot),
        own_normal: &impl Fn() -> Option<Point>,
    ) -> bool {
        let p = self.positions[self.nodes[place]];
        let looks_away = |normal: Point| own_normal().is_some_and(|own| dot(own, normal) > FACING);
        let is_behind = |(normal, gap): (Point, f64)| gap < 0.0 || looks_away(normal);
        self.depth(place, facet).is_some_and(|depth| projected.1.distance > depth)
            && self.direction(place, facet, p, projected).is_some_and(is_behind)
    }

    /// The projection onto the closest facet of the node at a place of the list, if its surface is within `reach`;
    /// none beyond the rim. A facet that is `likely` the closest one is tried first, which saves time.
    pub(crate) fn closest(&self, place: usize, reach: f64, likely: Option<usize>) -> Option<Stand> {
        let (facet, projected) = self.nearest(place, reach, likely)?;
        self.on(place, facet, &projected)
    }

    /// A bound of the distance to that surface or its rim, and the projection; `reach` if no surface is within it.
    pub(crate) fn clearance(&self, place: usize, reach: f64) -> (f64, Option<Stand>) {
        let Some((facet, projected)) = self.nearest(place, reach, None) else { return (reach, None) };
        let stand = self.on(place, facet, &projected);
        let height = self.height(place, facet, &projected.1);
        (stand.map_or(height, |stand| height.min(stand.gap.abs())), stand)
    }

    /// The distance of a node from a facet less their offsets. The nearest facet by this measure is the one whose
    /// offset surface is closest; with equal offsets everywhere it is the closest facet.
    fn height(&self, place: usize, facet: usize, foot: &Foot) -> f64 {
        let Offsets { factor, .. } = self.offsets;
        foot.distance - factor * self.offsets.upon(self.nodes[place], &self.surface.facets()[facet], &foot.weights)
    }

    fn nearest(&self, place: usize, reach: f64, likely: Option<usize>) -> Option<(usize, (Shape, Foot))> {
        let Self { surface, positions, .. } = *self;
        let node = self.nodes[place];
        let p = positions[node];
        let own_normal = OnceCell::new();
        let own_normal = || *own_normal.get_or_init(|| self.own_normal(place));
        let own_place = self.own_place(place);
        let slack = self.kept.zip(self.lists).map_or(f64::INFINITY, |(kept, lists)| kept.slack(lists, node, p));
        // Heights are distances of offset surfaces. They differ from the distances of facets by at most this.
        let most = |facet: usize| self.offsets.most(node, &surface.facets()[facet]);
        let mut best: Option<(usize, (Shape, Foot), f64)> = None;
        let look_at = |facet: usize, best: &mut Option<(usize, (Shape, Foot), f64)>| {
            let limit = best.as_ref().map_or(reach, |(.., depth)| *depth) + most(facet);
            let bounds = match self.boxes {
                Some(boxes) => boxes[facet],
                None => Bounds::of_corners(&surface.facets()[facet].shape(positions)),
            };
            if bounds.distance(p) > limit + overhang(&bounds) || !self.may_meet(place, facet) {
                return;
            }
            let Some(projected) = surface.project(facet, p, positions) else { return };
            let depth = self.height(place, facet, &projected.1);
            // Of two facets that share the point, the first one wins.
            let foot = Foot { distance: depth, ..projected.1 };
            let is_better = |(other, (_, best), depth): &(usize, (Shape, Foot), f64)| {
                let best = Foot { distance: *depth, ..*best };
                foot.is_better_than(&best) || (facet < *other && !best.is_better_than(&foot))
            };
            if depth > reach || best.as_ref().is_some_and(|best| !is_better(best)) {
                return;
            }
            let is_met = || {
                let limit = self.limit(place, facet);
                self.surely_faces(own_place, facet, limit)
                    || faces(&projected, own_normal(), limit)
                    || faces(&projected, own_normal(), SAME_SIDE) && is_over(&projected, p)
            };
            if is_met() && !self.is_beyond(place, facet, &projected, &own_normal) {
                *best = Some((facet, projected, depth));
            }
        };
        // The height over the first facet excludes others by their boxes.
        let is_listed = |likely: &usize| self.by_distance(place).any(|(_, facet)| facet == *likely);
        let first = likely.filter(is_listed);
        if let Some(facet) = first {
            look_at(facet, &mut best);
        }
        for (distance, facet) in self.by_distance(place).filter(|&(_, facet)| Some(facet) != first) {
            if distance - slack > best.as_ref().map_or(reach, |(.., depth)| *depth) {
                break;
            }
            look_at(facet, &mut best);
        }
        best.map(|(facet, projected, _)| (facet, projected))
    }

    /// The place of a node in its own surface, if it equals its place in the list.
    fn own_place(&self, place: usize) -> Option<usize> {
        self.own.filter(|own| own.nodes().get(place) == Some(&self.nodes[place])).map(|_| place)
    }

    /// Whether a facet surely faces a node, by the cones of the normals around both.
    fn surely_faces(&self, own_place: Option<usize>, facet: usize, limit: f64) -> bool {
        let [Some(cones), Some(own_cones)] = self.cones else { return false };
        let surely = |(own, place): (&Surface, usize)| own_cones.surely_face(own, place, (cones, facet), limit);
        self.own.zip(own_place).is_some_and(surely)
    }

    /// The projection onto the last facet of a node, within `reach`. Its limits are wider than in the search, so that
    /// a node that slides over the rim or turns away finishes its step.
    pub(crate) fn last(&self, place: usize, facet: usize, reach: f64) -> Option<Stand> {
        let p = self.positions[self.nodes[place]];
        let projected = self.surface.project_beyond(facet, p, RIM_OF_LAST, self.positions)?;
        let limit = if self.is_nearby(place, facet) { FACING_OF_LAST } else { SAME_SIDE_OF_LAST };
        let stays = projected.1.distance <= reach && faces(&projected, self.own_normal(place), limit);
        stays.then(|| self.on(place, facet, &projected)).flatten()
    }

    pub(crate) fn own_normal(&self, place: usize) -> Option<Point> {
        self.own.and_then(|own| own.node_normal(self.nodes[place], self.positions))
    }

    /// The vertex at which a projection lies, if any.
    pub(crate) fn vertex(&self, stand: &Stand) -> Option<usize> {
        let mut vertices = self.surface.facets()[stand.facet].nodes().iter().zip(&stand.weights);
        vertices.find(|(_, weight)| **weight >= 1.0 - self.rounding).map(|(&vertex, _)| vertex)
    }

    /// Whether a node that is projected onto a vertex, which is projected onto the node, leaves the row to the
    /// vertex. The sharper one of the two keeps the row, because it may have rows in a dent, and because a node on a
    /// sharp corner slides off. If both are equally sharp, the first one keeps it.
    pub(crate) fn is_second(&self, stand: &Stand, pass: usize) -> bool {
        let Some(vertex) = self.vertex(stand) else { return false };
        let node = self.nodes[stand.place];
        let own = self.own.map_or(0.0, |own| own.rise(node, self.positions));
        let steeper = own - self.surface.rise(vertex, self.positions);
        let comes_later = if self.own_facets.is_some() { vertex < node } else { pass > 0 };
        steeper > ROUNDED_SHARE || (steeper >= -ROUNDED_SHARE && comes_later)
    }

    /// Whether a node is beside the facet of its projection: outside at an edge, and behind the facet by more than a
    /// penetration. It cannot come in front of the facet within a step. But the direction of its gap reverses once it
    /// is deeper behind the facet than it is away from the side face.
    pub(crate) fn is_beside(&self, stand: &Stand) -> bool {
        /// Depth as a share of the facet.
        const PENETRATION: f64 = 1e-4;
        if stand.is_inside() {
            return false;
        }
        let Stand { facet, location, ref weights, normal, distance, factor, offset, .. } = *stand;
        let arm = normal.map(|x| distance * x);
        let shape = self.surface.facets()[facet].shape(self.positions);
        let gap = shape.normal(weights).map_or(0.0, |normal| dot(normal, arm) - factor * offset);
        gap < -PENETRATION * shape.size()
            && self.surface.is_outside(facet, location, (arm, ROUNDED_SHARE), self.positions)
    }

    /// The normal of the projection of a node at p onto a facet, and the distance along it.
    fn direction(&self, place: usize, facet: usize, p: Point, projected: &(Shape, Foot)) -> Option<(Point, f64)> {
        // Computed at most once, and only if the node touches a vertex or a side.
        let own = OnceCell::new();
        let meets = |normal: Point| self.meets((place, facet), normal, *own.get_or_init(|| self.own_normal(place)));
        self.surface.direction(facet, p, projected, (self.rounding, &meets), self.positions)
    }

    fn on(&self, place: usize, facet: usize, projected: &(Shape, Foot)) -> Option<Stand> {
        let Foot { weights, location, .. } = projected.1;
        if location == Location::Beyond {
            return None;
        }
        let p = self.positions[self.nodes[place]];
        let (normal, distance) = self.direction(place, facet, p, projected)?;
        Some(self.stand((place, facet), location, weights, normal, distance))
    }

    /// The projection of a node onto a facet, with the offsets of both.
    pub(super) fn stand(
        &self,
        (place, facet): (usize, usize),
        location: Location,
        weights: [f64; 4],
        normal: Point,
        distance: f64,
    ) -> Stand {
        let offset = self.offsets.upon(self.nodes[place], &self.surface.facets()[facet], &weights);
        let factor = self.offsets.factor;
        let gap = distance - factor * offset;
        Stand { place, facet, location, weights, normal, distance, gap, offset, factor, jumps: 0, seen: [None; 2] }
    }
}

/// Whether a facet faces a node with this normal; true if the normal is not known.
fn faces((shape, foot): &(Shape, Foot), own_normal: Option<Point>, same_side: f64) -> bool {
    let same = |normal: Point| shape.normal(&foot.weights).is_none_or(|facet| dot(facet, normal) > same_side);
    own_normal.is_none_or(|normal| !same(normal))
}

/// Whether a point is in front of the inside of a facet, or behind it by at most a typical penetration. Then they are
/// in contact even beside the own body.
fn is_over((shape, foot): &(Shape, Foot), p: Point) -> bool {
    /// Depth as a share of the facet.
    const PRESSED: f64 = 0.05;
    let height = |normal: Point| dot(normal, sub(p, foot.point));
    foot.location == Location::Inside
        && shape.normal(&foot.weights).is_some_and(|normal| height(normal) > -PRESSED * shape.size())
}

impl Stand {
    /// Whether the projection is along the facet's own normal, not at a side or a vertex.
    pub(super) fn is_inside(&self) -> bool {
        self.location == Location::Inside
    }

    /// The projection that replaces this one when the node is found as in `next` at time t; none if this one stays.
    ///
    /// It stays if the node has jumped too often: between two facets, or around an edge that it touches, the normal
    /// does not converge. It also stays if a kink lies between the two times of a step: rows are evaluated in turn
    /// where the balance holds and, later in the step, where the gap is zero. Then the row of the later time serves
    /// both.
    pub(crate) fn followed_by(&self, next: Self, t: f64) -> Option<Self> {
        /// Cosines of the angles that count as a jump and as a kink (18°), and the number of jumps allowed.
        const TURN: f64 = 1.0 - 1e-5;
        const KINK: f64 = 0.95;
        const PATIENCE: u8 = 8;
        let later = self.seen.iter().flatten().find(|seen| seen.t > t);
        let tired = self.jumps > PATIENCE;
        let stays = match later {
            Some(seen) => tired || dot(seen.normal, next.normal) < KINK,
            None => tired && self.seen[0].is_some_and(|seen| seen.t.to_bits() == t.to_bits()),
        };
        if stays {
            return None;
        }
        let same = |seen: &Option<Seen>| seen.is_some_and(|seen| seen.t.to_bits() == t.to_bits());
        let before = self.seen.iter().copied().find(same).flatten();
        let (normal, facet) = before.map_or((self.normal, self.facet), |seen| (seen.normal, seen.facet));
        let jumped = facet != next.facet || dot(normal, next.normal) < TURN;
        let other = self.seen.iter().copied().find(|seen| !same(seen)).flatten();
        let now = Seen { t, normal: next.normal, facet: next.facet };
        Some(Self { jumps: self.jumps.saturating_add(u8::from(jumped)), seen: [Some(now), other], ..next })
    }
}
