//! A capsule: all points near a straight line between two points.

use super::{Obstacle, Side, check_radius, dot, finite, minus, round, round_curvature};
use crate::error::Result;
use crate::real::Real;

/// A straight rod of constant thickness with round ends: a rod, a finger, a post.
///
/// ```
/// use contact_dynamics::contact::{Capsule, Obstacle};
/// let rod = Capsule::new([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], 0.5)?;
/// assert_eq!(rod.distance([1.0, 0.0, 2.0]), (1.5, [0.0, 0.0, 1.0])); // beside it
/// assert_eq!(rod.distance([5.0, 0.0, 0.0]), (2.5, [1.0, 0.0, 0.0])); // behind its end
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule<T, const D: usize> {
    ends: [[T; D]; 2],
    radius: T,
}

impl<T: Real, const D: usize> Capsule<T, D> {
    /// All points within `radius` (length) of the straight line between two points, which may be one.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless the radius is positive and finite,
    /// [`Error::NotFinite`](crate::Error::NotFinite).
    pub fn new(ends: [[T; D]; 2], radius: T) -> Result<Self> {
        for end in &ends {
            finite("an end of the capsule", end)?;
        }
        check_radius("the radius of the capsule", radius)?;
        Ok(Self { ends, radius })
    }

    /// The vector from the closest point of the axis to x; and the axis itself, if that point is between its ends.
    fn off_axis(&self, x: [T; D]) -> ([T; D], Option<[T; D]>) {
        let [from, to] = self.ends;
        let (axis, r) = (minus(to, from), minus(x, from));
        let (along, square) = (dot(r, axis), dot(axis, axis));
        if along <= T::zero() || square == T::zero() {
            (r, None)
        } else if along >= square {
            (minus(x, to), None)
        } else {
            let share = along / square;
            (std::array::from_fn(|k| r[k] - share * axis[k]), Some(axis))
        }
    }
}

impl<T: Real, const D: usize> Obstacle<T, D> for Capsule<T, D> {
    fn distance(&self, x: [T; D]) -> (T, [T; D]) {
        let (r, axis) = self.off_axis(x);
        match axis {
            // On the axis itself any direction across it is valid.
            Some(axis) if dot(r, r) == T::zero() => {
                let length = dot(axis, axis).sqrt();
                (-self.radius, super::across(axis.map(|x| x / length))[0])
            }
            _ => round(r, self.radius, Side::Outside),
        }
    }

    fn curvature(&self, x: [T; D], w: [T; D]) -> T {
        let (r, axis) = self.off_axis(x);
        let across = axis.map_or(w, |axis| {
            let share = dot(w, axis) / dot(axis, axis);
            std::array::from_fn(|k| w[k] - share * axis[k])
        });
        round_curvature(r, across, Side::Outside)
    }

    fn magnitude(&self) -> T {
        self.ends.iter().flatten().fold(self.radius, |largest, x| largest.max(x.abs()))
    }
}
