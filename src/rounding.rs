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

// Geometry of surfaces.

/// The share of a facet or an edge, and the sine of an angle, below which a value is rounding.
pub(crate) const ROUNDED_SHARE: f64 = 1e-9;

/// The distance that counts as contact with a facet or an edge, and the motion over which its shape is taken as
/// constant, as a share of its length: 1e-3, a typical strain.
pub(crate) const NEAR_SHARE: f64 = 1e-3;

/// The least area of a corner of a facet, and volume of a cell, as a share of the power of its size: smaller is flat.
pub(crate) const SMALLEST_AREA: f64 = 1e-10;

/// The least common part of two facets, as a share of the area of a facet: its quadrature points would be rounding.
pub(crate) const SLIVER: f64 = 1e-12;

/// The least covered share of a node's area for a row. The row of a smaller part would be nearly singular.
pub(crate) const LEAST_COVER: f64 = 1e-6;

/// The deviation of a quadrilateral from a parallelogram, as a share of its sides, up to which its shape functions are
/// integrated as those of a parallelogram.
pub(crate) const SKEWED: f64 = 1e-4;

/// The share of a function's square outside of the span of others below which the functions are linearly dependent.
pub(crate) const DEPENDENT: f64 = 1e-12;

/// The change of natural coordinates from which on Newton's method for a closest point converges quadratically.
pub(crate) const CONVERGING: f64 = 1e-7;

/// The least determinant of the matrix of Newton's method for a closest point, as a share of its diagonal's product.
pub(crate) const LEAST_CONVEXITY: f64 = 1e-3;

/// √ε: the share of a length below which the direction of a difference of positions is rounding.
pub(crate) fn root_of_rounding<T: Real>() -> T {
    T::epsilon().sqrt()
}
