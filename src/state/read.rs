//! Checks of numbers read from a file: rejects values that no run produces.

use crate::error::{Error, Result};
use crate::real::Real;
use std::borrow::Cow;

/// Upper bound of counts in a run; counts up to here are exact in `f64` and far from overflow.
pub(super) const COUNT: u64 = 1 << 53;

/// Rejects a list of another length than expected.
pub(super) fn length(what: &'static str, found: usize, expected: usize) -> Result<()> {
    match found == expected {
        true => Ok(()),
        false => Err(Error::Dimension { what, expected, found }),
    }
}

/// The entries of a vector, if they are finite and as many as expected.
pub(super) fn vector<T: Real>(what: &'static str, values: Cow<'_, [T]>, expected: usize) -> Result<Vec<T>> {
    length(what, values.len(), expected)?;
    match values.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(Error::NotFinite { what, index, value: values[index].value() }),
        None => Ok(values.into_owned()),
    }
}

/// The same for a vector that may be missing and is then empty.
pub(super) fn optional<T: Real>(what: &'static str, values: Cow<'_, [T]>, expected: usize) -> Result<Vec<T>> {
    let expected = if values.is_empty() { 0 } else { expected };
    vector(what, values, expected)
}

/// Rejects a number that is not in range.
pub(super) fn number(name: &'static str, value: f64, range: &'static str, is_fine: impl Fn(f64) -> bool) -> Result<()> {
    match is_fine(value) {
        true => Ok(()),
        false => Err(Error::Parameter { name, value, range }),
    }
}

/// Rejects a count that is not in range.
pub(super) fn count(name: &'static str, value: u64, range: std::ops::RangeInclusive<u64>) -> Result<()> {
    number(name, value as f64, "a count that a run may have", |_| range.contains(&value))
}
