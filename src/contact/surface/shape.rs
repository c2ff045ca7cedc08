//! Facets as shapes: closest points, shape functions and normals of segments, triangles and bilinear quadrilaterals.

use crate::rounding::{CONVERGING, LEAST_CONVEXITY, NEAR_SHARE, ROUNDED_SHARE, SMALLEST_AREA, rounding};

/// A point or a vector; in two dimensions the third component is zero.
pub(crate) type Point = [f64; 3];

/// How far outside an open side a projection still counts as inside, as a share of the facet: nodes at the rim of
/// matching meshes must not lose their row to rounding or a small strain.
pub(crate) const RIM: f64 = NEAR_SHARE;

#[inline]
pub(crate) fn sub(x: Point, y: Point) -> Point {
    [x[0] - y[0], x[1] - y[1], x[2] - y[2]]
}

/// `x + c y`.
#[inline]
pub(crate) fn add_scaled(x: Point, c: f64, y: Point) -> Point {
    [x[0] + c * y[0], x[1] + c * y[1], x[2] + c * y[2]]
}

#[inline]
pub(crate) fn dot(x: Point, y: Point) -> f64 {
    x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
}

#[inline]
pub(crate) fn cross(x: Point, y: Point) -> Point {
    [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
}

#[inline]
pub(crate) fn norm(x: Point) -> f64 {
    dot(x, x).sqrt()
}

/// `x / |x|`; none for the zero vector.
#[inline]
pub(crate) fn unit(x: Point) -> Option<Point> {
    let length = norm(x);
    (length > 0.0 && length.is_finite()).then(|| [x[0] / length, x[1] / length, x[2] / length])
}

/// x for a symmetric matrix by its entries 11, 12 and 22, and the right side.
#[inline]
pub(super) fn solve_symmetric([xx, xy, yy]: [f64; 3], [p, q]: [f64; 2]) -> [f64; 2] {
    let determinant = xx * yy - xy * xy;
    [(yy * p - xy * q) / determinant, (xx * q - xy * p) / determinant]
}

/// The sides and vertices of a facet at which the surface ends.
///
/// Side k runs from vertex k to the next; the sides of a segment are its two vertices.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rim {
    pub(crate) sides: [bool; 4],
    pub(crate) vertices: [bool; 4],
    /// Extension of the surface beyond its rim, as a share of the facet; [`RIM`] by default.
    pub(crate) beyond: f64,
}

impl Rim {
    /// The rim of a facet that has no neighbors.
    pub(super) fn all_around(beyond: f64) -> Self {
        Self { sides: [true; 4], vertices: [true; 4], beyond }
    }
}

/// Where on a facet a closest point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Location {
    /// Inside of the facet, along its normal.
    Inside,
    /// On a side that a neighbor shares.
    Side(usize),
    /// On a vertex that is not on the rim.
    Vertex(usize),
    /// On the rim, with the node beyond it.
    Beyond,
}

/// The point of a facet closest to a node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foot {
    /// Shape functions of the vertices there; their sum is one.
    pub(crate) weights: [f64; 4],
    pub(crate) point: Point,
    pub(crate) distance: f64,
    pub(crate) location: Location,
}

/// A facet at the current positions of its vertices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    corners: [Point; 4],
    count: usize,
}

impl Shape {
    #[inline]
    pub(crate) fn new(corners: [Point; 4], count: usize) -> Self {
        Self { corners, count }
    }

    #[inline]
    fn after(&self, k: usize) -> usize {
        if k + 1 == self.count { 0 } else { k + 1 }
    }

    #[inline]
    fn before(&self, k: usize) -> usize {
        if k == 0 { self.count - 1 } else { k - 1 }
    }

    /// The side that begins at vertex k, as a vector.
    #[inline]
    pub(crate) fn side(&self, k: usize) -> Point {
        sub(self.corners[self.after(k)], self.corners[k])
    }

    #[inline]
    pub(crate) fn corners(&self) -> &[Point] {
        &self.corners[..self.count]
    }

    #[inline]
    pub(crate) fn corner(&self, k: usize) -> Point {
        self.corners[k]
    }

    /// Whether a point projects onto a segment or a triangle, including its sides up to rounding.
    pub(crate) fn holds(&self, p: Point) -> bool {
        self.project(p, Rim::all_around(ROUNDED_SHARE)).is_some_and(|foot| foot.location == Location::Inside)
    }

    /// Length of the longest side.
    #[inline]
    pub(crate) fn size(&self) -> f64 {
        self.square_of_size().sqrt()
    }

    #[inline]
    pub(super) fn square_of_size(&self) -> f64 {
        (0..self.count).map(|k| dot(self.side(k), self.side(k))).fold(0.0, f64::max)
    }

    #[inline]
    pub(crate) fn middle(&self) -> Point {
        let (first, share) = (self.corners[0], 1.0 / self.count as f64);
        self.corners().iter().fold(first, |sum, &corner| add_scaled(sum, share, sub(corner, first)))
    }

    /// The point with the given shape functions.
    #[inline]
    pub(crate) fn point(&self, weights: &[f64; 4]) -> Point {
        // Differences from the first corner: far from the origin the sum of weighted corners would lose digits.
        let first = self.corners[0];
        self.corners[1..self.count]
            .iter()
            .zip(&weights[1..])
            .fold(first, |sum, (&corner, &weight)| add_scaled(sum, weight, sub(corner, first)))
    }

    /// The shape functions at share `s` of side k.
    #[inline]
    pub(crate) fn on_side(&self, k: usize, s: f64) -> [f64; 4] {
        let mut weights = [0.0; 4];
        weights[k] = 1.0 - s;
        weights[self.after(k)] = s;
        weights
    }

    /// How far inside of side k a point is, in shares of the facet: 0 on the side, 1 opposite of it.
    #[inline]
    pub(crate) fn inset(&self, weights: &[f64; 4], k: usize) -> f64 {
        match self.count {
            2 => weights[1 - k],
            3 => weights[self.before(k)],
            _ => weights[self.before(k)] + weights[(k + 2) % 4],
        }
    }

    /// The outward unit normal where the shape functions are `weights`; none if the facet is degenerate there.
    #[inline(always)]
    #[allow(clippy::inline_always)] // at each point of quadrature
    pub(crate) fn normal(&self, weights: &[f64; 4]) -> Option<Point> {
        unit(self.product(weights))
    }

    /// The product of the tangents at the point with these shape functions: its length is the area per unit of the
    /// parameters.
    #[inline(always)]
    #[allow(clippy::inline_always)] // at each point of quadrature
    pub(crate) fn product(&self, weights: &[f64; 4]) -> Point {
        let [first, second] = self.tangents_at(weights);
        cross(first, second)
    }

    /// Tangent products whose combinations with positive weights include all tangent products of the facet, extended
    /// beyond its sides by `beyond` of its size. The product of a quadrilateral is bilinear.
    #[inline]
    pub(super) fn extreme_products(&self, beyond: f64) -> [Point; 4] {
        if self.count < 4 {
            return [self.product(&[0.0; 4]); 4];
        }
        let end = 1.0 + 2.0 * beyond;
        let [lower, upper] = [-end, end].map(|end| self.tangents([end; 2]));
        std::array::from_fn(|k| cross([lower[0], upper[0]][k / 2], [lower[1], upper[1]][k % 2]))
    }

    /// The tangents at the point with these shape functions; the second one of a segment is the unit vector out of
    /// plane.
    #[inline(always)]
    #[allow(clippy::inline_always)] // at each point of quadrature
    pub(crate) fn tangents_at(&self, weights: &[f64; 4]) -> [Point; 2] {
        match self.count {
            2 => [self.side(0), [0.0, 0.0, 1.0]],
            3 => [self.side(0), sub(self.corners[2], self.corners[0])],
            _ => self.tangents(Self::coordinates(weights)),
        }
    }

    /// The derivatives of the shape functions along both tangents, at the point with these shape functions.
    #[inline]
    pub(super) fn derivatives(&self, weights: &[f64; 4]) -> [[f64; 4]; 2] {
        match self.count {
            2 => [[-1.0, 1.0, 0.0, 0.0], [0.0; 4]],
            3 => [[-1.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 1.0, 0.0]],
            _ => {
                let [w0, w1, w2, w3] = weights.map(|weight| 0.5 * weight);
                let [bottom, top, left, right] = [w0 + w1, w2 + w3, w0 + w3, w1 + w2];
                [[-bottom, bottom, top, -top], [-left, -right, right, left]]
            }
        }
    }

    /// The derivatives of the shape functions along side k.
    pub(super) fn along_side(&self, k: usize) -> [f64; 4] {
        let mut along = [0.0; 4];
        along[k] = -1.0;
        along[self.after(k)] = 1.0;
        along
    }

    /// ∂²x/∂ξ∂η of a quadrilateral; zero for the other shapes.
    #[inline]
    pub(crate) fn twist(&self) -> Point {
        if self.count < 4 {
            return [0.0; 3];
        }
        let [x0, x1, x2, x3] = self.corners;
        add_scaled(add_scaled([0.0; 3], 0.25, sub(x0, x1)), 0.25, sub(x2, x3))
    }

    /// Angle between the sides that meet at vertex k; 1 for a segment.
    pub(crate) fn angle(&self, k: usize) -> f64 {
        if self.count == 2 {
            return 1.0;
        }
        let (next, previous) = (self.side(k), sub(self.corners[self.before(k)], self.corners[k]));
        norm(cross(next, previous)).atan2(dot(next, previous))
    }

    /// Why it cannot be a facet; none if it has a length or an area, and normals at its vertices to the same side.
    pub(crate) fn fault(&self) -> Option<&'static str> {
        let square = self.square_of_size();
        let corner = |k: usize| cross(self.side(k), sub(self.corners[self.before(k)], self.corners[k]));
        let corners = if self.count == 2 { 0 } else { self.count };
        if square <= 0.0 || (0..corners).any(|k| norm(corner(k)) <= SMALLEST_AREA * square) {
            return Some("it has no length or area, or a corner that is straight");
        }
        let mean = (0..corners).fold([0.0; 3], |sum, k| add_scaled(sum, 1.0, corner(k)));
        let is_folded = |k: usize| dot(mean, corner(k)) <= SMALLEST_AREA * square * norm(mean);
        let reason = "its normals point to both sides; give its nodes in the order around it";
        (0..corners).any(is_folded).then_some(reason)
    }

    #[inline]
    fn foot(&self, p: Point, weights: [f64; 4], location: Location) -> Foot {
        let point = self.point(&weights);
        Foot { weights, point, distance: norm(sub(p, point)), location }
    }

    /// The closest point of the facet; none if the facet is degenerate.
    ///
    /// Beyond an open side the facet is extended by a share of its size, so that lever arms stay exact there.
    pub(crate) fn project(&self, p: Point, rim: Rim) -> Option<Foot> {
        match self.count {
            2 => self.project_on_segment(p, rim),
            3 => self.project_on_triangle(p, rim),
            _ => self.project_on_quadrilateral(p, rim),
        }
    }

    /// The share of side k at which a point projects onto its line, the nearer vertex, and the share beyond it.
    fn project_on_line(&self, p: Point, k: usize) -> Option<(f64, usize, f64)> {
        let side = self.side(k);
        let s = dot(sub(p, self.corners[k]), side) / dot(side, side);
        let (vertex, beyond) = if s < 0.5 { (k, -s) } else { (self.after(k), s - 1.0) };
        s.is_finite().then_some((s, vertex, beyond))
    }

    fn project_on_segment(&self, p: Point, rim: Rim) -> Option<Foot> {
        let (s, vertex, outside) = self.project_on_line(p, 0)?;
        let (s, location) = match rim.vertices[vertex] {
            true if outside <= rim.beyond => (s, Location::Inside),
            true => (s.clamp(0.0, 1.0), Location::Beyond),
            false if outside <= 0.0 => (s, Location::Inside),
            false => (s.clamp(0.0, 1.0), Location::Vertex(vertex)),
        };
        Some(self.foot(p, [1.0 - s, s, 0.0, 0.0], location))
    }

    fn project_on_triangle(&self, p: Point, rim: Rim) -> Option<Foot> {
        let (first, second) = (self.side(0), sub(self.corners[2], self.corners[0]));
        let normal = cross(first, second);
        let square = dot(normal, normal);
        if square <= 0.0 {
            return None;
        }
        let r = sub(p, self.corners[0]);
        let (w1, w2) = (dot(cross(r, second), normal) / square, dot(cross(first, r), normal) / square);
        let weights = [1.0 - w1 - w2, w1, w2, 0.0];
        let outside = |k: usize| self.inset(&weights, k) < if rim.sides[k] { -rim.beyond } else { 0.0 };
        let outside = [outside(0), outside(1), outside(2), false];
        match outside.contains(&true) {
            false => Some(self.foot(p, weights, Location::Inside)),
            true => self.nearest_on_sides(p, rim, outside),
        }
    }

    /// The closest point on the sides. Open sides count only if the node is outside of them.
    fn nearest_on_sides(&self, p: Point, rim: Rim, outside: [bool; 4]) -> Option<Foot> {
        let mut best: Option<Foot> = None;
        for k in (0..self.count).filter(|&k| outside[k] || !rim.sides[k]) {
            let Some((s, vertex, excess)) = self.project_on_line(p, k) else { continue };
            let (s, location) = match (rim.sides[k], rim.vertices[vertex]) {
                (true, _) => (s.clamp(0.0, 1.0), Location::Beyond),
                (false, true) if excess > rim.beyond => (s.clamp(0.0, 1.0), Location::Beyond),
                (false, false) if excess > 0.0 => (s.clamp(0.0, 1.0), Location::Vertex(vertex)),
                (false, _) => (s, Location::Side(k)),
            };
            let foot = self.foot(p, self.on_side(k, s), location);
            if best.is_none_or(|best| foot.is_better_than(&best)) {
                best = Some(foot);
            }
        }
        best
    }

    /// Natural coordinates (ξ, η) ∈ [−1, 1]² of a quadrilateral from its shape functions.
    #[inline]
    fn coordinates(weights: &[f64; 4]) -> [f64; 2] {
        let [w0, w1, w2, w3] = *weights;
        [w1 + w2 - w0 - w3, w2 + w3 - w0 - w1]
    }

    #[inline]
    fn bilinear([xi, eta]: [f64; 2]) -> [f64; 4] {
        let (left, right, bottom, top) = (0.5 * (1.0 - xi), 0.5 * (1.0 + xi), 0.5 * (1.0 - eta), 0.5 * (1.0 + eta));
        [left * bottom, right * bottom, right * top, left * top]
    }

    /// ∂x/∂ξ and ∂x/∂η of a quadrilateral.
    #[inline]
    fn tangents(&self, [xi, eta]: [f64; 2]) -> [Point; 2] {
        let [x0, x1, x2, x3] = self.corners;
        let blend = |c: f64, lower: Point, upper: Point| {
            add_scaled(add_scaled([0.0; 3], 0.25 * (1.0 - c), lower), 0.25 * (1.0 + c), upper)
        };
        [blend(eta, sub(x1, x0), sub(x2, x3)), blend(xi, sub(x3, x0), sub(x2, x1))]
    }

    fn project_on_quadrilateral(&self, p: Point, rim: Rim) -> Option<Foot> {
        let ends = rim.sides.map(|open| if open { 1.0 + 2.0 * rim.beyond } else { 1.0 });
        let (start, is_flat) = self.project_on_parallelogram(p, ends.into_iter().fold(1.0, f64::max));
        let Some(z) = self.stationary_point(p, start) else {
            return self.nearest_on_sides(p, rim, [true; 4]);
        };
        let [bottom, right, top, left] = ends;
        let outside = [-z[1] >= bottom, z[0] >= right, z[1] >= top, -z[0] >= left];
        if outside.contains(&true) {
            return self.nearest_on_sides(p, rim, outside);
        }
        let inside = self.foot(p, Self::bilinear(z), Location::Inside);
        if is_flat {
            return Some(inside);
        }
        // A warped facet seen from afar may have a second local minimum on a side.
        let side = self.nearest_on_sides(p, rim, outside);
        side.filter(|side| side.distance < inside.distance * (1.0 - ROUNDED_SHARE)).or(Some(inside))
    }

    /// Natural coordinates of the closest point of the parallelogram with the same middle and tangents there, and
    /// whether the facet is so close to this parallelogram that the distance from p has one minimum within `extent`
    /// times the natural coordinates.
    ///
    /// Let λ be the least eigenvalue of the metric, t the twist and d the distance of p. A point at Δ from the
    /// closest one is about √λ |Δ| away from it along the facet, and at most |t| |Δ|²/2 off its tangent plane. So it
    /// is farther from p if d |t| is small compared with λ.
    fn project_on_parallelogram(&self, p: Point, extent: f64) -> ([f64; 2], bool) {
        const TWIST: f64 = 0.02;
        const BEND: f64 = 0.1;
        let ([a, b], twist, r) = (self.tangents([0.0; 2]), self.twist(), sub(p, self.middle()));
        let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
        let determinant = aa * bb - ab * ab;
        let (least, twist) = (determinant / (aa + bb), dot(twist, twist));
        let is_flat =
            twist * extent * extent <= TWIST * TWIST * least && twist * dot(r, r) <= BEND * BEND * least * least;
        (solve_symmetric([aa, ab, bb], [dot(r, a), dot(r, b)]).map(|z| z.clamp(-1.0, 1.0)), is_flat)
    }

    /// Minimum of ½|p − x(ξ, η)|² on the facet extended without end, by Newton's method with enforced descent; none if
    /// it does not converge.
    fn stationary_point(&self, p: Point, start: [f64; 2]) -> Option<[f64; 2]> {
        const ITERATIONS: usize = 60;
        // Iterations after convergence is detected: one squares the error, one more settles the last digits.
        const POLISH: usize = 3;
        let (mut z, mut polished, twist) = (start, 0, self.twist());
        let residual = |z: [f64; 2]| sub(self.point(&Self::bilinear(z)), p);
        for _ in 0..ITERATIONS {
            let r = residual(z);
            let [a, b] = self.tangents(z);
            let (aa, bb, mut ab) = (dot(a, a), dot(b, b), dot(a, b) + dot(r, twist));
            if aa * bb - ab * ab <= LEAST_CONVEXITY * aa * bb {
                // Not convex here: without the curvature the matrix is positive definite.
                ab = dot(a, b);
            }
            let step = solve_symmetric([aa, ab, bb], [-dot(r, a), -dot(r, b)]);
            let mut share = 1.0;
            // Rounding hides the descent of the last iterations, which are the most accurate ones.
            let next = loop {
                let next = [z[0] + share * step[0], z[1] + share * step[1]];
                let moved = residual(next);
                let is_small = share * step[0].abs().max(step[1].abs()) <= CONVERGING;
                if is_small || dot(moved, moved) <= dot(r, r) {
                    break next;
                }
                if !(step[0].is_finite() && step[1].is_finite()) {
                    return None;
                }
                share *= 0.5;
            };
            let change = (next[0] - z[0]).abs().max((next[1] - z[1]).abs());
            z = next;
            polished += usize::from(change <= CONVERGING);
            if change <= rounding(1.0) || polished == POLISH {
                return Some(z);
            }
        }
        None
    }
}

impl Foot {
    /// Closer, or as close and not beyond the rim.
    #[allow(clippy::float_cmp)] // a tie between two facets that share the point
    pub(crate) fn is_better_than(&self, other: &Self) -> bool {
        self.distance < other.distance
            || (self.distance == other.distance
                && other.location == Location::Beyond
                && self.location != Location::Beyond)
    }
}

/// The shape functions at the middle of a facet.
pub(crate) fn middle(count: usize) -> [f64; 4] {
    let share = 1.0 / count as f64;
    std::array::from_fn(|k| if k < count { share } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pseudorandom values from −1 to 1.
    fn noise(k: usize) -> f64 {
        let x = (k as f64 * 12.9898).sin() * 43_758.545_3;
        2.0 * (x - x.floor()) - 1.0
    }

    fn vector(k: usize) -> Point {
        [noise(3 * k), noise(3 * k + 1), noise(3 * k + 2)]
    }

    /// A parallelogram whose third corner is off by a share of it.
    fn skewed(k: usize, share: f64) -> Shape {
        let (a, b) = (add_scaled([1.0, 0.0, 0.0], 0.3, vector(k)), add_scaled([0.0, 1.0, 0.0], 0.3, vector(k + 1)));
        let corner = add_scaled(add_scaled(a, 1.0, b), share, vector(k + 2));
        Shape::new([[0.0; 3], a, corner, b], 4)
    }

    #[test]
    fn closest_points_are_closest_on_nearly_flat_facets_and_on_others() {
        let (mut flat, mut others) = (0, 0);
        for k in 0..300 {
            let shape = skewed(7 * k, [0.0, 1e-3, 0.03, 0.3][k % 4]);
            let p = add_scaled([0.5, 0.5, 0.0], 1.5, vector(5000 + k));
            match shape.project_on_parallelogram(p, 1.0) {
                (_, true) => flat += 1,
                (_, false) => others += 1,
            }
            let found = shape.project(p, Rim::default()).unwrap();
            let at = |i: i32| f64::from(i) / 20.0 - 1.0;
            let points = (0..=40).flat_map(|i| (0..=40).map(move |j| Shape::bilinear([at(i), at(j)])));
            let sampled = points.map(|weights| norm(sub(p, shape.point(&weights)))).fold(f64::INFINITY, f64::min);
            assert!(found.distance <= sampled + 1e-12, "{k}: {} {sampled}", found.distance);
            assert!(found.distance >= sampled - 0.06, "{k}: {} {sampled}", found.distance);
        }
        assert!(flat > 50 && others > 50, "{flat} {others}");
    }
}
