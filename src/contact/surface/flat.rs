//! Facets in a plane: shape functions at a point, and what they have in common with a line or another facet.

use super::offsets::range;
use super::polygon::{Polygon, cross, difference};
use crate::rounding::rounding;

/// A triangle or a quadrilateral in a plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flat {
    pub(super) corners: [[f64; 2]; 4],
    pub(super) count: usize,
}

impl Flat {
    /// The shape functions at a point. For quadrilaterals by Newton's method, which takes one iteration on
    /// parallelograms.
    #[inline]
    pub(super) fn weights_at(&self, p: [f64; 2]) -> [f64; 4] {
        const ITERATIONS: usize = 12;
        let r = difference(p, self.corners[0]);
        let solve = |a: [f64; 2], b: [f64; 2], r: [f64; 2]| {
            let determinant = cross(a, b);
            [cross(r, b) / determinant, cross(a, r) / determinant]
        };
        if self.count == 3 {
            let [a, b] = [1, 2].map(|k| difference(self.corners[k], self.corners[0]));
            let [s, t] = solve(a, b, r);
            return [1.0 - s - t, s, t, 0.0];
        }
        // Coordinates from 0 to 1: x = x₀ + s a + t b + s t c.
        let [a, b, c] = self.sides();
        let size = a.iter().chain(&b).fold(0.0_f64, |size, x| size.max(x.abs()));
        let skew = c[0].abs().max(c[1].abs());
        let [mut s, mut t] = [0.5; 2];
        for _ in 0..ITERATIONS {
            let missing = std::array::from_fn(|i| r[i] - s * a[i] - t * b[i] - s * t * c[i]);
            let [by_s, by_t] = [std::array::from_fn(|i| a[i] + t * c[i]), std::array::from_fn(|i| b[i] + s * c[i])];
            let [ds, dt] = solve(by_s, by_t, missing);
            (s, t) = (s + ds, t + dt);
            // The residual is now ds dt c.
            if (ds * dt).abs() * skew <= rounding(size) {
                break;
            }
        }
        [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t]
    }

    /// The interval of a line segment, in shares of its length, that lies inside; none if it is empty.
    pub(super) fn crossing(&self, from: [f64; 2], way: [f64; 2]) -> Option<[f64; 2]> {
        let (mut begin, mut end) = (0.0_f64, 1.0_f64);
        for k in 0..self.count {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % self.count]);
            let side = difference(b, a);
            // Height of the start over the side, and its gain along the segment.
            let (height, gain) = (cross(side, difference(from, a)), cross(side, way));
            if gain > 0.0 {
                begin = begin.max(-height / gain);
            } else if gain < 0.0 {
                end = end.min(-height / gain);
            } else if height < 0.0 {
                return None;
            }
        }
        (begin < end).then_some([begin, end])
    }

    /// The common part with another polygon of opposite orientation, if its area is above `least` (Sutherland and
    /// Hodgman, Commun. ACM 17, 1974).
    #[inline]
    pub(super) fn common(&self, other: &Self, least: f64) -> Option<Polygon> {
        let is_apart = |axis: usize| {
            let ends = [self, other].map(|flat| range(flat.corners[..flat.count].iter().map(|x| x[axis])));
            ends[0][0] > ends[1][1] || ends[1][0] > ends[0][1]
        };
        if is_apart(0) || is_apart(1) {
            return None;
        }
        let mut polygon = Polygon::default();
        other.corners[..other.count].iter().rev().for_each(|&corner| polygon.push(corner));
        for k in 0..self.count {
            polygon = polygon.cut(self.corners[k], self.corners[(k + 1) % self.count]);
        }
        (polygon.area() > least).then_some(polygon)
    }
}
