//! Sparse LU.

use crate::scalar::Scalar;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu};
use faer::{Conj, MatMut, Par, Spec};

/// Factorizes with partial pivoting; the error has the failing column in the elimination order.
#[inline]
pub(crate) fn factorize<T: Scalar>(
    symbolic: &SymbolicLu<usize>,
    a: SparseColMatRef<'_, usize, T>,
    numeric: &mut NumericLu<usize, T>,
    memory: &mut MemBuffer,
) -> Result<(), LuError> {
    symbolic.factorize_numeric_lu(numeric, a, Par::Seq, MemStack::new(memory), Spec::default()).map(|_| ())
}

/// Solves in place for the columns of `rhs`.
#[inline]
pub(crate) fn solve<T: Scalar>(
    (symbolic, numeric): (&SymbolicLu<usize>, &NumericLu<usize, T>),
    rhs: &mut [T],
    columns: usize,
    memory: &mut MemBuffer,
) {
    let rhs = MatMut::from_column_major_slice_mut(rhs, symbolic.nrows(), columns);
    let factor = LuRef::new_unchecked(symbolic, numeric);
    factor.solve_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(memory));
}

/// Scratch for factorizing and for solving `columns` right-hand sides.
#[inline]
pub(crate) fn scratch<T: Scalar>(symbolic: &SymbolicLu<usize>, columns: usize) -> StackReq {
    let solve = symbolic.solve_in_place_scratch::<T>(columns, Par::Seq);
    solve.or(symbolic.factorize_numeric_lu_scratch::<T>(Par::Seq, Spec::default()))
}
