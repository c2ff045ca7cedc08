//! Fully implicit contact forces, and the stabilized prediction that goes with them.

use super::{Correction, Corrector, Effects, Extent, Prediction, Requirements, Verdict};
use crate::error::Result;
use crate::real::Real;
use crate::rounding::ONLY_ROUNDING;
use crate::tableau::{Rows, Tableau};

/// The contact-implicit form of a one-step scheme (Kane, Repetto, Ortiz, Marsden, Comput. Methods Appl. Mech. Eng.
/// 180, 1999): contact forces act as one impulse at the end of the step and do not remain in the acceleration.
///
/// With Newmark's rows, internal accelerations a_i and the contact's a_c = M⁻¹ Gᵀ λ_K:
///
/// ```text
/// u' = u + h v + h² ((½ − β) a_i + β a_i') + ½ h² a_c'      v' = v + h ((1 − γ) a_i + γ a_i') + h a_c'
/// ```
///
/// which is the step of the scheme itself with λ_K = 2 β λ, a ← a − M⁻¹ Gᵀ λ and v ← v + h (2β − γ) M⁻¹ Gᵀ λ: no
/// further problem is solved. It works with any one-step scheme of one stage, with its own response in place of 1, γ,
/// β.
///
/// Linear momentum is conserved. For β = ¼, γ = ½ the energy never rises. With damping it needs γ = 2β, because then
/// v is not changed; otherwise the build fails, because the damping of the step has not acted on the impulse added to
/// v. Known failure: contact force and velocity of the contact nodes oscillate, and the gap rate does not vanish in
/// persistent contact; [`ContactStabilized`] removes the force oscillation.
///
/// ```
/// use contact_dynamics::Corrector;
/// use contact_dynamics::corrector::ContactImplicit;
/// assert_eq!(Corrector::<f64>::name(&ContactImplicit), "contact-implicit");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContactImplicit;

impl<T: Real> Corrector<T> for ContactImplicit {
    fn name(&self) -> String {
        "contact-implicit".into()
    }

    fn requirements(&self, tableau: &Tableau) -> Requirements {
        Requirements { scheme: one_step(tableau), damping: adds_no_velocity(tableau), ..Requirements::default() }
    }

    fn effects(&self) -> Effects {
        Effects { leaves_smooth_motion: true, ..Effects::default() }
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        act_implicitly(step)
    }
}

/// The contact-stabilized scheme (Deuflhard, Krause, Ertel, Int. J. Numer. Methods Eng. 73, 2008):
/// [`ContactImplicit`] with the predicted displacements u + h v first moved to the nearest admissible ones in the
/// mass norm.
///
/// The contact forces then have no spurious oscillation. [`improved`](Self::improved) moves the prediction only on
/// contacts that were already closed (Klapproth, Schiela, Deuflhard, SIAM J. Numer. Anal. 49, 2011), so that bodies
/// may approach within a step as they do without contact.
///
/// Linear momentum is conserved, and the energy never rises (β = ¼, γ = ½). Known failures: an impact loses the
/// kinetic energy of the contact nodes, like a plastic one; their velocity keeps the value of the stopped approach,
/// because only displacements are moved. Damping would act on that velocity as long as contact lasts, so the build
/// fails for bodies with damping. Cost: one contact problem in the mass norm per step.
///
/// ```
/// use contact_dynamics::Corrector;
/// use contact_dynamics::corrector::ContactStabilized;
/// assert_eq!(Corrector::<f64>::name(&ContactStabilized::improved()), "contact-stabilized (closed)");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContactStabilized {
    extent: Extent,
}

impl ContactStabilized {
    /// Moves the prediction wherever it is inadmissible.
    pub const fn new() -> Self {
        Self { extent: Extent::All }
    }

    /// Moves the prediction on contacts that were already closed.
    pub const fn improved() -> Self {
        Self { extent: Extent::Closed }
    }
}

impl<T: Real> Corrector<T> for ContactStabilized {
    fn name(&self) -> String {
        match self.extent {
            Extent::All => "contact-stabilized".into(),
            Extent::Closed => "contact-stabilized (closed)".into(),
        }
    }

    fn requirements(&self, tableau: &Tableau) -> Requirements {
        let damping =
            Err("it leaves the contact nodes the velocity of their approach while they stay where they are, \
                           and damping would act on that; choose PersistencyCorrection");
        Requirements { scheme: one_step(tableau), damping, ..Requirements::default() }
    }

    fn effects(&self) -> Effects {
        Effects { predicts: true, leaves_smooth_motion: true, ..Effects::default() }
    }

    fn predict(&self, step: &mut Prediction<'_, T>) -> Result<()> {
        step.project(self.extent)
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        act_implicitly(step)
    }
}

/// Rejects schemes that read states before the last one or have intermediate stages: in these the force of a step
/// leaves more than an acceleration behind.
pub(super) fn one_step(tableau: &Tableau) -> Verdict {
    match tableau.depth() == 1 && tableau.stages.len() == 1 {
        true => Ok(()),
        false => Err("it needs a scheme of one stage that reads the last state alone"),
    }
}

/// Rejects schemes in which removing a constant contact force from the acceleration requires a change of v.
pub(super) fn adds_no_velocity(tableau: &Tableau) -> Verdict {
    let moves = |row: fn(&Rows) -> f64| tableau.stages.iter().map(|stage| row(&stage.recovery)).sum::<f64>();
    match (2.0 * moves(|rows| rows.u.z) - moves(|rows| rows.v.z)).abs() < ONLY_ROUNDING {
        true => Ok(()),
        false => Err("damping would act on the impulse that it adds to v only in the next step; choose a scheme with \
                      γ = 2β, as the trapezoidal rule"),
    }
}

/// Removes the contact forces of closed rows from the accelerations and applies them as one impulse in this step: a ←
/// a − r_a M⁻¹ Gᵀ λ, v ← v + h (2 r_u − r_v) M⁻¹ Gᵀ λ, reported force 2 r_u λ, with r the response of the scheme's
/// (u, h v, h² a) to a multiplier.
fn act_implicitly<T: Real>(step: &mut Correction<'_, T>) -> Result<()> {
    let rows = std::mem::take(&mut step.buffers.rows.closed);
    let mut impulses = std::mem::take(&mut step.buffers.impulses.multipliers);
    let [u, v, _] = step.response();
    let mut result = step.remove_raw_forces(&rows);
    impulses.clear();
    for &row in &rows {
        let lambda = step.contacts.lambda_raw[row];
        step.report_force(row, T::of(2.0 * u) * lambda);
        impulses.push(T::of(step.scheme.h * (2.0 * u - v)) * lambda);
    }
    result = result.and_then(|()| step.apply_impulses(&rows, &impulses));
    step.buffers.rows.closed = rows;
    step.buffers.impulses.multipliers = impulses;
    result
}
