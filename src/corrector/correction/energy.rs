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

    /// Whether a contact that took `energy` at impact opens by rounding alone: bodies that stay together without force
    /// do so by the sign of the last bit. Measured by the speed that was taken, which is relative.
    pub(in crate::corrector) fn opens_by_rounding(&mut self, row: usize, energy: T) -> Result<bool> {
        let (s, rate) = (self.compliance(row)?, self.rate(row)?);
        let bound = T::of(T::epsilon().value().powf(2.0 / 3.0)) * (T::of(2.0) * s * energy).sqrt();
        let noise = rounding(self.g.magnitude(row, &self.new.v) + self.buffers.rates[row].rate.abs());
        let gap = self.contacts.gap[row];
        let gap_noise = T::of(16.0) * rounding(self.g.magnitude(row, &self.new.u));
        let h = T::of(self.h);
        Ok(rate <= bound + noise
            && gap <= h * (bound + noise) + gap_noise
            && h * s * self.previous_force(row) <= bound + noise)
    }
}
