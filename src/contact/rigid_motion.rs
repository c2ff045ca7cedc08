//! The prescribed motion of a rigid body at one instant.

use super::obstacle::{dot, minus, unit_or_nan};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::half_digits;

/// The position, velocity and acceleration of a rigid body at an instant.
///
/// A point y of the body in its own frame has the position x = c + R y in space, with a rotation R and the position c
/// of the origin of the body's frame. With r = x − c and the angular velocity ω the point has the velocity v_c + ω ×
/// r and the acceleration a_c + ω̇ × r + ω × (ω × r). Angles are in radians, counter-clockwise in the plane and by
/// the right-hand rule in space. ω and ω̇ are vectors in space, not in the frame of the body.
///
/// All values must belong to the same motion: ω is the rate of R, ω̇ is the rate of ω.
/// [`verify::gap_jacobian`](crate::verify::gap_jacobian) checks them by comparing gap rates with differences.
///
/// ```
/// use contact_dynamics::contact::RigidMotion;
///
/// // A wheel of radius 0.5 rolls to the right at 2 m/s: it turns clockwise about its center, which moves.
/// let wheel = |t: f64| {
///     RigidMotion::about_point([0.0, 0.5], [-4.0 * t, -4.0, 0.0]).translated([[2.0 * t, 0.0], [2.0, 0.0], [0.0; 2]])
/// };
/// let now = wheel(0.3);
/// let ground = [0.6, 0.0]; // where it touches the ground it is at rest, and is accelerated upward by ω² r
/// assert!(now.velocity_at(ground).iter().all(|v| v.abs() < 1e-15));
/// assert!((now.acceleration_at(ground)[1] - 8.0).abs() < 1e-14);
/// // The point of the wheel that is there now, in the frame of the wheel, and back.
/// let [x, y] = now.to_space(now.to_own(ground));
/// assert!((x - 0.6).abs() < 1e-15 && y.abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidMotion<T, const D: usize> {
    /// The position of the origin of the body's frame, its velocity and its acceleration.
    origin: [[T; D]; 3],
    /// None for a pure translation, which saves the products.
    turn: Option<Turn<T, D>>,
}

/// A rotation by rows, and the skew matrices of ω × and ω̇ ×.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turn<T, const D: usize> {
    rotation: [[T; D]; D],
    spin: [[T; D]; D],
    spin_rate: [[T; D]; D],
}

fn product<T: Real, const D: usize>(matrix: &[[T; D]; D], x: [T; D]) -> [T; D] {
    matrix.map(|row| dot(row, x))
}

fn transposed_product<T: Real, const D: usize>(matrix: &[[T; D]; D], x: [T; D]) -> [T; D] {
    std::array::from_fn(|k| matrix.iter().zip(x).map(|(row, x)| row[k] * x).sum())
}

fn plus<T: Real, const D: usize>(x: [T; D], y: [T; D]) -> [T; D] {
    std::array::from_fn(|k| x[k] + y[k])
}

/// The matrix of ω ×.
fn skew<T: Real>([x, y, z]: [T; 3]) -> [[T; 3]; 3] {
    let zero = T::zero();
    [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
}

/// A translation, from (displacement, velocity, acceleration).
impl<T: Real, const D: usize> From<[[T; D]; 3]> for RigidMotion<T, D> {
    fn from(translation: [[T; D]; 3]) -> Self {
        Self { origin: translation, turn: None }
    }
}

impl<T: Real> RigidMotion<T, 2> {
    /// Rotation about a fixed point, by an angle with its first and second time derivative.
    ///
    /// ```
    /// use contact_dynamics::contact::RigidMotion;
    /// let quarter = RigidMotion::about_point([1.0, 0.0], [std::f64::consts::FRAC_PI_2, 3.0, 0.0]);
    /// let [x, y] = quarter.to_space([2.0, 0.0]);
    /// assert!((x - 1.0).abs() < 1e-15 && (y - 1.0).abs() < 1e-15);
    /// let [u, v] = quarter.velocity_at([1.0, 1.0]);
    /// assert!((u + 3.0).abs() < 1e-15 && v.abs() < 1e-15);
    /// ```
    pub fn about_point(point: [T; 2], [angle, velocity, acceleration]: [T; 3]) -> Self {
        let (sin, cos) = angle.sin_cos();
        let skew = |rate: T| [[T::zero(), -rate], [rate, T::zero()]];
        let turn = Turn { rotation: [[cos, -sin], [sin, cos]], spin: skew(velocity), spin_rate: skew(acceleration) };
        Self::turned_about(point, turn)
    }
}

impl<T: Real> RigidMotion<T, 3> {
    /// Rotation about a fixed axis, of any length, through a fixed point. The angle comes with its first and second
    /// time derivative. For an axis of length zero the rotation is NaN, which is rejected.
    ///
    /// ```
    /// use contact_dynamics::contact::RigidMotion;
    /// let turntable = RigidMotion::about_axis([0.0; 3], [0.0, 0.0, 2.0], [0.0, 5.0, 1.0]);
    /// assert_eq!(turntable.velocity_at([0.1, 0.0, 0.7]), [0.0, 0.5, 0.0]);
    /// assert_eq!(turntable.acceleration_at([0.1, 0.0, 0.7]), [-2.5, 0.1, 0.0]);
    /// ```
    pub fn about_axis(point: [T; 3], axis: [T; 3], [angle, velocity, acceleration]: [T; 3]) -> Self {
        let axis = unit_or_nan(axis);
        // Rodrigues: R = 1 + sin θ K + (1 − cos θ) K², K the matrix of the axis.
        let (sin, half) = (angle.sin(), (T::of(0.5) * angle).sin());
        let (around, versine) = (skew(axis), T::of(2.0) * half * half);
        let rotation = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let unit = if i == j { T::one() } else { T::zero() };
                unit + sin * around[i][j] + versine * (axis[i] * axis[j] - unit)
            })
        });
        Self::rotation(point, rotation, axis.map(|n| velocity * n), axis.map(|n| acceleration * n))
    }

    /// Any rotation about a fixed point: the rotation matrix by rows (p + y moves to p + R y), the angular velocity
    /// and the angular acceleration as vectors in space.
    ///
    /// The matrix must be orthonormal within √ε and not a reflection; this is checked where the motion is used.
    ///
    /// ```
    /// use contact_dynamics::contact::RigidMotion;
    /// // The y axis has become the x axis, x is −y now; turning about z.
    /// let rows = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    /// let motion = RigidMotion::rotation([0.0; 3], rows, [0.0, 0.0, 2.0], [0.0; 3]);
    /// assert_eq!(motion.to_space([0.0, 4.0, 1.0]), [4.0, 0.0, 1.0]);
    /// assert_eq!(motion.velocity_at([4.0, 0.0, 1.0]), [0.0, 8.0, 0.0]);
    /// ```
    pub fn rotation(
        point: [T; 3],
        rotation: [[T; 3]; 3],
        angular_velocity: [T; 3],
        angular_acceleration: [T; 3],
    ) -> Self {
        let turn = Turn { rotation, spin: skew(angular_velocity), spin_rate: skew(angular_acceleration) };
        Self::turned_about(point, turn)
    }
}

impl<T: Real, const D: usize> RigidMotion<T, D> {
    /// A rotation about a point, from the rotation matrix and its rates.
    fn turned_about(point: [T; D], turn: Turn<T, D>) -> Self {
        let arm = product(&turn.rotation, point);
        let velocity = product(&turn.spin, arm);
        let acceleration = plus(product(&turn.spin_rate, arm), product(&turn.spin, velocity));
        let origin = [minus(point, arm), velocity.map(|v| -v), acceleration.map(|a| -a)];
        Self { origin, turn: Some(turn) }
    }

    /// Adds a translation in space: (displacement, velocity, acceleration). A point about which the body turns then
    /// moves by it.
    #[must_use]
    pub fn translated(mut self, translation: [[T; D]; 3]) -> Self {
        for (own, added) in self.origin.iter_mut().zip(translation) {
            *own = plus(*own, added);
        }
        self
    }

    /// The position in space of a point of the body, from its position in the frame of the body.
    pub fn to_space(&self, y: [T; D]) -> [T; D] {
        plus(self.origin[0], self.direction(y))
    }

    /// The position in the frame of the body of a point at x in space.
    pub fn to_own(&self, x: [T; D]) -> [T; D] {
        self.own_direction(minus(x, self.origin[0]))
    }

    /// Velocity of the point of the body that is at x in space.
    pub fn velocity_at(&self, x: [T; D]) -> [T; D] {
        let [at, velocity, _] = self.origin;
        match &self.turn {
            None => velocity,
            Some(turn) => plus(velocity, product(&turn.spin, minus(x, at))),
        }
    }

    /// Acceleration of the point of the body that is at x in space.
    pub fn acceleration_at(&self, x: [T; D]) -> [T; D] {
        let [at, _, acceleration] = self.origin;
        match &self.turn {
            None => acceleration,
            Some(turn) => {
                let r = minus(x, at);
                let toward = product(&turn.spin, product(&turn.spin, r));
                plus(acceleration, plus(product(&turn.spin_rate, r), toward))
            }
        }
    }

    /// A direction of the body in space: R n.
    pub(super) fn direction(&self, n: [T; D]) -> [T; D] {
        self.turn.as_ref().map_or(n, |turn| product(&turn.rotation, n))
    }

    /// A direction of space in the frame of the body: Rᵀ n.
    fn own_direction(&self, n: [T; D]) -> [T; D] {
        self.turn.as_ref().map_or(n, |turn| transposed_product(&turn.rotation, n))
    }

    /// The velocity, in the body's frame, of a point at x with velocity v: ẏ = Rᵀ (v − v_c − ω × r).
    pub(super) fn own_velocity(&self, x: [T; D], v: [T; D]) -> [T; D] {
        self.own_direction(minus(v, self.velocity_at(x)))
    }

    /// The difference between the acceleration a, in space, of a point at x with velocity v, and its acceleration
    /// relative to the body: R ÿ = a − b with b = a_c + ω̇ × r + ω × (ω × r) + 2 ω × (v − v_c − ω × r).
    pub(super) fn apparent_acceleration(&self, x: [T; D], v: [T; D]) -> [T; D] {
        let acceleration = self.acceleration_at(x);
        match &self.turn {
            None => acceleration,
            Some(turn) => {
                let coriolis = product(&turn.spin, minus(v, self.velocity_at(x)));
                plus(acceleration, coriolis.map(|x| x + x))
            }
        }
    }

    /// The angle by which the body turns from here to `later`, after a time h: from the two rotations, or from the
    /// rate at either end, whichever is largest.
    pub(super) fn angle_to(&self, later: &Self, h: T) -> T {
        let (Some(from), Some(to)) = (&self.turn, &later.turn) else { return T::zero() };
        let (half, spare) = (T::of(0.5), T::of(D as f64 - 2.0));
        let trace: T = from.rotation.iter().zip(&to.rotation).map(|(a, b)| dot(*a, *b)).sum();
        let turned = (half * (trace - spare)).max(-T::one()).min(T::one()).acos();
        let rate = |spin: &[[T; D]; D]| (half * spin.iter().map(|row| dot(*row, *row)).sum::<T>()).sqrt();
        turned.max(h * rate(&from.spin)).max(h * rate(&to.spin))
    }

    /// A bound of the distance of a path from the straight line between its ends, in the frame of a body that turns
    /// by `angle`. The path is straight in space: from x, by `path` relative to the body's origin, in a time h. R ÿ is
    /// −a_c − ω × (ω × r) − 2 ω × w, and the distance of a curve from its chord is at most h² ÿ/8.
    pub(super) fn bend(&self, x: [T; D], path: [T; D], angle: T, h: T) -> T {
        if self.turn.is_none() {
            return T::zero();
        }
        let [at, _, acceleration] = self.origin;
        let length = |x: [T; D]| dot(x, x).sqrt();
        let (r, path) = (length(minus(x, at)), length(path));
        T::of(0.125) * (h * h * length(acceleration) + angle * (angle * (r + path) + path + path))
    }

    /// Displacement of the origin.
    pub(super) fn shift(&self) -> [T; D] {
        self.origin[0]
    }

    /// Rejects a matrix that is not a rotation.
    pub(super) fn check(&self) -> Result<()> {
        let Some(Turn { rotation, .. }) = &self.turn else { return Ok(()) };
        if let Some(index) = rotation.iter().flatten().position(|x| !x.is_finite()) {
            let value = rotation[index / D][index % D].value();
            return Err(Error::NotFinite { what: "the rotation of an obstacle (by rows)", index, value });
        }
        let mut largest = T::zero();
        for (i, row) in rotation.iter().enumerate() {
            for (j, other) in rotation.iter().enumerate() {
                let unit = if i == j { T::one() } else { T::zero() };
                largest = largest.max((dot(*row, *other) - unit).abs());
            }
        }
        if largest > half_digits() {
            return Err(Error::Parameter {
                name: "the largest entry of R Rᵀ − 1, R the rotation of an obstacle,",
                value: largest.value(),
                range: "at most √ε: give an orthonormal matrix",
            });
        }
        // In the plane this type makes all rotations itself.
        if D == 3 {
            let [a, b] = [rotation[0], rotation[1]];
            let normal: [T; D] =
                std::array::from_fn(|k| a[(k + 1) % D] * b[(k + 2) % D] - a[(k + 2) % D] * b[(k + 1) % D]);
            let determinant = dot(normal, rotation[2]);
            if determinant < T::zero() {
                return Err(Error::Parameter {
                    name: "the determinant of the rotation of an obstacle",
                    value: determinant.value(),
                    range: "1: the matrix reflects; turn the sign of one of its rows",
                });
            }
        }
        Ok(())
    }
}
