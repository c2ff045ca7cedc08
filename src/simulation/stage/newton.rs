//! Settings of Newton's method, the report of its iterations, and its memory.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::stage::path::PathWork;

/// When the effective matrix is formed and factorized again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TangentUpdate {
    Iteration,
    Stage,
}

impl TangentUpdate {
    /// A residual above rounding stagnates if it does not fall to this share in this number of iterations. With a
    /// constant tangent it may fall by only a fiftieth in each.
    pub(crate) fn falls(self) -> (usize, f64) {
        match self {
            Self::Iteration => (2, 0.5),
            Self::Stage => (8, 0.85),
        }
    }
}

/// How Newton's method solves the stages of a nonlinear system.
///
/// With r = f − M ā + Gᵀ λ and A the effective matrix, an iteration solves `A Δ = r` together with the contact
/// conditions at the end of the step, 0 ≤ g ⊥ λ ≥ 0, and moves the unknown by Δ. Gaps that are not affine in u are
/// linearized again within the iteration, on the contact dofs only, until the contact conditions hold: their
/// curvature needs no factorization and does not slow down convergence.
///
/// A stage is solved when both
///
/// * ‖r‖ ≤ `force` · (‖f‖ + ‖Gᵀ λ‖), and
/// * the next increment, estimated by ‖Δ‖ ‖r‖ / ‖r before‖, is at most `displacement` times the whole increment.
///
/// Norms are Euclidean over the free dofs. The increment is measured from the prediction, so that no common
/// translation enters.
///
/// Where forces cancel, in free flight or at rest, a stage is solved when increments are within `displacement` of the
/// whole increment and the residual has fallen by the factor `force` or stagnates. It stagnates if it does not fall
/// to one half in two iterations, or with a constant tangent to 0.85 in eight. A stage is also solved when increments
/// are below the resolution of u, ε ‖u‖. Tolerances below 64 ε of the scalar are raised to it.
///
/// ```
/// use contact_dynamics::Newton;
/// let careful = Newton::full().line_search().tolerances(1e-11, 1e-10)?.iterations(30)?;
/// assert_ne!(careful, Newton::default());
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Newton {
    pub(crate) tangent: TangentUpdate,
    pub(crate) line_search: bool,
    pub(crate) force: f64,
    pub(crate) displacement: f64,
    pub(crate) iterations: usize,
}

impl Default for Newton {
    fn default() -> Self {
        Self::full()
    }
}

impl Newton {
    /// A new tangent in each iteration: quadratic convergence.
    pub const fn full() -> Self {
        Self { tangent: TangentUpdate::Iteration, line_search: false, force: 1e-9, displacement: 1e-8, iterations: 20 }
    }

    /// The tangent of the prediction for all iterations of a stage: linear convergence, one factorization. Useful if
    /// a factorization is expensive and steps are small.
    pub const fn modified() -> Self {
        Self { tangent: TangentUpdate::Stage, iterations: 60, ..Self::full() }
    }

    /// Halves increments, down to an eighth, while they do not reduce the residual or lead to a state that the host
    /// does not admit. It costs nothing where full increments are accepted. Slender structures pass through larger
    /// residuals before they converge, and are better solved without it.
    #[must_use]
    pub const fn line_search(self) -> Self {
        Self { line_search: true, ..self }
    }

    /// Relative tolerances in force and displacement; 1e-9 and 1e-8 by default.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless both are in (0, 1).
    pub fn tolerances(self, force: f64, displacement: f64) -> Result<Self> {
        for (name, value) in
            [("Newton's tolerance in force", force), ("Newton's tolerance in displacement", displacement)]
        {
            if !(value > 0.0 && value < 1.0) {
                return Err(Error::Parameter { name, value, range: "in (0, 1)" });
            }
        }
        Ok(Self { force, displacement, ..self })
    }

    /// The largest number of iterations of a stage; 20 by default (60 for [`modified`](Self::modified)). Beyond it
    /// the step is undone, and [`Error::NewtonNotConverged`] is returned.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for zero and for more than a million, as memory for the report of each iteration is
    /// reserved.
    pub fn iterations(self, iterations: usize) -> Result<Self> {
        let (name, value) = ("Newton's number of iterations", iterations as f64);
        match (1..=1_000_000).contains(&iterations) {
            true => Ok(Self { iterations, ..self }),
            false => Err(Error::Parameter { name, value, range: "between 1 and a million" }),
        }
    }

    /// Tolerances in force and displacement, raised to the resolution of the scalar.
    pub(crate) fn bounds<T: Real>(&self) -> [f64; 2] {
        [self.force, self.displacement].map(|tolerance| tolerance.max(rounding(T::one()).value()))
    }
}

/// One iteration of Newton's method: [`Simulation::convergence`](crate::Simulation::convergence).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Iteration {
    /// ‖f − M ā + Gᵀ λ‖ after the iteration, over ‖f‖ + ‖Gᵀ λ‖.
    pub residual: f64,
    /// ‖Δ‖ of the iteration over the norm of the whole increment so far.
    pub increment: f64,
}

/// Memory of Newton's method.
pub(crate) struct NewtonWork<T> {
    pub(crate) settings: Newton,
    /// The whole increment of the stage so far, one a dof.
    pub(crate) d: Vec<T>,
    /// Residual without contact forces before an iteration, and the increment of the iteration.
    pub(crate) residual: Vec<T>,
    pub(crate) increment: Vec<T>,
    /// For schemes that evaluate the force along the whole path.
    pub(crate) path: Option<PathWork<T>>,
    pub(crate) report: Vec<Iteration>,
    /// The norm of the residual before the iterations of the stage, and after each.
    pub(crate) residuals: Vec<f64>,
}

impl<T: Real> NewtonWork<T> {
    /// Memory for a system of `dofs` dofs.
    pub(crate) fn new(settings: Newton, dofs: usize, path: Option<PathWork<T>>) -> Self {
        let zero = |size: usize| vec![T::zero(); size];
        Self {
            settings,
            d: zero(dofs),
            residual: zero(dofs),
            increment: zero(dofs),
            path,
            report: Vec::with_capacity(settings.iterations),
            residuals: Vec::with_capacity(settings.iterations + 1),
        }
    }
}
