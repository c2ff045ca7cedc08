//! Sparse Cholesky through faer: simplicial L D Lᵀ for chains (with sweeps of our own), supernodal L Lᵀ for the rest.

use super::{Factorization, LinearSolver};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::real::kernels::{Factorization as Kind, Simplicial};
use crate::sparse;
use faer::Side;
use faer::dyn_stack::MemBuffer;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};

/// Sparse Cholesky factorization of symmetric positive definite matrices, ordered by approximate minimum degree.
///
/// faer chooses between a simplicial factor (long thin structures) and a supernodal one (plates, solids). A matrix that
/// is not positive definite is refused with the dof of the failing pivot, one that is not symmetric with its worst
/// entry. In `f32` fill entries far from the diagonal may become subnormal and slow a factorization down several times;
/// see `docs/design.md`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cholesky {}

struct Factor<T: Real> {
    symbolic: SymbolicCholesky<usize>,
    kind: Kind,
    values: Vec<T>,
    memory: MemBuffer,
    /// Right-hand sides that `memory` has room for.
    columns: usize,
    /// Pivots in the numbering of the matrix.
    pivots: Vec<T>,
    /// One right-hand side in the order of elimination; simplicial factors only.
    sweep: Vec<T>,
}

/// A pivot of a matrix with `n` dofs that keeps less than this share of its diagonal entry is what rounding leaves of zero.
fn negligible<T: Real>(n: usize) -> T {
    T::of(16.0 * (n as f64).sqrt()) * T::epsilon()
}

impl<T: Real> std::fmt::Debug for Factor<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Factor").field("kind", &self.kind).field("values", &self.values.len()).finish_non_exhaustive()
    }
}

impl<T: Real> LinearSolver<T> for Cholesky {
    fn analyze(&self, pattern: SymbolicSparseColMatRef<'_, usize>) -> Result<Box<dyn Factorization<T>>> {
        let out_of_memory = |_| Error::OutOfMemory { what: "a sparse Cholesky factor" };
        let symbolic = factorize_symbolic_cholesky(
            pattern,
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map_err(out_of_memory)?;
        let kind = match symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(_) => Kind::Ldlt,
            SymbolicCholeskyRaw::Supernodal(_) => Kind::Llt,
        };
        let scratch = T::cholesky_scratch(kind, &symbolic, 1);
        let memory = MemBuffer::try_new(scratch).map_err(|_| Error::OutOfMemory { what: "sparse Cholesky scratch" })?;
        let values = vec![T::zero(); symbolic.len_val()];
        let pivots = vec![T::zero(); symbolic.nrows()];
        let sweep = match kind {
            Kind::Ldlt => vec![T::zero(); symbolic.nrows()],
            Kind::Llt => Vec::new(),
        };
        Ok(Box::new(Factor { symbolic, kind, values, memory, columns: 1, pivots, sweep }))
    }
}

impl<T: Real> Factorization<T> for Factor<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        sparse::check_symmetric("effective", a)?;
        let Self { symbolic, kind, values, pivots, memory, .. } = self;
        let singular = |dof| Error::Singular { matrix: "effective matrix", dof };
        T::cholesky(*kind, symbolic, a, values, pivots, memory).map_err(singular)?;
        let negligible = negligible::<T>(pivots.len());
        // Written so that NaN is refused too.
        let sound = |(dof, &pivot): (usize, &T)| pivot > negligible * sparse::entry(a, dof, dof);
        match pivots.iter().enumerate().position(|pivot| !sound(pivot)) {
            Some(dof) => Err(singular(dof)),
            None => Ok(()),
        }
    }

    fn solve(&mut self, rhs: &mut [T]) {
        let columns = rhs.len().checked_div(self.symbolic.nrows()).unwrap_or(0);
        if let SymbolicCholeskyRaw::Simplicial(raw) = self.symbolic.raw() {
            let factor = Simplicial {
                pointers: raw.col_ptr(),
                rows: raw.row_idx(),
                values: &self.values,
                order: self.symbolic.perm().map(|perm| perm.arrays().0),
            };
            for column in rhs.chunks_exact_mut(self.symbolic.nrows()) {
                T::simplicial_solve(&factor, column, &mut self.sweep);
            }
            return;
        }
        if columns > self.columns {
            self.memory = MemBuffer::new(T::cholesky_scratch(self.kind, &self.symbolic, columns));
            self.columns = columns;
        }
        T::supernodal_solve(&self.symbolic, &self.values, rhs, columns, &mut self.memory);
    }

    fn stored_values(&self) -> usize {
        self.values.len()
    }
}
