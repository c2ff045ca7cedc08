//! The scalar of a run: `f32` or `f64`, and the kernels that are compiled inside this crate for both.
//!
//! A host in a debug build would otherwise compile the generic loops without optimization: with
//! `[profile.dev.package."*"] opt-level = 3` the functions instantiated here stay fast.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::{ldlt::factor::LdltError, llt::factor::LltError};
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, SymbolicCholeskyRaw};
use faer::traits::RealField;
use faer::{Conj, MatMut, Par, Side};
use num_traits::{Float, NumAssign};
use std::fmt::{Debug, Display, LowerExp};
use std::iter::Sum;

/// A real scalar, `f32` or `f64` (sealed).
///
/// Time, step size and scheme coefficients are `f64` in every run; `Real` is the type of matrices and vectors.
pub trait Real:
    kernels::Kernels + Float + NumAssign + Default + Debug + Display + LowerExp + Sum + Send + Sync + 'static
{
    /// The scalar nearest to `x`.
    fn of(x: f64) -> Self;
    /// The value as `f64`.
    fn value(self) -> f64;
}

/// Kernels instantiated in this crate; hidden, because only this crate calls or implements them.
pub(crate) mod kernels {
    use super::{Conj, LdltError, LltError, LltRef, MatMut, MemBuffer, MemStack, Par, Real, RealField, Side};
    use super::{SparseColMatRef, SupernodalLltRef, SymbolicCholesky, SymbolicCholeskyRaw};
    use faer::Spec;
    use faer::linalg::cholesky::{ldlt::factor::LdltRegularization, llt::factor::LltRegularization};

    /// How a factor of a symmetric matrix is stored.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Factorization {
        /// L D Lᵀ, simplicial.
        Ldlt,
        /// L Lᵀ, supernodal.
        Llt,
    }

    /// A simplicial L D Lᵀ in the order of elimination: each column holds 1/D, then L below it.
    #[derive(Clone, Copy, Debug)]
    pub struct Simplicial<'a, T> {
        pub pointers: &'a [usize],
        pub rows: &'a [usize],
        pub values: &'a [T],
        /// The dof eliminated k-th, if not the k-th itself.
        pub order: Option<&'a [usize]>,
    }

    #[doc(hidden)]
    pub trait Kernels: Sized {
        /// `out = c x`.
        fn scale_into(c: Self, x: &[Self], out: &mut [Self]);
        /// `out += c x`.
        fn axpy(c: Self, x: &[Self], out: &mut [Self]);
        /// `out += c (x − y)`.
        fn axpy_difference(c: Self, x: &[Self], y: &[Self], out: &mut [Self]);
        /// Whether every entry is finite.
        fn all_finite(x: &[Self]) -> bool;
        /// `y += c A x`, any A.
        fn product(c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self]);
        /// `y += c A x` for symmetric A (both triangles stored): columns are read as rows.
        fn symmetric_product(c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self]);
        /// Factorizes and writes the pivots; `Err` holds the failing index. Both in the numbering of the caller.
        fn cholesky(
            kind: Factorization,
            symbolic: &SymbolicCholesky<usize>,
            a: SparseColMatRef<'_, usize, Self>,
            values: &mut [Self],
            pivots: &mut [Self],
            memory: &mut MemBuffer,
        ) -> Result<(), usize>;
        /// Solves in place for the columns of `rhs` with a supernodal factor.
        fn supernodal_solve(
            symbolic: &SymbolicCholesky<usize>,
            values: &[Self],
            rhs: &mut [Self],
            columns: usize,
            memory: &mut MemBuffer,
        );
        /// Solves in place for one right-hand side with a simplicial factor; `x` is scratch.
        fn simplicial_solve(factor: &Simplicial<'_, Self>, rhs: &mut [Self], x: &mut [Self]);
        /// Scratch for factorizing and for solving `columns` right-hand sides.
        fn cholesky_scratch(
            kind: Factorization,
            symbolic: &SymbolicCholesky<usize>,
            columns: usize,
        ) -> faer::dyn_stack::StackReq;
    }

    // The generic bodies are inlined into the concrete implementations below, once a scalar.

    #[inline]
    fn product<T: Real>(c: T, a: SparseColMatRef<'_, usize, T>, x: &[T], y: &mut [T]) {
        for (j, &xj) in x.iter().enumerate() {
            let cx = c * xj;
            for (&i, &value) in a.row_idx_of_col_raw(j).iter().zip(a.val_of_col(j)) {
                y[i] += value * cx;
            }
        }
    }

    #[inline]
    fn symmetric_product<T: Real>(c: T, a: SparseColMatRef<'_, usize, T>, x: &[T], y: &mut [T]) {
        let (pointers, rows, values) = (a.col_ptr(), a.row_idx(), a.val());
        for (yj, range) in y.iter_mut().zip(pointers.windows(2)) {
            let mut sum = T::zero();
            for (&i, &value) in rows[range[0]..range[1]].iter().zip(&values[range[0]..range[1]]) {
                sum += value * x[i];
            }
            *yj += c * sum;
        }
    }

    #[inline]
    fn cholesky<T: RealField>(
        kind: Factorization,
        symbolic: &SymbolicCholesky<usize>,
        a: SparseColMatRef<'_, usize, T>,
        values: &mut [T],
        pivots: &mut [T],
        memory: &mut MemBuffer,
    ) -> Result<(), usize> {
        let stack = MemStack::new(memory);
        let failure = match kind {
            Factorization::Llt => symbolic
                .factorize_numeric_llt(
                    values,
                    a,
                    Side::Lower,
                    LltRegularization::default(),
                    Par::Seq,
                    stack,
                    Spec::default(),
                )
                .err()
                .map(|LltError::NonPositivePivot { index }| index),
            Factorization::Ldlt => symbolic
                .factorize_numeric_ldlt(
                    values,
                    a,
                    Side::Lower,
                    LdltRegularization::default(),
                    Par::Seq,
                    stack,
                    Spec::default(),
                )
                .err()
                .map(|LdltError::ZeroPivot { index }| index),
        };
        let original = |k: usize| symbolic.perm().map_or(k, |p| p.arrays().0[k]);
        if let Some(index) = failure {
            // faer counts pivots from one in simplicial factors and from zero in supernodal ones.
            let base = usize::from(matches!(symbolic.raw(), SymbolicCholeskyRaw::Simplicial(_)));
            return Err(original(index.saturating_sub(base)));
        }
        // Pivots, for the caller to judge: LDLᵀ of an indefinite matrix succeeds, and a singular one leaves a pivot of
        // rounding.
        match symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(raw) => {
                for (k, &start) in raw.col_ptr()[..symbolic.nrows()].iter().enumerate() {
                    pivots[original(k)] = values[start].clone();
                    // The sweeps multiply by 1/D.
                    values[start] = T::recip_impl(&values[start]);
                }
            }
            SymbolicCholeskyRaw::Supernodal(raw) => {
                for s in 0..raw.n_supernodes() {
                    let (start, block) =
                        (raw.supernode_begin()[s], SupernodalLltRef::new(raw, values).supernode(s).val());
                    for j in 0..block.ncols() {
                        pivots[original(start + j)] = T::abs2_impl(&block[(j, j)]);
                    }
                }
            }
        }
        Ok(())
    }

    /// Permute, sweep forward, divide, sweep backward, permute back.
    ///
    /// In a chain each unknown waits for its neighbor: that one stays in a register, because a round trip through
    /// memory takes longer than the arithmetic.
    #[inline]
    fn simplicial_solve<T: Real>(factor: &Simplicial<'_, T>, rhs: &mut [T], x: &mut [T]) {
        let Simplicial { pointers, rows, values, order } = *factor;
        match order {
            Some(order) => x.iter_mut().zip(order).for_each(|(x, &dof)| *x = rhs[dof]),
            None => x.copy_from_slice(rhs),
        }
        let mut next = x.first().copied().unwrap_or(T::zero());
        for (j, range) in pointers.windows(2).enumerate() {
            let xj = next;
            next = x.get(j + 1).copied().unwrap_or(T::zero());
            let below = range[0] + 1..range[1];
            for (&i, &l) in rows[below.clone()].iter().zip(&values[below]) {
                if i == j + 1 {
                    next -= l * xj;
                } else {
                    x[i] -= l * xj;
                }
            }
            x[j] = xj * values[range[0]];
        }
        let mut last = T::zero();
        for (j, range) in pointers.windows(2).enumerate().rev() {
            let below = range[0] + 1..range[1];
            let mut sum = x[j];
            for (&i, &l) in rows[below.clone()].iter().zip(&values[below]) {
                sum -= l * if i == j + 1 { last } else { x[i] };
            }
            x[j] = sum;
            last = sum;
        }
        match order {
            Some(order) => x.iter().zip(order).for_each(|(&x, &dof)| rhs[dof] = x),
            None => rhs.copy_from_slice(x),
        }
    }

    macro_rules! kernels {
        ($scalar:ty) => {
            impl Kernels for $scalar {
                fn scale_into(c: Self, x: &[Self], out: &mut [Self]) {
                    for (y, &x) in out.iter_mut().zip(x) {
                        *y = c * x;
                    }
                }
                fn axpy(c: Self, x: &[Self], out: &mut [Self]) {
                    for (y, &x) in out.iter_mut().zip(x) {
                        *y += c * x;
                    }
                }
                fn axpy_difference(c: Self, x: &[Self], y: &[Self], out: &mut [Self]) {
                    for ((out, &x), &y) in out.iter_mut().zip(x).zip(y) {
                        *out += c * (x - y);
                    }
                }
                fn all_finite(x: &[Self]) -> bool {
                    // x − x is 0 for finite x and NaN otherwise; the sum vectorizes, an early exit does not.
                    x.iter().map(|&x| x - x).sum::<$scalar>() == 0.0
                }
                fn product(c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self]) {
                    product(c, a, x, y);
                }
                fn symmetric_product(c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self]) {
                    symmetric_product(c, a, x, y);
                }
                fn cholesky(
                    kind: Factorization,
                    symbolic: &SymbolicCholesky<usize>,
                    a: SparseColMatRef<'_, usize, Self>,
                    values: &mut [Self],
                    pivots: &mut [Self],
                    memory: &mut MemBuffer,
                ) -> Result<(), usize> {
                    cholesky(kind, symbolic, a, values, pivots, memory)
                }
                fn supernodal_solve(
                    symbolic: &SymbolicCholesky<usize>,
                    values: &[Self],
                    rhs: &mut [Self],
                    columns: usize,
                    memory: &mut MemBuffer,
                ) {
                    let rhs = MatMut::from_column_major_slice_mut(rhs, symbolic.nrows(), columns);
                    let stack = MemStack::new(memory);
                    LltRef::new(symbolic, values).solve_in_place_with_conj(Conj::No, rhs, Par::Seq, stack);
                }
                fn simplicial_solve(factor: &Simplicial<'_, Self>, rhs: &mut [Self], x: &mut [Self]) {
                    simplicial_solve(factor, rhs, x);
                }
                fn cholesky_scratch(
                    kind: Factorization,
                    symbolic: &SymbolicCholesky<usize>,
                    columns: usize,
                ) -> faer::dyn_stack::StackReq {
                    let solve = symbolic.solve_in_place_scratch::<$scalar>(columns, Par::Seq);
                    let factorize = match kind {
                        Factorization::Llt => {
                            symbolic.factorize_numeric_llt_scratch::<$scalar>(Par::Seq, Spec::default())
                        }
                        Factorization::Ldlt => {
                            symbolic.factorize_numeric_ldlt_scratch::<$scalar>(Par::Seq, Spec::default())
                        }
                    };
                    solve.or(factorize)
                }
            }

            impl Real for $scalar {
                #[inline]
                #[allow(clippy::cast_possible_truncation)]
                fn of(x: f64) -> Self {
                    x as $scalar
                }
                #[inline]
                fn value(self) -> f64 {
                    f64::from(self)
                }
            }
        };
    }

    kernels!(f64);
    kernels!(f32);
}
