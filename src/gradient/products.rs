//! Transposed products with K and C of a system, at a motion.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::sparse::{self, Product, Symmetry};
use crate::system::{Linearity, System, TangentWeights};
use faer::sparse::SparseColMat;

/// K and C of a system.
pub(super) struct Tangents<T> {
    stiffness: Tangent<T>,
    /// None without damping.
    damping: Option<Tangent<T>>,
    is_constant: bool,
    is_known: bool,
}

/// The values of a tangent in the order of the pattern of the system, or the matrix if it is constant and symmetric.
enum Tangent<T> {
    General(Vec<T>),
    Symmetric(SparseColMat<usize, T>, Product<T>),
}

impl<T: Real> Tangents<T> {
    pub(super) fn of(system: &mut dyn System<T>) -> Self {
        let entries = system.pattern().row_idx().len();
        let is_constant = system.linearity() == Linearity::Linear;
        // Only a linear system says by its damping force whether K alone is its tangent.
        let is_damped = !is_constant || system.damping_force().is_some();
        let tangent = || Tangent::General(vec![T::zero(); entries]);
        Self { stiffness: tangent(), damping: is_damped.then(tangent), is_constant, is_known: false }
    }

    /// Evaluates K and C at a motion.
    pub(super) fn evaluate(&mut self, system: &mut dyn System<T>, at: (f64, &[T], &[T])) -> Result<()> {
        if self.is_constant && self.is_known {
            return Ok(());
        }
        self.stiffness.evaluate(system, at, TangentWeights::new(T::one(), T::zero()), self.is_constant)?;
        if let Some(damping) = &mut self.damping {
            damping.evaluate(system, at, TangentWeights::new(T::zero(), T::one()), self.is_constant)?;
        }
        self.is_known = true;
        Ok(())
    }

    /// `out += c Kᵀ x`.
    pub(super) fn add_stiffness(&mut self, system: &dyn System<T>, c: T, x: &[T], out: &mut [T]) {
        self.stiffness.add_transposed(system, (c, x), out);
    }

    /// `out += c Cᵀ x`.
    pub(super) fn add_damping(&mut self, system: &dyn System<T>, c: T, x: &[T], out: &mut [T]) {
        if let Some(damping) = &mut self.damping {
            damping.add_transposed(system, (c, x), out);
        }
    }
}

impl<T: Real> Tangent<T> {
    fn evaluate(
        &mut self,
        system: &mut dyn System<T>,
        (t, u, v): (f64, &[T], &[T]),
        weights: TangentWeights<T>,
        is_constant: bool,
    ) -> Result<()> {
        let Self::General(values) = self else { return Ok(()) };
        system.tangent(t, u, v, weights, values)?;
        if is_constant {
            let no_memory = |_| Error::OutOfMemory { what: "the tangent of a gradient", bytes: None };
            let pattern = system.pattern().to_owned().map_err(no_memory)?;
            let matrix = SparseColMat::new(pattern, std::mem::take(values));
            if sparse::symmetry("tangent", matrix.as_ref())? == Symmetry::Symmetric {
                let mut product = Product::new(matrix.as_ref(), Symmetry::Symmetric)?;
                product.pack_large(matrix.as_ref())?;
                *self = Self::Symmetric(matrix, product);
            } else {
                *values = matrix.val().to_vec();
            }
        }
        Ok(())
    }

    fn add_transposed(&mut self, system: &dyn System<T>, (c, x): (T, &[T]), out: &mut [T]) {
        let values = match self {
            Self::Symmetric(matrix, product) => return product.add(c, matrix.as_ref(), x, out),
            Self::General(values) => values,
        };
        let pattern = system.pattern();
        for (column, out) in out.iter_mut().enumerate() {
            let range = pattern.col_range(column);
            let rows = &pattern.row_idx()[range.clone()];
            *out += c * rows.iter().zip(&values[range]).map(|(&row, &value)| value * x[row]).sum::<T>();
        }
    }
}
