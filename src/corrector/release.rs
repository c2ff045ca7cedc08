//! What velocities become where a contact opens.

use super::buffers::Given;
use super::{Correction, Corrector, Edits};
use crate::error::{Error, Result, positive};
use crate::real::Real;

/// Gives back at release what corrections took at impact: the release counterpart of the λ_v/λ_a correction, to be
/// added after it.
///
/// An impact stops the mass m_c of the contact nodes, and their energy ½ m_c ġ² is gone (theory, sections 10 and 16).
/// Nothing in the bodies has lost it: the exact solution has no such mass. At the end of the first step in which the
/// contact is open its nodes get the impulse that restores [`dissipated`](crate::ContactState::dissipated) to the
/// kinetic energy,
///
/// ```text
/// v ← v + M⁻¹ G_rowᵀ j,      ½ S j² + j ⟦v⟧ = dissipated,      ⟦v⟧ = G_row v + ∂g/∂t
/// ```
///
/// with past states, where the scheme reads them, moved as if they had had that velocity as well. For bars this is also
/// the velocity that the exact solution jumps to. Contacts that open in the same step and move the same nodes get these
/// impulses times one factor, by which their energies together are what they took together. Accelerations need no
/// correction: those of the first open step hold no contact force. Linear momentum is conserved. ⟦v⟧ and what was taken
/// are relative, so that a velocity common to all changes nothing. Kinetic energy never exceeds what it was before the
/// impact by more than the scheme makes of it, and without numerical damping the run keeps what is given back
/// (`docs/theory.md`, section 16).
///
/// Known failure: the energy returns in the shortest waves of the mesh, which a scheme with numerical damping removes
/// again. A contact that is pushed shut for good keeps what it took, and so does one of bodies that stay together
/// without force: where it opens by rounding alone, by less than ε^⅔ of the speed that the impact took, nothing is
/// given back. Schemes that read a past want it projected at
/// impact ([`with_history_projection`](crate::PersistencyCorrection::with_history_projection)): else contacts may open
/// and close again, and such a run of Park's scheme may end with .02 % of the energy less than without release.
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
        // (All from the same velocities: contacts that open together have no order.)
        let mut given = std::mem::take(&mut *step.buffers.given);
        given.clear();
        let result = give_back(step, &mut given);
        *step.buffers.given = given;
        result
    }
}

/// Gives back at all contacts that open what each of them took.
fn give_back<T: Real>(step: &mut Correction<'_, T>, given: &mut Given<T>) -> Result<()> {
    for i in 0..step.released().len() {
        let row = step.released()[i];
        let taken = step.contacts().dissipated()[row];
        if taken > T::zero() && !step.withholds(row, taken)? {
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
/// At impact, and as long as it lasts, velocity and acceleration of both sides are the common ones, as by
/// [`PersistencyCorrection`](super::PersistencyCorrection). At release the stress p that the contact has held runs off
/// as a wave, and changes the velocity of side i by p/(ρ_i c_i): the gap opens at the rate λ (1/Z₁ + 1/Z₂), with the
/// impedances Z_i = ρ_i c_i A of the bodies behind the contact and λ the last force reported. The nodes get this
/// relative velocity from one impulse j along the row,
///
/// ```text
/// v ← v + M⁻¹ Gᵀ j,      S j = λ (1/Z₁ + 1/Z₂)        (S = G M⁻¹ Gᵀ)
/// ```
///
/// which takes from one side the momentum that it gives to the other, whatever the bodies. With contact nodes of mass
/// m_i = ½ τ_i Z_i, whose elements a wave crosses in τ_i, it is j = ½ λ (τ₁ m₂ + τ₂ m₁)/(m₁ + m₂): the papers' own
/// condition where τ₁ = τ₂, and then
/// [`new`](Self::new) says it with τ alone, j = ½ τ λ. Where they differ, the papers' velocities of the two sides would
/// not conserve momentum on the nodes; here each side has its share of the relative velocity by its mass.
///
/// Energy changes at release by ½ S j² + j ⟦v⟧, which may be a rise.
///
/// Known failure: where the force falls to zero over several steps, as waves on a mesh make it, there is hardly any
/// left to be released, and the condition does next to nothing. Nor does it where a contact has opened by rounding
/// alone, by less than ε^⅔ of the speed that j would give: bodies that touch have none.
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

/// What is known of the waves behind the contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Waves {
    /// Time through a contact element, the same on both sides.
    Transit(f64),
    /// Impedances of the two sides.
    Impedances([f64; 2]),
}

impl TaylorPapadopoulos {
    /// With the time that a wave takes through a contact element, one for both sides of all contacts.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless it is positive and finite.
    pub fn new(transit: f64) -> Result<Self> {
        positive("the transit time of the contact elements", transit).map(|transit| Self(Waves::Transit(transit)))
    }

    /// With the impedances ρ c A of the two sides (mass/time), A the area that belongs to a contact; of all contacts
    /// the same. The impedance of what is rigid is infinite.
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

    fn edits(&self) -> Edits {
        Edits::Past
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        super::PersistencyCorrection::new().correct(step)?;
        // (All from the same velocities: contacts that open together have no order.)
        let mut given = std::mem::take(&mut *step.buffers.given);
        given.clear();
        let result = self.run_off(step, &mut given);
        *step.buffers.given = given;
        result
    }
}

impl TaylorPapadopoulos {
    /// Gives the contacts that open the impulses of the stress that they have held.
    fn run_off<T: Real>(&self, step: &mut Correction<'_, T>, given: &mut Given<T>) -> Result<()> {
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
            // (What touches without force gets nothing, nor does what rounding alone has opened.)
            if step.parts_by_rounding(row, s * impulse)?.is_none() {
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
