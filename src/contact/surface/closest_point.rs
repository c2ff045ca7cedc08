//! How the closest point of a facet moves with the node and the facet: gap acceleration, and the effect of varying
//! offsets on rows and rates.

use super::projection::{Ground, Stand};
use super::shape::{Location, Point, Shape, add_scaled, dot, solve_symmetric};
use crate::rounding::NEAR_SHARE;

/// The closest point S(ξ) of a facet or of one of its sides to a node.
///
/// With r = g n from there to the node and w the velocity of the node relative to the facet there, r · S,α = 0 gives
/// A ξ̇ = w · S,α + g n · Ṡ,α with A = S,α · S,β − g n · S,αβ.
struct ClosestPoint {
    normal: Point,
    distance: f64,
    /// S,α for two parameters of the facet (zero for a missing second one), and S,12.
    tangents: [Point; 2],
    twist: Point,
    /// S,α · S,β and A by their entries 11, 12 and 22.
    metric: [f64; 3],
    matrix: [f64; 3],
    /// The shape functions and their derivatives with respect to the parameters.
    weights: [f64; 4],
    derivatives: [[f64; 4]; 2],
}

/// The velocities of a facet's corners as rates at its closest point: Ṡ,α and Ṡ,12, and the velocity w.
struct Rates {
    relative: Point,
    tangents: [Point; 2],
    twist: Point,
}

impl ClosestPoint {
    /// Of a whole facet, or of the side on which the projection lies.
    fn new(stand: &Stand, shape: &Shape, side: Option<usize>) -> Self {
        let Stand { normal, distance, weights, .. } = *stand;
        let (tangents, twist, derivatives) = match side {
            Some(k) => ([shape.side(k), [0.0; 3]], [0.0; 3], [shape.along_side(k), [0.0; 4]]),
            None => (shape.tangents_at(&weights), shape.twist(), shape.derivatives(&weights)),
        };
        let [s, t] = tangents;
        let (ss, st, tt) = (dot(s, s), dot(s, t), if side.is_some() { 1.0 } else { dot(t, t) });
        let matrix = [ss, st - distance * dot(normal, twist), tt];
        Self { normal, distance, tangents, twist, metric: [ss, st, tt], matrix, weights, derivatives }
    }

    fn rates(&self, v: Point, velocity: &Shape, side: Option<usize>) -> Rates {
        let relative = add_scaled(v, -1.0, velocity.point(&self.weights));
        match side {
            Some(k) => Rates { relative, tangents: [velocity.side(k), [0.0; 3]], twist: [0.0; 3] },
            None => Rates { relative, tangents: velocity.tangents_at(&self.weights), twist: velocity.twist() },
        }
    }

    /// The derivatives of a function of the parameters, with these derivatives, with respect to the positions of the
    /// node and of the vertices.
    fn gradient(&self, slopes: [f64; 2]) -> [Point; 5] {
        let [y, z] = solve_symmetric(self.matrix, slopes);
        let along = add_scaled(self.tangents[0].map(|x| y * x), z, self.tangents[1]);
        let mut gradient = [along; 5];
        for (k, entry) in gradient[1..].iter_mut().enumerate() {
            let turned = self.distance * (y * self.derivatives[0][k] + z * self.derivatives[1][k]);
            *entry = add_scaled(along.map(|x| -self.weights[k] * x), turned, self.normal);
        }
        gradient
    }

    /// ξ̇ and ξ̈ as node and facet move at constant velocities.
    ///
    /// Differentiating the condition on the closest point once more, with ṙ = w − S,β ξ̇_β, gives
    /// A ξ̈ = −(2 Ṡ,β ξ̇_β + S,βγ ξ̇_β ξ̇_γ) · S,α + 2 ṙ · (Ṡ,α + S,αβ ξ̇_β) + 2 r · Ṡ,αβ ξ̇_β.
    fn parameters(&self, rates: &Rates) -> [[f64; 2]; 2] {
        let Self { tangents: [s, t], twist, matrix, .. } = *self;
        let Rates { relative: w, tangents: [s_rate, t_rate], .. } = *rates;
        let apart = self.normal.map(|x| self.distance * x);
        let [x, y] = solve_symmetric(matrix, [dot(w, s) + dot(apart, s_rate), dot(w, t) + dot(apart, t_rate)]);
        let turned = add_scaled(s_rate.map(|rate| 2.0 * x * rate), 2.0 * y, t_rate);
        let turned = add_scaled(turned, 2.0 * x * y, twist);
        let slip = add_scaled(add_scaled(w, -x, s), -y, t);
        let right = [(s, s_rate, y), (t, t_rate, x)].map(|(tangent, rate, other)| {
            let carried = dot(slip, add_scaled(rate, other, twist)) + other * dot(apart, rates.twist);
            2.0 * carried - dot(turned, tangent)
        });
        [[x, y], solve_symmetric(matrix, right)]
    }

    /// g̈ of the distance as node and facet move at constant velocities.
    ///
    /// With c_α = n · w,α the rate of the normal is ṅ · S,α = c − n · S,αβ ξ̇, and g̈ = ṅ · w + n · w,α ξ̇.
    fn acceleration(&self, rates: &Rates) -> f64 {
        let ([[x, y], _], [s, t]) = (self.parameters(rates), self.tangents);
        let c = rates.tangents.map(|rate| -dot(self.normal, rate));
        let bend = dot(self.normal, self.twist);
        let along = solve_symmetric(self.metric, [dot(rates.relative, s), dot(rates.relative, t)]);
        c[0] * x + c[1] * y + (c[0] - bend * y) * along[0] + (c[1] - bend * x) * along[1]
    }
}

impl Ground<'_> {
    /// The derivatives of the sum of the offsets of a projection, at full size, with respect to the positions of its
    /// node and of the vertices of its facet; none if they are zero.
    pub(crate) fn slope(&self, stand: &Stand) -> Option<[Point; 5]> {
        let facet = &self.surface.facets()[stand.facet];
        let (point, slopes, _) = stand.offsets_at(&facet.shape(self.positions), self.offsets.at_corners(facet))?;
        Some(point.gradient(slopes))
    }
}

impl Stand {
    fn side(&self) -> Option<usize> {
        if let Location::Side(k) = self.location { Some(k) } else { None }
    }

    /// The closest point, and the derivatives o,α and o,12 of the offset of the facet there; none where the offset is
    /// constant on the facet, or the closest point is a vertex.
    fn offsets_at(&self, shape: &Shape, offsets: [f64; 4]) -> Option<(ClosestPoint, [f64; 2], f64)> {
        let is_constant = offsets.iter().all(|offset| offset.to_bits() == offsets[0].to_bits());
        if is_constant || matches!(self.location, Location::Vertex(_)) {
            return None;
        }
        let offsets = Shape::new(offsets.map(|offset| [offset, 0.0, 0.0]), shape.corners().len());
        let point = ClosestPoint::new(self, &offsets, self.side());
        let (slopes, bend) = (point.tangents.map(|tangent| tangent[0]), point.twist[0]);
        Some((ClosestPoint::new(self, shape, self.side()), slopes, bend))
    }

    /// The first two time derivatives of the sum of the offsets, at full size, as node and facet move at constant
    /// velocities: the velocity of the node, the facet and the velocities of its vertices, and the offsets of the
    /// vertices.
    pub(crate) fn sliding(&self, v: Point, (shape, velocity): (&Shape, &Shape), offsets: [f64; 4]) -> [f64; 2] {
        let Some((point, slopes, bend)) = self.offsets_at(shape, offsets) else { return [0.0; 2] };
        let [[x, y], [xx, yy]] = point.parameters(&point.rates(v, velocity, self.side()));
        [slopes[0] * x + slopes[1] * y, slopes[0] * xx + slopes[1] * yy + 2.0 * bend * x * y]
    }

    /// d²g/ds² along x + s v: the node at x has velocity v; the facet and the velocities of its vertices are given as
    /// shapes.
    ///
    /// On a side or a vertex the node also turns around it: w⊥²/g. If the gap is below a small share of the facet,
    /// that turn takes almost no time and is left out; the facet then represents a smooth surface.
    pub(crate) fn acceleration(&self, x: Point, v: Point, shape: &Shape, velocity: &Shape) -> f64 {
        let gap = dot(self.normal, add_scaled(x, -1.0, shape.point(&self.weights)));
        let is_near = gap.abs() <= NEAR_SHARE * shape.size();
        let side = self.side().filter(|_| !is_near);
        let mut here = *self;
        here.distance = gap;
        let point = ClosestPoint::new(&here, shape, side);
        let rates = point.rates(v, velocity, side);
        let across = |w: Point, s: Point| add_scaled(w, -dot(w, s) / dot(s, s), s);
        let around = across(rates.relative, self.normal);
        match self.location {
            Location::Vertex(_) if !is_near => dot(around, around) / gap,
            Location::Side(k) if !is_near => {
                let around = across(around, shape.side(k));
                dot(around, around) / gap + point.acceleration(&rates)
            }
            _ => point.acceleration(&rates),
        }
    }
}
