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

/// Half of the digits: √ε.
pub(crate) fn half_digits<T: Real>() -> T {
    T::epsilon().sqrt()
}

// Contact.

/// The gap below which a contact touches: 1e-10 of the displacement in the step, plus its rounding. A length.
pub(crate) fn touching<T: Real>(way: T) -> T {
    T::of(1e-10) * way + rounding(way)
}

// Stages.

/// Rows linearized at the result of a stage are the rows solved for if gaps, relative to their change by the increment,
/// and forces, relative to their norm, differ by at most this share and no longer come closer.
pub(crate) const SAME_ROWS: f64 = 1e-7;

/// The part of a tolerance that the difference of a gap is compared with where the increment moves nothing, over
/// [`SAME_ROWS`].
pub(crate) const ROUNDING_OF_ROWS: f64 = 8.0 / SAME_ROWS;

/// A node at an edge has the normal of one facet or the other, and either pushes it to the other one. Rows alternate so
/// if gaps differ by at most this share of their change,
pub(crate) const ALTERNATING_GAPS: f64 = 1e-5;

/// forces by at most this share, the angle between two valid normals,
pub(crate) const ALTERNATING_FORCES: f64 = 0.1;

/// and the difference is at least this share of the difference two linearizations before.
pub(crate) const ALTERNATION: f64 = 0.999;

/// Displacements of dofs without mass have converged if the largest increment is this share of the first one.
pub(crate) const STATIC_INCREMENT: f64 = 1e-9;

/// An increment of Newton's method, over ε times the displacements, up to which a residual that has no scale may end the
/// iteration by stagnating.
pub(crate) const SMALL_INCREMENT: f64 = 1e4;

/// The largest compliance of a contact, over the diagonal entry of W: ε⁻⁴. The force of a softer contact is lost to
/// rounding.
pub(crate) fn largest_compliance<T: Real>() -> T {
    let square = T::epsilon() * T::epsilon();
    (square * square).recip()
}
