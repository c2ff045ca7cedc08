//! Sparse LU: the calls that need faer's own bound on the scalar.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu};
use faer::{Conj, MatMut, Par, Spec};

/// Whether a factor solves with A or with Aᵀ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Given,
    Transposed,
}

#[doc(hidden)]
pub trait LuKernels: Sized {
    /// Factorizes with partial pivoting; a failure says at which column of the order of elimination.
    fn lu(
        symbolic: &SymbolicLu<usize>,
        a: SparseColMatRef<'_, usize, Self>,
        numeric: &mut NumericLu<usize, Self>,
        memory: &mut MemBuffer,
    ) -> Result<(), LuError>;
    /// Solves in place for the columns of `rhs`.
    fn lu_solve(
        factor: (&SymbolicLu<usize>, &NumericLu<usize, Self>),
        side: Side,
        rhs: &mut [Self],
        columns: usize,
        memory: &mut MemBuffer,
    );
    /// Scratch for factorizing and for solving `columns` right-hand sides.
    fn lu_scratch(symbolic: &SymbolicLu<usize>, columns: usize) -> StackReq;
}

macro_rules! kernels {
    ($scalar:ty) => {
        impl LuKernels for $scalar {
            fn lu(
                symbolic: &SymbolicLu<usize>,
                a: SparseColMatRef<'_, usize, Self>,
                numeric: &mut NumericLu<usize, Self>,
                memory: &mut MemBuffer,
            ) -> Result<(), LuError> {
                let stack = MemStack::new(memory);
                symbolic.factorize_numeric_lu(numeric, a, Par::Seq, stack, Spec::default()).map(|_| ())
            }
            fn lu_solve(
                (symbolic, numeric): (&SymbolicLu<usize>, &NumericLu<usize, Self>),
                side: Side,
                rhs: &mut [Self],
                columns: usize,
                memory: &mut MemBuffer,
            ) {
                let rhs = MatMut::from_column_major_slice_mut(rhs, symbolic.nrows(), columns);
                let (factor, stack) = (LuRef::new_unchecked(symbolic, numeric), MemStack::new(memory));
                match side {
                    Side::Given => factor.solve_in_place_with_conj(Conj::No, rhs, Par::Seq, stack),
                    Side::Transposed => factor.solve_transpose_in_place_with_conj(Conj::No, rhs, Par::Seq, stack),
                }
            }
            fn lu_scratch(symbolic: &SymbolicLu<usize>, columns: usize) -> StackReq {
                let solve = symbolic
                    .solve_in_place_scratch::<$scalar>(columns, Par::Seq)
                    .or(symbolic.solve_transpose_in_place_scratch::<$scalar>(columns, Par::Seq));
                solve.or(symbolic.factorize_numeric_lu_scratch::<$scalar>(Par::Seq, Spec::default()))
            }
        }
    };
}

kernels!(f64);
kernels!(f32);
