//! Impulses that change the kinetic energy by a given amount.

use super::Correction;
use crate::corrector::buffers::Given;
use crate::error::Result;
use crate::real::Real;
use crate::rounding::{rounding, share_of_rounding};

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
        let (s, rate) = (self.compliance(row)?, self.rate(row)?);
        // The gap rate is a small difference of large numbers; this is its rounding error.
        let noise = rounding(self.g.magnitude(row, &self.new.v) + self.buffers.rates[row].rate.abs());
        if !(s > T::zero() && T::of(2.0) * s * energy.abs() > noise * noise && energy.is_finite()) {
            return Ok(T::zero());
        }
        // ½ S j² + j rate = energy, without cancellation. If the rate has less energy than asked, all of it is taken.
        let root = (rate * rate + T::of(2.0) * s * energy).max(T::zero()).sqrt();
        Ok(match rate > T::zero() {
            true if root > T::zero() => T::of(2.0) * energy / (root + rate),
            _ => (root - rate) / s,
        })
    }

    /// Applies impulses that add (positive) energies to the bodies at several rows, all computed from the same
    /// velocities. Coupled impulses are scaled by one factor, so that together they change the energy by the sum.
    pub(in crate::corrector) fn exchange_energies(&mut self, given: &mut Given<T>) -> Result<()> {
        let Given { rows, energies, impulses, group } = given;
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
            let positions = self.projection.groups().group(number);
            if positions.len() < 2 {
                continue;
            }
            let coupled = |place: &usize| impulses[*place] != T::zero();
            group.clear();
            group.extend(positions.iter().copied().filter(coupled));
            let factor = self.factor_of(group, rows, [energies, impulses])?;
            for &place in &*group {
                impulses[place] *= factor;
            }
        }
        self.apply(rows, impulses)
    }

    /// The factor by which impulses at these places add the sum of their energies.
    fn factor_of(&mut self, places: &[usize], rows: &[usize], [energies, impulses]: [&[T]; 2]) -> Result<T> {
        let (mut energy, mut first, mut second) = (T::zero(), T::zero(), T::zero());
        for &place in places {
            let (row, impulse) = (rows[place], impulses[place]);
            let rate = self.g.product(row, &self.new.v) + self.buffers.rates[row].rate;
            energy += energies[place];
            first += impulse * rate;
        }
        for (i, &place) in places.iter().enumerate() {
            for &other in &places[..=i] {
                self.projection.assemble(self.g, &[rows[place], rows[other]], &mut self.buffers.s)?;
                let twice = if place == other { T::one() } else { T::of(2.0) };
                second += twice * impulses[place] * self.buffers.s[1] * impulses[other];
            }
        }
        // ½ second x² + first x = energy.
        let root = (first * first + T::of(2.0) * second * energy).max(T::zero()).sqrt();
        let factor = if first > T::zero() { T::of(2.0) * energy / (root + first) } else { (root - first) / second };
        Ok(if factor.is_finite() { factor } else { T::one() })
    }

    /// Whether a contact that took `energy` at impact does not return it, because it opens only by rounding: bodies
    /// that stay together without force open by the sign of the last bit. The rounding is measured by the speed that
    /// the impact took, which is relative. The force of the impact itself does not count as a holding force; with
    /// damping it is not zero. If a pressed row is a multiple of this row, both are one contact, and the energy
    /// passes to the pressed row.
    pub(in crate::corrector) fn withholds(&mut self, row: usize, energy: T) -> Result<bool> {
        let s = self.compliance(row)?;
        let speed = (T::of(2.0) * s * energy).sqrt();
        let Some(noise) = self.parts_by_rounding(row, speed)? else { return Ok(false) };
        let mut pressed = self.buffers.closed.iter().copied().filter(|&other| self.is_pressed(other));
        if let Some(other) = pressed.find(|&other| self.g.are_multiples(row, other)) {
            self.contacts.dissipated[row] = T::zero();
            self.contacts.dissipated[other] += energy;
            return Ok(true);
        }
        let struck = s * self.buffers.struck[row].abs() > T::of(0.1 * self.h) * speed;
        Ok(struck || T::of(self.h) * s * self.previous_force(row) <= noise)
    }

    /// Whether a closed row holds its bodies by more than rounding: within a step its force moves the gap, or the
    /// impulse of its velocity jump moves the gap rate, by more than their rounding. For rates the rounding is a
    /// share of ε^⅔.
    pub(in crate::corrector) fn holds(&mut self, row: usize, impulse: T) -> Result<bool> {
        let s = self.compliance(row)?;
        let h = T::of(self.h);
        let of_rate =
            share_of_rounding::<T>() * (self.g.magnitude(row, &self.new.v) + self.buffers.rates[row].rate.abs());
        let magnitude = self.g.magnitude(row, &self.new.u);
        let of_gap = self.constraints.0.gap_rounding(row, magnitude, self.contacts.gap[row]) + h * of_rate;
        let by_force = T::of(self.scheme.response[0].abs()) * h * h * s * self.contacts.lambda_raw[row].abs();
        // Written so that NaN counts as holding.
        let by_rounding = by_force <= of_gap && s * impulse.abs() <= of_rate;
        Ok(!by_rounding)
    }

    /// If gap and gap rate of an opened contact are within rounding, where the rate may be wrong by a share of ε^⅔ of
    /// `speed`: returns the rounding of the rate.
    pub(in crate::corrector) fn parts_by_rounding(&mut self, row: usize, speed: T) -> Result<Option<T>> {
        let rate = self.rate(row)?;
        let own = rounding(self.g.magnitude(row, &self.new.v) + self.buffers.rates[row].rate.abs());
        let noise = share_of_rounding::<T>() * speed + own;
        let of_gap = T::of(16.0) * rounding(self.g.magnitude(row, &self.new.u));
        let parts = rate <= noise && self.contacts.gap[row] <= T::of(self.h) * noise + of_gap;
        Ok(parts.then_some(noise))
    }
}
