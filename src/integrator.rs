//! Time integrators: how u, v and a are computed from the unknown of a step.

mod bathe;
mod bdf2;
mod cd_lagrange;
mod central_difference;
mod chung_lee;
mod composite;
mod energy_momentum;
mod generalized_alpha;
mod gssss;
mod houbolt;
mod hulbert_chung;
mod moreau_jean;
mod newmark;
mod noh_bathe;
mod oalts;
mod park;
mod tchamwa_wielgosz;

pub use bathe::Bathe;
pub use bdf2::Bdf2;
pub use cd_lagrange::CdLagrange;
pub use central_difference::CentralDifference;
pub use chung_lee::ChungLee;
pub use composite::Composite;
pub use energy_momentum::EnergyMomentum;
pub use generalized_alpha::GeneralizedAlpha;
pub use gssss::Gssss;
pub use houbolt::Houbolt;
pub use hulbert_chung::HulbertChung;
pub use moreau_jean::MoreauJean;
pub use newmark::Newmark;
pub use noh_bathe::NohBathe;
pub use oalts::Oalts;
pub use park::Park;
pub use tchamwa_wielgosz::TchamwaWielgosz;

use crate::error::{Error, Result};
use crate::tableau::Tableau;
use std::ops::RangeInclusive;

/// A time-integration scheme: just a name and a [`Tableau`].
///
/// Effective matrix, right-hand side, start-up, momentum functional, λ_v/λ_a and history projection are derived from
/// the rows. A user's scheme is a single function:
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
    /// Name with parameters, as printed in tables and error messages.
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

/// Checks a parameter of a scheme; rejects NaN and values outside its range, described by `range`.
fn within(name: &'static str, value: f64, allowed: RangeInclusive<f64>, range: &'static str) -> Result<f64> {
    match allowed.contains(&value) {
        true => Ok(value),
        false => Err(Error::Parameter { name, value, range }),
    }
}
