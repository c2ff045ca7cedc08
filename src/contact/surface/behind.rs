//! The material behind the facets of a surface: how far a ray that goes into the body stays inside of it.
//!
//! Where a point x_s of one body is behind a facet of another one by d, the ray from x_s into its own body meets that
//! facet from inside of the other body. If the bodies are apart, it leaves the one before it enters the other: their
//! thicknesses t along the ray have t₁ + t₂ ≤ d. If they are in each other by d, both are there all along: t₁ + t₂ ≥
//! 2 d. What is met with less than [`ENOUGH`] d is met through both bodies: it is a far side, and no contact.

use super::search::Neighborhood;
use super::shape::{Point, add_scaled, dot};
use super::{Base, Facet, Surface};

/// Greatest cosine between the normals of two facets of a body such that a ray into the one may leave by the other,
/// once the body has bent.
const LEAVING: f64 = 0.5;

/// The same of facets that tell how thick the material is: by sides across a right angle a ray leaves only if the body
/// has bent, and far from here then.
const OPPOSITE: f64 = -0.2;

/// Share of the thickness in the reference configuration that is left at least, however the body deforms.
const LEFT: f64 = 0.5;

/// In shares of the depth, the thickness of both bodies together below which a facet is met through them: halfway
/// between bodies apart and bodies in each other.
const ENOUGH: f64 = 1.5;

/// Share of a facet up to which depths are rounding.
const ROUNDING: f64 = 1e-9;

/// For each facet of a surface, those that a ray into the body may leave by.
#[derive(Debug)]
pub(crate) struct Behind {
    lists: Neighborhood,
    /// Least thickness behind each facet, in the reference configuration: infinite if nothing is as near.
    thickness: Vec<f64>,
}

/// A facet of a body that may be met by another one.
#[derive(Clone, Copy)]
pub(crate) struct Side<'a> {
    pub(crate) surface: &'a Surface,
    pub(crate) behind: &'a Behind,
    pub(crate) facet: usize,
}

impl Behind {
    /// Looks up to a distance of `range` in the reference configuration.
    pub(crate) fn new(surface: &Surface, coordinates: &[Point], range: f64) -> Self {
        let boxes = || surface.boxes(coordinates);
        let normals: Vec<_> = surface.facets().iter().map(|facet| facet.normal(coordinates)).collect();
        let cosine = |one: usize, other: usize| match (normals[one], normals[other]) {
            (Some(one), Some(other)) => dot(one, other),
            _ => f64::INFINITY,
        };
        let mut lists = Neighborhood::default();
        lists.build(boxes(), boxes(), range);
        lists.retain(|one, other| one != other && cosine(one, other) < LEAVING);
        let heights = |facet: &Facet, normal: Point| {
            let heights = facet.nodes().iter().map(move |&node| dot(normal, coordinates[node]));
            heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        };
        let thickness = |(index, facet): (usize, &Facet)| {
            let Some(normal) = normals[index] else { return 0.0 };
            let [lowest, _] = heights(facet, normal);
            let opposite = lists.of(index).iter().filter(|&&other| cosine(index, other) < OPPOSITE);
            // (Along the normal: no more than the distance.)
            let below = opposite.map(|&other| lowest - heights(&surface.facets()[other], normal)[1]);
            below.fold(f64::INFINITY, f64::min).max(0.0)
        };
        let thickness = surface.facets().iter().enumerate().map(thickness).collect();
        Self { lists, thickness }
    }
}

impl Side<'_> {
    /// How far a ray from a point of the facet stays in the body; infinite if it leaves nowhere near.
    fn inside(&self, x: Point, direction: Point, positions: &[Point]) -> f64 {
        let leaves = |&other: &usize| self.surface.facets()[other].shape(positions).left_by(x, direction);
        self.behind.lists.of(self.facet).iter().filter_map(leaves).fold(f64::INFINITY, f64::min)
    }

    fn is_thick(&self) -> bool {
        self.behind.lists.of(self.facet).is_empty()
    }
}

/// Whether a slave facet, with its plane as `base`, lies on the far side of its body from where a master facet lies on
/// the far side of its own: for most of what they have in common. (`base` [sees](Base::see_beside) what is beside it.)
pub(crate) fn is_far_side(slave: Side<'_>, master: Side<'_>, base: &Base, positions: &[Point]) -> bool {
    if slave.is_thick() || master.is_thick() {
        return false;
    }
    let facet = &master.surface.facets()[master.facet];
    let deepest = base.lowest(facet, positions);
    let [one, other] = [slave, master].map(|side| side.behind.thickness[side.facet]);
    if deepest >= -ROUNDING * base.shape.size() || -deepest < LEFT * one.min(other) {
        return false;
    }
    let (mut far, mut all) = (0.0, 0.0);
    base.each_sample(facet, positions, &mut |sample| {
        let (depth, x) = (-sample.gap, base.shape.point(&sample.slave));
        if base.is_beside(add_scaled(x, -depth, base.normal), -depth) {
            return;
        }
        all += sample.area;
        if depth > 0.0 {
            let under = slave.inside(x, base.normal.map(|x| -x), positions);
            let over = || master.inside(add_scaled(x, -depth, base.normal), base.normal, positions);
            far += if under < ENOUGH * depth && under + over() < ENOUGH * depth { sample.area } else { 0.0 };
        }
    });
    2.0 * far > all
}
