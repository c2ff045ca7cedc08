//! The gaps of all constraints of a run as one list, for those who read them without knowing the constraints.

use super::{ContactLaw, GapRates, Tangents};
use crate::error::Result;
use crate::real::Real;

/// The gaps of all rows of a run, as a step evaluates them: those that are NaN or infinite are refused.
pub(crate) trait Gaps<T: Real> {
    fn law(&self, row: usize) -> ContactLaw;

    /// Whether any rows turn with u.
    fn turn(&self) -> bool;

    /// What of a gap is rounding, if the terms of G u have this magnitude.
    fn gap_rounding(&self, row: usize, magnitude: T, gap: T) -> T;

    fn rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) -> Result<()>;

    /// Which rows are those of friction.
    fn tangents(&self) -> &Tangents;

    /// What slips and their rates have of their own, one entry a tangential row.
    fn slip_rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) -> Result<()>;

    /// Gaps, gap rates or gap accelerations (`field` 0, 1, 2) at another motion (time; u, v, a), by rows linearized
    /// there; afterwards rows are those of `here` (time, u) again.
    fn elsewhere(&mut self, field: usize, there: (f64, [&[T]; 3]), here: (f64, &[T]), out: &mut [T]) -> Result<()>;
}

/// Borrowed gaps, debug-printable.
pub(crate) struct ErasedGaps<'a, T: Real>(pub(crate) &'a mut dyn Gaps<T>);

impl<T: Real> std::fmt::Debug for ErasedGaps<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Gaps")
    }
}

/// The share of a velocity, ε^⅔, that rounding may make of it: bodies that touch without force come apart, and
/// together, by the sign of the last bit.
pub(crate) fn share_of_rounding<T: Real>() -> T {
    T::of(T::epsilon().value().powf(2.0 / 3.0))
}

/// What rounding makes of a sum whose terms have this magnitude.
pub(crate) fn rounding<T: Real>(magnitude: T) -> T {
    T::of(64.0) * T::epsilon() * magnitude
}
