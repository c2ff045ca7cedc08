//! Checks whether nodes have passed through facets in a step: their paths against facets that move.

use super::NodeToFacet;
use super::candidates::pass_of;
use crate::contact::surface::{Bounds, Facet, Ground, Point, Shape, Stand, add_scaled, dot, norm, sub};
use crate::contact::{COARSE, ContactLaw, FINE, LARGEST_MISS, STEEP, Stride, impacts_differ, kept_depth};
use crate::error::Result;
use crate::real::Real;
use crate::rounding::half_digits;

/// Share of a path that may enter over a convex corner and leave again.
const SHALLOW: f64 = 0.05;

/// A node and the surface of its pass, at the start and at the end of a step.
struct Crossing<'a> {
    grounds: [Ground<'a>; 2],
    place: usize,
    node: usize,
    /// The facet of its row, if it has one.
    likely: Option<usize>,
    /// A bound of its displacement relative to the surface.
    path: f64,
    law: ContactLaw,
    /// Largest penetration that is recovered in a step.
    recovery: f64,
}

impl<T: Real> NodeToFacet<T> {
    /// Rejects a step in which a node went through the other surface, or was stopped away from it.
    pub(super) fn check_step(&mut self, step: &Stride<'_, T>) -> Result<()> {
        let mut ends = std::mem::take(&mut self.ends);
        let result = self.check_paths(step, &mut ends);
        self.ends = ends;
        result
    }

    fn check_paths(&self, step: &Stride<'_, T>, ends: &mut [Vec<Point>; 2]) -> Result<()> {
        let moved = |node: usize| self.nodes.way(node, step.u);
        let motions = self.nodes.boxes_of(moved);
        let longest = motions[0].farthest(&motions[1]);
        let surfaces = [Some(&self.surface), self.own_surface.as_ref()];
        if longest <= FINE * self.finest() {
            return Ok(());
        }
        for (positions, u) in ends.iter_mut().zip(step.u) {
            self.nodes.places_at(u, positions);
        }
        // For a node in a dent only the first row is checked.
        let rows = self.rows.identities.iter().copied().enumerate();
        let mut rows = rows.filter(|&(_, (_, candidate))| candidate == pass_of(candidate)).peekable();
        for (pass, (list, surface)) in self.passes.iter().zip(surfaces.into_iter().flatten()).enumerate() {
            let own = if pass == 0 { self.own_surface.as_ref() } else { Some(&self.surface) };
            for (place, &node) in list.nodes.iter().enumerate() {
                let row = rows.next_if(|&(_, identity)| identity == (node, pass)).map(|(row, _)| row);
                let path = Bounds::of_points([moved(node)]).farthest(&motions[1 - pass]);
                if path <= list.clearance[place] || path <= FINE * surface.finest() {
                    continue;
                }
                // Lists are complete unless the node was faster than its velocity at the search.
                let lists = Some(&list.lists).filter(|_| row.is_some() && path <= self.vicinity.reach.listed());
                let [start, end] = [0, 1].map(|k| Ground {
                    nodes: &list.nodes,
                    lists,
                    kept: None,
                    surface,
                    boxes: None,
                    cones: [None; 2],
                    own,
                    own_facets: self.vicinity.own_facets.as_ref(),
                    material: self.vicinity.material_of(pass),
                    positions: &ends[k],
                    offsets: self.vicinity.thickness.at(step.t[k]),
                    rounding: half_digits::<T>().value(),
                });
                let likely = row.map(|row| self.rows.spots[row].facet);
                let (law, recovery) = (self.settings.given_law(), self.recovery());
                let crossing = Crossing { grounds: [start, end], place, likely, node, path, law, recovery };
                let closed = row.map(|row| step.closed.map(|flags| flags[row]));
                let velocity = |node: usize| self.nodes.vector(node, step.v);
                if let Err((what, path, gap)) = crossing.check(closed, velocity) {
                    return Err(step.rejected((node, pass), what, path, gap));
                }
            }
        }
        Ok(())
    }
}

impl Crossing<'_> {
    fn facet(&self, facet: usize) -> &Facet {
        &self.grounds[0].surface.facets()[facet]
    }

    /// Returns the reason for a rejection, the length of the path of the node, and the gap at its start. `closed`
    /// says whether its row, if any, was closed at the start and at the end.
    fn check(
        &self,
        closed: Option<[bool; 2]>,
        velocity: impl Fn(usize) -> Point,
    ) -> std::result::Result<(), (&'static str, f64, f64)> {
        let range = 2.0 * self.path;
        let [start, end] = &self.grounds;
        let before = closed.and_then(|_| start.closest(self.place, f64::INFINITY, self.likely));
        let after = end.closest(self.place, range, self.likely);
        let gap = before.map_or(f64::INFINITY, |stand| stand.gap);
        let Some(from) = before else {
            return match self.passes(f64::INFINITY) {
                true => Err(("was out of reach, and went through a facet", self.path, gap)),
                false => Ok(()),
            };
        };
        // The displacement relative to the closest point on the facet, and the linearized gap at the end.
        let against = |vector: &dyn Fn(usize) -> Point| {
            let nodes = self.facet(from.facet).nodes;
            let carried = nodes.iter().zip(from.weights);
            carried.fold(vector(self.node), |sum, (&vertex, weight)| add_scaled(sum, -weight, vector(vertex)))
        };
        let path = against(&|node| sub(end.positions[node], start.positions[node]));
        let length = norm(path);
        let coarse = length > COARSE * start.surface.finest();
        // Includes the growth of the offset.
        let linear = gap + dot(from.normal, path) - (end.offsets.factor - from.factor) * from.offset;
        if let Some([false, true]) = closed {
            let Some(to) = after.or_else(|| end.last(self.place, from.facet, range)) else {
                return Err(("was stopped where the surface has ended", length, gap));
            };
            let kept = kept_depth(gap, self.law.recovery(self.recovery));
            if (to.gap + kept).abs() > LARGEST_MISS * length {
                return Err(("was stopped away from the surface", length, gap));
            }
            let speed = against(&velocity);
            let speeds = [from.normal, to.normal].map(|normal| dot(normal, speed));
            if coarse && impacts_differ(speeds, dot(speed, speed)) {
                return Err(("was stopped along a normal that is not the one where it met the surface", length, gap));
            }
        }
        // Inside as the row predicts, or around an edge that the node was near.
        let explained = |to: Stand| {
            let turn = dot(from.normal, to.normal);
            let inside = to.gap < 0.0 && linear - to.gap <= LARGEST_MISS * length && turn > 0.5;
            inside || gap.max(-to.gap) < LARGEST_MISS * length && turn > -0.5
        };
        // A node that is already inside, for instance because an edge has penetrated beside it, may leave freely.
        let outside = gap > -half_digits::<f64>() * start.surface.finest();
        if coarse && outside && !after.is_some_and(explained) && self.passes(length) {
            return Err(("went through a facet", length, gap));
        }
        let turned = after.is_some_and(|to| dot(from.normal, to.normal) < 0.0);
        // Rigid laws recover a penetration slowly.
        if self.law.is_compliant() && gap < 0.0 && turned && -dot(from.normal, path) > STEEP * length {
            return Err(("went through the body that it was in", length, gap));
        }
        Ok(())
    }

    /// Whether the node passes a facet that it may be in contact with, from the front to the back.
    fn passes(&self, length: f64) -> bool {
        let Self { grounds: [start, end], place, node, .. } = *self;
        let own_normal = start.own_normal(place);
        let ends = [start.positions[node], end.positions[node]];
        let whole = Bounds::of_points(ends);
        let goes_through = |facet: usize, corners: [[Point; 4]; 2]| {
            let swept = Bounds::of_points(corners.iter().flatten().copied());
            if !whole.intersects(&swept) {
                return false;
            }
            let triangles: &[[usize; 3]] = match self.facet(facet).nodes().len() {
                4 => &[[0, 1, 2], [0, 2, 3]],
                _ => &[[0, 1, 2]],
            };
            let segment = self.facet(facet).nodes().len() == 2;
            triangles.iter().any(|triangle| {
                let corners = corners.map(|corners| triangle.map(|k| corners[k]));
                pierces(ends, corners, segment, length, |normal| start.meets((self.place, facet), normal, own_normal))
            })
        };
        start.near(place).any(|index| {
            let mut layers = start.layers(place, index).zip(end.layers(place, index));
            layers.any(|(from, to)| goes_through(index, [from, to]))
        })
    }
}

/// Whether a point passes through a triangle, or a segment in the plane, from the front to the back. Both move in
/// straight lines.
fn pierces(
    ends: [Point; 2],
    corners: [[Point; 3]; 2],
    segment: bool,
    length: f64,
    meets: impl Fn(Point) -> bool,
) -> bool {
    const HALVINGS: usize = 40;
    let at = |s: f64| {
        let between = |[from, to]: [Point; 2]| add_scaled(from, s, sub(to, from));
        let [a, b, c] = [0, 1, 2].map(|k| between([corners[0][k], corners[1][k]]));
        let shape = Shape::new([a, b, if segment { b } else { c }, c], if segment { 2 } else { 3 });
        (between(ends), shape)
    };
    let middle = [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 0.0];
    let height = |s: f64| {
        let (p, shape) = at(s);
        shape.normal(&middle).map(|normal| (dot(normal, sub(p, shape.corner(0))), normal))
    };
    let (Some((before, normal)), Some((after, _))) = (height(0.0), height(1.0)) else { return false };
    // A node that ends at a small depth, as over a convex corner, has not gone through. Its path is at least as long
    // as its change in height.
    if !(before >= 0.0 && after < -SHALLOW * length.min(before - after) && meets(normal)) {
        return false;
    }
    let (mut front, mut back) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let s = 0.5 * (front + back);
        match height(s).is_some_and(|(height, _)| height >= 0.0) {
            true => front = s,
            false => back = s,
        }
    }
    let (p, shape) = at(front);
    shape.holds(p)
}
