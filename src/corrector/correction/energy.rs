//! Impulses that change the kinetic energy by a given amount.

use super::{Correction, rounding};
use crate::error::Result;
use crate::real::Real;

impl<T: Real> Correction<'_, T> {
    /// Applies an impulse along a row that changes the kinetic energy by `energy`, seen from the obstacle and as far as
    /// there is one: the bodies leave each other faster, or with a negative energy slower. Returns the impulse; zero,
    /// and nothing is done, for an energy below the rounding of the velocities.
    ///
    /// # Errors
    ///
    /// As [`apply_impulses`](Self::apply_impulses).
    pub fn exchange_energy(&mut self, row: usize, energy: T) -> Result<T> {
        let (s, rate) = (self.compliance(row)?, self.rate(row)?);
        // The gap rate is a small difference of larger numbers; this is their rounding.
        let noise = rounding(self.g.magnitude(row, &self.new.v) + self.buffers.rates[row].rate.abs());
        if !(s > T::zero() && T::of(2.0) * s * energy.abs() > noise * noise && energy.is_finite()) {
            return Ok(T::zero());
        }
        // ½ S j² + j rate = energy, without cancellation; beyond what the rate holds, all of it.
        let root = (rate * rate + T::of(2.0) * s * energy).max(T::zero()).sqrt();
        let impulse = match rate > T::zero() {
            true if root > T::zero() => T::of(2.0) * energy / (root + rate),
            _ => (root - rate) / s,
        };
        self.apply(&[row], &[impulse])?;
        Ok(impulse)
    }
}
