//! How the closest point of a facet slides as the node and the facet move: the effect of varying offsets on rows and
//! rates.

use super::projection::{Ground, Stand};
use super::shape::{Location, Point, Shape, add_scaled, dot};

/// The sum of the offsets of a node and of the closest point of a facet, without its factor.
///
/// With r = g n from the closest point S(ξ) to the node and w its velocity relative to the facet there, r · S,α = 0
/// gives A ξ̇ = w · S,α + g n · Ṡ,α with A = S,α · S,β − g n · S,αβ. The rate of the facet's offset o(ξ) is
/// o,α ξ̇_α = y · (w · S,α + g n · Ṡ,α) with A y = o,α.
struct Slide {
    /// S,α and o,α for one or two parameters of the facet (zero for a missing second one), and o,12.
    tangents: [Point; 2],
    slopes: [f64; 2],
    bend: f64,
    /// S,12, and the matrix A by its entries 11, 12 and 22.
    twist: Point,
    matrix: [f64; 3],
    /// The derivatives of the shape functions with respect to the parameters.
    derivatives: [[f64; 4]; 2],
}

impl Slide {
    /// None where the offset is constant on the facet, or the closest point is a vertex: then the offset does not
    /// slide.
    fn new(stand: &Stand, shape: &Shape, offsets: [f64; 4]) -> Option<Self> {
        let outside = Shape::new(offsets.map(|offset| [offset, 0.0, 0.0]), shape.corners().len());
        let on_line = |tangent: Point, slope: f64, derivatives: [f64; 4]| Self {
            tangents: [tangent, [0.0; 3]],
            slopes: [slope, 0.0],
            bend: 0.0,
            twist: [0.0; 3],
            matrix: [dot(tangent, tangent), 0.0, 1.0],
            derivatives: [derivatives, [0.0; 4]],
        };
        let slide = match stand.location {
            Location::Vertex(_) => return None,
            Location::Side(k) => on_line(shape.side(k), outside.side(k)[0], shape.along_side(k)),
            _ if shape.is_segment() => on_line(shape.side(0), outside.side(0)[0], [-1.0, 1.0, 0.0, 0.0]),
            _ => {
                let ([s, t], [one, other]) =
                    (shape.tangents_at(&stand.weights), outside.tangents_at(&stand.weights).map(|slope| slope[0]));
                let (ss, st, tt) = (dot(s, s), dot(s, t), dot(t, t));
                let curved = st - stand.distance * dot(stand.normal, shape.twist());
                // As for the acceleration of gaps, the facet is taken as flat at a focus of a warped facet.
                let convex = ss * tt - curved * curved > 1e-3 * (ss * tt - st * st);
                let (st, twist) = if convex { (curved, shape.twist()) } else { (st, [0.0; 3]) };
                Self {
                    tangents: [s, t],
                    slopes: [one, other],
                    bend: outside.twist()[0],
                    twist,
                    matrix: [ss, st, tt],
                    derivatives: shape.derivatives(&stand.weights),
                }
            }
        };
        (slide.slopes.iter().any(|slope| *slope != 0.0) || slide.bend != 0.0).then_some(slide)
    }

    /// A⁻¹ b.
    fn solve(&self, b: [f64; 2]) -> [f64; 2] {
        let [ss, st, tt] = self.matrix;
        let determinant = ss * tt - st * st;
        [(tt * b[0] - st * b[1]) / determinant, (ss * b[1] - st * b[0]) / determinant]
    }

    /// The derivatives of the offset with respect to the positions of the node and of the vertices.
    fn gradient(&self, stand: &Stand) -> [Point; 5] {
        let [y, z] = self.solve(self.slopes);
        let along = add_scaled(self.tangents[0].map(|x| y * x), z, self.tangents[1]);
        let mut gradient = [along; 5];
        for (k, entry) in gradient[1..].iter_mut().enumerate() {
            let turned = stand.distance * (y * self.derivatives[0][k] + z * self.derivatives[1][k]);
            *entry = add_scaled(along.map(|x| -stand.weights[k] * x), turned, stand.normal);
        }
        gradient
    }

    /// The first two time derivatives of the offset as node and facet move at constant velocities: w of the node
    /// relative to the closest point, Ṡ,α and Ṡ,12 of the facet.
    ///
    /// Differentiating the condition on the closest point once more, with ṙ = w − S,β ξ̇_β, gives
    /// A ξ̈ = −(2 Ṡ,β ξ̇_β + S,βγ ξ̇_β ξ̇_γ) · S,α + 2 ṙ · (Ṡ,α + S,αβ ξ̇_β) + 2 r · Ṡ,αβ ξ̇_β.
    fn rates(&self, stand: &Stand, w: Point, rates: [Point; 2], twisting: Point) -> [f64; 2] {
        let Self { tangents: [s, t], slopes, bend, twist, .. } = *self;
        let apart = stand.normal.map(|x| stand.distance * x);
        let [x, y] = self.solve([dot(w, s) + dot(apart, rates[0]), dot(w, t) + dot(apart, rates[1])]);
        let turned = add_scaled(rates[0].map(|rate| 2.0 * x * rate), 2.0 * y, rates[1]);
        let turned = add_scaled(turned, 2.0 * x * y, twist);
        let slip = add_scaled(add_scaled(w, -x, s), -y, t);
        let right = [(s, rates[0], y), (t, rates[1], x)].map(|(tangent, rate, other)| {
            2.0 * (dot(slip, add_scaled(rate, other, twist)) + other * dot(apart, twisting)) - dot(turned, tangent)
        });
        let [xx, yy] = self.solve(right);
        [slopes[0] * x + slopes[1] * y, slopes[0] * xx + slopes[1] * yy + 2.0 * bend * x * y]
    }
}

impl Ground<'_> {
    /// The derivatives of the sum of the offsets of a projection, at full size, with respect to the positions of its
    /// node and of the vertices of its facet; none if they are zero.
    pub(crate) fn slope(&self, stand: &Stand) -> Option<[Point; 5]> {
        if self.offsets.is_none() {
            return None;
        }
        let facet = &self.surface.facets()[stand.facet];
        let slide = Slide::new(stand, &facet.shape(self.positions), self.offsets.at_corners(facet))?;
        Some(slide.gradient(stand))
    }
}

impl Stand {
    /// The first two time derivatives of the sum of the offsets, at full size, as node and facet move at constant
    /// velocities: the velocity of the node, the facet and the velocities of its vertices, and the offsets of the
    /// vertices.
    pub(crate) fn sliding(&self, v: Point, (shape, velocity): (&Shape, &Shape), offsets: [f64; 4]) -> [f64; 2] {
        let Some(slide) = Slide::new(self, shape, offsets) else { return [0.0; 2] };
        let w = add_scaled(v, -1.0, velocity.point(&self.weights));
        let (rates, twisting) = match self.location {
            Location::Side(k) => ([velocity.side(k), [0.0; 3]], [0.0; 3]),
            _ => (velocity.tangents_at(&self.weights), velocity.twist()),
        };
        slide.rates(self, w, rates, twisting)
    }
}
