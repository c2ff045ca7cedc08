//! Checks for the parts a host writes itself.

mod gap_jacobian;
mod tangent;

pub use gap_jacobian::{GapJacobianError, gap_jacobian};
pub use tangent::{ForceMismatch, MatrixMismatch, TangentError, tangent};
