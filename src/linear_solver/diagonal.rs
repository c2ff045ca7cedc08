//! Diagonal systems: explicit schemes with a lumped mass.

use super::{Factorization, LinearSolver};
use crate::error::{Error, Result};
use crate::real::Real;
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};

/// Division by the diagonal.
#[derive(Clone, Copy, Debug, Default)]
pub struct Diagonal;

#[derive(Debug)]
struct Inverse<T> {
    inverse: Vec<T>,
}

/// Whether every stored entry is on the diagonal.
pub(super) fn is_diagonal(pattern: SymbolicSparseColMatRef<'_, usize>) -> bool {
    (0..pattern.ncols()).all(|j| pattern.row_idx_of_col_raw(j).iter().all(|&i| i == j))
}

impl<T: Real> LinearSolver<T> for Diagonal {
    fn analyze(&self, pattern: SymbolicSparseColMatRef<'_, usize>) -> Result<Box<dyn Factorization<T>>> {
        if !is_diagonal(pattern) {
            return Err(Error::Incompatible {
                part: "the diagonal solver".into(),
                reason: "the effective matrix has entries off the diagonal; use Cholesky",
            });
        }
        Ok(Box::new(Inverse { inverse: vec![T::zero(); pattern.ncols()] }))
    }
}

impl<T: Real> Factorization<T> for Inverse<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        for (dof, inverse) in self.inverse.iter_mut().enumerate() {
            let value = a.val_of_col(dof).iter().copied().sum::<T>();
            if !(value > T::zero() && value.is_finite()) {
                return Err(Error::Singular { matrix: "diagonal matrix", dof });
            }
            *inverse = value.recip();
        }
        Ok(())
    }

    fn solve(&mut self, rhs: &mut [T]) {
        for column in rhs.chunks_exact_mut(self.inverse.len()) {
            for (x, &inverse) in column.iter_mut().zip(&self.inverse) {
                *x *= inverse;
            }
        }
    }

    fn stored_values(&self) -> usize {
        self.inverse.len()
    }
}
