//! Quadrature over parts of quadrilaterals that are not parallelograms, exact in the sum over all parts.
//!
//! Positions in such a quadrilateral are x = x₀ + s a + t b + s t c, so that its shape functions are combinations of
//! 1, x and s t. A polynomial rule integrates all but ∫ s t dA exactly, because s t is not a polynomial of x. By
//! Green's theorem that integral is ∮ Q dt around a part, with ∂Q/∂s = s t J and the Jacobian J of the coordinates,
//! which is linear in s and t. Along the sides of the quadrilateral Q dt is a polynomial, which Gauss' rule
//! integrates exactly. Along a cut it is not, but the parts on both sides have opposite errors. So sums over all
//! parts are exact, and so are the nodal forces of a constant pressure. The weights of the rule are changed as little
//! as possible to match the integral while ∫ dA and ∫ x dA stay.

use super::flat::Flat;
use super::polygon::{cross, difference};
use crate::rounding::{DEPENDENT, SKEWED};

/// The most points of a rule: six triangles of an octagon, twelve points each.
const MOST: usize = 72;

/// Largest relative change of a weight; only rounding leads to larger ones.
const MOST_CHANGE: f64 = 0.5;

/// Gauss' rule of twelve points on a line of length one (degree 23): weight, and distance from the middle to either
/// side.
const LINE: [(f64, f64); 6] = [
    (0.023_587_668_193_255_914, 0.490_780_317_123_359_6),
    (0.053_469_662_997_659_21, 0.452_058_628_185_237_45),
    (0.080_039_164_271_673_11, 0.384_951_337_097_152_35),
    (0.101_583_713_361_532_96, 0.293_658_977_143_308_74),
    (0.116_746_268_269_177_4, 0.183_915_749_499_090_1),
    (0.124_573_522_906_701_39, 0.062_616_704_255_734_46),
];

/// A quadrature point: its weight, position, and the shape functions of both facets.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RulePoint {
    pub(super) weight: f64,
    pub(super) at: [f64; 2],
    pub(super) slave: [f64; 4],
    pub(super) master: [f64; 4],
}

#[derive(Clone, Copy, Debug)]
pub(super) struct RulePoints {
    points: [RulePoint; MOST],
    count: usize,
}

impl RulePoints {
    pub(super) fn new() -> Self {
        Self { points: [RulePoint::default(); MOST], count: 0 }
    }

    pub(super) fn push(&mut self, point: RulePoint) {
        // There is room for the points of a polygon of eight corners.
        if let Some(place) = self.points.get_mut(self.count) {
            *place = point;
            self.count += 1;
        }
    }

    pub(super) fn as_slice(&self) -> &[RulePoint] {
        &self.points[..self.count]
    }

    /// Changes the weights until ∫ s t dA of both facets equals its contour integral around the polygon.
    ///
    /// The factors of the weights are 1 + Σ λ_j f_j, with 1, x, y and s t of both facets as functions f_j less their
    /// values at the first point. Then the missing integrals are a linear function of λ, with a Gram matrix.
    pub(super) fn correct(&mut self, flats: [&Flat; 2], polygon: &[[f64; 2]]) {
        let points = &mut self.points[..self.count];
        let Some(&first) = points.first() else { return };
        let functions = |point: &RulePoint| {
            let [x, y] = difference(point.at, first.at);
            [1.0, x, y, point.slave[2] - first.slave[2], point.master[2] - first.master[2]]
        };
        let mut gram = [[0.0; 5]; 5];
        for point in &*points {
            let values = functions(point);
            for (row, value) in gram.iter_mut().zip(values) {
                row.iter_mut().zip(values).for_each(|(entry, other)| *entry += point.weight * value * other);
            }
        }
        // On a parallelogram, and on a triangle, s t is a polynomial, which the rule integrates exactly.
        let mut missing = [0.0; 5];
        for (k, (flat, first)) in [(3, (flats[0], first.slave[2])), (4, (flats[1], first.master[2]))] {
            if flat.is_skewed() {
                missing[k] = flat.integral_of_product(polygon) - gram[0][k] - first * gram[0][0];
            }
        }
        let multipliers = solve(gram, missing);
        let change = |point: &RulePoint| functions(point).iter().zip(multipliers).map(|(f, by)| f * by).sum::<f64>();
        if points.iter().all(|point| change(point).abs() < MOST_CHANGE) {
            for point in points.iter_mut() {
                point.weight *= 1.0 + change(point);
            }
        }
    }
}

/// Solves a symmetric semidefinite system by elimination; unknowns of linearly dependent functions are zero.
fn solve(mut matrix: [[f64; 5]; 5], mut right: [f64; 5]) -> [f64; 5] {
    let sizes: [f64; 5] = std::array::from_fn(|k| matrix[k][k]);
    let is_pivot = |matrix: &[[f64; 5]; 5], k: usize| matrix[k][k] > DEPENDENT * sizes[k];
    for k in (0..5).filter(|&k| sizes[k] > 0.0) {
        if is_pivot(&matrix, k) {
            let pivot = matrix[k];
            for i in k + 1..5 {
                let share = matrix[i][k] / pivot[k];
                (k..5).for_each(|j| matrix[i][j] -= share * pivot[j]);
                right[i] -= share * right[k];
            }
        }
    }
    let mut x = [0.0; 5];
    for k in (0..5).rev().filter(|&k| is_pivot(&matrix, k)) {
        let known: f64 = (k + 1..5).map(|j| matrix[k][j] * x[j]).sum();
        x[k] = (right[k] - known) / matrix[k][k];
    }
    x
}

impl Flat {
    /// Whether it is a quadrilateral that is not a parallelogram.
    pub(super) fn is_skewed(&self) -> bool {
        let [a, b, c] = self.sides();
        let size = |x: [f64; 2]| x[0].hypot(x[1]);
        self.count == 4 && size(c) > SKEWED * size(a).max(size(b))
    }

    /// The vectors a, b and c of a quadrilateral.
    pub(super) fn sides(&self) -> [[f64; 2]; 3] {
        let [x0, x1, x2, x3] = self.corners;
        let (a, b) = (difference(x1, x0), difference(x3, x0));
        [a, b, difference(difference(x2, x0), [a[0] + b[0], a[1] + b[1]])]
    }

    /// ∫ s t dA over a counterclockwise polygon, up to errors along cuts, which cancel in the sum over all parts.
    fn integral_of_product(&self, polygon: &[[f64; 2]]) -> f64 {
        let [a, b, c] = self.sides();
        let (constant, by_s, by_t) = (cross(a, b), cross(a, c), cross(c, b));
        let mut sum = 0.0;
        for (k, from) in polygon.iter().enumerate() {
            let to = polygon[(k + 1) % polygon.len()];
            let way = difference(to, *from);
            for (weight, place) in LINE.into_iter().flat_map(|(weight, off)| [(weight, 0.5 - off), (weight, 0.5 + off)])
            {
                let [_, w1, w2, w3] = self.weights_at([from[0] + place * way[0], from[1] + place * way[1]]);
                let (s, t) = (w1 + w2, w2 + w3);
                let along = [a[0] + t * c[0], a[1] + t * c[1]];
                let area = constant + s * by_s + t * by_t;
                let antiderivative = t * s * s * (constant / 2.0 + s * by_s / 3.0 + t * by_t / 2.0);
                sum += weight * antiderivative * cross(along, way) / area;
            }
        }
        sum
    }
}
