//! The check of a number given by the host.

use super::{Error, Result};

/// Rejects lengths, times, stiffnesses and the like that are not positive and finite.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<f64> {
    match value > 0.0 && value.is_finite() {
        true => Ok(value),
        false => Err(Error::Parameter { name, value, range: "positive and finite" }),
    }
}
