//! No acceleration on contact nodes.

use super::{Correction, Corrector};
use crate::error::Result;
use crate::real::Real;

/// Sets the accelerations of all dofs that pressed contacts act on to zero, and takes the inertia of the relative
/// acceleration out of the reported force: the naive stabilization that is common in Schwarz couplings and for
/// obstacles at rest.
///
/// Between equal bodies that meet head on it is the acceleration part of the λ_v/λ_a correction. Velocities are left as
/// they are. Linear momentum is not conserved where bodies differ, nor for an obstacle that accelerates: what is left
/// of a is removed, though nothing pushes. The impulse of a contact books the relative part alone, so that it misses
/// the change of momentum of the schemes that read a. Where rows are oblique to the dofs, tangential accelerations
/// vanish too. Contacts that hold their bodies by no more than the rounding of gaps and rates are left alone.
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
            // (Engaged rows are some of the closed ones, in their order.)
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
