//! The gaps of all constraints of a run as one list, independent of the types of the constraints.

use super::{ContactLaw, GapRates, Tangents};
use crate::error::Result;
use crate::real::Real;

/// The gaps of all rows of a run, as a step evaluates them. Gaps that are NaN or infinite are rejected.
pub(crate) trait Gaps<T: Real> {
    fn law(&self, row: usize) -> ContactLaw;

    /// Whether any rows change with u.
    fn turn(&self) -> bool;

    /// The rounding error of a gap if the terms of G u have this magnitude.
    fn gap_rounding(&self, row: usize, magnitude: T, gap: T) -> T;

    fn rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) -> Result<()>;

    fn tangents(&self) -> &Tangents;

    /// The parts of slips and of their rates that do not come from v and a, one entry per tangential row.
    fn slip_rates(&mut self, t: f64, u: &[T], v: &[T], out: &mut [GapRates<T>]) -> Result<()>;

    /// Gaps, gap rates or gap accelerations (`field` 0, 1, 2) at another motion (time; u, v, a), from rows linearized
    /// there. Then the rows are linearized at `here` (time, u) again.
    fn elsewhere(&mut self, field: usize, there: (f64, [&[T]; 3]), here: (f64, &[T]), out: &mut [T]) -> Result<()>;
}

/// Borrowed gaps that can be debug-printed.
pub(crate) struct ErasedGaps<'a, T: Real>(pub(crate) &'a mut dyn Gaps<T>);

impl<T: Real> std::fmt::Debug for ErasedGaps<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Gaps")
    }
}
