//! Impulses that change the kinetic energy by a given amount.

use super::Correction;
use crate::corrector::buffers::Given;
use crate::error::Result;
use crate::real::Real;
use crate::rounding::{ROUNDINGS_OF_STEP, rounding, share_of_rounding};

impl<T: Real> Correction<'_, T> {
    /// Applies an impulse along a row that changes the kinetic energy relative to the obstacle by `energy`. With a
    /// positive energy the bodies separate faster, with a negative one slower; at most the available energy is taken.
    /// Returns the impulse, which is zero for an energy below the rounding of the velocities.
    ///
    /// # Errors
    ///
    /// As [`apply_impulses`](Self::apply_impulses).
    pub fn exchange_energy(&mut self, row: usize, energy: T) -> Result<T> {
        let impulse = self.impulse_of(row, energy)?;
        if impulse != T::zero() {
            self.apply(&[row], &[impulse])?;
        }
        Ok(impulse)
    }

    /// The impulse of [`exchange_energy`](Self::exchange_energy).
    fn impulse_of(&mut self, row: usize, energy: T) -> Result<T> {
        let s = self.compliance(row)?;
        self.read_rates()?;
        // The gap rate is a small difference of large numbers; this is its rounding error.
        let noise = rounding(self.g.magnitude(row, &self.new.v) + self.buffers.readings.rates[row].rate.abs());
        if !(s > T::zero() && T::of(2.0) * s * energy.abs() > noise * noise && energy.is_finite()) {
            return Ok(T::zero());
        }
        let mut impulse = [T::one()];
        Ok(if self.scale_to_energy(&[row], &mut impulse, energy)? { impulse[0] } else { T::zero() })
    }

    /// Scales impulses along rows by one factor so that together they change the kinetic energy relative to the
    /// obstacle by `energy`, ½ x² Xᵀ S X + x X · rates = energy, with the root that separates. At most the available
    /// energy is taken. Returns false, with the impulses unchanged, if there is no such factor.
    pub(in crate::corrector) fn scale_to_energy(
        &mut self,
        rows: &[usize],
        impulses: &mut [T],
        energy: T,
    ) -> Result<bool> {
        self.projection.assemble(self.g, rows, &mut self.buffers.scratch)?;
        let (s, rates) = (&self.buffers.scratch, &self.buffers.readings.rates);
        let (mut first, mut second) = (T::zero(), T::zero());
        for ((&row, &impulse), column) in rows.iter().zip(&*impulses).zip(s.chunks_exact(rows.len().max(1))) {
            first += impulse * (self.g.product(row, &self.new.v) + rates[row].rate);
            second += impulse * column.iter().zip(&*impulses).map(|(&s, &other)| s * other).sum::<T>();
        }
        let root = (first * first + T::of(2.0) * second * energy).max(T::zero()).sqrt();
        // Without cancellation.
        let factor = match first > T::zero() {
            true if root > T::zero() => T::of(2.0) * energy / (root + first),
            _ => (root - first) / second,
        };
        let exists = second > T::zero() && factor.is_finite();
        if exists {
            for impulse in impulses {
                *impulse *= factor;
            }
        }
        Ok(exists)
    }

    /// Applies impulses that add (positive) energies to the bodies at several rows, all computed from the same
    /// velocities. Coupled impulses are scaled by one factor, so that together they change the energy by the sum.
    pub(in crate::corrector) fn exchange_energies(&mut self, given: &mut Given<T>) -> Result<()> {
        let Given { rows, energies, impulses, group, shares } = given;
        for (&row, &energy) in rows.iter().zip(&*energies) {
            impulses.push(self.impulse_of(row, energy)?);
        }
        // A single row leaves the projection its factor.
        let mut groups = 0;
        if rows.len() > 1 {
            self.projection.sort(self.g, rows);
            groups = self.projection.groups().len();
        }
        for number in 0..groups {
            let places = self.projection.groups().group(number);
            if places.len() < 2 {
                continue;
            }
            group.clear();
            group.extend(places.iter().map(|&place| rows[place]));
            shares.clear();
            shares.extend(places.iter().map(|&place| impulses[place]));
            let energy = places.iter().map(|&place| energies[place]).sum();
            self.scale_to_energy(group, shares, energy)?;
            for (&place, &share) in self.projection.groups().group(number).iter().zip(&*shares) {
                impulses[place] = share;
            }
        }
        self.apply(rows, impulses)
    }

    /// Whether a contact that took `energy` at impact does not return it, because it opens only by rounding: bodies
    /// that stay together without force open by the sign of the last bit. The rounding is measured by the speed that
    /// the impact took, which is relative. The force of the impact itself does not count as a holding force; with
    /// damping it is not zero. If a pressed row is a multiple of this row, both are one contact, and the energy
    /// passes to the pressed row.
    pub(in crate::corrector) fn keeps_energy(&mut self, row: usize, energy: T) -> Result<bool> {
        let s = self.compliance(row)?;
        let speed = (T::of(2.0) * s * energy).sqrt();
        let Some(noise) = self.separates_by_rounding(row, speed)? else { return Ok(false) };
        let mut pressed = self.buffers.rows.closed.iter().copied().filter(|&other| self.is_pressed(other));
        if let Some(other) = pressed.find(|&other| self.g.are_multiples(row, other)) {
            self.contacts.dissipated[row] = T::zero();
            self.contacts.dissipated[other] += energy;
            return Ok(true);
        }
        let by_impact = s * self.buffers.rows.impacts[row].abs() > T::of(0.1 * self.scheme.h) * speed;
        Ok(by_impact || T::of(self.scheme.h) * s * self.previous_force(row) <= noise)
    }

    /// Whether a closed row holds its bodies by more than rounding: within a step its force moves the gap, or the
    /// impulse of its velocity jump moves the gap rate, by more than their rounding. For rates the rounding is a
    /// share of ε^⅔.
    pub(in crate::corrector) fn holds(&mut self, row: usize, impulse: T) -> Result<bool> {
        let s = self.compliance(row)?;
        let h = T::of(self.scheme.h);
        let of_rate = share_of_rounding::<T>()
            * (self.g.magnitude(row, &self.new.v) + self.buffers.readings.rates[row].rate.abs());
        let magnitude = self.g.magnitude(row, &self.new.u);
        let of_gap = self.constraints.0.gap_rounding(row, magnitude, self.contacts.gap[row]) + h * of_rate;
        let by_force = T::of(self.scheme.response[0].abs()) * h * h * s * self.contacts.lambda_raw[row].abs();
        // Written so that NaN counts as holding.
        let by_rounding = by_force <= of_gap && s * impulse.abs() <= of_rate;
        Ok(!by_rounding)
    }

    /// If gap and gap rate of an opened contact are within rounding, where the rate may be wrong by a share of ε^⅔ of
    /// `speed`: returns the rounding of the rate.
    pub(in crate::corrector) fn separates_by_rounding(&mut self, row: usize, speed: T) -> Result<Option<T>> {
        let rate = self.rate(row)?;
        let own = rounding(self.g.magnitude(row, &self.new.v) + self.buffers.readings.rates[row].rate.abs());
        let noise = share_of_rounding::<T>() * speed + own;
        let of_gap = T::of(ROUNDINGS_OF_STEP) * rounding(self.g.magnitude(row, &self.new.u));
        let separates = rate <= noise && self.contacts.gap[row] <= T::of(self.scheme.h) * noise + of_gap;
        Ok(separates.then_some(noise))
    }
}
