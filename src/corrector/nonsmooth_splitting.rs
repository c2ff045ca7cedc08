//! Splits a motion into a smooth part and impulses: generalized-α becomes the nonsmooth generalized-α scheme.

use super::contact_implicit::{adds_no_velocity, one_step};
use super::correction::Pressed;
use super::{Correction, Corrector, Effects, Requirements};
use crate::error::Result;
use crate::real::Real;
use crate::tableau::Tableau;

/// The nonsmooth generalized-α scheme (Chen, Acary, Virlez, Brüls, Int. J. Numer. Methods Eng. 96, 2013; with gaps and
/// gap rates both, Brüls, Acary, Cardona, Comput. Methods Appl. Mech. Eng. 281, 2014), as a correction of generalized-α
/// or any other one-step scheme: the scheme integrates the smooth motion, whose accelerations contain no contact force,
/// and contact acts by impulses alone.
///
/// Notation: ã' is the smooth acceleration, ν the impulses that enforce the gaps, Λ the impulses that enforce the gap
/// rates:
///
/// ```text
/// M ã' = f(u', v')                                                    (balanced where the scheme does that)
/// u' = u + h v + h² ((½ − β) ã + β ã') + M⁻¹ Gᵀ ν                      0 ≤ g(u') ⊥ ν ≥ 0
/// v' = v + h ((1 − γ) ã + γ ã') + M⁻¹ Gᵀ Λ                             0 ≤ G v' ⊥ Λ ≥ 0 on closed contacts
/// ```
///
/// The step of the scheme itself, with its multiplier λ and its response r of (u, h v, h² a) to a multiplier, solves
/// the first two lines with ã' = a' − r_a M⁻¹ Gᵀ λ (theory, section 16). A velocity projection as in λ_v/λ_a solves
/// the third: Λ = h r_v λ + the impulse of the projection. The two problems are solved one after the other; for
/// linear systems this is the decoupled form (Cosimo, Galvez, Cavalieri, Cardona, Brüls, Multibody Syst. Dyn. 48,
/// 2020) without its splitting error. Unlike with [`PersistencyCorrection`](super::PersistencyCorrection), a pressed
/// contact may open in the same step, and the next step reads an acceleration without contact.
///
/// The reported force is Λ/h, the mean over a step; in an impact step it contains the impact. The acceleration of the
/// state is the smooth one: a body at rest under its weight reports the acceleration of free fall. Linear momentum is
/// conserved. Friction lies in the cone of ν, opposed to the slip of the step so that sticking contacts do not creep,
/// and in the cone of Λ. With damping it needs γ = 2β, as [`ContactImplicit`](super::ContactImplicit) does: in all
/// contact, not only at impacts, the correction changes velocities by h (1 − γ/(2β)) times the acceleration of the
/// contact force, and the damping of the step has not acted on that change.
///
/// Known failure: in an impact step the force contains the momentum of the contact nodes, so it grows as the step
/// shrinks; an impact costs the kinetic energy of the contact nodes, as with λ_v/λ_a.
///
/// ```
/// use contact_dynamics::corrector::NonsmoothSplitting;
/// use contact_dynamics::faer::sparse::SparseColMat;
/// use contact_dynamics::{GeneralizedAlpha, LinearRows, LinearSystem, Simulation};
///
/// // A ball of 2 kg that is dropped from 0.2 m.
/// let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[])?;
/// let mut run = Simulation::builder(
///     LinearSystem::lumped(vec![2.0], k)?.load(|_, f| f[0] = -2.0 * 9.81),
///     GeneralizedAlpha::chung_hulbert(0.8)?,
///     1e-3,
/// )
/// .displacement(vec![0.2])
/// .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 0.0))
/// .corrector(NonsmoothSplitting)
/// .build()?;
/// run.run_until(0.3, &mut ())?;
/// let state = run.state();
/// assert!(state.displacement()[0].abs() < 1e-15 && state.velocity()[0].abs() < 1e-15);
/// assert!((state.contacts().forces()[0] - 2.0 * 9.81).abs() < 1e-12);
/// assert!((state.acceleration()[0] + 9.81).abs() < 1e-12); // that of the smooth motion
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NonsmoothSplitting;

impl<T: Real> Corrector<T> for NonsmoothSplitting {
    fn name(&self) -> String {
        "nonsmooth splitting".into()
    }

    fn requirements(&self, tableau: &Tableau) -> Requirements {
        let (scheme, damping) = (one_step(tableau), adds_no_velocity(tableau));
        Requirements { scheme, damping, friction: Ok(()), ..Requirements::default() }
    }

    fn effects(&self) -> Effects {
        Effects { leaves_smooth_motion: true, ..Effects::default() }
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        step.solve_velocity(Pressed::MaySeparate)?;
        step.push_velocity()?;
        step.split_forces()
    }
}

impl<T: Real> Correction<'_, T> {
    /// Removes the forces of closed contacts, including friction, from the accelerations, and reports the total
    /// impulses of the velocity problem divided by h.
    fn split_forces(&mut self) -> Result<()> {
        let rows = std::mem::take(&mut self.buffers.impulses.rows);
        let result = self.remove_raw_forces(&rows);
        for (&row, &total) in rows.iter().zip(&self.buffers.problem.totals) {
            self.contacts.lambda[row] = total / T::of(self.scheme.h);
        }
        self.buffers.impulses.rows = rows;
        result
    }
}
