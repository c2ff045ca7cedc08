//! Cholesky factors: how they are stored and computed, sparse and dense, and the sweeps over simplicial ones.

use crate::scalar::Scalar;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::ldlt::factor::{LdltError, LdltRegularization};
use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::prelude::ReborrowMut;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use faer::sparse::linalg::cholesky::{SymbolicCholesky, SymbolicCholeskyRaw};
use faer::{MatMut, MatRef, Par, Side, Spec};
use std::ops::Range;

/// A simplicial L D Lᵀ in the order of elimination: each column holds 1/D, then L below it.
#[derive(Clone, Copy, Debug)]
pub struct Simplicial<'a, T> {
    pub pointers: &'a [usize],
    pub rows: &'a [usize],
    pub values: &'a [T],
    /// Number of entries omitted at the front of the swept vectors.
    pub skipped: usize,
}

/// A supernodal L Lᵀ.
#[derive(Clone, Copy, Debug)]
pub struct Supernodal<'a, T> {
    pub symbolic: &'a SymbolicSupernodalCholesky<usize>,
    pub values: &'a [T],
}

/// The right-hand side of a supernodal sweep, in the order of elimination.
#[derive(Debug)]
pub struct RightHandSide<'a, T> {
    /// Without its first `skipped` entries.
    pub values: &'a mut [T],
    pub skipped: usize,
    /// Memory for the rows of any supernode.
    pub scratch: &'a mut [T],
}

/// The supernodes that hold any of the columns.
#[inline]
pub(super) fn supernodes<T>(factor: &Supernodal<'_, T>, columns: &Range<usize>) -> Range<usize> {
    let begin = &factor.symbolic.supernode_begin()[..factor.symbolic.n_supernodes()];
    match columns.is_empty() {
        true => 0..0,
        false => begin.partition_point(|&b| b <= columns.start) - 1..begin.partition_point(|&b| b < columns.end),
    }
}

/// Factorizes a simplicial L D Lᵀ and writes the pivots; `Err` holds the failing index. Both in the numbering of the
/// caller.
#[inline]
pub(crate) fn simplicial<T: Scalar>(
    symbolic: &SymbolicCholesky<usize>,
    a: SparseColMatRef<'_, usize, T>,
    values: &mut [T],
    pivots: &mut [T],
    memory: &mut MemBuffer,
) -> Result<(), usize> {
    let (regularization, stack) = (LdltRegularization::default(), MemStack::new(memory));
    let factorized =
        symbolic.factorize_numeric_ldlt(values, a, Side::Lower, regularization, Par::Seq, stack, Spec::default());
    let original = |k: usize| symbolic.perm().map_or(k, |perm| perm.arrays().0[k]);
    if let Err(LdltError::ZeroPivot { index }) = factorized {
        // faer counts the pivots of simplicial factors from one.
        return Err(original(index.saturating_sub(1)));
    }
    // The caller checks the pivots: LDLᵀ of an indefinite matrix succeeds, and a singular one gives a pivot of
    // rounding size.
    if let SymbolicCholeskyRaw::Simplicial(raw) = symbolic.raw() {
        for (k, &start) in raw.col_ptr()[..symbolic.nrows()].iter().enumerate() {
            pivots[original(k)] = values[start];
            // The sweeps multiply by 1/D.
            values[start] = T::recip_impl(&values[start]);
        }
    }
    Ok(())
}

/// Scratch for factorizing a simplicial factor.
#[inline]
pub(crate) fn scratch<T: Scalar>(symbolic: &SymbolicCholesky<usize>) -> StackReq {
    symbolic.factorize_numeric_ldlt_scratch::<T>(Par::Seq, Spec::default())
}

// In a chain each unknown waits for its neighbor, which therefore stays in a register: a round trip through memory
// takes longer than the arithmetic.

/// Eliminates `columns` (in the order of elimination) of a simplicial factor: forward sweep and division by D.
#[inline]
pub(crate) fn simplicial_forward<T: Scalar>(factor: &Simplicial<'_, T>, columns: Range<usize>, x: &mut [T]) {
    let Simplicial { pointers, rows, values, skipped } = *factor;
    let mut next = x.get(columns.start - skipped).copied().unwrap_or(T::zero());
    for (j, range) in columns.clone().zip(pointers[columns.start..=columns.end].windows(2)) {
        let xj = next;
        next = x.get(j + 1 - skipped).copied().unwrap_or(T::zero());
        let below = range[0] + 1..range[1];
        for (&i, &l) in rows[below.clone()].iter().zip(&values[below]) {
            if i == j + 1 {
                next -= l * xj;
            } else {
                x[i - skipped] -= l * xj;
            }
        }
        x[j - skipped] = xj * values[range[0]];
    }
    if let Some(behind) = x.get_mut(columns.end - skipped) {
        *behind = next;
    }
}

/// The backward sweep over `columns`; later entries hold the solution.
#[inline]
pub(crate) fn simplicial_backward<T: Scalar>(factor: &Simplicial<'_, T>, columns: Range<usize>, x: &mut [T]) {
    let Simplicial { pointers, rows, values, skipped } = *factor;
    let mut last = x.get(columns.end - skipped).copied().unwrap_or(T::zero());
    for (j, range) in columns.clone().zip(pointers[columns.start..=columns.end].windows(2)).rev() {
        let below = range[0] + 1..range[1];
        let mut sum = x[j - skipped];
        for (&i, &l) in rows[below.clone()].iter().zip(&values[below]) {
            sum -= l * if i == j + 1 { last } else { x[i - skipped] };
        }
        x[j - skipped] = sum;
        last = sum;
    }
}

/// Factorizes the lower triangle of a dense column-major matrix into L Lᵀ, in place; returns whether all pivots were
/// positive.
#[inline]
pub(crate) fn dense<T: Scalar>(size: usize, values: &mut [T], memory: &mut MemBuffer) -> bool {
    let a = MatMut::from_column_major_slice_mut(values, size, size);
    let (regularization, stack) = (LltRegularization::default(), MemStack::new(memory));
    cholesky_in_place(a, regularization, Par::Seq, stack, Spec::default()).is_ok()
}

/// Scratch for [`dense`].
#[inline]
pub(crate) fn dense_scratch<T: Scalar>(size: usize) -> StackReq {
    cholesky_in_place_scratch::<T>(size, Par::Seq, Spec::default())
}

/// Solves L Lᵀ x = b in place.
#[inline]
pub(crate) fn dense_solve<T: Scalar>(size: usize, values: &[T], x: &mut [T]) {
    let l = MatRef::from_column_major_slice(values, size, size);
    let mut x = MatMut::from_column_major_slice_mut(x, size, 1);
    solve_lower_triangular_in_place(l, x.rb_mut(), Par::Seq);
    solve_upper_triangular_in_place(l.transpose(), x, Par::Seq);
}
