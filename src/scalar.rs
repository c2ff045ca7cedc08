//! Requirements of the kernels on a scalar: trait bounds, and conversions from and to `f64`.

use faer::traits::RealField;
use num_traits::{Float, NumAssign};
use std::iter::Sum;

/// A scalar of the kernels, `f32` or `f64`.
pub(crate) trait Scalar: Float + NumAssign + RealField + Sum + Send + Sync + 'static {
    /// The scalar nearest to `x`.
    fn of(x: f64) -> Self;
    /// The value as `f64`.
    fn value(self) -> f64;
}

impl Scalar for f64 {
    #[inline]
    fn of(x: f64) -> Self {
        x
    }
    #[inline]
    fn value(self) -> f64 {
        self
    }
}

impl Scalar for f32 {
    #[inline]
    #[allow(clippy::cast_possible_truncation)]
    fn of(x: f64) -> Self {
        x as Self
    }
    #[inline]
    fn value(self) -> f64 {
        f64::from(self)
    }
}
