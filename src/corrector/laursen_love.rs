//! Velocity jumps that return the work of the contact forces.

use super::contact_implicit::one_step;
use super::{Correction, Corrector, Requirements};
use crate::error::Result;
use crate::real::Real;
use crate::rounding::ONLY_ROUNDING;
use crate::tableau::Tableau;

/// The velocity jump of Laursen and Love (Int. J. Numer. Methods Eng. 53, 2002): after a step the velocities along
/// closed contacts jump so that the kinetic energy changes by exactly the work that the contact forces took from the
/// bodies.
///
/// ```text
/// v ← v + τ M⁻¹ Gᵀ λ,      ½ τ² λᵀ S λ + τ λᵀ G v + λᵀ (g' − g) = 0
/// ```
///
/// with the root that separates. It needs a scheme whose balance holds in the middle of the step, where λ (g' − g) is
/// the work of contact. With the midpoint rule, `Gssss::new(1.0, 1.0, 1.0)`, and with
/// [`EnergyMomentum`](crate::EnergyMomentum) every step ends with the energy it started with, for any mesh and step.
/// Linear momentum is conserved. Contacts under [`PersistencySwitch`](crate::contact::ContactLaw) are rejected: the
/// law holds the gap rate while the contact rebounds, and energy would grow without bound.
///
/// Known failure: the contact nodes rebound elastically, one element deep, so contact opens and closes repeatedly
/// while the bodies stay together. Forces arrive as a train of pulses, and the velocity error of contact nodes is as
/// large as the velocity itself.
///
/// ```
/// use contact_dynamics::Corrector;
/// use contact_dynamics::corrector::LaursenLove;
/// assert_eq!(Corrector::<f64>::name(&LaursenLove), "Laursen–Love");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LaursenLove;

impl<T: Real> Corrector<T> for LaursenLove {
    fn name(&self) -> String {
        "Laursen–Love".into()
    }

    fn requirements(&self, tableau: &Tableau) -> Requirements {
        let is_midpoint = tableau.stages.iter().all(|stage| (stage.load - 0.5).abs() < ONLY_ROUNDING);
        let midpoint = if is_midpoint {
            Ok(())
        } else {
            Err("it needs a scheme whose balance, with the force of contact, holds in the middle of the step")
        };
        // With a rate held at the end of a step that begins with a rebound, the force does work along the opening gap,
        // and no velocity is left to return this work.
        let persistency_switch =
            Err("contacts rebound by it, and this law holds their rate while they leave: energy would grow without \
                 bound; choose `ContactLaw::Rigid`, or `PersistencyCorrection`");
        Requirements { scheme: one_step(tableau).and(midpoint), persistency_switch, ..Requirements::default() }
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        let work = contact_work(step)?;
        exchange_by_forces(step, -work)
    }
}

/// Work of the raw multipliers over the stage: the sum of multiplier times change of gap.
fn contact_work<T: Real>(step: &mut Correction<'_, T>) -> Result<T> {
    if step.starting_gaps()?.is_empty() {
        return Ok(T::zero());
    }
    let Correction { buffers, contacts, .. } = step;
    let (closed, gaps) = (&buffers.rows.closed, &buffers.readings.gaps);
    Ok(closed.iter().map(|&row| contacts.lambda_raw[row] * (contacts.gap[row] - gaps[row])).sum())
}

/// Changes the kinetic energy relative to the obstacle by `energy`, or as much of it as there is, by impulses
/// proportional to the raw multipliers of the closed rows.
fn exchange_by_forces<T: Real>(step: &mut Correction<'_, T>, energy: T) -> Result<()> {
    step.read_rates()?;
    let rows = std::mem::take(&mut step.buffers.rows.closed);
    let mut impulses = std::mem::take(&mut step.buffers.impulses.multipliers);
    impulses.clear();
    impulses.extend(rows.iter().map(|&row| step.contacts.lambda_raw[row].max(T::zero())));
    let mut result = step.scale_to_energy(&rows, &mut impulses, energy);
    if let Ok(true) = result {
        result = step.apply(&rows, &impulses).map(|()| true);
    }
    step.buffers.rows.closed = rows;
    step.buffers.impulses.multipliers = impulses;
    result.map(|_| ())
}
