//! Why a reference solution cannot be built, and the checks of its parameters.

use std::error::Error;
use std::fmt;

/// Limit of events at the contact.
pub(super) const MAX_EVENTS: usize = 200_000;

/// Why a reference solution cannot be built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReferenceError {
    /// A parameter, or a quantity computed from it, is not finite or has the wrong sign.
    InvalidParameter {
        /// Name of the parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// More wave fronts than can be stored reach the contact before the horizon.
    TooManyEvents {
        /// Time reached.
        time: f64,
    },
}

impl fmt::Display for ReferenceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InvalidParameter { name, value } => write!(f, "invalid {name}: {value}"),
            Self::TooManyEvents { time } => {
                write!(f, "more than {MAX_EVENTS} wave fronts up to time {time}")
            }
        }
    }
}

impl Error for ReferenceError {}

pub(super) fn finite(name: &'static str, value: f64, valid: bool) -> Result<f64, ReferenceError> {
    if value.is_finite() && valid { Ok(value) } else { Err(ReferenceError::InvalidParameter { name, value }) }
}

pub(super) fn positive(name: &'static str, value: f64) -> Result<f64, ReferenceError> {
    finite(name, value, value > 0.0)
}
