//! Dense steps of a supernodal factorization, by faer's kernels on one thread each.

use crate::scalar::Scalar;
use crate::threads::{self, Threads};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization, cholesky_in_place};
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, MatMut, MatRef, Par, Spec};
use std::ops::Range;

/// Some columns of a matrix.
pub(super) fn slab<'a, T>(a: MatRef<'a, T>, columns: &Range<usize>) -> MatRef<'a, T> {
    a.subcols(columns.start, columns.len())
}

/// The lower triangle of c A Aᵀ.
pub(super) fn lower_product<T: Scalar>(result: MatMut<'_, T>, accumulate: Accum, a: MatRef<'_, T>, c: T) {
    let (rectangle, lower) = (BlockStructure::Rectangular, BlockStructure::TriangularLower);
    triangular::matmul(result, lower, accumulate, a, rectangle, a.transpose(), rectangle, c, Par::Seq);
}

/// Factorizes a small block; `Err` holds the pivot that is not positive.
pub(super) fn pivots<T: Scalar>(block: MatMut<'_, T>, memory: &mut MemBuffer) -> Result<(), usize> {
    let regularization = LltRegularization::default();
    match cholesky_in_place(block, regularization, Par::Seq, MemStack::new(memory), Spec::default()) {
        Ok(_) => Ok(()),
        Err(LltError::NonPositivePivot { index }) => Err(index),
    }
}

/// Solves X Lᵀ = B in place, at most `rows` rows of B at a time.
pub(super) fn divide<T: Scalar>(threads: Threads, rows: usize, l: MatRef<'_, T>, b: MatMut<'_, T>) {
    let count = b.nrows();
    if count <= rows {
        return solve_lower_triangular_in_place(l, b.transpose_mut(), Par::Seq);
    }
    let (first, second) = b.split_at_row_mut((count / 2).next_multiple_of(rows));
    threads::join_by(threads, || divide(threads, rows, l, first), || divide(threads, rows, l, second));
}
