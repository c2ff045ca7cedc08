//! A round cone with a base.

use super::{Obstacle, Side, across, check_radius, dot, finite, length, minus, round, round_curvature};
use crate::error::{Error, Result, positive};
use crate::real::Real;
use crate::rounding::rounding;

/// A straight round cone with a flat base and a rounded tip and rim: a funnel's plug, an indenter, a bit.
///
/// Tip and rim are not sharp for the same reason as the edges of a [`Cuboid`](super::Cuboid). The rounding removes a
/// part of the sharp cone and keeps its base and side: for radius R, height H and slant S = √(R² + H²) the tip
/// recedes by ρ (S/R − 1).
///
/// ```
/// use contact_dynamics::contact::{Cone, Obstacle};
/// let cone = Cone::new([0.0; 3], [0.0, 0.0, 4.0], 3.0, 0.5)?; // stands on its base, its side has the slope 4 : 3
/// assert_eq!(cone.distance([0.0, 1.0, -2.0]), (2.0, [0.0, 0.0, -1.0])); // below its base
/// let (gap, normal) = cone.distance([1.5 + 0.8, 0.0, 2.0 + 0.6]); // 1 away from the middle of its side
/// assert!((gap - 1.0_f64).abs() < 1e-14 && (normal[0] - 0.8).abs() < 1e-14 && (normal[2] - 0.6).abs() < 1e-14);
/// let (gap, _) = cone.distance([0.0, 0.0, 4.0]); // where a sharp tip would be
/// assert!((gap - 0.5 * (5.0 / 3.0 - 1.0)).abs() < 1e-14);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone<T> {
    /// Center of the base, and direction to the tip, of the cone without the rounding.
    base: [T; 3],
    axis: [T; 3],
    height: T,
    radius: T,
    /// Components of the normal of the side across and along the axis.
    side: [T; 2],
    rounding: T,
}

/// The nearest part of a cone; for a vertex of the meridian with the vector from it to the point.
enum Nearest<T> {
    /// Distance and normal of a face, across and along the axis.
    Face(T, [T; 2]),
    Tip([T; 3]),
    Rim([T; 3]),
}

impl<T: Real> Cone<T> {
    /// From the center of its base, its tip and the radius of its base as for a sharp cone, and the radius of its
    /// rounding (lengths).
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if base and tip are the same point, unless the radii are positive and finite, and if the
    /// rounding is larger than the radius of the ball that fits into the cone; [`Error::NotFinite`].
    pub fn new(base: [T; 3], tip: [T; 3], radius: T, rounding: T) -> Result<Self> {
        finite("the center of the cone's base", &base)?;
        finite("the tip of the cone", &tip)?;
        positive("the radius of the cone's base", radius.value())?;
        check_radius("the radius of the cone's rounding", rounding)?;
        let way = minus(tip, base);
        let axis = super::unit("the axis of the cone", way)?;
        let height = length(way);
        let slant = length([radius, height]);
        let ball = radius * (height / (radius + slant));
        if rounding > ball {
            let (name, range) = ("the radius of the cone's rounding", "at most that of the ball that fits into it");
            return Err(Error::Parameter { name, value: rounding.value(), range });
        }
        let left = T::one() - rounding / ball;
        Ok(Self {
            base: std::array::from_fn(|k| base[k] + rounding * axis[k]),
            axis,
            height: left * height,
            radius: left * radius,
            side: [height / slant, radius / slant],
            rounding,
        })
    }

    /// The direction from the axis to x, the distance from the axis, and the height above the base.
    fn meridian(&self, x: [T; 3]) -> ([T; 3], T, T) {
        let r = minus(x, self.base);
        let z = dot(r, self.axis);
        let off: [T; 3] = std::array::from_fn(|k| r[k] - z * self.axis[k]);
        let s = length(off);
        // On the axis itself any direction across it is valid; within rounding of it the direction is unknown.
        let outward = if s <= rounding(length(r) + self.height) { across(self.axis)[0] } else { off.map(|x| x / s) };
        (outward, s, z)
    }

    fn nearest(&self, (outward, s, z): ([T; 3], T, T)) -> Nearest<T> {
        let Self { height, radius, side, .. } = *self;
        let above = z - height;
        let [beside, down] = [side[0] * s + side[1] * above, side[1] * s - side[0] * above];
        let zero = T::zero();
        let arm = |s: T, z: T| std::array::from_fn(|k| s * outward[k] + z * self.axis[k]);
        let base = [zero, -T::one()];
        if beside <= zero && z >= zero {
            if beside > -z { Nearest::Face(beside, side) } else { Nearest::Face(-z, base) }
        } else if down < zero {
            Nearest::Tip(arm(s, above))
        } else if beside > zero && down <= length([radius, height]) {
            Nearest::Face(beside, side)
        } else if z < zero && s <= radius {
            Nearest::Face(-z, base)
        } else {
            Nearest::Rim(arm(s - radius, z))
        }
    }
}

impl<T: Real> Obstacle<T, 3> for Cone<T> {
    fn distance(&self, x: [T; 3]) -> (T, [T; 3]) {
        let meridian = self.meridian(x);
        match self.nearest(meridian) {
            Nearest::Face(distance, [out, up]) => {
                let normal = std::array::from_fn(|k| out * meridian.0[k] + up * self.axis[k]);
                (distance - self.rounding, normal)
            }
            Nearest::Tip(arm) | Nearest::Rim(arm) => round(arm, self.rounding, Side::Outside),
        }
    }

    fn curvature(&self, x: [T; 3], w: [T; 3]) -> T {
        let meridian = self.meridian(x);
        let (outward, s, _) = meridian;
        let (out, along) = (dot(w, outward), dot(w, self.axis));
        let meridional = std::array::from_fn(|k| out * outward[k] + along * self.axis[k]);
        let around = minus(w, meridional);
        // A normal with the component n across the axis turns by n φ along an arc of the angle φ.
        let circling = |n: T| if s > T::zero() { n * (dot(around, around) / s) } else { T::zero() };
        match self.nearest(meridian) {
            Nearest::Face(_, [n, _]) => circling(n),
            Nearest::Tip(arm) => round_curvature(arm, w, Side::Outside),
            Nearest::Rim(arm) => {
                let n = round(arm, self.rounding, Side::Outside).1;
                round_curvature(arm, meridional, Side::Outside) + circling(dot(n, outward))
            }
        }
    }

    fn magnitude(&self) -> T {
        let lengths = [self.rounding, self.height, self.radius];
        self.base.iter().chain(&lengths).fold(T::zero(), |largest, x| largest.max(x.abs()))
    }
}
