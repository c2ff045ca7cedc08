//! Diagonal systems: explicit schemes with a lumped mass.

use super::{Condensation, Factorization, LinearSolver, check_analysis};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::sparse;
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};

/// Division by the diagonal.
#[derive(Clone, Copy, Debug, Default)]
pub struct Diagonal;

#[derive(Debug)]
struct Inverse<T> {
    reciprocals: Vec<T>,
    interface: Vec<usize>,
    /// The solution between `condense` and `expand`.
    solution: Vec<T>,
}

/// Whether every stored entry is on the diagonal.
pub(super) fn is_diagonal(pattern: SymbolicSparseColMatRef<'_, usize>) -> bool {
    (0..pattern.ncols()).all(|j| pattern.row_idx_of_col_raw(j).iter().all(|&i| i == j))
}

impl<T: Real> LinearSolver<T> for Diagonal {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<T>>> {
        check_analysis(pattern, last)?;
        if !is_diagonal(pattern) {
            return Err(Error::Incompatible {
                part: "the diagonal solver".into(),
                reason: "the effective matrix has entries off the diagonal; use Cholesky",
            });
        }
        let zero = || vec![T::zero(); pattern.ncols()];
        Ok(Box::new(Inverse { reciprocals: zero(), interface: last.to_vec(), solution: zero() }))
    }
}

impl<T: Real> Factorization<T> for Inverse<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let dofs = sparse::square("effective matrix", a)?;
        if dofs != self.reciprocals.len() {
            return Err(Error::Dimension { what: "effective matrix", expected: self.reciprocals.len(), found: dofs });
        }
        if !is_diagonal(a.symbolic()) {
            let reason = "its pattern is not the one that was analyzed; analyze it again";
            return Err(Error::Incompatible { part: "the effective matrix".into(), reason });
        }
        for (dof, inverse) in self.reciprocals.iter_mut().enumerate() {
            let value = a.val_of_col(dof).iter().copied().sum::<T>();
            if !(value > T::zero() && value.is_finite()) {
                return Err(Error::Singular { matrix: "diagonal matrix", dof });
            }
            *inverse = value.recip();
        }
        Ok(())
    }

    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        for column in rhs.chunks_exact_mut(self.reciprocals.len()) {
            for (x, &inverse) in column.iter_mut().zip(&self.reciprocals) {
                *x *= inverse;
            }
        }
        Ok(())
    }

    fn is_symmetric(&self) -> bool {
        true
    }

    fn stored_values(&self) -> usize {
        self.reciprocals.len()
    }

    fn condensation(&mut self) -> Option<&mut dyn Condensation<T>> {
        Some(self)
    }
}

impl<T: Real> Condensation<T> for Inverse<T> {
    fn condense(&mut self, rhs: &[T], interface: &mut [T]) -> Result<()> {
        for ((x, &b), &inverse) in self.solution.iter_mut().zip(rhs).zip(&self.reciprocals) {
            *x = b * inverse;
        }
        for (x, &dof) in interface.iter_mut().zip(&self.interface) {
            *x = self.solution[dof];
        }
        Ok(())
    }

    fn expand(&mut self, interface: &[T], solution: &mut [T]) -> Result<()> {
        solution.copy_from_slice(&self.solution);
        for (&x, &dof) in interface.iter().zip(&self.interface) {
            solution[dof] = x;
        }
        Ok(())
    }

    fn solve(&mut self, forces: &mut [T]) -> Result<()> {
        if !self.interface.is_empty() {
            for column in forces.chunks_exact_mut(self.interface.len()) {
                for (x, &dof) in column.iter_mut().zip(&self.interface) {
                    *x *= self.reciprocals[dof];
                }
            }
        }
        Ok(())
    }
}
