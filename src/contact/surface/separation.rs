//! The plane that separates the convex hulls of two facets, at rest and in motion.
//!
//! At rest the normal of the plane is the shortest vector between the hulls, by the method of Gilbert, Johnson and
//! Keerthi (IEEE J. Robot. Autom. 4, 1988). In motion the corners of both facets move on straight lines, each at a
//! constant velocity. Along a fixed normal the distance of two corners is then linear in time: a plane that separates
//! all corners at both ends of an interval separates the hulls within the interval. Where a plane fails, the interval
//! is halved; where it does not, the next interval is twice as long. Planes are only proposed by floating-point
//! arithmetic, and then checked.

use super::shape::{Point, add_scaled, cross, dot, sub};

/// The corners of a facet, two to four.
pub(crate) type Corners = ([Point; 4], usize);

/// The number of planes that are tried for two facets in a step.
const MOST_PLANES: usize = 1000;

/// Iterations to the shortest vector; more are not needed even for nearly parallel facets.
const MOST_ITERATIONS: usize = 32;

/// A lower bound of the distance of two facets while their corners move from the first positions to the second; none
/// if it is not shown to be more than `least` at all times.
pub(crate) fn distance_in_motion(ends: &[[Corners; 2]; 2], least: f64) -> Option<f64> {
    let (mut from, mut length, mut smallest) = (0.0, 1.0, f64::INFINITY);
    for _ in 0..MOST_PLANES {
        let to = f64::min(from + length, 1.0);
        let middle = at(ends, from.midpoint(to));
        let normal = between(&middle)?;
        let [start, end] = [from, to].map(|share| along(normal, &at(ends, share)));
        let distance = start.min(end);
        if distance > least {
            smallest = smallest.min(distance);
            if to >= 1.0 {
                return Some(smallest);
            }
            (from, length) = (to, 2.0 * length);
        } else if along(normal, &middle) <= least {
            // No other plane is better there.
            return None;
        } else {
            length = 0.5 * (to - from);
        }
    }
    None
}

/// Both facets at a share of the motion.
fn at(ends: &[[Corners; 2]; 2], share: f64) -> [Corners; 2] {
    let [from, to] = ends;
    [0, 1].map(|facet| {
        let ((start, count), (end, _)) = (from[facet], to[facet]);
        // Exactly the end for a share of one.
        let point = |k: usize| std::array::from_fn(|i| (1.0 - share) * start[k][i] + share * end[k][i]);
        ([0, 1, 2, 3].map(point), count)
    })
}

/// The distance of two facets along a unit normal from the second to the first; negative if they overlap.
fn along(normal: Point, [one, other]: &[Corners; 2]) -> f64 {
    let lowest = one.0[..one.1].iter().map(|&x| dot(normal, sub(x, other.0[0]))).fold(f64::INFINITY, f64::min);
    let highest = other.0[..other.1].iter().map(|&x| dot(normal, sub(x, other.0[0]))).fold(0.0, f64::max);
    lowest - highest
}

/// The direction of the shortest vector from the second hull to the first; none if they meet.
fn between(facets: &[Corners; 2]) -> Option<Point> {
    let [one, other] = facets;
    let farthest = |(corners, count): &Corners, direction: Point| {
        let all = corners[..*count].iter().copied();
        all.max_by(|&x, &y| dot(direction, x).total_cmp(&dot(direction, y))).unwrap_or(corners[0])
    };
    let mut simplex = Simplex { points: [[0.0; 3]; 4], count: 0 };
    let mut shortest = sub(one.0[0], other.0[0]);
    for _ in 0..MOST_ITERATIONS {
        let square = dot(shortest, shortest);
        let support = sub(farthest(one, shortest.map(|x| -x)), farthest(other, shortest));
        // No corner lies closer by more than rounding.
        if square - dot(shortest, support) <= 8.0 * f64::EPSILON * square || simplex.has(support) {
            break;
        }
        if simplex.count == 0 {
            simplex = Simplex { points: [shortest, [0.0; 3], [0.0; 3], [0.0; 3]], count: 1 };
        }
        simplex.push(support);
        let closest = simplex.reduce()?;
        if dot(closest, closest) >= square {
            break;
        }
        shortest = closest;
    }
    super::shape::unit(shortest)
}

/// Up to four points, whose hull has the point closest to the origin in its interior.
struct Simplex {
    points: [Point; 4],
    count: usize,
}

impl Simplex {
    fn has(&self, point: Point) -> bool {
        self.points[..self.count].contains(&point)
    }

    fn push(&mut self, point: Point) {
        self.points[self.count.min(3)] = point;
        self.count = (self.count + 1).min(4);
    }

    /// The point of the hull closest to the origin; keeps the fewest points that have it in their hull. None if the
    /// origin is inside of all four.
    fn reduce(&mut self) -> Option<Point> {
        let mut best: Option<(f64, Point, u32)> = None;
        for subset in 1_u32..1 << self.count {
            let Some(closest) = self.closest_of(subset) else { continue };
            let square = dot(closest, closest);
            if best.is_none_or(|(least, ..)| square < least) {
                best = Some((square, closest, subset));
            }
        }
        let (_, closest, subset) = best.filter(|&(.., subset)| subset != 0b1111)?;
        let mut kept = 0;
        for k in (0..self.count).filter(|k| subset >> k & 1 == 1) {
            self.points[kept] = self.points[k];
            kept += 1;
        }
        self.count = kept;
        Some(closest)
    }

    /// The point closest to the origin in the plane through some of the points, if it lies between them.
    fn closest_of(&self, subset: u32) -> Option<Point> {
        let mut chosen = [[0.0; 3]; 4];
        let mut count = 0;
        for (k, &point) in self.points[..self.count].iter().enumerate() {
            if subset >> k & 1 == 1 {
                chosen[count] = point;
                count += 1;
            }
        }
        let [a, b, c, d] = chosen;
        match count {
            1 => Some(a),
            2 => {
                let side = sub(b, a);
                let share = -dot(a, side) / dot(side, side);
                (share > 0.0 && share < 1.0).then(|| add_scaled(a, share, side))
            }
            3 => {
                let normal = cross(sub(b, a), sub(c, a));
                let square = dot(normal, normal);
                // Where the origin projects to, by areas.
                let inside = [[a, b], [b, c], [c, a]].iter().all(|&[x, y]| dot(normal, cross(x, y)) > 0.0);
                (inside && square > 0.0).then(|| normal.map(|x| x * dot(normal, a) / square))
            }
            _ => {
                let volume = |[x, y, z]: [Point; 3]| dot(x, cross(y, z));
                let whole = volume([sub(b, a), sub(c, a), sub(d, a)]);
                let parts = [[b, c, d], [a, d, c], [a, b, d], [a, c, b]].map(volume);
                (whole != 0.0 && parts.iter().all(|part| part * whole > 0.0)).then_some([0.0; 3])
            }
        }
    }
}
