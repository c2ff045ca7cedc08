//! Time integrators: how u, v and a are computed from the unknown of a step.
//!
//! The most used ones; `docs/schemes.md` has the measured comparison of all:
//!
//! | scheme | order | ρ∞ | solves a step | contact | take it for |
//! | --- | --- | --- | --- | --- | --- |
//! | [`GeneralizedAlpha::default()`](GeneralizedAlpha) | 2 | 0.8 | 1 | gap, with correction | the default |
//! | [`Composite`] | 2 | 0 | 1 | gap, with correction | stiff modes gone in four steps, low ones kept by Ω⁵ |
//! | [`Newmark::trapezoidal`] | 2 | 1 | 1 | gap, with correction | energy kept, nothing stiff |
//! | [`Bathe`] | 2 | 0, or as given | 2 | gap, with correction | stiff modes gone in one step |
//! | [`CentralDifference`] | 2 | explicit | 1 | gap of the next step | waves; exact at Courant number 1 in 1-D |
//! | [`CdLagrange`] | 2 | explicit | 1 | gap rate | small steps, the smoothest raw contact force |
//! | [`EnergyMomentum`] | 2 | 1 | 1 | gap, with correction | energy and angular momentum in large rotations |
//! | [`MoreauJean`] | 2 (θ = ½) | 1 | 1 | gap rate | impacts as impulses, many contacts |
//!
//! The correction does most of the work at impact: corrected, the schemes of second order differ little. The step may
//! change at any time ([`Simulation::set_step_size`](crate::Simulation::set_step_size)); every scheme keeps its order.
//! [`analysis::report`](crate::analysis::report) prints the properties of a scheme, also of a user's own.

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
