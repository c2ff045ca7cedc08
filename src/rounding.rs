//! Where rounding is judged: every tolerance of the crate has its name, quantity, unit and reason here.
//!
//! A tolerance is a share of the magnitudes from which a value is computed, so that results do not depend on units.
//! ε is the rounding of the scalar. The sections follow the modules that use them.

use crate::real::Real;

// Sums, in every module.

/// What rounding may add to a sum whose terms have this magnitude: 64 ε of it. In the unit of the sum.
pub(crate) fn rounding<T: Real>(magnitude: T) -> T {
    T::of(64.0) * T::epsilon() * magnitude
}

/// The share ε^⅔ of a velocity below which its last bits decide whether bodies that touch without force open or close.
pub(crate) fn share_of_rounding<T: Real>() -> T {
    T::of(T::epsilon().value().powf(2.0 / 3.0))
}

/// √ε: the share of their own magnitude by which values are changed for a difference that keeps half of the digits, and
/// by which rounding may move a solved force beyond its bound.
pub(crate) fn root_of_rounding<T: Real>() -> T {
    T::epsilon().sqrt()
}

// Contact.

/// The gap below which a contact touches: 1e-10 of the displacement in the step, plus its rounding. A length.
pub(crate) fn touching<T: Real>(way: T) -> T {
    T::of(1e-10) * way + rounding(way)
}

// Start.

/// What the input may add to a gap with this rounding: coordinates may have been written to a file with twelve digits.
/// A length.
pub(crate) fn rounding_of_input<T: Real>(rounded: T) -> T {
    T::of(64.0) * rounded
}

/// The share of a step by which the time of a resumed state may differ from the end of its history.
pub(crate) const SAME_TIME: f64 = 1e-6;

/// The share of the displacement along a row that a gap may miss before the row counts as turned: hosts may omit turns
/// that do not matter.
pub(crate) const TURNED: f64 = 0.01;
