//! The scalar of a run, `f32` or `f64`, with kernels compiled for both inside this crate.
//!
//! A host's debug build would compile generic loops without optimization. Functions instantiated here stay fast with
//! `[profile.dev.package.contact-dynamics] opt-level = 3`.

mod stored;

use crate::kernels::chain::{self, Chains};
use crate::kernels::cholesky::{self, RightHandSide, Simplicial, Supernodal};
use crate::kernels::coarse::{self, NodeRows};
use crate::kernels::conjugate_gradients::{self, Deflation, Iteration, LANES, Outcome, Vectors};
use crate::kernels::forest::Forest;
use crate::kernels::lu;
use crate::kernels::product::{self, LowerColumns, Tridiagonal};
use crate::kernels::vector::{self, Accumulate};
use crate::kernels::{interleaved_sweep, supernodal, sweep};
use crate::scalar::Scalar;
use faer::dyn_stack::{MemBuffer, StackReq};
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::cholesky::SymbolicCholesky;
use faer::sparse::linalg::lu::{NumericLu, SymbolicLu};
use num_traits::{Float, NumAssign};
use std::fmt::{Debug, Display, LowerExp};
use std::iter::Sum;
use std::ops::Range;
use stored::Stored;

/// A real scalar, `f32` or `f64` (sealed).
///
/// Time, step size and scheme coefficients are `f64` in every run; `Real` is the type of matrices and vectors.
pub trait Real:
    Kernels + Stored + Float + NumAssign + Into<f64> + Default + Debug + Display + LowerExp + Sum + Send + Sync + 'static
{
    /// The scalar nearest to `x`.
    fn of(x: f64) -> Self;
    /// The value as `f64`.
    fn value(self) -> f64;
}

/// Declares kernels, and instantiates the generic functions that they name for both scalars.
macro_rules! kernels {
    ($(
        $(#[$doc:meta])*
        fn $name:ident $(<const $n:ident: usize>)?
            ($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)? = $kernel:path;
    )*) => {
        /// Kernels instantiated in this crate; hidden, because only this crate calls or implements them.
        #[doc(hidden)]
        pub trait Kernels: Sized {
            $($(#[$doc])* fn $name $(<const $n: usize>)? ($($argument: $type),*) $(-> $result)?;)*
        }

        impl Kernels for f64 {
            $(fn $name $(<const $n: usize>)? ($($argument: $type),*) $(-> $result)? { $kernel($($argument),*) })*
        }

        impl Kernels for f32 {
            $(fn $name $(<const $n: usize>)? ($($argument: $type),*) $(-> $result)? { $kernel($($argument),*) })*
        }
    };
}

kernels! {
    /// `out = c x`.
    fn scale_into(c: Self, x: &[Self], out: &mut [Self]) = vector::scale_into;
    /// `out += c x`.
    fn axpy(c: Self, x: &[Self], out: &mut [Self]) = vector::axpy;
    /// `out += c (x − y)`.
    fn axpy_difference(c: Self, x: &[Self], y: &[Self], out: &mut [Self]) = vector::axpy_difference;
    /// `out = Σ c x + Σ c (x − y)` in one pass, summed in this order; without a term nothing is written.
    fn combine(
        terms: &[(Self, &[Self])], differences: &[(Self, &[Self])], y: &[Self], out: &mut [Self]
    ) = vector::combine;
    /// Σ x y of several x of one length, in one pass.
    fn products<const N: usize>(x: [&[Self]; N], y: &[Self]) -> [Self; N] = vector::products;
    /// `out += Σ c x` of several x of one length, in one pass.
    fn add_all<const N: usize>(c: [Self; N], x: [&[Self]; N], out: &mut [Self]) = vector::add_all;
    /// `u += w₀ d, v += w₁ d`, and `a = w₂ d` or `a += w₂ d`, in one pass; returns whether the written values are
    /// finite.
    fn recover(weights: [Self; 3], d: &[Self], motion: [&mut [Self]; 3], a: Accumulate) -> bool = vector::recover;
    /// Whether every entry is finite.
    fn all_finite(x: &[Self]) -> bool = vector::all_finite;
    /// The largest |x|; NaN is ignored.
    fn largest(x: &[Self]) -> Self = vector::largest;
    /// `y += c A x`, any A.
    fn product(c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self]) = product::product;
    /// `y = c A x` or `y += c A x` for symmetric A (both triangles stored): columns are read as rows.
    fn symmetric_product(
        c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self], put: Accumulate
    ) = product::symmetric_product;
    /// `y = c A x` or `y += c A x` for tridiagonal symmetric A.
    fn tridiagonal_product(
        c: Self, a: Tridiagonal<'_, Self>, x: &[Self], y: &mut [Self], put: Accumulate
    ) = product::tridiagonal_product;
    /// `y += c A x` with some columns of a symmetric A from the diagonal down, and their mirror images; `y` starts at
    /// the first of the columns.
    fn lower_product(c: Self, columns: LowerColumns<'_, Self>, x: &[Self], y: &mut [Self]) = product::lower_product;
    /// Factorizes a simplicial L D Lᵀ and writes the pivots; `Err` holds the failing index. Both in the numbering of
    /// the caller.
    fn simplicial_cholesky(
        symbolic: &SymbolicCholesky<usize>,
        a: SparseColMatRef<'_, usize, Self>,
        values: &mut [Self],
        pivots: &mut [Self],
        memory: &mut MemBuffer,
    ) -> Result<(), usize> = cholesky::simplicial;
    /// Factorizes a supernodal L Lᵀ and writes the pivots; `Err` holds the failing index. Both in the numbering of the
    /// matrix.
    fn supernodal_cholesky(
        problem: &supernodal::Problem<'_, Self>, values: &mut [Self], pivots: &mut [Self]
    ) -> Result<(), usize> = supernodal::factorize;
    /// The workspace of a thread for factorizing a matrix with this many dofs; `None` if there is no memory.
    fn supernodal_workspace(dofs: usize) -> Option<supernodal::Workspace<Self>> = supernodal::workspace;
    /// Solves in place for several right-hand sides with the trailing block of a supernodal factor.
    fn supernodal_solve(
        factor: &Supernodal<'_, Self>, first: usize, order: Option<&[usize]>, rhs: &mut [Self], memory: &mut [Self]
    ) = interleaved_sweep::solve;
    /// Eliminates `columns` (in the order of elimination) of a simplicial factor: forward sweep and division by D.
    fn simplicial_forward(
        factor: &Simplicial<'_, Self>, columns: Range<usize>, x: &mut [Self]
    ) = cholesky::simplicial_forward;
    /// The backward sweep over `columns`; later entries hold the solution.
    fn simplicial_backward(
        factor: &Simplicial<'_, Self>, columns: Range<usize>, x: &mut [Self]
    ) = cholesky::simplicial_backward;
    /// Forward along two chains.
    fn chains_forward(chains: Chains<'_, Self>) = chain::forward;
    /// Backward along two chains, from the known values after them.
    fn chains_backward(chains: Chains<'_, Self>, behind: [Self; 2]) = chain::backward;
    /// The forward sweep over `columns` of a supernodal factor.
    fn supernodal_forward(
        factor: &Supernodal<'_, Self>, columns: Range<usize>, x: RightHandSide<'_, Self>
    ) = sweep::forward;
    /// The backward sweep over `columns`; later entries hold the solution.
    fn supernodal_backward(
        factor: &Supernodal<'_, Self>, columns: Range<usize>, x: RightHandSide<'_, Self>
    ) = sweep::backward;
    /// The forward sweep over the interior for one right-hand side `b`, whose entries are read through `order`; `w`
    /// are the work vectors of the forest.
    fn forest_forward(
        factor: Supernodal<'_, Self>, forest: &Forest, b: &[Self], order: Option<&[usize]>, w: &mut [Self]
    ) = sweep::forest_forward;
    /// The backward sweep over the interior.
    fn forest_backward(factor: Supernodal<'_, Self>, forest: &Forest, w: &mut [Self]) = sweep::forest_backward;
    /// Factorizes the lower triangle of a dense column-major matrix into L Lᵀ, in place; returns whether all pivots
    /// were positive.
    fn dense_cholesky(size: usize, values: &mut [Self], memory: &mut MemBuffer) -> bool = cholesky::dense;
    /// Scratch for [`dense_cholesky`](Self::dense_cholesky).
    fn dense_cholesky_scratch(size: usize) -> StackReq = cholesky::dense_scratch::<Self>;
    /// Solves L Lᵀ x = b in place.
    fn dense_cholesky_solve(size: usize, values: &[Self], x: &mut [Self]) = cholesky::dense_solve;
    /// Factorizes a dense row-major matrix into L U with partial pivoting, in place. `order` receives the rows in the
    /// order of their pivots, and the inverse of this order.
    fn dense_lu(size: usize, values: &mut [Self], order: [&mut [usize]; 2], memory: &mut MemBuffer) = lu::dense;
    /// Scratch for [`dense_lu`](Self::dense_lu).
    fn dense_lu_scratch(size: usize) -> StackReq = lu::dense_scratch::<Self>;
    /// Solves L U x = b in place, with b in the order of the pivots.
    fn dense_lu_solve(size: usize, values: &[Self], x: &mut [Self]) = lu::dense_solve;
    /// Scales a matrix in blocks of `size`² by the Cholesky factors of its diagonal blocks, which are replaced by
    /// their inverses; `Err` is the dof of a pivot that is not positive.
    fn scale_blocks(
        size: usize, pattern: (&[usize], &[u32]), values: &mut [Self], diagonal: &mut [Self]
    ) -> Result<(), usize> = conjugate_gradients::scale_blocks;
    /// Solves with a scaled matrix in blocks of `size`².
    fn conjugate_gradients(
        size: usize,
        iteration: &Iteration<'_, Self>,
        deflation: Option<&mut dyn Deflation<Self>>,
        vectors: Vectors<'_, Self, 1>,
    ) -> [Outcome; 1] = conjugate_gradients::solve_blocks;
    /// `sums += Aᵀ x` for some rows of a matrix of nodes and aggregates.
    fn gather_coarse(a: NodeRows<'_, Self>, rows: Range<usize>, x: &[Self], sums: &mut [Self]) = coarse::gather;
    /// `x −= A weights` for some rows of a matrix of nodes and aggregates.
    fn subtract_coarse(a: NodeRows<'_, Self>, rows: Range<usize>, weights: &[Self], x: &mut [Self]) = coarse::subtract;
    /// Scratch for factorizing a simplicial factor.
    fn cholesky_scratch(symbolic: &SymbolicCholesky<usize>) -> StackReq = cholesky::scratch::<Self>;
    /// Solves for several right-hand sides with a scaled matrix, given entry by entry.
    fn conjugate_gradients_side_by_side(
        iteration: &Iteration<'_, Self>, vectors: Vectors<'_, Self, LANES>
    ) -> [Outcome; LANES] = conjugate_gradients::solve_side_by_side;
    /// Factorizes with partial pivoting; the error has the failing column in the elimination order.
    fn lu(
        symbolic: &SymbolicLu<usize>,
        a: SparseColMatRef<'_, usize, Self>,
        numeric: &mut NumericLu<usize, Self>,
        memory: &mut MemBuffer,
    ) -> Result<(), LuError> = lu::factorize;
    /// Solves in place for the columns of `rhs`.
    fn lu_solve(
        factor: (&SymbolicLu<usize>, &NumericLu<usize, Self>),
        rhs: &mut [Self],
        columns: usize,
        memory: &mut MemBuffer,
    ) = lu::solve;
    /// Scratch for factorizing and for solving `columns` right-hand sides.
    fn lu_scratch(symbolic: &SymbolicLu<usize>, columns: usize) -> StackReq = lu::scratch::<Self>;
}

macro_rules! real {
    ($($scalar:ty),*) => {
        $(impl Real for $scalar {
            #[inline]
            fn of(x: f64) -> Self {
                Scalar::of(x)
            }
            #[inline]
            fn value(self) -> f64 {
                Scalar::value(self)
            }
        })*
    };
}

real!(f64, f32);
