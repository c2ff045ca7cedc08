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

/// √ε, half of the digits: a solved value may miss its bound by this share of itself.
pub(crate) fn root_of_rounding<T: Real>() -> T {
    T::epsilon().sqrt()
}

/// A share of the coefficients of a scheme below which only rounding remains after subtractions.
pub(crate) const ONLY_ROUNDING: f64 = 1e-12;

// Correctors.

/// How many roundings of a gap the sums of a step may add to it. A number.
pub(crate) const ROUNDINGS_OF_STEP: f64 = 32.0;

// Contact.

/// The gap below which a contact touches: 1e-10 of the displacement in the step, plus its rounding. A length.
pub(crate) fn touching<T: Real>(way: T) -> T {
    T::of(1e-10) * way + rounding(way)
}
