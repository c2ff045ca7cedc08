//! The part of a slave facet that a master facet covers, and quadrature points on it.
//!
//! Both are projected onto the plane through the middle of the slave facet, along its normal there. Lines between
//! nodes stay lines, so that the common part is a polygon (Puso and Laursen, Comput. Methods Appl. Mech. Eng. 193,
//! 2004, section 4). In two dimensions it is a part of a line.

use super::exact::{RulePoint, RulePoints};
use super::flat::Flat;
use super::polygon::Rule;
use super::shape::{Point, Shape, add_scaled, cross, dot, middle, norm, sub, unit};
use super::{Facet, Surface};
use crate::rounding::SLIVER;

/// A quadrature point on the part of a slave facet that a master facet covers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// Its share of the area (length in two dimensions) in the slave facet's plane.
    pub(crate) area: f64,
    /// Shape functions of the slave facet, and of the master facet at its intersection with the normal through the
    /// point.
    pub(crate) slave: [f64; 4],
    pub(crate) master: [f64; 4],
    /// The distance from slave to master along the slave facet's normal: negative where they penetrate each other.
    pub(crate) gap: f64,
    /// ν/(ν · n), with the normal ν of the master facet there and the normal n of the slave facet. The gap changes by
    /// its product with the motion of the master point relative to the slave point.
    pub(crate) direction: Point,
}

/// A point of a slave facet that lies below an open side of the master surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RimSample {
    /// Its share of the length in the plane (one in two dimensions).
    pub(crate) length: f64,
    pub(crate) slave: [f64; 4],
    pub(crate) master: [f64; 4],
    pub(crate) gap: f64,
    /// The outward unit normal of that side in the slave's plane.
    pub(crate) outward: Point,
}

/// A slave facet and the plane through its middle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Base {
    pub(crate) shape: Shape,
    pub(crate) normal: Point,
    /// The product of the tangents there, along the normal. For a segment the second tangent is the unit vector out
    /// of plane.
    pub(crate) product: Point,
    axes: [Point; 2],
    /// Its corners in the plane.
    corners: [[f64; 2]; 4],
    count: usize,
    /// By side, the facet behind a sharp edge: a point of it, and its normal.
    beside: [Option<[Point; 2]>; 4],
    /// Whether it is a part of a facet of second order.
    curved: bool,
}

/// Least cosine between the normal of a facet and the reversed normal of another one in contact: 60 degrees.
const FACING: f64 = 0.5;

/// Largest cosine between the normals of facets at a sharp edge: 37 degrees.
const SHARP: f64 = 0.8;

/// A point below a facet belongs to a facet behind a sharp edge if its depth below that one is at most this share of
/// its depth below this facet.
const NEARER: f64 = 0.25;

impl Base {
    /// None if the facet has no normal.
    #[inline]
    pub(crate) fn new(facet: &Facet, positions: &[Point]) -> Option<Self> {
        let (shape, count) = (facet.shape(positions), facet.nodes().len());
        let [first, second] = shape.tangents_at(&middle(count));
        let product = cross(first, second);
        let normal = unit(product)?;
        let along = unit(first)?;
        let axes = [along, cross(normal, along)];
        let (corners, curved) = ([[0.0; 2]; 4], facet.whole.is_some());
        let mut base = Self { shape, normal, product, axes, corners, count, curved, beside: [None; 4] };
        base.corners = std::array::from_fn(|k| base.in_plane(shape.corner(k)));
        Some(base)
    }

    /// Stores the facets behind sharp edges, so that there is no contact through the body: points that have
    /// penetrated one of these, or lie behind it, are not below this facet.
    ///
    /// `normals` are the normals at the middles of all facets.
    pub(crate) fn see_beside(
        &mut self,
        surface: &Surface,
        index: usize,
        (positions, normals): (&[Point], &[Option<Point>]),
    ) {
        for side in 0..self.count {
            let Some((other, _)) = surface.neighbor(index, side) else { continue };
            let sharp = |normal: &Point| dot(*normal, self.normal) < SHARP;
            self.beside[side] = normals[other].filter(sharp).and_then(|normal| {
                let point = surface.facets()[other].shape(positions).middle();
                let convex = dot(self.normal, sub(point, self.shape.corner(side))) < 0.0;
                convex.then_some([point, normal])
            });
        }
    }

    /// Whether a point x, at `gap` above this facet, belongs to a facet behind a sharp edge.
    pub(super) fn is_beside(&self, x: Point, gap: f64) -> bool {
        let is_above = |[point, normal]: &[Point; 2]| dot(*normal, sub(x, *point)) > NEARER * gap;
        gap < 0.0 && self.beside.iter().flatten().any(is_above)
    }

    /// Whether a master facet belongs to facets behind sharp edges: with more than half of the area that it covers
    /// here, or with all corners if it covers nothing.
    ///
    /// Each search decides this for the whole facet. Decided point by point at each relinearization, points appeared
    /// and disappeared with the contact forces, and the iteration did not converge.
    pub(crate) fn has_beside(&self, facet: &Facet, positions: &[Point]) -> bool {
        if self.beside.iter().all(Option::is_none) || self.lowest(facet, positions) >= 0.0 {
            return false;
        }
        let is_beside = |sample: &Sample| {
            self.is_beside(add_scaled(self.shape.point(&sample.slave), sample.gap, self.normal), sample.gap)
        };
        let corners = || facet.nodes().iter().zip(self.heights(facet, positions));
        self.mostly(facet, positions, is_beside)
            .unwrap_or_else(|| corners().all(|(&node, gap)| self.is_beside(positions[node], gap)))
    }

    /// Whether a condition holds on more than half of the area that a master facet covers; none if it covers nothing.
    fn mostly(&self, facet: &Facet, positions: &[Point], holds: impl Fn(&Sample) -> bool) -> Option<bool> {
        let (mut some, mut all) = (0.0, 0.0);
        self.each_sample(facet, positions, &mut |sample| {
            all += sample.area;
            some += if holds(sample) { sample.area } else { 0.0 };
        });
        (all > 0.0).then_some(2.0 * some > all)
    }

    /// Whether more than half of the area that a master facet covers is deeper than `depth` behind this facet.
    pub(crate) fn is_deeper(&self, facet: &Facet, positions: &[Point], depth: f64) -> bool {
        self.lowest(facet, positions) < -depth
            && self.mostly(facet, positions, |sample| -sample.gap > depth) == Some(true)
    }

    #[inline]
    fn in_plane(&self, x: Point) -> [f64; 2] {
        let r = sub(x, self.shape.corner(0));
        [dot(r, self.axes[0]), dot(r, self.axes[1])]
    }

    /// The heights of a facet's corners above the first corner of this one, along its normal.
    #[inline]
    fn heights<'a>(&'a self, facet: &'a Facet, positions: &'a [Point]) -> impl Iterator<Item = f64> + 'a {
        facet.nodes().iter().map(|&node| dot(self.normal, sub(positions[node], self.shape.corner(0))))
    }

    /// Whether a facet with this normal faces this one and is not behind it by more than `depth`.
    #[inline]
    pub(crate) fn may_meet(&self, normal: Point, facet: &Facet, positions: &[Point], depth: f64) -> bool {
        dot(normal, self.normal) < -FACING && self.heights(facet, positions).any(|height| height > -depth)
    }

    /// The height of the lowest corner of a facet above the highest corner of this one; negative if it is below.
    pub(crate) fn lowest(&self, facet: &Facet, positions: &[Point]) -> f64 {
        let corner = |x: &Point| dot(self.normal, sub(*x, self.shape.corner(0)));
        let highest = self.shape.corners().iter().map(corner).fold(0.0, f64::max);
        self.heights(facet, positions).fold(f64::INFINITY, f64::min) - highest
    }

    /// Calls `act` with the quadrature points of the part that a master facet covers.
    pub(crate) fn each_sample(&self, facet: &Facet, positions: &[Point], act: &mut impl FnMut(&Sample)) {
        let (shape, count) = (facet.shape(positions), facet.nodes().len());
        let corners = std::array::from_fn(|k| self.in_plane(shape.corner(k)));
        let master = Flat { corners, count };
        if self.count == 2 {
            return self.along_a_line(&shape, &master, act);
        }
        let own = Flat { corners: self.corners, count: self.count };
        let Some(common) = own.common(&master, SLIVER * self.shape.square_of_size()) else { return };
        let (curved, quadrilateral) = (self.curved || facet.whole.is_some(), self.count == 4 || count == 4);
        let rule = match (curved, quadrilateral) {
            (false, false) => Rule::Two,
            (true, true) => Rule::Six,
            _ => Rule::Four,
        };
        let mut skewed = (own.is_skewed() || master.is_skewed()).then(RulePoints::new);
        common.each_point(rule, &mut |weight, at| {
            let (slave, master) = (own.weights_at(at), master.weights_at(at));
            match &mut skewed {
                Some(points) => points.push(RulePoint { weight, at, slave, master }),
                None => self.sample(weight, slave, &shape, master, act),
            }
        });
        if let Some(points) = &mut skewed {
            points.correct([&own, &master], common.corners());
            for point in points.as_slice() {
                self.sample(point.weight, point.slave, &shape, point.master, act);
            }
        }
    }

    fn along_a_line(&self, shape: &Shape, master: &Flat, act: &mut impl FnMut(&Sample)) {
        let (length, [from, to]) = (self.corners[1][0], [master.corners[0][0], master.corners[1][0]]);
        let (begin, end) = (from.min(to).max(0.0), from.max(to).min(length));
        if end - begin <= SLIVER * length {
            return;
        }
        for (weight, place) in LINE {
            let x = begin + place * (end - begin);
            let line = |from: f64, to: f64| [(to - x) / (to - from), (x - from) / (to - from), 0.0, 0.0];
            self.sample(weight * (end - begin), line(0.0, length), shape, line(from, to), act);
        }
    }

    #[inline]
    fn sample(&self, area: f64, slave: [f64; 4], shape: &Shape, master: [f64; 4], act: &mut impl FnMut(&Sample)) {
        let Some(normal) = shape.normal(&master) else { return };
        let cosine = dot(normal, self.normal);
        let point = shape.point(&master);
        let gap = dot(self.normal, sub(point, self.shape.point(&slave)));
        // A point of a warped facet may face away.
        if cosine < 0.0 && gap.is_finite() {
            act(&Sample { area, slave, master, gap, direction: normal.map(|x| x / cosine) });
        }
    }

    /// Calls `act` with quadrature points below the open sides of a master facet.
    pub(crate) fn each_rim_sample(
        &self,
        facet: &Facet,
        open: [bool; 4],
        positions: &[Point],
        act: &mut impl FnMut(&RimSample),
    ) {
        let (shape, count) = (facet.shape(positions), facet.nodes().len());
        let corners: [[f64; 2]; 4] = std::array::from_fn(|k| self.in_plane(shape.corner(k)));
        let own = Flat { corners: self.corners, count: self.count };
        for k in (0..count).filter(|&k| open[k]) {
            let (from, to) = (corners[k], corners[(k + 1) % count]);
            let mut sample = |length: f64, share: f64, slave: [f64; 4], outward: [f64; 2]| {
                let master = shape.on_side(k, share);
                let point = shape.point(&master);
                let gap = dot(self.normal, sub(point, self.shape.point(&slave)));
                let [along, across] = outward;
                let outward = add_scaled(self.axes[0].map(|x| along * x), across, self.axes[1]);
                act(&RimSample { length, slave, master, gap, outward });
            };
            if self.count == 2 {
                // The sides of a segment are its ends.
                let (x, length) = (from[0], self.corners[1][0]);
                if x > 0.0 && x < length {
                    sample(1.0, 0.0, [1.0 - x / length, x / length, 0.0, 0.0], [(from[0] - to[0]).signum(), 0.0]);
                }
                continue;
            }
            let way = [to[0] - from[0], to[1] - from[1]];
            let length = way[0].hypot(way[1]);
            let Some([begin, end]) = own.crossing(from, way) else { continue };
            // Seen from the slave the master's corners are in clockwise order, so its outside is on the left of each
            // side.
            let outward = [-way[1] / length, way[0] / length];
            for (weight, place) in LINE {
                let share = begin + place * (end - begin);
                let slave = own.weights_at([from[0] + share * way[0], from[1] + share * way[1]]);
                sample(weight * (end - begin) * length, share, slave, outward);
            }
        }
    }

    /// The product t₁ × t₂ of the tangents at the point with these shape functions, and the derivatives by the
    /// corners of its component along n, the area per unit of the facet's coordinates. The second tangent of a
    /// segment is the unit vector out of plane.
    #[inline]
    pub(crate) fn stretch(&self, weights: &[f64; 4]) -> (Point, [Point; 4]) {
        let tangents = self.shape.tangents_at(weights);
        (cross(tangents[0], tangents[1]), self.turned_by(tangents, weights, self.normal))
    }

    /// An orthonormal frame that turns with the facet: its first tangent at the middle, the vector across it, and n.
    pub(crate) fn frame(&self) -> [Point; 3] {
        [self.axes[0], self.axes[1], self.normal]
    }

    /// The derivatives of θ · q by the corners, for a vector q and the small rotation θ of [`frame`](Self::frame).
    ///
    /// The part of θ across n is n × δn. Along n it is e₂ · δe₁ with the first two vectors e₁ and e₂.
    pub(crate) fn rotated(&self, q: Point) -> [Point; 4] {
        let weights = middle(self.count);
        let [first, _] = self.shape.tangents_at(&weights);
        let tilted = self.turned(&weights, cross(q, self.normal).map(|x| x / norm(self.product)));
        let spin = dot(self.normal, q) / norm(first);
        let [by_corner, _] = self.shape.derivatives(&weights);
        std::array::from_fn(|k| add_scaled(tilted[k], spin * by_corner[k], self.axes[1]))
    }

    /// The gradient, by the slave point, of a function with these values at the corners of a master facet, at its
    /// intersection with the ray of this facet. It lies in the facet's plane, because the ray moves with the point.
    ///
    /// With d the vectors across n whose products with the tangents are 0 and 1, the coordinate ξ of the intersection
    /// changes by dξ = d · dx.
    pub(crate) fn slope(&self, facet: &Facet, positions: &[Point], weights: &[f64; 4], values: &[f64; 4]) -> Point {
        let shape = facet.shape(positions);
        let change = shape.derivatives(weights).map(|by| by.iter().zip(values).map(|(by, value)| by * value).sum());
        self.gradient(&shape, weights, change)
    }

    /// As [`slope`](Self::slope), for the height along n of a master facet of second order over its linear part.
    pub(crate) fn slope_of_second_order(&self, facet: &Facet, positions: &[Point], weights: &[f64; 4]) -> Point {
        let Some(whole) = &facet.whole else { return [0.0; 3] };
        let shape = facet.shape(positions);
        let slopes = whole.excess_slopes(weights, &shape.derivatives(weights));
        let change = slopes.map(|slopes| dot(self.normal, facet.combine(&slopes, positions)));
        self.gradient(&shape, weights, change)
    }

    /// The gradient of a function with these derivatives with respect to the coordinates of a master facet.
    fn gradient(&self, shape: &Shape, weights: &[f64; 4], change: [f64; 2]) -> Point {
        let [first, second] = shape.tangents_at(weights);
        let across = [cross(second, self.normal), cross(self.normal, first)];
        let area = dot(first, across[0]);
        let [along, beside] = change;
        add_scaled(across[0].map(|x| along / area * x), beside / area, across[1])
    }

    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// The derivatives of `vector · (t₁ × t₂)` by the corners, with the tangents t at the point with these shape
    /// functions.
    #[inline]
    pub(crate) fn turned(&self, weights: &[f64; 4], vector: Point) -> [Point; 4] {
        self.turned_by(self.shape.tangents_at(weights), weights, vector)
    }

    #[inline]
    fn turned_by(&self, [first, second]: [Point; 2], weights: &[f64; 4], vector: Point) -> [Point; 4] {
        // The second tangent of a segment is constant.
        let [by_first, by_second] = [cross(second, vector), cross(vector, first)];
        let [one, other] = self.shape.derivatives(weights);
        std::array::from_fn(|k| add_scaled(by_first.map(|x| one[k] * x), other[k], by_second))
    }
}

/// Gauss' rule of three points on a line of length one (degree 5): weight and position.
const LINE: [(f64, f64); 3] =
    [(5.0 / 18.0, 0.112_701_665_379_258_31), (8.0 / 18.0, 0.5), (5.0 / 18.0, 0.887_298_334_620_741_7)];
