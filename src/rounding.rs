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

/// The share ε^⅔ of a velocity below which its last bits decide whether bodies that touch without force open or close;
/// of the diagonal, below which a pivot may be rounding multiplied by the condition of the earlier ones.
pub(crate) fn share_of_rounding<T: Float>() -> T {
    T::epsilon().powf(number(2.0 / 3.0))
}

/// √ε, half of the digits: values that agree to this share agree as far as solves with a matrix of unknown condition
/// can tell; the share by which values are changed for a difference that keeps half of the digits, and by which
/// rounding may move a solved force beyond its bound. Distances below this share of the size of a facet have no
/// direction; a matrix is a rotation if it differs from an orthonormal one by less.
pub(crate) fn half_digits<T: Float>() -> T {
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

// Contact solvers.

/// The share of √(W_ii W_jj) by which W_ij and W_ji of a symmetric W may differ: the rounding of 64 terms.
pub(crate) fn asymmetry<T: Float>() -> T {
    rounding(number(64.0))
}

/// The share ε^⅖ of its motion without contact by which a gap may be violated by rounding, however large the forces of
/// badly conditioned rows are.
pub(crate) fn conditioned_share<T: Float>() -> T {
    T::epsilon().powf(number(0.4))
}

/// The residual of the balance, in the energy of unit motions and relative to the contact forces, at which an iteration
/// without W ends: forces then have eleven digits.
pub(crate) fn projected_residual<T: Float>() -> T {
    number::<T>(1e-12).max(number::<T>(8.0) * T::epsilon())
}

/// The residual of the first contact problem of a stage with turning rows, relative to the contact forces; and of a
/// later one, divided by the largest change of its rows since the last problem.
pub(crate) const FIRST_RESIDUAL: f64 = 1e-4;
pub(crate) const RESIDUAL_BY_MISS: f64 = 1e-3;

/// Gaps below this have lost their digits, as of motions that have died out: they need no solve. A length.
pub(crate) fn smallest_gap<T: Float>() -> T {
    T::min_positive_value() / T::epsilon()
}

// Correctors.

/// A closed row is a combination of others if these leave less than this share of its S_ii: rows of the same node that
/// differ by a milliradian. As equations of their own such rows would ask for a thousand times the accelerations by
/// which they differ (theory, section 5.4).
pub(crate) const ONE_ROW: f64 = 1e-6;

/// How many roundings of a gap the sums of a step may add to it. A number.
pub(crate) const ROUNDINGS_OF_STEP: f64 = 32.0;

// Contact.

/// The gap below which a contact touches: 1e-10 of the displacement in the step, plus its rounding. A length.
pub(crate) fn touching<T: Float>(way: T) -> T {
    number::<T>(1e-10) * way + rounding(way)
}

// Gradients.

/// The largest difference between derivatives of rows by differences over two distances: relative to the derivative,
/// and to the derivative of a row that turns by 1 over the length of its facet. Across a jump of the row it is larger.
pub(crate) const DIFFERENCES: f64 = 1e-4;

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

/// At the last linearization of a stage rows may alternate by this share of the forces, if gaps differ by at most
/// [`ALTERNATING_GAPS`] of the displacement that contact undoes.
pub(crate) const LAST_FORCES: f64 = 1e-3;

/// An increment of Newton's method, over ε times the displacements, up to which a residual that has no scale may end
/// the iteration by stagnating.
pub(crate) const SMALL_INCREMENT: f64 = 1e4;

/// The largest compliance of a contact, over the diagonal entry of W: ε⁻⁴. The force of a softer contact is lost to
/// rounding.
pub(crate) fn largest_compliance<T: Float>() -> T {
    let square = T::epsilon() * T::epsilon();
    (square * square).recip()
}

// Stability.

/// Relative accuracy of the critical Ω of a scheme, computed in `f64`: its roots are double there, and accurate to the
/// square root of rounding only.
pub(crate) const CRITICAL_ACCURACY: f64 = 1e-7;

/// Relative accuracy of the square of the highest frequency if an error names the largest stable step: 0.1 % of h.
pub(crate) const FREQUENCY_ACCURACY: f64 = 2e-3;

/// Coefficients of a scheme, computed in `f64` from its rows, count as zero below this. Without unit.
pub(crate) const COEFFICIENT: f64 = 1e-9;

/// Relative error of a stiffness from differences of a force over the share √ε of the displacements: 32 √ε.
pub(crate) fn difference_error<T: Float>() -> T {
    number::<T>(32.0) * half_digits()
}

// Time.

/// Share of the step size within which two times, or two step sizes, count as the same.
pub(crate) const TIME_SHARE: f64 = 1e-9;

/// The distance between times near t that an `f64` can tell apart.
pub(crate) fn time_resolution(t: f64) -> f64 {
    t.abs().next_up() - t.abs()
}

// Start.

/// What the input may add to a gap with this rounding: coordinates may have been written to a file with twelve digits.
/// A length.
pub(crate) fn rounding_of_input<T: Float>(rounded: T) -> T {
    number::<T>(64.0) * rounded
}

/// The share of a step by which the time of a resumed state may differ from the end of its history.
pub(crate) const SAME_TIME: f64 = 1e-6;

/// The share of the displacement along a row that a gap may miss before the row counts as turned: hosts may omit turns
/// that do not matter.
pub(crate) const TURNED: f64 = 0.01;
