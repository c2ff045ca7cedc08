//! The CD-Lagrange scheme.

use super::{TimeIntegrator, central_difference};
use crate::tableau::{ContactLevel, Rows, Stage, Tableau};

/// CD-Lagrange (Fekak, Brun, Gravouil, Depale, Comput. Mech. 60, 2017; Di Stasio et al., Adv. Model. Simul. Eng. Sci.
/// 6, 2019): central differences with contact as a condition on the half-step velocity.
///
/// ```text
/// u' = u + h v + ½ h² a,     v' = v + ½ h (a + a')         M a' + C v' + f_int(u') = f(t') + Gᵀλ'
/// 0 ≤ ġ at v' + ½ h a' ⊥ λ' ≥ 0  for contacts with g' ≤ 0
/// ```
///
/// The rows are the same as in [`CentralDifference`](crate::CentralDifference); with a lumped mass no matrix is
/// factorized.
///
/// * Order 2 on smooth motion; period shortening Ω²/24, no damping; stable for Ω < 2.
/// * Conserves linear momentum in the form v + ½ h a. Impacts are plastic (restitution 0).
/// * Contact is imposed on v' + ½ h a' once the gap has closed. A node that would meet an obstacle a fraction φ of a
///   step after its beginning, at the relative speed v, keeps a penetration of (1 − φ) h v as long as they touch. It
///   is of first order in h and the error of a single step: impacts do not accumulate it (theory, 5.1;
///   `docs/reliability.md` has long runs). [`CentralDifference`](crate::CentralDifference), with the same rows, has
///   no penetration. At impact the force is the impulse over h, and no correction applies.
///
/// ```
/// use contact_dynamics::{CdLagrange, TimeIntegrator, analysis};
/// assert!((analysis::spectral_radius(&CdLagrange.tableau(), 1.9, 0.0) - 1.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CdLagrange;

impl TimeIntegrator for CdLagrange {
    fn name(&self) -> String {
        "CD-Lagrange".into()
    }

    fn tableau(&self) -> Tableau {
        let rows: Rows = central_difference::rows();
        let contact = ContactLevel::Velocity { lead: 0.5, forecast: rows.u, forecast_at: 1.0 };
        Tableau::single(Stage::new(rows).with_contact(contact))
    }
}
