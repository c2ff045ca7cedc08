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

// Contact.

/// The gap below which a contact touches: 1e-10 of the displacement in the step, plus its rounding. A length.
pub(crate) fn touching<T: Real>(way: T) -> T {
    T::of(1e-10) * way + rounding(way)
}

// Stability.

/// Relative accuracy of the critical Ω of a scheme, computed in `f64`: its roots are double there, and accurate to the
/// square root of rounding only.
pub(crate) const CRITICAL_ACCURACY: f64 = 1e-7;

/// Relative accuracy of the square of the highest frequency if an error names the largest stable step: 0.1 % of h.
pub(crate) const FREQUENCY_ACCURACY: f64 = 2e-3;

/// Coefficients of a scheme, computed in `f64` from its rows, count as zero below this. Without unit.
pub(crate) const COEFFICIENT: f64 = 1e-9;

/// The share √ε of the displacements over which a force is differenced: half of the digits go to the difference.
pub(crate) fn difference_share<T: Real>() -> T {
    T::epsilon().sqrt()
}

/// Relative error of a stiffness from differences of a force: 32 √ε.
pub(crate) fn difference_error<T: Real>() -> f64 {
    32.0 * difference_share::<T>().value()
}

// Time.

/// Share of the step size within which two times, or two step sizes, count as the same.
pub(crate) const TIME_SHARE: f64 = 1e-9;

/// The distance between times near t that an `f64` can tell apart.
pub(crate) fn time_resolution(t: f64) -> f64 {
    t.abs().next_up() - t.abs()
}
