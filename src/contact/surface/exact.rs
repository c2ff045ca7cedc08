//! Quadrature over parts of quadrilaterals that are not parallelograms, exact in the sum over all parts.
//!
//! Positions in such a quadrilateral are x = x₀ + s a + t b + s t c, so that its shape functions are combinations of
//! 1, x and s t. A polynomial rule integrates all but ∫ s t dA exactly, because s t is not a polynomial of x. By
//! Green's theorem that integral is ∮ Q dt around a part, with ∂Q/∂s = s t J and the Jacobian J of the coordinates,
//! which is linear in s and t. Along the sides of the quadrilateral Q dt is a polynomial, which Gauss' rule
//! integrates exactly. Along a cut it is not, but the parts on both sides have opposite errors. So sums over all
//! parts are exact, and so are the nodal forces of a constant pressure. The weights of the rule are changed as little
//! as possible to match the integral while ∫ dA and ∫ x dA stay.

use super::overlap::Flat;

/// The most points of a rule: six triangles of an octagon, twelve points each.
const MOST: usize = 72;

/// Deviation from a parallelogram, as a share of the sides, below which the rule is not corrected.
const SKEWED: f64 = 1e-4;

/// Share of the square of a function that is left after projection, below which it counts as linearly dependent.
const ALIKE: f64 = 1e-12;

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
    pub(super) fn correct(&mut self, [slave, master]: [&Flat; 2], polygon: &[[f64; 2]]) {
        let count = self.count;
        let points = &self.points[..count];
        let Some(first) = points.first().map(|point| point.at) else { return };
        let sum = |f: &Function, g: &Function| -> f64 {
            points.iter().zip(f.iter().zip(g)).map(|(point, (f, g))| point.weight * f * g).sum()
        };
        // Makes a function orthogonal to another one with this sum of squares. Values behind the last point are not
        // read.
        let leave_out = |function: &mut Function, other: &Function, square: f64| {
            if square > 0.0 {
                let share = sum(function, other) / square;
                function[..count].iter_mut().zip(&other[..count]).for_each(|(x, other)| *x -= share * other);
            }
        };
        let of = |value: &dyn Fn(&RulePoint) -> f64| -> Function {
            let mut function = [0.0; MOST];
            function.iter_mut().zip(points).for_each(|(x, point)| *x = value(point));
            function
        };
        // The functions whose integrals must stay, made orthogonal; then the missing integrals.
        let one = of(&|_| 1.0);
        let mut kept = [one, of(&|point| point.at[0] - first[0]), of(&|point| point.at[1] - first[1])];
        let mut squares = [0.0; 3];
        for k in 0..3 {
            let (before, this) = kept.split_at_mut(k);
            before.iter().zip(squares).for_each(|(other, square)| leave_out(&mut this[0], other, square));
            squares[k] = sum(&this[0], &this[0]);
        }
        let mut factors: Function = [1.0; MOST];
        let mut before: Option<(Function, f64, f64)> = None;
        for (flat, product) in [(slave, of(&|point| point.slave[2])), (master, of(&|point| point.master[2]))] {
            // Shape functions of a triangle are linear.
            if flat.count < 4 {
                continue;
            }
            // On a parallelogram s t is a polynomial, which the rule integrates exactly. The new weights must keep
            // that.
            let mut missing = match flat.is_skewed() {
                true => flat.integral_of_product(polygon) - sum(&product, &one),
                false => 0.0,
            };
            let mut rest = product;
            kept.iter().zip(squares).for_each(|(other, square)| leave_out(&mut rest, other, square));
            let whole = sum(&rest, &rest);
            if let Some((other, square, of_other)) = &before {
                missing -= sum(&rest, other) / square * of_other;
                leave_out(&mut rest, other, *square);
            }
            let square = sum(&rest, &rest);
            let largest = rest[..self.count].iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            if square > ALIKE * whole && missing.abs() * largest < MOST_CHANGE * square {
                factors[..count].iter_mut().zip(&rest).for_each(|(factor, rest)| *factor += missing / square * rest);
                before = Some((rest, square, missing));
            }
        }
        self.points.iter_mut().zip(factors).for_each(|(point, factor)| point.weight *= factor);
    }
}

type Function = [f64; MOST];

fn cross([a, b]: [f64; 2], [c, d]: [f64; 2]) -> f64 {
    a * d - b * c
}

impl Flat {
    /// Whether it is a quadrilateral that is not a parallelogram.
    pub(super) fn is_skewed(&self) -> bool {
        let [a, b, c] = self.sides();
        let size = |x: [f64; 2]| x[0].hypot(x[1]);
        self.count == 4 && size(c) > SKEWED * size(a).max(size(b))
    }

    /// The vectors a, b and c of a quadrilateral.
    fn sides(&self) -> [[f64; 2]; 3] {
        let from = |k: usize| -> [f64; 2] { std::array::from_fn(|i| self.corners[k][i] - self.corners[0][i]) };
        let (a, b) = (from(1), from(3));
        [a, b, std::array::from_fn(|i| from(2)[i] - a[i] - b[i])]
    }

    /// ∫ s t dA over a counterclockwise polygon, up to errors along cuts, which cancel in the sum over all parts.
    fn integral_of_product(&self, polygon: &[[f64; 2]]) -> f64 {
        let [a, b, c] = self.sides();
        let (constant, by_s, by_t) = (cross(a, b), cross(a, c), cross(c, b));
        let mut sum = 0.0;
        for (k, from) in polygon.iter().enumerate() {
            let to = polygon[(k + 1) % polygon.len()];
            let way = [to[0] - from[0], to[1] - from[1]];
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
