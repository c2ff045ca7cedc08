//! Checks of parts that a host implements.

mod gap_jacobian;
mod tangent;

pub use gap_jacobian::{GapJacobianError, gap_jacobian};
pub use tangent::{ForceMismatch, MatrixMismatch, TangentError, tangent};
