//! Time integrators: how u, v and a follow from the unknown of a step.

mod composite;
mod newmark;

pub use composite::Composite;
pub use newmark::Newmark;

use crate::tableau::Tableau;

/// A time-integration scheme: a name and a [`Tableau`], nothing else.
///
/// Effective matrix, right-hand side, start-up, momentum functional, λ_v/λ_a and history projection are derived from
/// the rows. A scheme of one's own is one function:
///
/// ```
/// use contact_dynamics::tableau::{Rows, Stage, Tableau, U, V, Z};
/// use contact_dynamics::{TimeIntegrator, analysis};
///
/// /// Backward Euler.
/// #[derive(Debug)]
/// struct BackwardEuler;
///
/// impl TimeIntegrator for BackwardEuler {
///     fn name(&self) -> String {
///         "backward Euler".into()
///     }
///     fn tableau(&self) -> Tableau {
///         let v = Z - U[0];
///         Tableau::single(Stage::new(Rows { u: Z, v, a: v - V[0] }))
///     }
/// }
///
/// let scheme: Box<dyn TimeIntegrator> = Box::new(BackwardEuler);
/// // |λ| = 1/√(1 + Ω²)
/// let radius = analysis::spectral_radius(&scheme.tableau(), 2.0, 0.0);
/// assert!((radius - 1.0 / 5.0_f64.sqrt()).abs() < 1e-12);
/// ```
pub trait TimeIntegrator: std::fmt::Debug + Send {
    /// Name with parameters, as a table or an error message shows it.
    fn name(&self) -> String;

    /// The rows of the scheme.
    fn tableau(&self) -> Tableau;
}

impl<I: TimeIntegrator + ?Sized> TimeIntegrator for Box<I> {
    fn name(&self) -> String {
        (**self).name()
    }
    fn tableau(&self) -> Tableau {
        (**self).tableau()
    }
}
