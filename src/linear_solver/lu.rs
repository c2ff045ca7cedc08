//! Sparse LU through faer: matrices that are not symmetric, or not definite.

use super::{Factorization, Fingerprint, LinearSolver, check_analysis};
use crate::error::{Error, Result};
use crate::memory;
use crate::real::Real;
use crate::rounding::rounding;
use crate::sparse::{self, scattered_signed};
use faer::dyn_stack::MemBuffer;
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::lu::{LuSymbolicParams, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};

/// Sparse LU factorization with partial pivoting, for any regular matrix: unsymmetric tangents (follower loads,
/// gyroscopic and circulatory matrices) and indefinite ones.
///
/// Columns are eliminated in an order with little fill for any choice of pivots (COLAMD), rows as pivoting requires.
/// Rows and columns are first scaled by powers of two, to largest entries of about one: pivots do not depend on the
/// units of translations and rotations, or on a stiff body next to a soft one.
///
/// **Singular matrices** are rejected as [`Error::Singular`] if their condition number, after scaling, exceeds
/// 1/(64 ε). It is estimated from the solution for a generic right-hand side, one solve per factorization. The named
/// dof has the largest entry of the null vector.
///
/// **Cost.** Two factors and a less favorable order: in three dimensions several times the time and memory of
/// [`Cholesky`](super::Cholesky). It offers no [`Condensation`](super::Condensation), so a step in contact needs a
/// full solve for each pressed contact, and one more. The size of the factors depends on the pivots:
/// [`stored_values`](Factorization::stored_values) counts the entries of the matrix alone, the factors have more.
/// Refactorization does not allocate for long thin structures, which faer processes column by column; for plates and
/// solids it works in blocks and allocates some memory each time.
///
/// An **indefinite** matrix is factorized without an error. [`Cholesky`](super::Cholesky) rejects it, which tells
/// Newton's method that a step is too long for a negative stiffness; with this solver that information is missing.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{GeneralizedAlpha, LinearSystem, Lu, Simulation};
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
/// let mut run = Simulation::builder(rotor, GeneralizedAlpha::default(), period / 1000.0)
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
    is_factorized: bool,
    fingerprint: Fingerprint,
    /// The values of R A C.
    scaled: Vec<T>,
    /// Diagonals of R and C.
    rows: Vec<T>,
    columns: Vec<T>,
    memory: MemBuffer,
    /// Number of right-hand sides for which `memory` suffices.
    room: usize,
    /// Vectors for estimating the condition number.
    probe: Vec<T>,
}

impl<T: Real> std::fmt::Debug for Factor<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Factor")
            .field("size", &self.rows.len())
            .field("is_factorized", &self.is_factorized)
            .finish_non_exhaustive()
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
        let memory = MemBuffer::try_new(T::lu_scratch(&symbolic, 1))
            .map_err(|_| Error::OutOfMemory { what: "sparse LU scratch", bytes: None })?;
        let zero = |columns| memory::zeros(n, columns, "a sparse LU");
        Ok(Box::new(Factor {
            symbolic,
            numeric: NumericLu::new(),
            is_factorized: false,
            fingerprint: Fingerprint::of(pattern),
            scaled: memory::zeros(pattern.row_idx().len(), 1, "a sparse LU")?,
            rows: zero(1)?,
            columns: zero(1)?,
            memory,
            room: 1,
            probe: zero(1)?,
        }))
    }
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

fn sum_of_sizes<T: Real>(x: &[T]) -> T {
    x.iter().map(|x| x.abs()).sum()
}

/// Index of the entry of largest magnitude; of the first that is not finite, if there is one.
fn largest<T: Real>(x: &[T]) -> usize {
    let larger = |best: usize, i: usize| if x[i].abs() > x[best].abs() { i } else { best };
    x.iter().position(|x| !x.is_finite()).unwrap_or_else(|| (0..x.len()).fold(0, larger))
}

impl<T: Real> Factor<T> {
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
        (0..PASSES).try_for_each(|_| self.balance(a.symbolic()))
    }

    /// One pass over the matrix.
    fn balance(&mut self, pattern: SymbolicSparseColMatRef<'_, usize>) -> std::result::Result<(), usize> {
        let Self { scaled, rows, columns, probe: factors, .. } = self;
        factors.fill(T::zero());
        for (&row, &value) in pattern.row_idx().iter().zip(scaled.iter()) {
            factors[row] = factors[row].max(value.abs());
        }
        if let Some(dof) = factors.iter().position(|factor| *factor == T::zero()) {
            return Err(dof);
        }
        for (row, factor) in rows.iter_mut().zip(factors.iter_mut()) {
            *factor = reciprocal_root(*factor);
            *row *= *factor;
        }
        for (dof, column) in columns.iter_mut().enumerate() {
            let range = pattern.col_range(dof);
            let entries = &mut scaled[range.clone()];
            let largest = entries.iter().fold(T::zero(), |largest, value| largest.max(value.abs()));
            if largest == T::zero() {
                return Err(dof);
            }
            let own = reciprocal_root(largest);
            *column *= own;
            for (value, &row) in entries.iter_mut().zip(&pattern.row_idx()[range]) {
                *value *= own * factors[row];
            }
        }
        Ok(())
    }

    /// Factorizes the scaled values and checks that the condition number of R A C leaves significant digits.
    fn eliminate(&mut self, pattern: SymbolicSparseColMatRef<'_, usize>) -> std::result::Result<(), Failure> {
        let Self { symbolic, numeric, scaled, probe, memory, .. } = self;
        T::lu(symbolic, SparseColMatRef::new(pattern, &scaled[..]), numeric, memory).map_err(|error| match error {
            LuError::SymbolicSingular { index } => {
                Failure::Pivot(symbolic.col_perm().arrays().0.get(index).copied().unwrap_or(0))
            }
            LuError::Generic(_) => Failure::OutOfMemory,
        })?;
        let columns = (0..pattern.ncols()).map(|dof| sum_of_sizes(&scaled[pattern.col_range(dof)]));
        let norm = columns.fold(T::zero(), T::max);
        // A generic right-hand side: for a singular matrix the null vector dominates the solution.
        probe.iter_mut().enumerate().for_each(|(i, x)| *x = T::of(scattered_signed(i)));
        let size = sum_of_sizes(probe);
        T::lu_solve((symbolic, numeric), probe, 1, memory);
        let condition = norm * sum_of_sizes(probe) / size;
        match condition.is_finite() {
            true if rounding(condition) <= T::one() => Ok(()),
            true => Err(Failure::NullVector(largest(probe))),
            false => Err(Failure::Pivot(largest(probe))),
        }
    }

    /// The dof to name after an exactly zero pivot: from the null vector of the matrix perturbed by rounding.
    fn name_singular(&mut self, pattern: SymbolicSparseColMatRef<'_, usize>, found: usize) -> usize {
        for (at, value) in self.scaled.iter_mut().enumerate() {
            *value += rounding(*value) * T::of(0.1 * scattered_signed(at));
        }
        match self.eliminate(pattern) {
            Err(Failure::NullVector(dof)) => dof,
            _ => found,
        }
    }
}

/// Why an elimination failed.
enum Failure {
    OutOfMemory,
    /// An exactly zero pivot at this dof.
    Pivot(usize),
    /// A matrix singular to rounding; the dof of the largest entry of its null vector.
    NullVector(usize),
}

impl<T: Real> Factorization<T> for Factor<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        self.is_factorized = false;
        self.fingerprint.check(a)?;
        sparse::check_finite("effective", a)?;
        let singular = |dof| Error::Singular { matrix: "effective matrix", dof };
        if !self.rows.is_empty() {
            self.scale(a).map_err(singular)?;
            self.eliminate(a.symbolic()).map_err(|failure| match failure {
                Failure::OutOfMemory => Error::OutOfMemory { what: "a sparse LU", bytes: None },
                Failure::Pivot(dof) => singular(self.name_singular(a.symbolic(), dof)),
                Failure::NullVector(dof) => singular(dof),
            })?;
        }
        self.is_factorized = true;
        Ok(())
    }

    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        if !self.is_factorized {
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
            T::lu_solve((symbolic, numeric), &mut rhs[..count * size], count, memory);
        }
        scale(rhs, columns);
        Ok(())
    }

    fn stored_values(&self) -> usize {
        self.scaled.len()
    }
}
