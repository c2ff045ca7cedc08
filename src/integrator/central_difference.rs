//! The central difference scheme, with contact by forward increments.

use super::TimeIntegrator;
use crate::tableau::{A, ContactLevel, Rows, Stage, Tableau, U, V, Z};

/// The central difference scheme, written for whole states (velocity Verlet), with the forward-increment multipliers of
/// Carpenter, Taylor and Katona (Int. J. Numer. Meth. Eng. 32, 1991).
///
/// ```text
/// u' = u + h v + ½ h² a,     v' = v + ½ h (a + a')         M a' + C v' + f_int(u') = f(t') + Gᵀλ'
/// 0 ≤ g(t' + h, u' + h v' + ½ h² a') ⊥ λ' ≥ 0
/// ```
///
/// The half-step velocity of the leapfrog form is v + ½ h a; both forms give the same displacements. With a lumped mass
/// and no damping, or damping proportional to mass, no matrix is factorized; other damping is implicit (M + ½ h C).
///
/// * Order 2; period shortening Ω²/24, no damping. Stable for Ω < 2: h below 2/ω_max, the time a wave takes through the
///   smallest element.
/// * Exact in one dimension at Courant number 1 with lumped linear elements of equal size, also through impact and
///   release.
/// * Conserves linear momentum in the form v + ½ h a, and an energy that differs from the system's energy by up to a
///   fraction Ω²/4.
/// * Contact is imposed on the displacements of the next step, which λ' determines: gaps are exact, and u of a state
///   never penetrates. The velocity of a state is the mean of the velocities before and after it, and no correction
///   applies. The multiplier is valid for one step size: if the step changes right after an impact, a small gap
///   remains.
///
/// ```
/// use contact_dynamics::{CentralDifference, TimeIntegrator, analysis};
/// let tableau = CentralDifference.tableau();
/// assert!((analysis::spectral_radius(&tableau, 1.99, 0.0) - 1.0).abs() < 1e-12);
/// assert!(analysis::spectral_radius(&tableau, 2.01, 0.0) > 1.1);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CentralDifference;

/// u, v and a of a step.
pub(super) fn rows() -> Rows {
    Rows { u: U[0] + V[0] + 0.5 * A[0], v: V[0] + 0.5 * (A[0] + Z), a: Z }
}

impl TimeIntegrator for CentralDifference {
    fn name(&self) -> String {
        "central difference".into()
    }

    fn tableau(&self) -> Tableau {
        Tableau::single(Stage::new(rows()).with_contact(ContactLevel::Position { lead: 1.0 }))
    }
}
