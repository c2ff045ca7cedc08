//! Contact problems and the trait of their solvers.

mod acceptance;
mod active_set;
mod cone;
mod cone_newton;
mod equations;
mod failure;
mod gauss_seidel;
mod many_rows;
mod pivoting;
mod problem;
mod projected_cg;
mod structure;
mod sweeps;

pub use crate::contact_failure::ContactFailure;
pub use active_set::ActiveSet;
pub(crate) use failure::{contact_error, no_response};
pub use gauss_seidel::GaussSeidel;
pub use pivoting::Pivoting;
pub(crate) use problem::new_version;
pub use problem::{AdmissibleSet, ContactProblem};
pub(crate) use projected_cg::{Body, Outcome, Patience, ProjectedCg, RowData, SparseProblem};

use crate::real::Real;

/// From this many rows on, cubic cost is avoided, and so is one solve per row in repeated assemblies.
pub(crate) const MANY: usize = 256;

/// Whether the Delassus operator W = G A⁻¹ Gᵀ of a contact problem is formed.
///
/// Without W the problem is solved by projected conjugate gradients on the displacements (Gould, Hribar and Nocedal,
/// SIAM J. Sci. Comput. 23, 2001): products with A, as many as for a system without contact. Displacements and
/// velocities of a run then differ by less than 1e-8.
///
/// ```
/// use contact_dynamics::ActiveSet;
/// use contact_dynamics::contact_solver::Assembly;
/// use contact_dynamics::prelude::*;
///
/// // A bar of two masses flies against a wall.
/// let entries = [(0, 0, 1.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)].map(|(i, j, k)| Triplet::new(i, j, k));
/// let stiffness = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &entries)?;
/// let bar = LinearSystem::lumped(vec![1.0; 2], stiffness)?;
/// let mut run = Simulation::builder(bar, GeneralizedAlpha::default(), 0.01)
///     .velocity(vec![1.0; 2])
///     .constraint(LinearRows::new().unilateral(&[(1, -1.0)], 0.005))
///     .contact_solver(ActiveSet::default().with_assembly(Assembly::Never))
///     .build()?;
/// run.run_until(0.1, &mut ())?;
/// assert!(run.state().contacts().forces()[0] > 0.0);
/// assert!(run.statistics().contact_products > 0 && run.statistics().contact_iterations == 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Assembly {
    /// Whichever is less work, counted from the sizes of the problem; never if the linear solver iterates. If the
    /// iteration does not converge, W is formed.
    #[default]
    Automatic,
    /// Always.
    Always,
    /// Never: a problem of which the iteration does not converge is an error. Contacts whose force is known, contacts
    /// on dofs without mass or with prescribed dofs alone, unsymmetric matrices and diagonal ones have W in any case.
    Never,
}

impl Assembly {
    /// The number of rows from which on a problem may do without W.
    pub(crate) fn least(self) -> usize {
        match self {
            Self::Automatic => MANY,
            Self::Always => usize::MAX,
            Self::Never => 1,
        }
    }
}

/// A solver of [`ContactProblem`]s.
///
/// ```
/// use contact_dynamics::contact_solver::{AdmissibleSet, ContactProblem};
/// use contact_dynamics::{ActiveSet, ContactSolver};
///
/// let mut solver: Box<dyn ContactSolver<f64>> = Box::new(ActiveSet::default());
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

    /// Solves; `multipliers` holds a guess on entry (rows with λ > 0 are first taken as active) and the solution on
    /// exit. The guess may change the work, but the result only within rounding. Returns the number of iterations.
    /// Memory that a solver keeps for the next problem makes steady steps free of allocation.
    ///
    /// # Errors
    ///
    /// [`ContactFailure`]; the multipliers are then unspecified.
    fn solve(
        &mut self,
        problem: &ContactProblem<'_, T>,
        multipliers: &mut [T],
    ) -> std::result::Result<usize, ContactFailure<T>>;

    /// Whether a run may solve problems itself, without W, in the place of this solver. Default: no.
    fn assembly(&self) -> Assembly {
        Assembly::Always
    }
}

impl<T: Real, S: ContactSolver<T> + ?Sized> ContactSolver<T> for Box<S> {
    fn assembly(&self) -> Assembly {
        (**self).assembly()
    }
    fn admits(&self, set: AdmissibleSet) -> bool {
        (**self).admits(set)
    }
    fn solve(
        &mut self,
        problem: &ContactProblem<'_, T>,
        multipliers: &mut [T],
    ) -> std::result::Result<usize, ContactFailure<T>> {
        (**self).solve(problem, multipliers)
    }
}
