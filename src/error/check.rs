//! Checks of numbers given by the host.

use super::{Error, Result};
use crate::real::Real;

/// Rejects lengths, times, stiffnesses and the like that are not positive and finite.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<f64> {
    match value > 0.0 && value.is_finite() {
        true => Ok(value),
        false => Err(Error::Parameter { name, value, range: "positive and finite" }),
    }
}

/// Rejects step sizes that are not positive and finite, or whose square or its reciprocal the scalar cannot
/// represent.
pub(crate) fn step_size<T: Real>(h: f64) -> Result<()> {
    let fits = |x: f64| T::of(x).is_normal();
    match h > 0.0 && h.is_finite() && fits(h * h) && fits(1.0 / (h * h)) {
        true => Ok(()),
        false => Err(Error::Parameter {
            name: "the step size h",
            value: h,
            range: "positive and finite, with h² and 1/h² in the range of the scalar; choose another unit of time",
        }),
    }
}
