//! The motion at which a tangent is evaluated.

use crate::state::Motion;
use crate::system::Path;

/// Where a tangent is evaluated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct At<'m, T> {
    pub(crate) t: f64,
    pub(crate) u: &'m [T],
    pub(crate) v: &'m [T],
    pub(crate) of: TangentOf<'m, T>,
}

impl<'m, T> At<'m, T> {
    /// A motion and the force there.
    pub(crate) fn state(motion: &'m Motion<T>) -> Self {
        Self { t: motion.t, u: &motion.u, v: &motion.v, of: TangentOf::State }
    }
}

/// The force that a tangent belongs to.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TangentOf<'m, T> {
    /// The force of the motion.
    State,
    /// The system's own force along a path.
    Path(Path<'m, T>),
    /// Simpson's mean over a path with this end, whose middle is the motion.
    Simpson { end: &'m [T] },
}
