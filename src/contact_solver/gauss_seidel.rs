//! Projected Gauss–Seidel: row by row, robust, for many rows and moderate accuracy.

use super::acceptance::Settings;
use super::structure::Structure;
use super::sweeps::{Schedule, Sweeps};
use super::{AdmissibleSet, ContactFailure, ContactProblem, ContactSolver};
use crate::error::{Error, Result};
use crate::real::Real;

/// Projected Gauss–Seidel with optional over-relaxation: each row in turn closes its own gap within the bounds of its
/// multiplier.
///
/// ```text
/// λ_i ← max(0, λ_i − ω y_i / W_ii)      free rows: without max
/// ```
///
/// C. W. Cryer, The solution of a quadratic programming problem using systematic overrelaxation (SIAM J. Control 9,
/// 1971). It needs two numbers of memory per row and O(n²) operations per sweep. It converges for
/// every positive semi-definite W, so also with redundant rows, if the problem has a solution and 0 < ω < 2 (Luo and
/// Tseng, SIAM J. Control Optim. 29, 1991, and J. Optim. Theory Appl. 72, 1992). y is then unique, the multipliers
/// are not: they depend on the guess and on the order of the rows.
///
/// It accepts an unsymmetric W, but convergence is then proven only for diagonally dominant W, as for weakly coupled
/// rows (Cottle, Pang and Stone, The Linear Complementarity Problem, ch. 5, for H-matrices). If the sweeps do not
/// converge, it fails.
///
/// A result is accepted by its residual: in every row `|min(y_i, W_ii λ_i)|` (`|y_i|` of a free row) is rounding or at
/// most the tolerance times the largest |q_i|. A guess that is accepted is returned after 0 sweeps; one that is not
/// finite is not used.
///
/// A contact with friction is a block, whose subproblem is solved exactly in its turn. Sweeps then start at zero,
/// whatever the guess, and convergence is not proven: in every test they have converged on independent rows with
/// coefficients below 1, on redundant rows often not. Sweeps that do not end are [`ContactFailure::NotConverged`];
/// [`ContactFailure::Jammed`] names a contact uncoupled from all others that provably has no solution.
///
/// Known weakness: convergence is linear, and the number of sweeps grows with the condition of W: stiff against soft
/// bodies, or long stacks, take thousands. One tolerance applies to all rows, so small gaps next to large ones are
/// less accurate. A problem without a solution uses all allowed sweeps before it fails.
///
/// ```
/// use contact_dynamics::contact_solver::{AdmissibleSet, ContactProblem, GaussSeidel};
/// use contact_dynamics::ContactSolver;
///
/// // The same contact twice: which of the two carries is arbitrary, their sum is not.
/// let sets = [AdmissibleSet::NonNegative; 2];
/// let problem = ContactProblem::new(&[1.0, 1.0, 1.0, 1.0], &[-3.0, -3.0], &sets, &[1e-15; 2]).unwrap();
/// let mut lambda = [0.0_f64; 2];
/// GaussSeidel::default().solve(&problem, &mut lambda).unwrap();
/// assert!((lambda[0] + lambda[1] - 3.0).abs() < 1e-11);
/// ```
#[derive(Clone, Debug)]
pub struct GaussSeidel<T = f64> {
    relaxation: T,
    settings: Settings<T>,
    structure: Structure,
    sweeps: Sweeps<T>,
}

impl<T: Real> Default for GaussSeidel<T> {
    fn default() -> Self {
        let (settings, structure, sweeps) = (Settings::default(), Structure::default(), Sweeps::default());
        Self { relaxation: T::one(), settings, structure, sweeps }
    }
}

impl<T: Real> GaussSeidel<T> {
    /// With relaxation factor ω: 1 by default; larger values may save sweeps if rows are strongly coupled.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless 0 < ω < 2.
    pub fn new(omega: f64) -> Result<Self> {
        match omega > 0.0 && omega < 2.0 {
            true => Ok(Self { relaxation: T::of(omega), ..Self::default() }),
            false => Err(Error::Parameter { name: "omega", value: omega, range: "in (0, 2)" }),
        }
    }

    /// Accepts a residual of this fraction of the largest |q_i|; by default 1e-12, or 8 eps of a coarser scalar.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless it is in [0, 1).
    pub fn tolerance(self, tolerance: f64) -> Result<Self> {
        Ok(Self { settings: self.settings.with_tolerance(tolerance)?, ..self })
    }

    /// Gives up after this many sweeps; by default 10 000.
    #[must_use]
    pub fn sweeps(mut self, sweeps: usize) -> Self {
        self.settings.iterations = sweeps;
        self
    }
}

impl<T: Real> ContactSolver<T> for GaussSeidel<T> {
    /// All sets are supported.
    fn admits(&self, _set: AdmissibleSet) -> bool {
        true
    }

    fn solve(
        &mut self,
        problem: &ContactProblem<'_, T>,
        multipliers: &mut [T],
    ) -> std::result::Result<usize, ContactFailure<T>> {
        let Self { relaxation: omega, settings, structure, sweeps } = self;
        let known = structure.is_known(problem);
        let acceptance = settings.begin(problem, known, multipliers)?;
        if !known {
            structure.find(problem);
        }
        let schedule = Schedule { omega: *omega, sweeps: settings.iterations, impatient: false };
        let mut spent = 0;
        match sweeps.solve(&acceptance, structure.symmetry(), schedule, &mut spent, multipliers) {
            true => Ok(spent),
            false => Err(acceptance.failure(spent, multipliers)),
        }
    }
}
