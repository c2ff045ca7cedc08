//! The complementarity problem of a step, and the seam for its solvers.

mod acceptance;
mod active_set;
mod gauss_seidel;
mod many_rows;
mod pivoting;
mod projected_gradient;

pub use active_set::ActiveSet;
pub use gauss_seidel::GaussSeidel;
pub use pivoting::Pivoting;
pub use projected_gradient::ProjectedGradient;

use crate::contact::ContactLaw;
use crate::dense::dot;
use crate::real::Real;

/// What the multiplier of a row may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// 0 ≤ y ⊥ λ ≥ 0.
    NonNegative,
    /// y = 0, λ of either sign.
    Free,
}

impl From<ContactLaw> for Bound {
    fn from(law: ContactLaw) -> Self {
        match law {
            ContactLaw::Equality => Self::Free,
            _ => Self::NonNegative,
        }
    }
}

/// Find λ with `y = W λ + q`, `0 ≤ y ⊥ λ ≥ 0` on unilateral rows and `y = 0` on free ones.
///
/// W is the Delassus operator (positive semidefinite; definite on independent rows), with the compliances of the laws
/// on its diagonal. It is as symmetric as the effective matrix A: W = G A⁻¹ Gᵀ. y has the unit of a gap, and so have
/// the tolerances: a residual compares y_i with W_ii λ_i, never meters with newtons.
#[derive(Clone, Copy, Debug)]
pub struct ContactProblem<'a, T> {
    /// W row by row, size × size: entry (i, j), what λ_j adds to y_i, is at `i · size + j`.
    pub delassus: &'a [T],
    /// q: y at λ = 0.
    pub offset: &'a [T],
    /// What each multiplier may be.
    pub bounds: &'a [Bound],
    /// For each row, the size of y that is rounding.
    pub tolerance: &'a [T],
    /// A number that changes whenever W does, 0 if unknown: what a solver has computed from W serves it again while the
    /// number is the same.
    pub version: u64,
}

impl<'a, T: Real> ContactProblem<'a, T> {
    /// Number of rows.
    pub fn size(&self) -> usize {
        self.offset.len()
    }

    /// Entry (i, j) of W.
    pub fn delassus(&self, i: usize, j: usize) -> T {
        self.delassus[i * self.size() + j]
    }

    /// Row i of W.
    pub fn row(&self, i: usize) -> &'a [T] {
        &self.delassus[i * self.size()..(i + 1) * self.size()]
    }

    /// `y_i = (W λ + q)_i`.
    pub fn gap(&self, i: usize, multipliers: &[T]) -> T {
        self.offset[i] + dot(self.row(i), multipliers)
    }

    /// What of y_i is rounding: its tolerance, and that of the sum `(W λ + q)_i` itself.
    pub fn rounding(&self, i: usize, multipliers: &[T]) -> T {
        let terms = self.row(i).iter().zip(multipliers).map(|(&w, &lambda)| (w * lambda).abs());
        self.tolerance[i] + T::of(32.0) * T::epsilon() * (self.offset[i].abs() + terms.sum::<T>())
    }

    /// The row that misses complementarity most, and by how much (unit of y): max over `|min(y_i, W_ii λ_i)|`, or
    /// `|y_i|` for free rows.
    pub fn residual(&self, multipliers: &[T]) -> (usize, T) {
        let miss = |i: usize| {
            let y = self.gap(i, multipliers);
            match self.bounds[i] {
                Bound::Free => y.abs(),
                Bound::NonNegative => y.min(self.delassus(i, i) * multipliers[i]).abs(),
            }
        };
        (0..self.size()).map(|i| (i, miss(i))).fold((0, T::zero()), |worst, x| if x.1 > worst.1 { x } else { worst })
    }
}

/// Why a contact problem was not solved; rows count within the problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ContactFailure<T> {
    /// No multipliers meet all conditions: rows demand opposite things of the same dofs.
    Contradictory {
        /// The row that is violated most.
        row: usize,
        /// The row that presses hardest against it.
        other: usize,
        /// The violation, in the unit of y.
        residual: T,
    },
    /// The iteration limit was reached.
    NotConverged {
        /// Iterations spent.
        iterations: usize,
        /// The worst row.
        row: usize,
        /// Its residual, in the unit of y.
        residual: T,
    },
    /// W is not symmetric, and the solver is for symmetric ones; nothing was done.
    Unsymmetric {
        /// The pair of rows whose entries across the diagonal differ most.
        row: usize,
        /// The other row.
        other: usize,
    },
}

impl<T: Real> std::fmt::Display for ContactFailure<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Contradictory { row, other, residual } => {
                let residual = residual.value();
                write!(f, "rows {row} and {other} contradict each other: {row} stays violated by {residual:e}")
            }
            Self::NotConverged { iterations, row, residual } => {
                let residual = residual.value();
                write!(f, "not solved after {iterations} iterations: row {row} misses complementarity by {residual:e}")
            }
            Self::Unsymmetric { row, other } => {
                write!(
                    f,
                    "rows {row} and {other} answer to each other differently: W is not symmetric; use ActiveSet or \
                     GaussSeidel"
                )
            }
        }
    }
}

impl<T: Real> std::error::Error for ContactFailure<T> {}

/// A solver of [`ContactProblem`]s.
///
/// ```
/// use contact_dynamics::contact_solver::{ActiveSet, Bound, ContactProblem, ContactSolver};
///
/// let mut solver: Box<dyn ContactSolver<f64>> = Box::new(ActiveSet::default());
/// solver.reserve(2);
/// let problem = ContactProblem {
///     delassus: &[2.0, 1.0, 1.0, 2.0],
///     offset: &[-2.0, 1.0],
///     bounds: &[Bound::NonNegative; 2],
///     tolerance: &[1e-14; 2],
///     version: 0,
/// };
/// let mut lambda = [0.0; 2];
/// solver.solve(&problem, &mut lambda).unwrap();
/// assert!((lambda[0] - 1.0).abs() < 1e-15 && lambda[1] == 0.0);
/// assert!((problem.gap(1, &lambda) - 2.0).abs() < 1e-15); // the second contact is pushed open
/// ```
pub trait ContactSolver<T: Real>: std::fmt::Debug + Send {
    /// Reserves memory for problems of up to `size` rows, so that [`solve`](Self::solve) does not allocate.
    fn reserve(&mut self, size: usize);

    /// Solves; `multipliers` holds a guess on entry (rows with λ > 0 are taken as active first) and the solution on
    /// exit. The guess may change the work, never the result beyond rounding. Returns the number of iterations.
    ///
    /// # Errors
    ///
    /// [`ContactFailure`]; the multipliers are then unspecified.
    fn solve(
        &mut self,
        problem: &ContactProblem<'_, T>,
        multipliers: &mut [T],
    ) -> std::result::Result<usize, ContactFailure<T>>;
}

impl<T: Real, S: ContactSolver<T> + ?Sized> ContactSolver<T> for Box<S> {
    fn reserve(&mut self, size: usize) {
        (**self).reserve(size);
    }
    fn solve(
        &mut self,
        problem: &ContactProblem<'_, T>,
        multipliers: &mut [T],
    ) -> std::result::Result<usize, ContactFailure<T>> {
        (**self).solve(problem, multipliers)
    }
}
