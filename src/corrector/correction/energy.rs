//! Work of the contacts, and impulses that change the kinetic energy by a given amount.

use super::{Buffers, Correction};
use crate::error::Result;
use crate::real::Real;

impl<T: Real> Correction<'_, T> {
    /// Applies an impulse along a row that changes the kinetic energy by `energy`, seen from the obstacle and as far as
    /// there is one: the bodies leave each other faster, or with a negative energy slower.
    ///
    /// # Errors
    ///
    /// As [`apply_impulses`](Self::apply_impulses).
    pub fn exchange_energy(&mut self, row: usize, energy: T) -> Result<()> {
        let (s, rate) = (self.compliance(row), self.rate(row)?);
        if s > T::zero() && energy != T::zero() && energy.is_finite() {
            // ½ S j² + rate j = energy; beyond what the rate holds, all of it.
            let root = (rate * rate + T::of(2.0) * s * energy).max(T::zero()).sqrt();
            return self.apply(&[row], &[(root - rate) / s]);
        }
        Ok(())
    }

    /// Work of the raw multipliers over the stage, each times the change of its gap.
    ///
    /// # Errors
    ///
    /// What a constraint says of the start of the stage.
    pub(in crate::corrector) fn contact_work(&mut self) -> Result<T> {
        let Self { buffers, contacts, constraints, past, new, .. } = self;
        let Buffers { closed, gaps, .. } = &mut **buffers;
        let Some(start) = past.first() else { return Ok(T::zero()) };
        constraints.0.elsewhere(0, start.place(), (new.t, &new.u), gaps)?;
        Ok(closed.iter().map(|&row| contacts.lambda_raw[row] * (contacts.gap[row] - gaps[row])).sum())
    }

    /// Changes the kinetic energy, seen from the obstacle, by `energy` through impulses in proportion to the raw
    /// multipliers of the closed rows, as far as there is any.
    pub(in crate::corrector) fn exchange_by_forces(&mut self, energy: T) -> Result<()> {
        self.read_rates()?;
        let rows = std::mem::take(&mut self.buffers.closed);
        let mut impulses = std::mem::take(&mut self.buffers.impulses);
        impulses.clear();
        impulses.extend(rows.iter().map(|&row| self.contacts.lambda_raw[row].max(T::zero())));
        self.projection.assemble(self.g, &rows, &mut self.buffers.s);
        let size = rows.len();
        let (mut square, mut rate) = (T::zero(), T::zero());
        for (i, (&row, &x)) in rows.iter().zip(&impulses).enumerate() {
            rate += x * (self.g.product(row, &self.new.v) + self.buffers.rates[row].rate);
            let column = &self.buffers.s[i * size..(i + 1) * size];
            square += x * column.iter().zip(&impulses).map(|(&s, &y)| s * y).sum::<T>();
        }
        let mut result = Ok(());
        if square > T::zero() {
            let root = (rate * rate + T::of(2.0) * square * energy).max(T::zero()).sqrt();
            let factor = (root - rate) / square;
            for x in &mut impulses {
                *x *= factor;
            }
            result = self.apply(&rows, &impulses);
        }
        self.buffers.closed = rows;
        self.buffers.impulses = impulses;
        result
    }
}
