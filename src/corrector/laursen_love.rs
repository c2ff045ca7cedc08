//! Velocity jumps that give the work of contact back.

use super::contact_implicit::one_step;
use super::{Correction, Corrector};
use crate::error::Result;
use crate::real::Real;
use crate::tableau::Tableau;

/// The velocity jump of Laursen and Love (Int. J. Numer. Methods Eng. 53, 2002): after a step the velocities along
/// closed contacts jump so that kinetic energy changes by what the contact forces took from the bodies, to the digit.
///
/// ```text
/// v ← v + τ M⁻¹ Gᵀ λ,      ½ τ² λᵀ S λ + τ λᵀ G v + λᵀ (g' − g) = 0
/// ```
///
/// with the root that separates. For schemes whose balance holds in the middle of the step, where λ (g' − g) is what
/// contact does: with the midpoint rule, `Gssss::new(1.0, 1.0, 1.0)`, and with
/// [`EnergyMomentum`](crate::EnergyMomentum) every step ends with the energy it began with, whatever the mesh and the
/// step. Linear momentum is conserved.
///
/// Known failure: the contact nodes rebound elastically, one element deep, so that contact is lost and found again
/// while the bodies stay together: forces come as a train of pulses, and the velocity of contact nodes is wrong by its
/// own size.
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

    fn check(&self, tableau: &Tableau) -> std::result::Result<(), &'static str> {
        one_step(tableau)?;
        match tableau.stages.iter().all(|stage| (stage.load - 0.5).abs() < 1e-12) {
            true => Ok(()),
            false => Err("it needs a scheme whose balance, with the force of contact, holds in the middle of the step"),
        }
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        let work = step.contact_work()?;
        step.exchange_by_forces(-work)
    }
}
