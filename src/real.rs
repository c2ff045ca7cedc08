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

pub(crate) mod chain;
mod iteration;
pub(crate) mod lu;
mod sweep;

/// A real scalar, `f32` or `f64` (sealed).
///
/// Time, step size and scheme coefficients are `f64` in every run; `Real` is the type of matrices and vectors.
pub trait Real:
    kernels::Kernels
    + lu::LuKernels
    + Float
    + NumAssign
    + Default
    + Debug
    + Display
    + LowerExp
    + Sum
    + Send
    + Sync
    + 'static
{
    /// The scalar nearest to `x`.
    fn of(x: f64) -> Self;
    /// The value as `f64`.
    fn value(self) -> f64;
}

/// Kernels instantiated in this crate; hidden, because only this crate calls or implements them.
#[allow(clippy::inline_always)] // what is not inlined is not compiled for the machine's vector units
pub(crate) mod kernels {
    use super::chain::Chains;
    use super::{Conj, LdltError, LltError, LltRef, MatMut, MemBuffer, MemStack, Par, Real, RealField, Side};
    use super::{SparseColMatRef, SupernodalLltRef, SymbolicCholesky, SymbolicCholeskyRaw, chain, iteration, sweep};
    use crate::linear_solver::forest::Forest;
    use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
    use faer::linalg::cholesky::llt::factor::{LltRegularization, cholesky_in_place, cholesky_in_place_scratch};
    use faer::linalg::matmul::matmul;
    use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
    use faer::prelude::{Reborrow, ReborrowMut};
    use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
    use faer::traits::pulp::{Arch, Simd, WithSimd};
    use faer::{Accum, MatRef, Spec};
    use std::ops::Range;

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
        /// Entries left out at the front of the vectors swept.
        pub skipped: usize,
    }

    /// A supernodal L Lᵀ.
    #[derive(Clone, Copy, Debug)]
    pub struct Supernodal<'a, T> {
        pub symbolic: &'a SymbolicSupernodalCholesky<usize>,
        pub values: &'a [T],
    }

    /// Right-hand sides of a supernodal sweep, in the order of elimination.
    #[derive(Debug)]
    pub struct Columns<'a, T> {
        /// The columns one after the other, each without its first `skipped` entries.
        pub values: &'a mut [T],
        pub skipped: usize,
        /// Room for the rows below any supernode, once a column.
        pub scratch: &'a mut [T],
    }

    /// Blocks below the diagonal of a symmetric matrix, row by row, each stored column by column.
    #[derive(Clone, Copy, Debug)]
    pub struct Blocks<'a, T> {
        pub pointers: &'a [usize],
        pub columns: &'a [u32],
        pub values: &'a [T],
    }

    /// Preconditioners of conjugate gradients for a matrix with identities as diagonal blocks.
    #[derive(Clone, Copy, Debug)]
    pub enum Sweeps<'a, T> {
        /// None but that scaling.
        Nodes,
        /// (1 + L)(1 + Lᵀ).
        GaussSeidel,
        /// An incomplete factor, with the inverses of its diagonal blocks.
        Incomplete { factor: Blocks<'a, T>, inverses: &'a [T] },
    }

    /// Conjugate gradients for a scaled matrix.
    #[derive(Clone, Copy, Debug)]
    pub struct Iteration<'a, T> {
        pub lower: Blocks<'a, T>,
        /// C⁻¹ of each diagonal block C Cᵀ of the matrix.
        pub scaling: &'a [T],
        pub sweeps: Sweeps<'a, T>,
        /// Of the preconditioned residual, over that of the right-hand side.
        pub tolerance: f64,
        pub limit: usize,
    }

    /// Memory of conjugate gradients.
    #[derive(Debug)]
    pub struct Vectors<'a, T> {
        pub x: &'a mut [T],
        pub r: &'a mut [T],
        pub p: &'a mut [T],
        pub t: &'a mut [T],
        pub q: &'a mut [T],
    }

    /// How conjugate gradients ended.
    #[derive(Clone, Copy, Debug)]
    pub enum Outcome {
        Converged {
            iterations: usize,
        },
        NotConverged {
            iterations: usize,
            residual: f64,
        },
        /// pᵀAp over pᵀdiag(A)p of a direction, and the dof with the smallest share in the former.
        Indefinite {
            curvature: f64,
            dof: usize,
        },
    }

    /// Whether a pass adds to what is there.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Accumulate {
        Replace,
        Add,
    }

    #[doc(hidden)]
    pub trait Kernels: Sized {
        /// `out = c x`.
        fn scale_into(c: Self, x: &[Self], out: &mut [Self]);
        /// `out += c x`.
        fn axpy(c: Self, x: &[Self], out: &mut [Self]);
        /// `out += c (x − y)`.
        fn axpy_difference(c: Self, x: &[Self], y: &[Self], out: &mut [Self]);
        /// `out = Σ c x + Σ c (x − y)` in one pass, summed in this order; without a term nothing is written.
        fn combine(terms: &[(Self, &[Self])], differences: &[(Self, &[Self])], y: &[Self], out: &mut [Self]);
        /// `u += w₀ d, v += w₁ d`, and `a = w₂ d` or `a += w₂ d`, in one pass; says whether what was written is
        /// finite.
        fn recover(weights: [Self; 3], d: &[Self], motion: [&mut [Self]; 3], a: Accumulate) -> bool;
        /// Whether every entry is finite.
        fn all_finite(x: &[Self]) -> bool;
        /// `y += c A x`, any A.
        fn product(c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self]);
        /// `y += c A x` for symmetric A (both triangles stored): columns are read as rows.
        fn symmetric_product(c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self]);
        /// `y = c A x` for symmetric A.
        fn symmetric_product_into(c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self]);
        /// Factorizes and writes the pivots; `Err` holds the failing index. Both in the numbering of the caller. Only
        /// supernodal factors use threads.
        fn cholesky(
            kind: Factorization,
            symbolic: &SymbolicCholesky<usize>,
            a: SparseColMatRef<'_, usize, Self>,
            values: &mut [Self],
            pivots: &mut [Self],
            par: Par,
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
        /// Eliminates `columns` (in the order of elimination) of a simplicial factor: forward sweep and division by D.
        fn simplicial_forward(factor: &Simplicial<'_, Self>, columns: Range<usize>, x: &mut [Self]);
        /// The backward sweep over `columns`; entries behind them hold the solution.
        fn simplicial_backward(factor: &Simplicial<'_, Self>, columns: Range<usize>, x: &mut [Self]);
        /// Down two chains.
        fn chains_forward(chains: Chains<'_, Self>);
        /// Up two chains, from what is known behind them.
        fn chains_backward(chains: Chains<'_, Self>, behind: [Self; 2]);
        /// The forward sweep over `columns` of a supernodal factor.
        fn supernodal_forward(factor: &Supernodal<'_, Self>, columns: Range<usize>, x: Columns<'_, Self>);
        /// The backward sweep over `columns`; entries behind them hold the solution.
        fn supernodal_backward(factor: &Supernodal<'_, Self>, columns: Range<usize>, x: Columns<'_, Self>);
        /// The forward sweep over the interior for one right-hand side `b`, of which each column finds its own entry
        /// through `order`; `w` are the work vectors of the forest.
        fn forest_forward(
            factor: Supernodal<'_, Self>,
            forest: &Forest,
            b: &[Self],
            order: Option<&[usize]>,
            w: &mut [Self],
        );
        /// The backward sweep over the interior.
        fn forest_backward(factor: Supernodal<'_, Self>, forest: &Forest, w: &mut [Self]);
        /// Factorizes the lower triangle of a dense column-major matrix into L Lᵀ, in place; says whether all pivots
        /// were positive.
        fn dense_cholesky(size: usize, values: &mut [Self], memory: &mut MemBuffer) -> bool;
        /// Scratch for [`dense_cholesky`](Self::dense_cholesky).
        fn dense_cholesky_scratch(size: usize) -> faer::dyn_stack::StackReq;
        /// Solves L Lᵀ x = b in place.
        fn dense_cholesky_solve(size: usize, values: &[Self], x: &mut [Self]);
        /// Scales a matrix in blocks of `size`² by the Cholesky factors of its diagonal blocks, which become their
        /// inverses; `Err` is the dof of a pivot that is not positive.
        fn scale_blocks(
            size: usize,
            pattern: (&[usize], &[u32]),
            values: &mut [Self],
            diagonal: &mut [Self],
        ) -> Result<(), usize>;
        /// Incomplete Cholesky factor of a scaled matrix in blocks with `shift` added to the diagonal; says whether all
        /// pivots were positive.
        fn incomplete_cholesky(
            size: usize,
            lower: &Blocks<'_, Self>,
            shift: Self,
            values: &mut [Self],
            inverses: &mut [Self],
        ) -> bool;
        /// Solves in place with a matrix in blocks of `size`².
        fn conjugate_gradients(
            size: usize,
            iteration: &Iteration<'_, Self>,
            b: &mut [Self],
            vectors: Vectors<'_, Self>,
        ) -> Outcome;
        /// Scratch for factorizing and for solving `columns` right-hand sides.
        fn cholesky_scratch(
            kind: Factorization,
            symbolic: &SymbolicCholesky<usize>,
            columns: usize,
            par: Par,
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
    fn symmetric_product<T: Real>(a: SparseColMatRef<'_, usize, T>, x: &[T], y: &mut [T], put: impl Fn(&mut T, T)) {
        let (pointers, rows, values) = (a.col_ptr(), a.row_idx(), a.val());
        for (yj, range) in y.iter_mut().zip(pointers.windows(2)) {
            let mut sum = T::zero();
            for (&i, &value) in rows[range[0]..range[1]].iter().zip(&values[range[0]..range[1]]) {
                sum += value * x[i];
            }
            put(yj, sum);
        }
    }

    /// Numbers that are added up side by side: one sum after the other would wait for each addition.
    const LANES: usize = 8;

    /// Σ 0 x: zero if every x is finite, NaN otherwise. An early exit would not vectorize.
    #[inline(always)]
    fn all_finite<T: Real>(x: &[T]) -> bool {
        let mut sums = [T::zero(); LANES];
        let chunks = x.chunks_exact(LANES);
        let rest: T = chunks.remainder().iter().map(|&x| x * T::zero()).sum();
        for chunk in chunks {
            for (sum, &x) in sums.iter_mut().zip(chunk) {
                *sum += x * T::zero();
            }
        }
        sums.into_iter().sum::<T>() + rest == T::zero()
    }

    /// The same for vectors of one length, looked at together.
    #[inline(always)]
    fn all_finite_together<T: Real, const N: usize>(x: [&[T]; N]) -> bool {
        let n = x.first().map_or(0, |x| x.len());
        let x = x.map(|x| &x[..n]);
        let whole = n - n % LANES;
        let mut sums = [T::zero(); LANES];
        for start in (0..whole).step_by(LANES) {
            let lanes: [&[T]; N] = x.map(|x| &x[start..start + LANES]);
            for (lane, sum) in sums.iter_mut().enumerate() {
                for x in lanes {
                    *sum += x[lane] * T::zero();
                }
            }
        }
        x.iter().all(|x| x[whole..].iter().all(|x| x.is_finite())) && sums.into_iter().sum::<T>() == T::zero()
    }

    #[inline(always)]
    fn combine<T: Real>(terms: &[(T, &[T])], differences: &[(T, &[T])], y: &[T], out: &mut [T]) {
        /// P terms and D differences; all slices are cut to one length, so that no access is checked.
        #[inline(always)]
        fn fused<T: Real, const P: usize, const D: usize>(
            terms: &[(T, &[T])],
            differences: &[(T, &[T])],
            y: &[T],
            out: &mut [T],
        ) {
            let n = out.len();
            let (y, x): (&[T], [&[T]; P]) = (&y[..n], std::array::from_fn(|k| &terms[k].1[..n]));
            let d: [&[T]; D] = std::array::from_fn(|k| &differences[k].1[..n]);
            let (c, e) =
                (std::array::from_fn::<T, P, _>(|k| terms[k].0), std::array::from_fn::<T, D, _>(|k| differences[k].0));
            for (i, out) in out.iter_mut().enumerate() {
                let mut sum = if P > 0 { c[0] * x[0][i] } else { T::zero() };
                for k in 1..P {
                    sum += c[k] * x[k][i];
                }
                for k in 0..D {
                    sum += e[k] * (d[k][i] - y[i]);
                }
                *out = sum;
            }
        }
        match (terms.len(), differences.len()) {
            (0, 0) => {}
            (1, 0) => fused::<T, 1, 0>(terms, differences, y, out),
            (2, 0) => fused::<T, 2, 0>(terms, differences, y, out),
            (3, 0) => fused::<T, 3, 0>(terms, differences, y, out),
            (4, 0) => fused::<T, 4, 0>(terms, differences, y, out),
            (0, 1) => fused::<T, 0, 1>(terms, differences, y, out),
            (1, 1) => fused::<T, 1, 1>(terms, differences, y, out),
            (2, 1) => fused::<T, 2, 1>(terms, differences, y, out),
            (3, 1) => fused::<T, 3, 1>(terms, differences, y, out),
            (0, 2) => fused::<T, 0, 2>(terms, differences, y, out),
            (1, 2) => fused::<T, 1, 2>(terms, differences, y, out),
            (2, 2) => fused::<T, 2, 2>(terms, differences, y, out),
            (1, 3) => fused::<T, 1, 3>(terms, differences, y, out),
            _ => {
                out.fill(T::zero());
                for (c, x) in terms {
                    for (out, &x) in out.iter_mut().zip(*x) {
                        *out += *c * x;
                    }
                }
                for (c, x) in differences {
                    for ((out, &x), &y) in out.iter_mut().zip(*x).zip(y) {
                        *out += *c * (x - y);
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn recover<T: Real>(weights: [T; 3], d: &[T], motion: [&mut [T]; 3], accumulate: Accumulate) -> bool {
        /// Entries a block: what it touches stays in the first-level cache until it has been looked at.
        const BLOCK: usize = 512;
        /// With or without u, and a replaced or added to.
        #[inline(always)]
        fn pass<T: Real, const MOVES: bool, const ADDS: bool>(w: [T; 3], d: &[T], [u, v, a]: [&mut [T]; 3]) -> bool {
            let n = d.len();
            let (u, v, a) = (&mut u[..n], &mut v[..n], &mut a[..n]);
            for i in 0..n {
                if MOVES {
                    u[i] += w[0] * d[i];
                }
                v[i] += w[1] * d[i];
                a[i] = if ADDS { a[i] + w[2] * d[i] } else { w[2] * d[i] };
            }
            // No d that is not finite leaves a finite.
            match MOVES {
                true => all_finite_together([u, v, a]),
                false => all_finite_together([v, a]),
            }
        }
        let [u, v, a] = motion;
        let mut finite = true;
        for (k, d) in d.chunks(BLOCK).enumerate() {
            let part = k * BLOCK..k * BLOCK + d.len();
            let motion = [&mut u[part.clone()], &mut v[part.clone()], &mut a[part]];
            // The displacements of explicit schemes do not contain d.
            finite &= match (weights[0] != T::zero(), accumulate) {
                (true, Accumulate::Replace) => pass::<T, true, false>(weights, d, motion),
                (true, Accumulate::Add) => pass::<T, true, true>(weights, d, motion),
                (false, Accumulate::Replace) => pass::<T, false, false>(weights, d, motion),
                (false, Accumulate::Add) => pass::<T, false, true>(weights, d, motion),
            };
        }
        finite
    }

    #[inline]
    fn cholesky<T: RealField>(
        kind: Factorization,
        symbolic: &SymbolicCholesky<usize>,
        a: SparseColMatRef<'_, usize, T>,
        values: &mut [T],
        pivots: &mut [T],
        par: Par,
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
                    par,
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

    // In a chain each unknown waits for its neighbor: that one stays in a register, because a round trip through memory
    // takes longer than the arithmetic.

    #[inline]
    fn simplicial_forward<T: Real>(factor: &Simplicial<'_, T>, columns: Range<usize>, x: &mut [T]) {
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

    #[inline]
    fn simplicial_backward<T: Real>(factor: &Simplicial<'_, T>, columns: Range<usize>, x: &mut [T]) {
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

    /// The part of a supernode that a sweep over some columns visits.
    struct Panel<'a, T> {
        /// First column, and number of columns.
        start: usize,
        size: usize,
        /// The lower triangle on these columns, and the rows below it.
        top: MatRef<'a, T>,
        below: MatRef<'a, T>,
        /// How many of the rows below follow the columns directly; the others are `pattern`.
        following: usize,
        pattern: &'a [usize],
    }

    impl<'a, T> Panel<'a, T> {
        fn new(factor: &Supernodal<'a, T>, supernode: usize, columns: &Range<usize>) -> Self {
            let node = SupernodalLltRef::new(factor.symbolic, factor.values).supernode(supernode);
            let (begin, block) = (node.start(), node.val());
            let (start, end) = (columns.start.max(begin), columns.end.min(begin + block.ncols()));
            let (first, last) = (start - begin, end - begin);
            Self {
                start,
                size: end - start,
                top: block.submatrix(first, first, end - start, end - start),
                below: block.submatrix(last, first, block.nrows() - last, end - start),
                following: block.ncols() - last,
                pattern: node.pattern(),
            }
        }

        /// The rows below the panel, in the order of the rows of `below`.
        fn rows(&self) -> impl Iterator<Item = usize> {
            let behind = self.start + self.size;
            (behind..behind + self.following).chain(self.pattern.iter().copied())
        }
    }

    /// The supernodes that hold any of the columns.
    #[inline]
    pub(in crate::real) fn supernodes<T>(factor: &Supernodal<'_, T>, columns: &Range<usize>) -> Range<usize> {
        let begin = &factor.symbolic.supernode_begin()[..factor.symbolic.n_supernodes()];
        match columns.is_empty() {
            true => 0..0,
            false => begin.partition_point(|&b| b <= columns.start) - 1..begin.partition_point(|&b| b < columns.end),
        }
    }

    #[inline]
    fn supernodal_forward<T: RealField + Real>(
        factor: &Supernodal<'_, T>,
        columns: Range<usize>,
        Columns { values, skipped, scratch }: Columns<'_, T>,
    ) {
        let height = factor.symbolic.nrows() - skipped;
        let width = values.len().checked_div(height).unwrap_or(0);
        if width == 1 {
            return sweep::forward(factor, columns, Columns { values, skipped, scratch });
        }
        for supernode in supernodes(factor, &columns) {
            let panel = Panel::new(factor, supernode, &columns);
            let mut x = MatMut::from_column_major_slice_mut(values, height, width);
            let mut top = x.rb_mut().subrows_mut(panel.start - skipped, panel.size);
            solve_lower_triangular_in_place(panel.top, top.rb_mut(), Par::Seq);
            let count = panel.below.nrows();
            let mut product = MatMut::from_column_major_slice_mut(&mut scratch[..count * width], count, width);
            matmul(product.rb_mut(), Accum::Replace, panel.below, top.rb(), T::one(), Par::Seq);
            for (x, product) in values.chunks_exact_mut(height).zip(scratch.chunks_exact(count.max(1))) {
                for (row, &product) in panel.rows().zip(product) {
                    x[row - skipped] -= product;
                }
            }
        }
    }

    #[inline]
    fn supernodal_backward<T: RealField + Real>(
        factor: &Supernodal<'_, T>,
        columns: Range<usize>,
        Columns { values, skipped, scratch }: Columns<'_, T>,
    ) {
        let height = factor.symbolic.nrows() - skipped;
        let width = values.len().checked_div(height).unwrap_or(0);
        if width == 1 {
            return sweep::backward(factor, columns, Columns { values, skipped, scratch });
        }
        for supernode in supernodes(factor, &columns).rev() {
            let panel = Panel::new(factor, supernode, &columns);
            let count = panel.below.nrows();
            for (x, gathered) in values.chunks_exact(height).zip(scratch.chunks_exact_mut(count.max(1))) {
                for (row, gathered) in panel.rows().zip(gathered) {
                    *gathered = x[row - skipped];
                }
            }
            let gathered = MatRef::from_column_major_slice(&scratch[..count * width], count, width);
            let mut x = MatMut::from_column_major_slice_mut(values, height, width);
            let mut top = x.rb_mut().subrows_mut(panel.start - skipped, panel.size);
            matmul(top.rb_mut(), Accum::Add, panel.below.transpose(), gathered, -T::one(), Par::Seq);
            solve_upper_triangular_in_place(panel.top.transpose(), top, Par::Seq);
        }
    }

    // Dispatched to the vector units of the machine, with the same bits: nothing is fused.

    struct Combine<'a, T>(&'a [(T, &'a [T])], &'a [(T, &'a [T])], &'a [T], &'a mut [T]);

    impl<T: Real> WithSimd for Combine<'_, T> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) {
            combine(self.0, self.1, self.2, self.3);
        }
    }

    struct Recover<'a, T>([T; 3], &'a [T], [&'a mut [T]; 3], Accumulate);

    impl<T: Real> WithSimd for Recover<'_, T> {
        type Output = bool;

        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) -> bool {
            recover(self.0, self.1, self.2, self.3)
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
                fn combine(terms: &[(Self, &[Self])], differences: &[(Self, &[Self])], y: &[Self], out: &mut [Self]) {
                    Arch::new().dispatch(Combine(terms, differences, y, out));
                }
                fn recover(weights: [Self; 3], d: &[Self], motion: [&mut [Self]; 3], a: Accumulate) -> bool {
                    Arch::new().dispatch(Recover(weights, d, motion, a))
                }
                fn all_finite(x: &[Self]) -> bool {
                    all_finite(x)
                }
                fn product(c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self]) {
                    product(c, a, x, y);
                }
                fn symmetric_product(c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self]) {
                    symmetric_product(a, x, y, |y, sum| *y += c * sum);
                }
                fn symmetric_product_into(c: Self, a: SparseColMatRef<'_, usize, Self>, x: &[Self], y: &mut [Self]) {
                    symmetric_product(a, x, y, |y, sum| *y = c * sum);
                }
                fn cholesky(
                    kind: Factorization,
                    symbolic: &SymbolicCholesky<usize>,
                    a: SparseColMatRef<'_, usize, Self>,
                    values: &mut [Self],
                    pivots: &mut [Self],
                    par: Par,
                    memory: &mut MemBuffer,
                ) -> Result<(), usize> {
                    cholesky(kind, symbolic, a, values, pivots, par, memory)
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
                fn simplicial_forward(factor: &Simplicial<'_, Self>, columns: Range<usize>, x: &mut [Self]) {
                    simplicial_forward(factor, columns, x);
                }
                fn simplicial_backward(factor: &Simplicial<'_, Self>, columns: Range<usize>, x: &mut [Self]) {
                    simplicial_backward(factor, columns, x);
                }
                fn chains_forward(chains: Chains<'_, Self>) {
                    chain::forward(chains);
                }
                fn chains_backward(chains: Chains<'_, Self>, behind: [Self; 2]) {
                    chain::backward(chains, behind);
                }
                fn supernodal_forward(factor: &Supernodal<'_, Self>, columns: Range<usize>, x: Columns<'_, Self>) {
                    supernodal_forward(factor, columns, x);
                }
                fn supernodal_backward(factor: &Supernodal<'_, Self>, columns: Range<usize>, x: Columns<'_, Self>) {
                    supernodal_backward(factor, columns, x);
                }
                fn forest_forward(
                    factor: Supernodal<'_, Self>,
                    forest: &Forest,
                    b: &[Self],
                    order: Option<&[usize]>,
                    w: &mut [Self],
                ) {
                    sweep::forest_forward(&sweep::Interior { factor, forest }, b, order, w);
                }
                fn forest_backward(factor: Supernodal<'_, Self>, forest: &Forest, w: &mut [Self]) {
                    sweep::forest_backward(&sweep::Interior { factor, forest }, w);
                }
                fn dense_cholesky(size: usize, values: &mut [Self], memory: &mut MemBuffer) -> bool {
                    let a = MatMut::from_column_major_slice_mut(values, size, size);
                    let (regularization, stack) = (LltRegularization::default(), MemStack::new(memory));
                    cholesky_in_place(a, regularization, Par::Seq, stack, Spec::default()).is_ok()
                }
                fn dense_cholesky_scratch(size: usize) -> faer::dyn_stack::StackReq {
                    cholesky_in_place_scratch::<$scalar>(size, Par::Seq, Spec::default())
                }
                fn dense_cholesky_solve(size: usize, values: &[Self], x: &mut [Self]) {
                    let l = MatRef::from_column_major_slice(values, size, size);
                    let mut x = MatMut::from_column_major_slice_mut(x, size, 1);
                    solve_lower_triangular_in_place(l, x.rb_mut(), Par::Seq);
                    solve_upper_triangular_in_place(l.transpose(), x, Par::Seq);
                }
                fn scale_blocks(
                    size: usize,
                    pattern: (&[usize], &[u32]),
                    values: &mut [Self],
                    diagonal: &mut [Self],
                ) -> Result<(), usize> {
                    match size {
                        3 => iteration::scale::<$scalar, 3>(pattern, values, diagonal),
                        2 => iteration::scale::<$scalar, 2>(pattern, values, diagonal),
                        _ => iteration::scale::<$scalar, 1>(pattern, values, diagonal),
                    }
                }
                fn incomplete_cholesky(
                    size: usize,
                    lower: &Blocks<'_, Self>,
                    shift: Self,
                    values: &mut [Self],
                    inverses: &mut [Self],
                ) -> bool {
                    match size {
                        3 => iteration::factorize::<$scalar, 3>(lower, shift, values, inverses),
                        2 => iteration::factorize::<$scalar, 2>(lower, shift, values, inverses),
                        _ => iteration::factorize::<$scalar, 1>(lower, shift, values, inverses),
                    }
                }
                fn conjugate_gradients(
                    size: usize,
                    iteration: &Iteration<'_, Self>,
                    b: &mut [Self],
                    vectors: Vectors<'_, Self>,
                ) -> Outcome {
                    match size {
                        3 => iteration::solve::<$scalar, 3>(iteration, b, vectors),
                        2 => iteration::solve::<$scalar, 2>(iteration, b, vectors),
                        _ => iteration::solve::<$scalar, 1>(iteration, b, vectors),
                    }
                }
                fn cholesky_scratch(
                    kind: Factorization,
                    symbolic: &SymbolicCholesky<usize>,
                    columns: usize,
                    par: Par,
                ) -> faer::dyn_stack::StackReq {
                    let solve = symbolic.solve_in_place_scratch::<$scalar>(columns, Par::Seq);
                    let factorize = match kind {
                        Factorization::Llt => symbolic.factorize_numeric_llt_scratch::<$scalar>(par, Spec::default()),
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

#[cfg(test)]
mod tests {
    use super::kernels::{Accumulate, Kernels};

    /// The blocks of a recovery give what one loop gives, bit for bit, and find what is not finite in any of them.
    #[test]
    fn recovery_in_blocks_is_one_loop() {
        let vector = |seed: usize, n: usize| -> Vec<f64> { (0..n).map(|i| ((seed + 5 * i) as f64).sin()).collect() };
        for n in [0, 1, 7, 511, 512, 513, 1700] {
            for (w, accumulate) in [
                ([1.0, 0.3, 0.7], Accumulate::Replace),
                ([0.2, 0.3, 0.7], Accumulate::Add),
                ([0.0, 0.3, 0.7], Accumulate::Replace),
                ([0.0, 0.3, 0.7], Accumulate::Add),
            ] {
                let d = vector(1, n);
                let [mut u, mut v, mut a] = [2, 3, 4].map(|seed| vector(seed, n));
                assert!(Kernels::recover(w, &d, [&mut u, &mut v, &mut a], accumulate));
                let [u0, v0, a0] = [2, 3, 4].map(|seed| vector(seed, n));
                for i in 0..n {
                    let past = if accumulate == Accumulate::Add { a0[i] } else { 0.0 };
                    assert_eq!(u[i].to_bits(), (u0[i] + w[0] * d[i]).to_bits());
                    assert_eq!(v[i].to_bits(), (v0[i] + w[1] * d[i]).to_bits());
                    assert_eq!(a[i].to_bits(), (past + w[2] * d[i]).to_bits());
                }
                for bad in (0..n).step_by(97) {
                    let mut d = d.clone();
                    d[bad] = if bad % 2 == 0 { f64::NAN } else { f64::INFINITY };
                    assert!(!Kernels::recover(w, &d, [&mut u, &mut v, &mut a], accumulate));
                }
            }
        }
    }
}
