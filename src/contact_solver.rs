//! Contact problems and the trait of their solvers.

mod acceptance;
mod active_set;
mod applied;
mod cone;
mod cone_newton;
mod equations;
mod failure;
mod gauss_seidel;
mod many_rows;
mod pivoting;
mod problem;
mod projected_gradient;
mod structure;
mod sweeps;

pub use crate::contact_failure::ContactFailure;
pub use active_set::ActiveSet;
pub use applied::AppliedProblem;
pub(crate) use failure::{contact_error, no_response};
pub use gauss_seidel::GaussSeidel;
pub use pivoting::Pivoting;
pub use problem::{AdmissibleSet, ContactProblem};
pub use projected_gradient::ProjectedGradient;

use crate::real::Real;

/// Number of rows for which memory is reserved at build; larger problems get memory at their first solve.
pub(crate) const FORESEEN: usize = 128;

/// From this many rows on, cubic cost is avoided, and so is one solve per row in repeated assemblies.
pub(crate) const MANY: usize = 256;

/// A solver of [`ContactProblem`]s.
///
/// ```
/// use contact_dynamics::contact_solver::{AdmissibleSet, ContactProblem};
/// use contact_dynamics::{ActiveSet, ContactSolver};
///
/// let mut solver: Box<dyn ContactSolver<f64>> = Box::new(ActiveSet::default());
/// solver.reserve(2);
/// let sets = [AdmissibleSet::NonNegative; 2];
/// let problem = ContactProblem::new(&[2.0, 1.0, 1.0, 2.0], &[-2.0, 1.0], &sets, &[1e-14; 2]).unwrap();
/// let mut lambda = [0.0; 2];
/// solver.solve(&problem, &mut lambda).unwrap();
/// assert!((lambda[0] - 1.0).abs() < 1e-15 && lambda[1] == 0.0);
/// assert!((problem.gap(1, &lambda) - 2.0).abs() < 1e-15); // the second contact is pushed open
/// ```
pub trait ContactSolver<T: Real>: std::fmt::Debug + Send {
    /// Whether the solver handles blocks of a set; building a simulation fails for contact laws that need another
    /// one. Default: all sets of one row.
    fn admits(&self, set: AdmissibleSet) -> bool {
        set.rows() == 1
    }

    /// Announces problems of up to `size` rows: a solver that allocates no memory in [`solve`](Self::solve) reserves
    /// it here. Called at build, and before the first problem with more rows than announced, then for up to twice as
    /// many. Default: reserves no memory.
    fn reserve(&mut self, size: usize) {
        let _ = size;
    }

    /// Solves; `multipliers` holds a guess on entry (rows with λ > 0 are first taken as active) and the solution on
    /// exit. The guess may change the work, but the result only within rounding. Returns the number of iterations.
    ///
    /// # Errors
    ///
    /// [`ContactFailure`]; the multipliers are then unspecified.
    fn solve(
        &mut self,
        problem: &ContactProblem<'_, T>,
        multipliers: &mut [T],
    ) -> std::result::Result<usize, ContactFailure<T>>;

    /// Solves a problem with a matrix-free W, like [`solve`](Self::solve): for hundreds of rows on a body whose
    /// matrix changes with every iteration. If this returns an error or `None`, W is formed and
    /// [`solve`](Self::solve) called. Default: `None`, for solvers that need the entries of W.
    fn solve_applied(
        &mut self,
        problem: &mut AppliedProblem<'_, T>,
        multipliers: &mut [T],
    ) -> Option<std::result::Result<usize, ContactFailure<T>>> {
        let _ = (problem, multipliers);
        None
    }
}

impl<T: Real, S: ContactSolver<T> + ?Sized> ContactSolver<T> for Box<S> {
    fn solve_applied(
        &mut self,
        problem: &mut AppliedProblem<'_, T>,
        multipliers: &mut [T],
    ) -> Option<std::result::Result<usize, ContactFailure<T>>> {
        (**self).solve_applied(problem, multipliers)
    }
    fn admits(&self, set: AdmissibleSet) -> bool {
        (**self).admits(set)
    }
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
