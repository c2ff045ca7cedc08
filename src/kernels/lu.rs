//! LU of sparse and of dense matrices.

use crate::scalar::Scalar;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::lu::partial_pivoting::factor::{lu_in_place, lu_in_place_scratch};
use faer::linalg::triangular_solve::{solve_unit_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::prelude::ReborrowMut;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu};
use faer::{Conj, MatMut, MatRef, Par, Spec};

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

/// Factorizes a dense row-major matrix with partial pivoting, in place. `order` receives the rows in the order of their
/// pivots, and the inverse of this order.
pub(crate) fn dense<T: Scalar>(
    size: usize,
    values: &mut [T],
    [order, inverse]: [&mut [usize]; 2],
    memory: &mut MemBuffer,
) {
    let a = MatMut::from_row_major_slice_mut(values, size, size);
    lu_in_place(a, order, inverse, Par::Seq, MemStack::new(memory), Spec::default());
}

/// Scratch for [`dense`].
#[inline]
pub(crate) fn dense_scratch<T: Scalar>(size: usize) -> StackReq {
    lu_in_place_scratch::<usize, T>(size, size, Par::Seq, Spec::default())
}

/// Solves L U x = b in place, with b in the order of the pivots.
#[inline]
pub(crate) fn dense_solve<T: Scalar>(size: usize, values: &[T], x: &mut [T]) {
    let factors = MatRef::from_row_major_slice(values, size, size);
    let mut x = MatMut::from_column_major_slice_mut(x, size, 1);
    solve_unit_lower_triangular_in_place(factors, x.rb_mut(), Par::Seq);
    solve_upper_triangular_in_place(factors, x, Par::Seq);
}
