//! Checks of numbers read from a file: rejects values that no run produces.

use crate::error::{Error, Result};
use crate::real::Real;

/// Upper bound of counts in a run; counts up to here are exact in `f64` and far from overflow.
pub(super) const COUNT: u64 = 1 << 53;

/// Rejects a list of another length than expected.
pub(super) fn length(what: &'static str, found: usize, expected: usize) -> Result<()> {
    match found == expected {
        true => Ok(()),
        false => Err(Error::Dimension { what, expected, found }),
    }
}

/// Rejects a vector of another length than expected, or with entries that are not finite.
pub(super) fn vector<T: Real>(what: &'static str, values: &[T], expected: usize) -> Result<()> {
    length(what, values.len(), expected)?;
    match values.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(Error::NotFinite { what, index, value: values[index].value() }),
        None => Ok(()),
    }
}

/// Rejects a number that is not in range.
pub(super) fn number(name: &'static str, value: f64, range: &'static str, is_fine: impl Fn(f64) -> bool) -> Result<()> {
    match is_fine(value) {
        true => Ok(()),
        false => Err(Error::Parameter { name, value, range }),
    }
}

/// Rejects a number that is infinite or no number.
pub(super) fn finite(name: &'static str, value: f64) -> Result<()> {
    number(name, value, "finite", f64::is_finite)
}

/// Rejects a duration that is not positive and finite.
pub(super) fn positive(name: &'static str, value: f64) -> Result<()> {
    number(name, value, "positive and finite", |value| value > 0.0 && value.is_finite())
}

/// Rejects a number that is negative, infinite or no number.
pub(super) fn not_negative(name: &'static str, value: f64) -> Result<()> {
    number(name, value, "finite, not negative", |value| value >= 0.0 && value.is_finite())
}

/// Rejects a count that is not in range.
pub(super) fn count(name: &'static str, value: u64, range: std::ops::RangeInclusive<u64>) -> Result<()> {
    number(name, value as f64, "a count that a run may have", |_| range.contains(&value))
}
