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

/// √ε, as a share: of a facet's size, distances below it are rounding, so that they have no direction; entries of a
/// rotation differ by less than it from those of an orthonormal matrix.
pub(crate) fn root_of_rounding<T: Real>() -> T {
    T::epsilon().sqrt()
}

/// The covered share of a node's area below which the node has no row: weights divided by less would be rounding.
#[cfg(feature = "mesh-contact")]
pub(crate) const LEAST_COVER: f64 = 1e-6;
