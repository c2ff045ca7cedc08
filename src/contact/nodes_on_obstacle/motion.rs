//! The motion of an obstacle, and bounds of the motion of nodes relative to it.

use crate::contact::RigidMotion;
use crate::error::Result;
use crate::real::Real;

use super::super::obstacle::{dot, minus};

pub(super) enum Motion<'a, T, const D: usize> {
    Rest,
    /// Displacement at t, its velocity and its acceleration.
    Shifting(Box<dyn FnMut(f64) -> [[T; D]; 3] + Send + 'a>),
    Turning(Box<dyn FnMut(f64) -> RigidMotion<T, D> + Send + 'a>),
}

impl<T: Real, const D: usize> Motion<'_, T, D> {
    /// The motion at t; rejected if its rotation is not a rotation.
    pub(super) fn at(&mut self, t: f64) -> Result<RigidMotion<T, D>> {
        match self {
            Self::Rest => Ok(RigidMotion::from([[T::zero(); D]; 3])),
            Self::Shifting(motion) => Ok(motion(t).into()),
            Self::Turning(motion) => {
                let motion = motion(t);
                motion.check()?;
                Ok(motion)
            }
        }
    }

    pub(super) fn is_rest(&self) -> bool {
        matches!(self, Self::Rest)
    }

    /// Whether the normals of the obstacle may change in space.
    pub(super) fn turns(&self) -> bool {
        matches!(self, Self::Turning(_))
    }
}

/// The motion of an obstacle from one time to another.
pub(super) struct Course<T, const D: usize> {
    pub(super) ends: [RigidMotion<T, D>; 2],
    /// The displacement of its origin between these times.
    carried: [T; D],
    /// The angle by which it turns.
    pub(super) angle: T,
    h: T,
}

impl<T: Real, const D: usize> Course<T, D> {
    /// Between two motions a time h apart.
    pub(super) fn new(ends: [RigidMotion<T, D>; 2], h: T) -> Self {
        let [from, to] = &ends;
        let (carried, angle) = (minus(to.shift(), from.shift()), from.angle_to(to, h));
        Self { ends, carried, angle, h }
    }

    /// A bound of the squared length of a path relative to the obstacle; `path` begins at x and is straight in space.
    pub(super) fn square(&self, x: [T; D], path: [T; D]) -> T {
        let straight = minus(path, self.carried);
        if self.angle == T::zero() {
            return dot(straight, straight);
        }
        let [from, to] = &self.ends;
        let chord = minus(to.to_own(std::array::from_fn(|k| x[k] + path[k])), from.to_own(x));
        let length = dot(chord, chord).sqrt() + self.bend(x, path);
        length * length
    }

    /// A bound of the distance of the path from the straight line between its ends, in the frame of the obstacle.
    pub(super) fn bend(&self, x: [T; D], path: [T; D]) -> T {
        self.ends[0].bend(x, minus(path, self.carried), self.angle, self.h)
    }
}
