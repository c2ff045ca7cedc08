//! Velocity corrections for contacts that open.

use super::buffers::Given;
use super::{Correction, Corrector, Edits, Effects};
use crate::error::{Error, Result, positive};
use crate::real::Real;

/// Returns at release the energy that corrections took at impact: the release counterpart of the λ_v/λ_a correction,
/// to be added after it.
///
/// An impact stops the mass m_c of the contact nodes and so removes their energy ½ m_c ġ² (theory, sections 10 and
/// 16). The exact solution has no such mass and loses no energy. At the end of the first step in which the contact is
/// open, its nodes get the impulse that restores [`dissipated`](crate::ContactState::dissipated) to the kinetic
/// energy,
///
/// ```text
/// v ← v + M⁻¹ G_rowᵀ j,      ½ S j² + j ⟦v⟧ = dissipated,      ⟦v⟧ = G_row v + ∂g/∂t
/// ```
///
/// If the scheme reads past states, these are moved as if they had had that velocity too. For bars this is also the
/// velocity to which the exact solution jumps. If contacts that open in the same step move the same nodes, one factor
/// scales their impulses so that together they return the energy that they took together. Accelerations need no
/// correction: in the first open step they contain no contact force. Linear momentum is conserved. ⟦v⟧ and the
/// dissipated energy are relative, so a common velocity changes nothing. The kinetic energy exceeds its value before
/// the impact at most by the error of the scheme, and without numerical damping the run keeps the returned energy
/// (`docs/theory.md`, section 16).
///
/// Known failures: the energy returns in the shortest waves of the mesh, which a scheme with numerical damping
/// removes again. A contact that is pushed shut permanently never returns its energy, nor does a contact of bodies
/// that stay together without force: if it opens only by rounding, slower than ε^⅔ of the impact speed, no energy is
/// returned. Schemes that read past states need these projected at impact
/// ([`with_history_projection`](crate::PersistencyCorrection::with_history_projection)); otherwise contacts may open
/// and close again, and such a run of Park's scheme may end with .02 % less energy than without release.
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

    fn effects(&self) -> Effects {
        Effects { edits: Edits::Past, ..Effects::default() }
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        step.with_released(return_energies)
    }
}

impl<T: Real> Correction<'_, T> {
    /// Calls a function with memory for the impulses of contacts that open. All impulses use the same velocities:
    /// contacts that open together have no order.
    fn with_released(&mut self, correct: impl FnOnce(&mut Self, &mut Given<T>) -> Result<()>) -> Result<()> {
        let mut given = std::mem::take(&mut self.buffers.given);
        given.clear();
        let result = correct(self, &mut given);
        self.buffers.given = given;
        result
    }
}

/// Returns the dissipated energy at every contact that opens.
fn return_energies<T: Real>(step: &mut Correction<'_, T>, given: &mut Given<T>) -> Result<()> {
    for i in 0..step.released().len() {
        let row = step.released()[i];
        let taken = step.contacts().dissipated()[row];
        if taken > T::zero() && !step.keeps_energy(row, taken)? {
            given.rows.push(row);
            given.energies.push(taken);
        }
    }
    step.exchange_energies(given)?;
    for (&row, &impulse) in given.rows.iter().zip(&given.impulses).filter(|(_, impulse)| **impulse != T::zero()) {
        step.move_past(row, impulse)?;
    }
    Ok(())
}

/// Impact and release conditions from waves in the contact elements (Hughes, Taylor, Sackman, Curnier, Kanoknukulchai,
/// Comput. Methods Appl. Mech. Eng. 8, 1976; Taylor, Papadopoulos, Int. J. Numer. Methods Eng. 36, 1993), in a form
/// that conserves momentum.
///
/// At impact and during contact, velocity and acceleration of both sides are the common ones, as with
/// [`PersistencyCorrection`](super::PersistencyCorrection). At release the contact stress p travels away as a wave
/// and changes the velocity of side i by p/(ρ_i c_i): the gap opens at the rate λ (1/Z₁ + 1/Z₂), with the impedances
/// Z_i = ρ_i c_i A of the bodies behind the contact and λ the last reported force. One impulse j along the row gives
/// the nodes this relative velocity,
///
/// ```text
/// v ← v + M⁻¹ Gᵀ j,      S j = λ (1/Z₁ + 1/Z₂)        (S = G M⁻¹ Gᵀ)
/// ```
///
/// Each side loses the momentum that the other side gains, for any bodies. For contact nodes of mass m_i = ½ τ_i Z_i,
/// where τ_i is the transit time of a wave through the contact element, j = ½ λ (τ₁ m₂ + τ₂ m₁)/(m₁ + m₂). For τ₁ =
/// τ₂ = τ this is the papers' own condition, j = ½ τ λ, and [`new`](Self::new) needs only τ. For different τ_i the
/// papers' velocities of the two sides would not conserve momentum on the nodes; here the masses divide the relative
/// velocity between the sides.
///
/// The energy changes at release by ½ S j² + j ⟦v⟧, which may be positive.
///
/// Known failure: waves on a mesh reduce the force to zero over several steps, so that hardly any force is left at
/// release and the condition has almost no effect. It also has no effect if a contact has opened only by rounding,
/// slower than ε^⅔ of the speed that j would give: bodies that touch have no such speed.
///
/// ```
/// use contact_dynamics::Corrector;
/// use contact_dynamics::corrector::TaylorPapadopoulos;
/// // Steel, c = 5000 m/s, elements of 1 mm on both sides.
/// let corrector = TaylorPapadopoulos::new(1e-3 / 5000.0)?;
/// assert_eq!(Corrector::<f64>::name(&corrector), "Taylor–Papadopoulos(2e-7)");
/// // Steel on aluminium, 1 cm² behind each contact, in kg/s.
/// let corrector = TaylorPapadopoulos::with_impedances([7850.0 * 5000.0 * 1e-4, 2700.0 * 5100.0 * 1e-4])?;
/// // Steel on a rigid wall.
/// let wall = TaylorPapadopoulos::with_impedances([7850.0 * 5000.0 * 1e-4, f64::INFINITY])?;
/// # let _: [&dyn Corrector<f64>; 2] = [&corrector, &wall];
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaylorPapadopoulos(Waves);

/// Data of the waves behind the contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Waves {
    /// Time through a contact element, the same on both sides.
    Transit(f64),
    /// Impedances of the two sides.
    Impedances([f64; 2]),
}

impl TaylorPapadopoulos {
    /// With the transit time of a wave through a contact element, the same for both sides of all contacts.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless it is positive and finite.
    pub fn new(transit: f64) -> Result<Self> {
        positive("the transit time of the contact elements", transit).map(|transit| Self(Waves::Transit(transit)))
    }

    /// With the impedances ρ c A of the two sides (mass/time), A the area of a contact; the same for all contacts.
    /// The impedance of a rigid side is infinite.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless both are positive, and one of them finite.
    pub fn with_impedances(impedances: [f64; 2]) -> Result<Self> {
        for value in impedances {
            if !(value > 0.0 && value.recip().is_finite()) {
                let range = "positive, and infinite for one side at most";
                return Err(Error::Parameter { name: "the impedance of a side", value, range });
            }
        }
        let softer = impedances[0].min(impedances[1]);
        positive("the smaller impedance", softer).map(|_| Self(Waves::Impedances(impedances)))
    }
}

impl<T: Real> Corrector<T> for TaylorPapadopoulos {
    fn name(&self) -> String {
        match self.0 {
            Waves::Transit(transit) => format!("Taylor–Papadopoulos({transit:e})"),
            Waves::Impedances([first, second]) => format!("Taylor–Papadopoulos(Z = {first:e}, {second:e})"),
        }
    }

    fn effects(&self) -> Effects {
        Effects { edits: Edits::Past, ..Effects::default() }
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        super::PersistencyCorrection::new().correct(step)?;
        step.with_released(|step, given| self.release_stress(step, given))
    }
}

impl TaylorPapadopoulos {
    /// Applies the impulses of the released contact stress at contacts that open.
    fn release_stress<T: Real>(&self, step: &mut Correction<'_, T>, given: &mut Given<T>) -> Result<()> {
        for i in 0..step.released().len() {
            let row = step.released()[i];
            let force = step.previous_force(row).max(T::zero());
            let s = step.compliance(row)?;
            let impulse = match self.0 {
                Waves::Transit(transit) => T::of(0.5 * transit) * force,
                Waves::Impedances(sides) => {
                    let opening = T::of(sides.map(f64::recip).iter().sum()) * force;
                    if s > T::zero() { opening / s } else { T::zero() }
                }
            };
            // Contacts that touch without force, or have opened only by rounding, get no impulse.
            if step.separates_by_rounding(row, s * impulse)?.is_none() {
                given.rows.push(row);
                given.impulses.push(impulse);
            }
        }
        for (&row, &impulse) in given.rows.iter().zip(&given.impulses) {
            step.apply_impulses(&[row], &[impulse])?;
            step.move_past(row, impulse)?;
        }
        Ok(())
    }
}
