//! Linear solvers: analyze a pattern once, factorize values many times, solve in place.

mod cholesky;
mod diagonal;

pub use cholesky::Cholesky;
pub use diagonal::Diagonal;

use crate::error::Result;
use crate::real::Real;
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};

/// A method to solve `A x = b` with sparse A; a small value, whose memory is the [`Factorization`].
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{Cholesky, LinearSolver};
///
/// let a = SparseColMat::try_new_from_triplets(
///     2, 2, &[Triplet::new(0, 0, 4.0), Triplet::new(0, 1, 1.0), Triplet::new(1, 0, 1.0), Triplet::new(1, 1, 3.0)],
/// )?;
/// let solver: Box<dyn LinearSolver<f64>> = Box::new(Cholesky::default());
/// let mut factor = solver.analyze(a.symbolic())?;
/// factor.factorize(a.as_ref())?;
/// let mut x = [1.0, 2.0];
/// factor.solve(&mut x);
/// assert!((x[0] - 1.0 / 11.0).abs() < 1e-15 && (x[1] - 7.0 / 11.0).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait LinearSolver<T: Real>: std::fmt::Debug + Send {
    /// Analyzes a pattern (both triangles) and allocates everything a factorization needs.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory), or [`Error::Incompatible`](crate::Error::Incompatible) for a
    /// pattern the solver cannot handle.
    fn analyze(&self, pattern: SymbolicSparseColMatRef<'_, usize>) -> Result<Box<dyn Factorization<T>>>;
}

impl<T: Real, L: LinearSolver<T> + ?Sized> LinearSolver<T> for Box<L> {
    fn analyze(&self, pattern: SymbolicSparseColMatRef<'_, usize>) -> Result<Box<dyn Factorization<T>>> {
        (**self).analyze(pattern)
    }
}

/// The memory of a [`LinearSolver`] for one pattern; several may live at once.
pub trait Factorization<T: Real>: std::fmt::Debug + Send {
    /// Factorizes a matrix with the analyzed pattern.
    ///
    /// # Errors
    ///
    /// [`Error::Singular`](crate::Error::Singular) with the failing dof; the factorization is then unusable until the
    /// next success.
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()>;

    /// Solves in place; `rhs` holds one or more columns of the system's size, one after the other.
    ///
    /// Does not allocate for a single column. Call after a successful [`factorize`](Self::factorize) only.
    fn solve(&mut self, rhs: &mut [T]);

    /// Number of stored values: the memory of the factor, in scalars.
    fn stored_values(&self) -> usize;
}

/// The solver that fits a pattern: [`Diagonal`] if there is no entry off the diagonal, else [`Cholesky`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Automatic;

impl<T: Real> LinearSolver<T> for Automatic {
    fn analyze(&self, pattern: SymbolicSparseColMatRef<'_, usize>) -> Result<Box<dyn Factorization<T>>> {
        if diagonal::is_diagonal(pattern) { Diagonal.analyze(pattern) } else { Cholesky::default().analyze(pattern) }
    }
}
