//! Sparse LU through faer: matrices that are not symmetric, or not definite.

use super::{Factorization, LinearSolver, check_analysis};
use crate::error::{Error, Result};
use crate::kernels::lu::Side;
use crate::memory;
use crate::real::Real;
use crate::sparse;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::lu::{LuSymbolicParams, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::linalg::{LuError, qr};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};

/// Sparse LU factorization with partial pivoting, for any regular matrix: unsymmetric tangents (follower loads,
/// gyroscopic and circulatory matrices) and indefinite ones.
///
/// Columns are eliminated in an order with little fill for any choice of pivots (COLAMD), rows as pivoting requires.
/// Rows and columns are first scaled by powers of two, to largest entries of about one: pivots do not depend on the
/// units of translations and rotations, or on a stiff body next to a soft one.
///
/// **Singular matrices** are rejected as [`Error::Singular`] if their condition number, after scaling, exceeds
/// 1/(16 ε) (Hager's estimate of the 1-norm). The solution for a generic right-hand side reveals it: one solve per
/// factorization, and two more only if that solution is large. The named dof has the largest entry of the null
/// vector.
///
/// **Cost.** Two factors and a less favorable order: in three dimensions several times the time and memory of
/// [`Cholesky`](super::Cholesky). It offers no [`Condensation`](super::Condensation), so a step in contact needs a
/// full solve for each pressed contact, and one more. [`stored_values`](Factorization::stored_values) is an upper
/// bound for any choice of pivots; the factor may be much smaller. Refactorization does not allocate for long thin
/// structures, which faer processes column by column; for plates and solids it works in blocks and allocates some
/// memory each time.
///
/// An **indefinite** matrix is factorized without an error. [`Cholesky`](super::Cholesky) rejects it, which tells
/// Newton's method that a step is too long for a negative stiffness; with this solver that information is missing.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{LinearSystem, Lu, Newmark, Simulation};
///
/// let matrix = |entries: &[(usize, usize, f64)]| {
///     let entries: Vec<_> = entries.iter().map(|&(i, j, x)| Triplet::new(i, j, x)).collect();
///     SparseColMat::try_new_from_triplets(2, 2, &entries)
/// };
/// // A disc on a shaft, turning fast: C is skew. Seen from the shaft a push along x drives it along y too.
/// let shaft = matrix(&[(0, 0, 100.0), (1, 1, 100.0)])?;
/// let gyroscopic = matrix(&[(0, 1, 15.0), (1, 0, -15.0)])?;
/// let rotor = LinearSystem::lumped(vec![1.0, 1.0], shaft)?.damping(gyroscopic)?;
///
/// // Its circular whirls have ω² − 15 ω = 100: the forward one turns with 20, the backward one with −5.
/// let period = 2.0 * std::f64::consts::PI / 20.0;
/// let mut run = Simulation::builder(rotor, Newmark::trapezoidal(), period / 1000.0)
///     .linear_solver(Lu)
///     .displacement(vec![1.0, 0.0])
///     .velocity(vec![0.0, 20.0])
///     .build()?;
/// run.run_until(period, &mut ())?;
/// assert!((run.state().displacement()[0] - 1.0).abs() < 1e-4);
/// assert!(run.state().displacement()[1].abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lu;

struct Factor<T: Real> {
    symbolic: SymbolicLu<usize>,
    numeric: NumericLu<usize, T>,
    state: State,
    /// The analyzed pattern, and the scaled values R A C in it.
    pattern: SymbolicSparseColMat<usize>,
    scaled: Vec<T>,
    /// Diagonals of R and C.
    rows: Vec<T>,
    columns: Vec<T>,
    memory: MemBuffer,
    /// Number of right-hand sides for which `memory` suffices.
    room: usize,
    /// Upper bound of the number of scalars in L and U.
    bound: usize,
    /// Vectors for estimating the condition number.
    probe: Vec<T>,
}

/// Whether there is a factor to solve with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    None,
    Factorized,
}

impl<T: Real> std::fmt::Debug for Factor<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Factor").field("size", &self.rows.len()).field("state", &self.state).finish_non_exhaustive()
    }
}

impl<T: Real> LinearSolver<T> for Lu {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<T>>> {
        let n = check_analysis(pattern, last)?;
        let no_memory = |_| Error::OutOfMemory { what: "the analysis of a sparse LU", bytes: None };
        let symbolic = factorize_symbolic_lu(pattern, LuSymbolicParams::default()).map_err(no_memory)?;
        let bound = bound(pattern, &symbolic)?;
        let memory = MemBuffer::try_new(T::lu_scratch(&symbolic, 1))
            .map_err(|_| Error::OutOfMemory { what: "sparse LU scratch", bytes: None })?;
        let pattern = pattern.to_owned().map_err(no_memory)?;
        let zero = |columns| memory::zeros(n, columns, "a sparse LU");
        Ok(Box::new(Factor {
            symbolic,
            numeric: NumericLu::new(),
            state: State::None,
            scaled: memory::zeros(pattern.row_idx().len(), 1, "a sparse LU")?,
            pattern,
            rows: zero(1)?,
            columns: zero(1)?,
            memory,
            room: 1,
            bound,
            probe: zero(1)?,
        }))
    }
}

/// Upper bound of the number of entries of L and U for this order of columns and any pivots: U fits into the
/// triangular factor of AᵀA, L into the Householder vectors of QR (George and Ng, SIAM J. Sci. Stat. Comput. 8,
/// 1987).
fn bound(pattern: SymbolicSparseColMatRef<'_, usize>, symbolic: &SymbolicLu<usize>) -> Result<usize> {
    let n = pattern.ncols();
    let no_memory = || Error::OutOfMemory { what: "the analysis of a sparse LU", bytes: None };
    let transposed = pattern.transpose().to_col_major().map_err(|_| no_memory())?;
    let scratch = qr::col_etree_scratch::<usize>(n, n)
        .or(qr::postorder_scratch::<usize>(n))
        .or(qr::column_counts_aat_scratch::<usize>(n, n));
    let mut memory = MemBuffer::try_new(scratch).map_err(|_| no_memory())?;
    let stack = MemStack::new(&mut memory);
    let order = Some(symbolic.col_perm());
    let [mut parents, mut post, mut counts, mut first] = [(); 4].map(|()| vec![0; n]);
    let tree = qr::col_etree(pattern, order, &mut parents, stack);
    qr::postorder(&mut post, tree, stack);
    qr::column_counts_ata(&mut counts, &mut first, transposed.as_ref(), order, tree, &post, stack);
    // Row i joins at its first column; each column passes all rows except the pivot row on to the parent.
    let mut heights = vec![0_usize; n];
    for &column in first.iter().filter(|&&column| column < n) {
        heights[column] += 1;
    }
    for (column, &parent) in tree.into_inner().iter().enumerate() {
        if let Ok(parent) = usize::try_from(parent) {
            heights[parent] += heights[column].saturating_sub(1);
        }
    }
    Ok(heights.iter().sum::<usize>() + counts.iter().sum::<usize>())
}

/// Largest number of scaling passes; each halves the logarithms of the row and column scales.
const PASSES: usize = 6;

/// The exponent of the largest power of two that is not above a positive x.
fn binary_exponent<T: Real>(x: T) -> i32 {
    let (mantissa, exponent, _) = x.integer_decode();
    i32::from(exponent) + mantissa.checked_ilog2().unwrap_or(0).cast_signed()
}

/// The power of two next to 1/√x for a positive x; one for x within a factor of four of one.
fn reciprocal_root<T: Real>(x: T) -> T {
    T::of(2.0).powi(-(binary_exponent(x) / 2))
}

/// A pseudo-random number between −1 and 1, of magnitude at least ½.
fn scatter<T: Real>(index: usize) -> T {
    let mixed = (index as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let size = 0.5 + 0.5 * ((mixed >> 32) & 0xffff) as f64 / 65536.0;
    T::of(if mixed & (1 << 50) == 0 { size } else { -size })
}

fn sum_of_sizes<T: Real>(x: &[T]) -> T {
    x.iter().map(|x| x.abs()).sum()
}

/// Index of the entry of largest magnitude; of the first that is not finite, if there is one.
fn largest<T: Real>(x: &[T]) -> usize {
    let larger = |best: usize, i: usize| if x[i].abs() > x[best].abs() { i } else { best };
    x.iter().position(|x| !x.is_finite()).unwrap_or_else(|| (0..x.len()).fold(0, larger))
}

impl<T: Real> Factor<T> {
    /// Rejects another pattern than the analyzed one, and NaN and infinity.
    fn check(&self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let pattern = self.pattern.as_ref();
        let n = sparse::square("effective matrix", a)?;
        if n != pattern.ncols() {
            return Err(Error::Dimension { what: "effective matrix", expected: pattern.ncols(), found: n });
        }
        if a.col_nnz().is_some() || a.col_ptr() != pattern.col_ptr() || a.row_idx() != pattern.row_idx() {
            let reason = "its pattern is not the one that was analyzed; analyze it again";
            return Err(Error::Incompatible { part: "the effective matrix".into(), reason });
        }
        match a.val().iter().position(|value| !value.is_finite()) {
            Some(at) => {
                let column = a.col_ptr().partition_point(|&start| start <= at) - 1;
                let (row, value) = (a.row_idx()[at], a.val()[at].value());
                Err(Error::MatrixNotFinite { matrix: "effective", row, column, value })
            }
            None => Ok(()),
        }
    }

    /// Forms R A C; `Err` names a dof without entries.
    ///
    /// Rows and columns are equilibrated by the roots of their largest entries (Ruiz, RAL-TR-2001-034), which
    /// compensates different units of dofs.
    fn scale(&mut self, a: SparseColMatRef<'_, usize, T>) -> std::result::Result<(), usize> {
        // Scale the largest entries to about one first, so that the rest does not depend on the unit of the matrix.
        // The reciprocal of a subnormal number may overflow. A matrix without entries names dof 0.
        let size = a.val().get(largest(a.val())).ok_or(0_usize)?.abs().max(T::min_positive_value());
        let (unit, root) = (T::of(2.0).powi(-binary_exponent(size)), reciprocal_root(size));
        T::scale_into(unit, a.val(), &mut self.scaled);
        self.rows.fill(root);
        self.columns.fill(unit / root);
        for _ in 0..PASSES {
            if self.balance()? {
                break;
            }
        }
        Ok(())
    }

    /// One pass over the matrix; returns whether it was already balanced.
    fn balance(&mut self) -> std::result::Result<bool, usize> {
        let Self { pattern, scaled, rows, columns, probe: factors, .. } = self;
        factors.fill(T::zero());
        for (&row, &value) in pattern.row_idx().iter().zip(scaled.iter()) {
            factors[row] = factors[row].max(value.abs());
        }
        let mut balanced = true;
        for (dof, (row, factor)) in rows.iter_mut().zip(factors.iter_mut()).enumerate() {
            if *factor == T::zero() {
                return Err(dof);
            }
            *factor = reciprocal_root(*factor);
            *row *= *factor;
            balanced &= *factor == T::one();
        }
        for (dof, column) in columns.iter_mut().enumerate() {
            let range = pattern.as_ref().col_range(dof);
            let entries = &mut scaled[range.clone()];
            let largest = entries.iter().fold(T::zero(), |largest, value| largest.max(value.abs()));
            if largest == T::zero() {
                return Err(dof);
            }
            let own = reciprocal_root(largest);
            *column *= own;
            balanced &= own == T::one();
            for (value, &row) in entries.iter_mut().zip(&pattern.row_idx()[range]) {
                *value *= own * factors[row];
            }
        }
        Ok(balanced)
    }

    /// Factorizes the scaled values; `Err(Ok(dof))` if no pivot is left.
    fn eliminate(&mut self) -> std::result::Result<(), std::result::Result<usize, Error>> {
        let Self { symbolic, numeric, pattern, scaled, memory, .. } = self;
        let a = SparseColMatRef::new(pattern.as_ref(), &scaled[..]);
        T::lu(symbolic, a, numeric, memory).map_err(|error| match error {
            LuError::SymbolicSingular { index } => {
                let order = symbolic.col_perm().arrays().0;
                Ok(order.get(index).copied().unwrap_or(0))
            }
            LuError::Generic(_) => Err(Error::OutOfMemory { what: "a sparse LU", bytes: None }),
        })
    }

    /// Solves with R A C, or its transpose, for the probe.
    fn solve_probe(&mut self, side: Side) {
        let Self { symbolic, numeric, probe, memory, .. } = self;
        T::lu_solve((symbolic, numeric), side, probe, 1, memory);
    }

    /// Whether the condition number of R A C leaves significant digits; `Err` holds the dof with the largest entry of
    /// its null vector, and whether that is known.
    fn judge(&mut self) -> std::result::Result<(), (usize, bool)> {
        let norm = (0..self.rows.len())
            .map(|dof| sum_of_sizes(&self.scaled[self.pattern.as_ref().col_range(dof)]))
            .fold(T::zero(), T::max);
        let verdict = |probe: &[T]| (largest(probe), T::all_finite(probe));
        // A generic right-hand side: for a singular matrix the null vector dominates the solution.
        self.probe.iter_mut().enumerate().for_each(|(i, x)| *x = scatter(i));
        let size = sum_of_sizes(&self.probe);
        self.solve_probe(Side::Given);
        let generic = norm * sum_of_sizes(&self.probe) / size;
        if generic <= T::epsilon().powf(T::of(-2.0 / 3.0)) {
            return Ok(());
        }
        if !generic.is_finite() {
            return Err(verdict(&self.probe));
        }
        self.probe.iter_mut().for_each(|x| *x = x.signum());
        self.solve_probe(Side::Transposed);
        let worst = largest(&self.probe);
        self.probe.fill(T::zero());
        self.probe[worst] = T::one();
        self.solve_probe(Side::Given);
        let condition = generic.max(norm * sum_of_sizes(&self.probe));
        // Written so that NaN is rejected too.
        match condition * T::of(16.0) * T::epsilon() <= T::one() {
            true => Ok(()),
            false => Err(verdict(&self.probe)),
        }
    }

    /// The dof to name after an exactly zero pivot: from the null vector of the matrix perturbed by rounding.
    fn name_singular(&mut self, found: usize) -> usize {
        for (at, value) in self.scaled.iter_mut().enumerate() {
            *value += *value * scatter::<T>(at) * T::of(8.0) * T::epsilon();
        }
        match self.eliminate() {
            Ok(()) => match self.judge() {
                Err((dof, true)) => dof,
                _ => found,
            },
            Err(_) => found,
        }
    }
}

impl<T: Real> Factorization<T> for Factor<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        self.state = State::None;
        self.check(a)?;
        if self.rows.is_empty() {
            self.state = State::Factorized;
            return Ok(());
        }
        let singular = |dof| Error::Singular { matrix: "effective matrix", dof };
        self.scale(a).map_err(singular)?;
        match self.eliminate() {
            Ok(()) => {}
            Err(Ok(dof)) => return Err(singular(dof)),
            Err(Err(error)) => return Err(error),
        }
        match self.judge() {
            Ok(()) => {
                self.state = State::Factorized;
                Ok(())
            }
            Err((dof, true)) => Err(singular(dof)),
            Err((dof, false)) => Err(singular(self.name_singular(dof))),
        }
    }

    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        if self.state == State::None {
            let reason = "there is none: the last factorization failed, or there was no first one";
            return Err(Error::Incompatible { part: "the LU of the effective matrix".into(), reason });
        }
        let size = self.rows.len();
        let count = rhs.len().checked_div(size).unwrap_or(0);
        if count > self.room {
            self.memory = MemBuffer::try_new(T::lu_scratch(&self.symbolic, count))
                .map_err(|_| Error::OutOfMemory { what: "sparse LU scratch", bytes: None })?;
            self.room = count;
        }
        let Self { symbolic, numeric, rows, columns, memory, .. } = self;
        let scale = |rhs: &mut [T], factors: &[T]| {
            for column in rhs.chunks_exact_mut(size.max(1)) {
                column.iter_mut().zip(factors).for_each(|(x, &factor)| *x *= factor);
            }
        };
        scale(rhs, rows);
        if count > 0 {
            T::lu_solve((symbolic, numeric), Side::Given, &mut rhs[..count * size], count, memory);
        }
        scale(rhs, columns);
        Ok(())
    }

    fn stored_values(&self) -> usize {
        self.bound
    }
}
