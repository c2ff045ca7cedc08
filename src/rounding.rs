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

/// The share √ε, half of the digits. Less cannot be told from rounding where rounding enters by its root.
pub(crate) fn half_of_digits<T: Real>() -> T {
    T::epsilon().sqrt()
}

// Contact solvers.

/// The share of √(W_ii W_jj) by which W_ij and W_ji of a symmetric W may differ: the rounding of 64 terms.
pub(crate) fn asymmetry<T: Real>() -> T {
    rounding(T::of(64.0))
}

/// The share ε^⅖ of its motion without contact by which a gap may be violated by rounding, however large the forces of
/// badly conditioned rows are.
pub(crate) fn conditioned_share<T: Real>() -> T {
    T::of(T::epsilon().value().powf(0.4))
}

/// Gaps below this have lost their digits, as of motions that have died out: they need no solve. A length.
pub(crate) fn smallest_gap<T: Real>() -> T {
    T::min_positive_value() / T::epsilon()
}

// Contact.

/// The gap below which a contact touches: 1e-10 of the displacement in the step, plus its rounding. A length.
pub(crate) fn touching<T: Real>(way: T) -> T {
    T::of(1e-10) * way + rounding(way)
}
