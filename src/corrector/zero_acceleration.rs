//! No acceleration on contact nodes.

use super::{Correction, Corrector};
use crate::error::Result;
use crate::real::Real;

/// Sets the accelerations of all dofs under pressed contacts to zero, and removes the inertia of the relative
/// acceleration from the reported force: the naive stabilization that is common in Schwarz couplings and for
/// obstacles at rest.
///
/// Between equal bodies that meet head on it is the acceleration part of the λ_v/λ_a correction. Velocities are
/// unchanged. Linear momentum is not conserved if the bodies differ or the obstacle accelerates: the remaining
/// acceleration is set to zero without a force. Only the relative part is booked as a contact impulse, so the impulse
/// misses the momentum change in schemes that read a. If rows are oblique to the dofs, tangential accelerations
/// vanish too. Contacts that hold their bodies only within the rounding of gaps and rates are skipped.
///
/// ```
/// use contact_dynamics::Corrector;
/// use contact_dynamics::corrector::ZeroAcceleration;
/// assert_eq!(Corrector::<f64>::name(&ZeroAcceleration), "a = 0");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ZeroAcceleration;

impl<T: Real> Corrector<T> for ZeroAcceleration {
    fn name(&self) -> String {
        "a = 0".into()
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        step.solve_velocity_jumps()?;
        step.solve_acceleration_jumps()?;
        let (share, weight) = (T::of(step.force_share()), T::of(step.momentum_weights()[2]));
        let mut place = 0;
        for i in 0..step.engaged().len() {
            let (row, force) = (step.engaged()[i], step.jump_forces()[i]);
            // Engaged rows are a subset of the closed ones, in the same order.
            while step.closed()[place] != row {
                place += 1;
            }
            // Bodies that stay together without force are closed by the sign of the last bit.
            if !step.holds(row, step.jump_impulses()[place])? {
                continue;
            }
            step.report_force(row, step.contacts().forces()[row] + share * force);
            step.book_impulse(row, weight * force);
            for (dof, _) in step.row(row).filter(|(_, entry)| *entry != T::zero()) {
                step.acceleration_mut()[dof] = T::zero();
            }
        }
        Ok(())
    }
}
