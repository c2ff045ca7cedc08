//! A box with sides along the axes.

use super::{Obstacle, Side, check_radius, finite, length, minus, round_curvature};
use crate::error::{Error, Result, positive};
use crate::real::Real;

/// A box, a rectangle in two dimensions, with sides along the axes and rounded edges.
///
/// No edge is sharp: at a sharp edge the normal would turn in no time, which no step can resolve. Steps must resolve
/// the rounding where nodes press on it; step control reduces them.
///
/// ```
/// use contact_dynamics::contact::{Cuboid, Obstacle};
/// let table = Cuboid::new([0.0, 0.0, -0.5], [2.0, 1.0, 0.5], 0.25)?; // 4 × 2 × 1, its top at z = 0
/// assert_eq!(table.distance([1.0, 0.5, 0.25]), (0.25, [0.0, 0.0, 1.0]));
/// assert_eq!(table.distance([0.0, 0.0, -0.125]), (-0.125, [0.0, 0.0, 1.0])); // inside
/// let (gap, normal) = table.distance([2.0, 0.0, 0.0]); // where a sharp edge would be
/// assert!((gap - 0.25 * (2.0_f64.sqrt() - 1.0)).abs() < 1e-15 && normal[0] == normal[2]);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid<T, const D: usize> {
    center: [T; D],
    /// Half of the side lengths, without the rounding.
    half: [T; D],
    rounding: T,
}

impl<T: Real, const D: usize> Cuboid<T, D> {
    /// Around a center, with half of its side lengths and the radius of its edges (lengths).
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless the sides and the radius are positive and finite, and the radius at most half of the
    /// shortest side; [`Error::NotFinite`].
    pub fn new(center: [T; D], half: [T; D], rounding: T) -> Result<Self> {
        finite("the center of the cuboid", &center)?;
        check_radius("the radius of the cuboid's edges", rounding)?;
        for half in half {
            let half = positive("half a side of the cuboid", half.value())?;
            if rounding.value() > half {
                let range = "at most half of the shortest side";
                return Err(Error::Parameter {
                    name: "the radius of the cuboid's edges",
                    value: rounding.value(),
                    range,
                });
            }
        }
        Ok(Self { center, half: half.map(|half| half - rounding), rounding })
    }

    /// How far x is beyond the sides without the rounding, along each axis: negative between them.
    fn beyond(&self, x: [T; D]) -> [T; D] {
        let r = minus(x, self.center);
        std::array::from_fn(|k| r[k].abs() - self.half[k])
    }

    /// The part of a vector along the axes on which x is beyond the sides.
    fn outer(beyond: [T; D], vector: [T; D]) -> [T; D] {
        std::array::from_fn(|k| if beyond[k] > T::zero() { vector[k] } else { T::zero() })
    }

    fn signs(&self, x: [T; D]) -> [T; D] {
        std::array::from_fn(|k| if x[k] < self.center[k] { -T::one() } else { T::one() })
    }
}

impl<T: Real, const D: usize> Obstacle<T, D> for Cuboid<T, D> {
    fn distance(&self, x: [T; D]) -> (T, [T; D]) {
        let (beyond, signs) = (self.beyond(x), self.signs(x));
        let farthest = (1..D).fold(0, |most, k| if beyond[k] > beyond[most] { k } else { most });
        let outer = beyond.iter().filter(|beyond| **beyond > T::zero()).count();
        if outer > 1 {
            let arm = Self::outer(beyond, beyond);
            let length = length(arm);
            return (length - self.rounding, std::array::from_fn(|k| signs[k] * arm[k] / length));
        }
        // NaN is passed on to the distance.
        let distance = beyond.iter().fold(beyond[farthest], |most, x| if x.is_nan() { *x } else { most });
        (distance - self.rounding, std::array::from_fn(|k| if k == farthest { signs[k] } else { T::zero() }))
    }

    fn curvature(&self, x: [T; D], w: [T; D]) -> T {
        let beyond = self.beyond(x);
        if beyond.iter().filter(|beyond| **beyond > T::zero()).count() < 2 {
            return T::zero();
        }
        let signs = self.signs(x);
        let arm = std::array::from_fn(|k| signs[k] * beyond[k]);
        round_curvature(Self::outer(beyond, arm), Self::outer(beyond, w), Side::Outside)
    }

    fn magnitude(&self) -> T {
        self.center.iter().chain(&self.half).fold(self.rounding, |largest, x| largest.max(x.abs()))
    }
}
