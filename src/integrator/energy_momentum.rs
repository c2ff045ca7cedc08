//! The energy–momentum scheme.

use super::TimeIntegrator;
use crate::tableau::{Rows, Stage, Tableau, U, V, Z};

/// The conserving scheme of Simo and Tarnow (Z. angew. Math. Phys. 43, 1992) and of Gonzalez (Comput. Methods Appl.
/// Mech. Eng. 190, 2000), for nonlinear systems: the internal force of a step is the one whose work is the change of
/// the potential.
///
/// ```text
/// u' = u + ½ h (v + v'),     M (v' − v)/h = f(t + ½ h; u → u', v̄) + Gᵀ λ,     v̄ = ½ (v + v')
/// ```
///
/// The system's own force along the path u → u' ([`path_force`](crate::System::path_force)) is used. If there is
/// none, it is the mean of the forces at start, middle and end that is nearest to Simpson's rule and does that work;
/// this mean reads [`potential_energy`](crate::System::potential_energy) and
/// [`external_load`](crate::System::external_load), and needs three forces and two tangents per iteration.
///
/// * Conserves the energy of conservative systems without contact, for any step, to the tolerance of
///   [`Newton`](crate::Newton)'s method; linear momentum in the form v; angular momentum if `force_along` conserves
///   it (the mean stress on the mean configuration does, Simpson's mean has an error of O(h²)).
/// * Order 2. On linear systems it is the trapezoidal rule, unconditionally stable, ρ∞ = 1; the stored a belongs to
///   the middle of the step and is extrapolated for a [`State`](crate::State).
/// * The exact tangent of a path is unsymmetric and needs [`Lu`](crate::Lu); a symmetric approximation takes one more
///   iteration. For the mean of three forces the tangent of Simpson's rule is used.
/// * Contact is imposed on the displacements at the end of the step. Corrected impacts lose the energy of the contact
///   nodes; without a correction the energy may rise or fall there.
///
/// ```
/// use contact_dynamics::{EnergyMomentum, Newmark, TimeIntegrator, analysis};
/// let radius = |scheme: &dyn TimeIntegrator| analysis::spectral_radius(&scheme.tableau(), 3.0, 0.1);
/// assert!((radius(&EnergyMomentum) - radius(&Newmark::trapezoidal())).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EnergyMomentum;

impl TimeIntegrator for EnergyMomentum {
    fn name(&self) -> String {
        "energy–momentum".into()
    }

    fn tableau(&self) -> Tableau {
        let v = 2.0 * (Z - U[0]) - V[0];
        let a = v - V[0];
        let balance = Rows { u: 0.5 * Z + 0.5 * U[0], v: Z - U[0], a };
        Tableau::single(Stage::new(Rows { u: Z, v, a }).balanced(balance, 0.5).along_path())
    }
}
