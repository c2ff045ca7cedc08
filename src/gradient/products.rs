//! Transposed products with K and C of a system, at a motion.

use crate::error::Result;
use crate::real::Real;
use crate::system::{Linearity, System, TangentWeights};

/// The values of K and C in the order of the pattern of the system.
pub(super) struct Tangents<T> {
    stiffness: Vec<T>,
    /// Empty without damping.
    damping: Vec<T>,
    is_constant: bool,
    is_known: bool,
}

impl<T: Real> Tangents<T> {
    pub(super) fn of(system: &mut dyn System<T>) -> Self {
        let entries = system.pattern().row_idx().len();
        let is_constant = system.linearity() == Linearity::Linear;
        // Only a linear system says by its damping force whether K alone is its tangent.
        let is_damped = !is_constant || system.damping_force().is_some();
        let damping = vec![T::zero(); if is_damped { entries } else { 0 }];
        Self { stiffness: vec![T::zero(); entries], damping, is_constant, is_known: false }
    }

    /// Evaluates K and C at a motion.
    pub(super) fn evaluate(&mut self, system: &mut dyn System<T>, (t, u, v): (f64, &[T], &[T])) -> Result<()> {
        if self.is_constant && self.is_known {
            return Ok(());
        }
        system.tangent(t, u, v, TangentWeights::new(T::one(), T::zero()), &mut self.stiffness)?;
        if !self.damping.is_empty() {
            system.tangent(t, u, v, TangentWeights::new(T::zero(), T::one()), &mut self.damping)?;
        }
        self.is_known = true;
        Ok(())
    }

    /// `out += c Kᵀ x`.
    pub(super) fn add_stiffness(&self, system: &dyn System<T>, c: T, x: &[T], out: &mut [T]) {
        add_transposed(system, &self.stiffness, (c, x), out);
    }

    /// `out += c Cᵀ x`.
    pub(super) fn add_damping(&self, system: &dyn System<T>, c: T, x: &[T], out: &mut [T]) {
        if !self.damping.is_empty() {
            add_transposed(system, &self.damping, (c, x), out);
        }
    }
}

fn add_transposed<T: Real>(system: &dyn System<T>, values: &[T], (c, x): (T, &[T]), out: &mut [T]) {
    let pattern = system.pattern();
    for (column, out) in out.iter_mut().enumerate() {
        let range = pattern.col_range(column);
        let rows = &pattern.row_idx()[range.clone()];
        *out += c * rows.iter().zip(&values[range]).map(|(&row, &value)| value * x[row]).sum::<T>();
    }
}
