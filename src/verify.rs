//! Checks of parts that a host implements, and of gradients.

mod gap_jacobian;
mod gradient;
mod tangent;

pub use gap_jacobian::{GapJacobianError, gap_jacobian};
pub use gradient::{GradientError, gradient};
pub use tangent::{ForceMismatch, MatrixMismatch, TangentError, tangent};
