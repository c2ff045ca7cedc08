//! What velocities become where a contact opens.

use super::{Correction, Corrector, Edits};
use crate::error::{Result, positive};
use crate::real::Real;

/// Gives back at release what corrections took at impact: the release counterpart of the λ_v/λ_a correction, to be added
/// after it.
///
/// An impact stops the mass m_c of the contact nodes, and their energy ½ m_c ġ² is gone (theory, sections 10 and 16). Nothing in the bodies
/// has lost it: the exact solution has no such mass. At the end of the first step in which the contact is open its nodes get the
/// impulse that restores [`dissipated`](crate::ContactState::dissipated) to the kinetic energy,
///
/// ```text
/// v ← v + M⁻¹ G_rowᵀ j,      ½ S j² + j [[v]] = dissipated,      [[v]] = G_row v + ∂g/∂t
/// ```
///
/// with past states, where the scheme reads them, moved as if they had had that velocity as well. For bars this is also the
/// velocity that the exact solution jumps to. Accelerations need no correction: those of the first open step hold no contact
/// force. Linear momentum is conserved. [[v]] and what was taken are relative, so that a velocity common to all changes nothing. Kinetic
/// energy never exceeds what it was before the impact by more than the scheme makes of it, and without numerical damping the
/// run keeps what is given back (`docs/theory.md`, section 16).
///
/// Known failure: the energy returns in the shortest waves of the mesh, which a scheme with numerical damping removes again. A
/// contact that is pushed shut for good keeps what it took. Schemes that read a past want it projected at impact
/// ([`with_history_projection`](crate::PersistencyCorrection::with_history_projection)): else contacts may open and close again,
/// and such a run of Park's scheme may end with .02 % of the energy less than without release.
///
/// ```
/// use contact_dynamics::corrector::Release;
/// use contact_dynamics::{Corrector, PersistencyCorrection};
/// let correctors: [Box<dyn Corrector<f64>>; 2] = [Box::new(PersistencyCorrection::new()), Box::new(Release)];
/// assert_eq!(correctors[1].name(), "release");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Release;

impl<T: Real> Corrector<T> for Release {
    fn name(&self) -> String {
        "release".into()
    }

    fn edits(&self) -> Edits {
        Edits::Past
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        step.each_released(Correction::give_back)
    }
}

/// Impact and release conditions from waves in the contact elements (Hughes, Taylor, Sackman, Curnier, Kanoknukulchai, Comput.
/// Methods Appl. Mech. Eng. 8, 1976; Taylor, Papadopoulos, Int. J. Numer. Methods Eng. 36, 1993), in the form that the masses of
/// the contact nodes allow.
///
/// At impact, and as long as it lasts, velocity and acceleration of both sides are the common ones, as by
/// [`PersistencyCorrection`](super::PersistencyCorrection). At release the stress p that the contact has held runs off as a
/// wave, and changes the velocity of either side by p/(ρ c): with a contact node of mass m = ρ A h_e/2 and the time τ = h_e/c of a
/// wave through its element this is the impulse ½ τ λ,
///
/// ```text
/// v ← v + M⁻¹ Gᵀ (½ τ λ)
/// ```
///
/// with λ the last force reported. One τ serves all contacts; where the elements on both sides have different ones, it is not
/// the condition of the papers, which would not conserve momentum there. As derived here linear momentum is conserved; energy
/// may rise at release, by ½ S (½ τ λ)².
///
/// Known failure: where the force falls to zero over several steps, as waves on a mesh make it, there is hardly any left to be
/// released, and the condition does next to nothing.
///
/// ```
/// use contact_dynamics::Corrector;
/// use contact_dynamics::corrector::TaylorPapadopoulos;
/// // Steel, c = 5000 m/s, elements of 1 mm.
/// let corrector = TaylorPapadopoulos::new(1e-3 / 5000.0)?;
/// assert_eq!(Corrector::<f64>::name(&corrector), "Taylor–Papadopoulos(2e-7)");
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaylorPapadopoulos {
    transit: f64,
}

impl TaylorPapadopoulos {
    /// With the time that a wave takes through a contact element.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless it is positive and finite.
    pub fn new(transit: f64) -> Result<Self> {
        positive("the transit time of the contact elements", transit).map(|transit| Self { transit })
    }
}

impl<T: Real> Corrector<T> for TaylorPapadopoulos {
    fn name(&self) -> String {
        format!("Taylor–Papadopoulos({:e})", self.transit)
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        super::PersistencyCorrection::new().correct(step)?;
        step.each_released(|step, row| {
            let impulse = T::of(0.5 * self.transit) * step.previous_force(row).max(T::zero());
            step.apply_impulses(&[row], &[impulse])
        })
    }
}
