//! Rigid obstacles: bodies given by their signed distance.

mod capsule;
#[cfg(feature = "mesh-contact")]
mod closed_surface;
mod cone;
mod cuboid;

pub use capsule::Capsule;
#[cfg(feature = "mesh-contact")]
pub use closed_surface::ClosedSurface;
pub use cone::Cone;
pub use cuboid::Cuboid;

use crate::error::{Error, Result, positive};
use crate::real::Real;

/// A rigid body, given by the signed distance of a point from its surface: positive outside, negative inside.
///
/// Evaluations are pure. The gradient of a signed distance is the outward unit normal at the nearest point of the
/// surface. The obstacle is at rest in its own frame; [`NodesOnObstacle`](super::NodesOnObstacle) moves it.
///
/// ```
/// use contact_dynamics::contact::Obstacle;
///
/// /// A floor with long waves: not quite a distance, but its zero and its normal are right.
/// #[derive(Debug)]
/// struct Waves;
///
/// impl Obstacle<f64, 2> for Waves {
///     fn distance(&self, [x, y]: [f64; 2]) -> (f64, [f64; 2]) {
///         let (height, slope) = (0.1 * x.sin(), 0.1 * x.cos());
///         let length = (1.0 + slope * slope).sqrt();
///         ((y - height) / length, [-slope / length, 1.0 / length])
///     }
/// }
/// assert!(Waves.distance([0.0, 0.5]).0 > 0.0);
/// ```
pub trait Obstacle<T: Real, const D: usize>: Send {
    /// Signed distance of x (length) and its gradient, the unit normal.
    fn distance(&self, x: [T; D]) -> (T, [T; D]);

    /// wᵀ H w with H the second derivative of the distance: the acceleration of the gap by a motion with velocity w
    /// along a curved surface. Default: zero, for flat surfaces.
    fn curvature(&self, x: [T; D], w: [T; D]) -> T {
        let _ = (x, w);
        T::zero()
    }

    /// The normal, if it is the same everywhere.
    fn fixed_normal(&self) -> Option<[T; D]> {
        None
    }

    /// The largest length, for instance a radius, that is subtracted in the computation of a distance (length): gaps
    /// within its rounding are zero. Default: zero, so that only the coordinates of the point count.
    fn magnitude(&self) -> T {
        T::zero()
    }

    /// The passage of a straight path that goes into the body and turns outward again, if it does: such a motion in
    /// one step has missed a contact. Default: found by marching along the path in increments of the distance, at
    /// least 1/16 of the path; smaller hollows and crests may be missed.
    fn passage(&self, from: [T; D], to: [T; D]) -> Option<Passage<T>> {
        trace(|x| self.distance(x), from, minus(to, from))
    }
}

/// The passage of a straight path through a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage<T> {
    /// The depth of its deepest point (length).
    pub depth: T,
    /// Cosine of the angle between the path and the inward normal where it enters, or starts.
    pub steepness: T,
}

fn trace<T: Real, const D: usize>(
    distance: impl Fn([T; D]) -> (T, [T; D]),
    from: [T; D],
    path: [T; D],
) -> Option<Passage<T>> {
    const SHORTEST: f64 = 1.0 / 16.0;
    const HALVINGS: usize = 30;
    let length = dot(path, path).sqrt();
    let at = |s: T| distance(std::array::from_fn(|k| from[k] + s * path[k]));
    let (half, mut s) = (T::of(0.5), T::zero());
    // The last point found outside, or the start.
    let mut outside = s;
    let (mut gap, mut normal) = at(s);
    while s < T::one() && length > T::zero() {
        if gap > T::zero() {
            outside = s;
        }
        let next = (s + (gap / length).max(T::of(SHORTEST))).min(T::one());
        let (next_gap, next_normal) = at(next);
        if dot(normal, path) < T::zero() && dot(next_normal, path) > T::zero() {
            // The deepest point is in between.
            let (mut down, mut up) = (s, next);
            for _ in 0..HALVINGS {
                let middle = half * (down + up);
                match dot(at(middle).1, path) < T::zero() {
                    true => down = middle,
                    false => up = middle,
                }
            }
            let deepest = at(down).0;
            if deepest < T::zero() {
                let mut inside = down;
                for _ in 0..if at(outside).0 > T::zero() { HALVINGS } else { 0 } {
                    let middle = half * (outside + inside);
                    match at(middle).0 > T::zero() {
                        true => outside = middle,
                        false => inside = middle,
                    }
                }
                return Some(Passage { depth: -deepest, steepness: -dot(at(outside).1, path) / length });
            }
        }
        (s, gap, normal) = (next, next_gap, next_normal);
    }
    None
}

/// A half-space: everything on the other side of a plane (a line in two dimensions).
///
/// ```
/// use contact_dynamics::contact::{Obstacle, Plane};
/// let floor = Plane::new([0.0, 0.0, 1.0], [0.0, 0.0, 2.0])?; // through (0, 0, 1), facing up
/// assert_eq!(floor.distance([3.0, 4.0, 1.5]), (0.5, [0.0, 0.0, 1.0]));
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane<T, const D: usize> {
    point: [T; D],
    normal: [T; D],
}

impl<T: Real, const D: usize> Plane<T, D> {
    /// Through a point, with a normal of any length that points to the free side.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the normal is zero, [`Error::NotFinite`].
    pub fn new(point: [T; D], normal: [T; D]) -> Result<Self> {
        finite("a point of the plane", &point)?;
        Ok(Self { point, normal: unit("the normal of the plane", normal)? })
    }
}

impl<T: Real, const D: usize> Obstacle<T, D> for Plane<T, D> {
    fn distance(&self, x: [T; D]) -> (T, [T; D]) {
        (dot(self.normal, minus(x, self.point)), self.normal)
    }

    fn fixed_normal(&self) -> Option<[T; D]> {
        Some(self.normal)
    }
}

/// The side of a closed surface on which bodies may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Outside of a solid obstacle.
    Outside,
    /// Inside of a hollow one.
    Inside,
}

impl Side {
    fn sign<T: Real>(self) -> T {
        match self {
            Self::Outside => T::one(),
            Self::Inside => -T::one(),
        }
    }
}

/// A ball (a disc in two dimensions), or the space outside of one.
///
/// ```
/// use contact_dynamics::contact::{Obstacle, Side, Sphere};
/// let ball = Sphere::new([0.0, 0.0], 1.0, Side::Outside)?;
/// assert_eq!(ball.distance([0.0, 3.0]), (2.0, [0.0, 1.0]));
/// let bowl = Sphere::new([0.0, 0.0], 1.0, Side::Inside)?;
/// assert_eq!(bowl.distance([0.0, 0.25]), (0.75, [0.0, -1.0]));
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere<T, const D: usize> {
    center: [T; D],
    radius: T,
    side: Side,
}

impl<T: Real, const D: usize> Sphere<T, D> {
    /// Around a center.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless the radius is positive and finite, [`Error::NotFinite`].
    pub fn new(center: [T; D], radius: T, side: Side) -> Result<Self> {
        finite("the center of the sphere", &center)?;
        check_radius("the radius of the sphere", radius)?;
        Ok(Self { center, radius, side })
    }
}

impl<T: Real, const D: usize> Obstacle<T, D> for Sphere<T, D> {
    fn distance(&self, x: [T; D]) -> (T, [T; D]) {
        round(minus(x, self.center), self.radius, self.side)
    }

    fn curvature(&self, x: [T; D], w: [T; D]) -> T {
        round_curvature(minus(x, self.center), w, self.side)
    }

    fn magnitude(&self) -> T {
        self.center.iter().fold(self.radius, |largest, x| largest.max(x.abs()))
    }
}

/// A straight cylinder without ends, or the space outside of one.
///
/// ```
/// use contact_dynamics::contact::{Cylinder, Obstacle, Side};
/// let pipe = Cylinder::new([0.0; 3], [1.0, 0.0, 0.0], 2.0, Side::Inside)?;
/// assert_eq!(pipe.distance([7.0, 0.0, 1.5]), (0.5, [0.0, 0.0, -1.0]));
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder<T> {
    point: [T; 3],
    axis: [T; 3],
    radius: T,
    side: Side,
}

impl<T: Real> Cylinder<T> {
    /// Around an axis through a point.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the axis is zero or unless the radius is positive and finite, [`Error::NotFinite`].
    pub fn new(point: [T; 3], axis: [T; 3], radius: T, side: Side) -> Result<Self> {
        finite("a point of the cylinder's axis", &point)?;
        check_radius("the radius of the cylinder", radius)?;
        Ok(Self { point, axis: unit("the axis of the cylinder", axis)?, radius, side })
    }

    /// The component across the axis.
    fn across(&self, x: [T; 3]) -> [T; 3] {
        let along = dot(x, self.axis);
        std::array::from_fn(|k| x[k] - along * self.axis[k])
    }
}

impl<T: Real> Obstacle<T, 3> for Cylinder<T> {
    fn distance(&self, x: [T; 3]) -> (T, [T; 3]) {
        round(self.across(minus(x, self.point)), self.radius, self.side)
    }

    fn curvature(&self, x: [T; 3], w: [T; 3]) -> T {
        round_curvature(self.across(minus(x, self.point)), self.across(w), self.side)
    }

    fn magnitude(&self) -> T {
        self.point.iter().fold(self.radius, |largest, x| largest.max(x.abs()))
    }
}

/// Distance from a round surface for a point at `r` from its center or axis. At the center itself any normal is
/// valid.
fn round<T: Real, const D: usize>(r: [T; D], radius: T, side: Side) -> (T, [T; D]) {
    let (length, sign) = (length(r), side.sign::<T>());
    let normal = match length > T::zero() {
        true => r.map(|x| sign * x / length),
        false => std::array::from_fn(|k| if k + 1 == D { sign } else { T::zero() }),
    };
    (sign * (length - radius), normal)
}

/// wᵀ H w of a round surface: the square of the speed along it divided by the distance from its center or axis.
fn round_curvature<T: Real, const D: usize>(r: [T; D], w: [T; D], side: Side) -> T {
    let (square, along) = (dot(r, r), dot(r, w));
    match square > T::zero() {
        true => side.sign::<T>() * (dot(w, w) - along * along / square) / square.sqrt(),
        false => T::zero(),
    }
}

fn length<T: Real, const D: usize>(x: [T; D]) -> T {
    dot(x, x).sqrt()
}

/// Rejects a radius that is not positive and finite, or whose square is not a normal number: distances are computed
/// from squares.
fn check_radius<T: Real>(name: &'static str, radius: T) -> Result<()> {
    positive(name, radius.value())?;
    match (radius * radius).is_normal() {
        true => Ok(()),
        false => Err(Error::Parameter { name, value: radius.value(), range: "a length whose square is a number" }),
    }
}

impl<T: Real, const D: usize, O: Obstacle<T, D> + ?Sized> Obstacle<T, D> for Box<O> {
    fn distance(&self, x: [T; D]) -> (T, [T; D]) {
        (**self).distance(x)
    }
    fn curvature(&self, x: [T; D], w: [T; D]) -> T {
        (**self).curvature(x, w)
    }
    fn fixed_normal(&self) -> Option<[T; D]> {
        (**self).fixed_normal()
    }
    fn magnitude(&self) -> T {
        (**self).magnitude()
    }
    fn passage(&self, from: [T; D], to: [T; D]) -> Option<Passage<T>> {
        (**self).passage(from, to)
    }
}

pub(super) fn dot<T: Real, const D: usize>(x: [T; D], y: [T; D]) -> T {
    x.into_iter().zip(y).map(|(x, y)| x * y).sum()
}

/// Orthonormal tangents to a unit normal: one in the plane, two in space (others are zero). For a normal along an
/// axis they are axes.
pub(super) fn across<T: Real, const D: usize>(normal: [T; D]) -> [[T; D]; 2] {
    let mut directions = [[T::zero(); D]; 2];
    if D == 2 {
        (directions[0][0], directions[0][1]) = (normal[1], -normal[0]);
    } else if D == 3 {
        // The first axis at a sufficient angle from the normal, which one of three always has; symmetric normals are
        // not at the limit. The axis at the largest angle would not do: on a flat surface rounding would decide which
        // one it is, and the tangents would jump while a normal is iterated.
        let axis = (0..D).find(|&axis| normal[axis].abs() < T::of(0.61)).unwrap_or(0);
        let mut first: [T; D] = std::array::from_fn(|k| -normal[axis] * normal[k]);
        first[axis] += T::one();
        let length = dot(first, first).sqrt();
        directions[0] = first.map(|x| x / length);
        let [n, s] = [normal, directions[0]];
        directions[1] = std::array::from_fn(|k| n[(k + 1) % D] * s[(k + 2) % D] - n[(k + 2) % D] * s[(k + 1) % D]);
    }
    directions
}

pub(super) fn minus<T: Real, const D: usize>(x: [T; D], y: [T; D]) -> [T; D] {
    std::array::from_fn(|k| x[k] - y[k])
}

fn finite<T: Real>(what: &'static str, x: &[T]) -> Result<()> {
    match x.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(Error::NotFinite { what, index, value: x[index].value() }),
        None => Ok(()),
    }
}

/// `x / |x|`; vectors that are zero or not finite are rejected under the given name.
pub(super) fn unit<T: Real, const D: usize>(name: &'static str, x: [T; D]) -> Result<[T; D]> {
    finite(name, &x)?;
    if x.iter().all(|x| *x == T::zero()) {
        return Err(Error::Parameter { name, value: 0.0, range: "a vector that is not zero" });
    }
    Ok(unit_or_nan(x))
}

/// `x / |x|`, NaN if x is zero or not finite.
pub(super) fn unit_or_nan<T: Real, const D: usize>(x: [T; D]) -> [T; D] {
    // Scaled first, because squares of very small or large entries underflow or overflow.
    let largest = x.iter().fold(T::zero(), |m, x| m.max(x.abs()));
    let scaled = x.map(|x| x / largest);
    let length = dot(scaled, scaled).sqrt();
    scaled.map(|x| x / length)
}

#[cfg(test)]
mod tests {
    use super::across;

    /// Rounding of a flat surface's normal changes its tangents only by rounding.
    #[test]
    fn directions_do_not_jump_where_a_normal_is_rounded() {
        let near = |x: [f64; 3], y: [f64; 3]| x.iter().zip(y).all(|(x, y)| (x - y).abs() < 1e-12);
        for axis in 0..3 {
            for (x, y) in [(0.0, 0.0), (1e-16, 3e-15), (-3e-15, 1e-16), (2e-15, -2e-15)] {
                let [mut exact, mut rounded] = [[0.0; 3]; 2];
                (exact[axis], rounded[axis]) = (1.0, 1.0);
                (rounded[(axis + 1) % 3], rounded[(axis + 2) % 3]) = (x, y);
                let [one, other] = [across(exact), across(rounded)];
                assert!(near(one[0], other[0]) && near(one[1], other[1]), "{axis}: {other:?}");
            }
        }
    }
}
