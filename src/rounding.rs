//! Where rounding is judged: every tolerance of the crate has its name, quantity, unit and reason here.
//!
//! A tolerance is a share of the magnitudes from which a value is computed, so that results do not depend on units.
//! ε is the rounding of the scalar. The sections follow the modules that use them.

use num_traits::Float;

/// A number in the scalar of the run.
fn number<T: Float>(x: f64) -> T {
    T::from(x).unwrap_or_else(T::nan)
}

// Sums, in every module.

/// What rounding may add to a sum whose terms have this magnitude: 64 ε of it. In the unit of the sum.
pub(crate) fn rounding<T: Float>(magnitude: T) -> T {
    number::<T>(64.0) * T::epsilon() * magnitude
}

/// The share ε^⅔ of a velocity below which its last bits decide whether bodies that touch without force open or close.
pub(crate) fn share_of_rounding<T: Float>() -> T {
    T::epsilon().powf(number(2.0 / 3.0))
}

/// √ε, half of the digits: values that agree to this share agree as far as solves with a matrix of unknown condition
/// can tell.
pub(crate) fn half_of_digits<T: Float>() -> T {
    T::epsilon().sqrt()
}

// Linear solvers, mass and reduction.

/// 1e-3 ε, a share of the largest entry: updates and entries below it have no effect, also in a body a million times
/// as heavy as the one in contact with it, whose response is smaller than its own rounding.
pub(crate) fn far_below_rounding<T: Float>() -> T {
    number::<T>(1e-3) * T::epsilon()
}

/// A share of the length of a vector, of the coefficients of a scheme, or of a time, below which only rounding remains
/// after subtractions.
pub(crate) const ONLY_ROUNDING: f64 = 1e-12;

/// The allowed residual of computed modes in the norm of M, relative to a mode: far above rounding, below any error of
/// a mesh.
pub(crate) const MODE_RESIDUAL: f64 = 1e-9;

/// The relative difference from which eigenvalues count as distinct: double ones split by the root of rounding.
pub(crate) const DISTINCT: f64 = 1e-5;

// Analysis of schemes.

/// ε of the result of one operation.
pub(crate) fn of_operation(x: f64) -> f64 {
    f64::EPSILON * x.abs()
}

/// How far rounding splits a root of this multiplicity, relative to the largest entry of the matrix.
pub(crate) fn split_of_root(multiplicity: usize) -> f64 {
    f64::EPSILON.powf(1.0 / multiplicity as f64)
}

// Contact.

/// The gap below which a contact touches: 1e-10 of the displacement in the step, plus its rounding. A length.
pub(crate) fn touching<T: Float>(way: T) -> T {
    number::<T>(1e-10) * way + rounding(way)
}
