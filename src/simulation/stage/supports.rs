//! Prescribed motions: read from the host, checked for NaN and infinity, and written to the vectors.

use crate::error::{Error, Result};
use crate::mass::Mass;
use crate::real::Real;
use crate::rounding::rounding;
use crate::state::Motion;
use crate::system::System;

/// The prescribed dofs and their motions in a stage.
pub(crate) struct Supports<T> {
    /// Ascending.
    pub(crate) dofs: Vec<usize>,
    /// Prescribed u, v, a at the time of the state and at the time of the balance.
    pub(crate) state: Vec<[T; 3]>,
    pub(crate) balance: Vec<[T; 3]>,
    /// Whether M couples prescribed dofs with free ones.
    pub(crate) coupled_mass: bool,
}

impl<T: Real> Supports<T> {
    /// Memory for the supports of a system.
    pub(crate) fn of(system: &dyn System<T>) -> Self {
        let dofs = system.prescribed().to_vec();
        Self {
            state: vec![[T::zero(); 3]; dofs.len()],
            balance: vec![[T::zero(); 3]; dofs.len()],
            coupled_mass: !dofs.is_empty() && matches!(system.mass(), Mass::Consistent(_)),
            dofs,
        }
    }
}

/// Refuses prescribed motions that are NaN or infinite.
pub(crate) fn finite_supports<T: Real>(t: f64, prescribed: &[usize], supports: &[[T; 3]]) -> Result<()> {
    for (&dof, support) in prescribed.iter().zip(supports) {
        if let Some(value) = support.iter().find(|x| !x.is_finite()) {
            return Err(Error::SupportNotFinite { t, dof, value: value.value() });
        }
    }
    Ok(())
}

/// Writes displacements and velocities of the supports at t to a motion.
pub(crate) fn put_supports<T: Real>(
    system: &mut dyn System<T>,
    t: f64,
    prescribed: &[usize],
    supports: &mut [[T; 3]],
    motion: &mut Motion<T>,
) -> Result<()> {
    if prescribed.is_empty() {
        return Ok(());
    }
    system.prescribed_motion(t, supports)?;
    finite_supports(t, prescribed, supports)?;
    for (&dof, support) in prescribed.iter().zip(supports.iter()) {
        (motion.u[dof], motion.v[dof]) = (support[0], support[1]);
    }
    Ok(())
}

/// Writes displacements and velocities of the supports at the start, and returns their motions. Refuses initial
/// values that differ from them.
pub(crate) fn put_initial_supports<T: Real>(
    system: &mut dyn System<T>,
    t: f64,
    u: &mut [T],
    v: &mut [T],
) -> Result<Vec<[T; 3]>> {
    let prescribed = system.prescribed().to_vec();
    let mut supports = vec![[T::zero(); 3]; prescribed.len()];
    system.prescribed_motion(t, &mut supports)?;
    finite_supports(t, &prescribed, &supports)?;
    for (&dof, support) in prescribed.iter().zip(&supports) {
        put(&mut u[dof], support[0], "displacement", dof)?;
        put(&mut v[dof], support[1], "velocity", dof)?;
    }
    Ok(supports)
}

/// Sets an initial value to the value of its support. Refuses a different value given by the host, unless it is zero.
fn put<T: Real>(place: &mut T, prescribed: T, what: &'static str, dof: usize) -> Result<()> {
    let given = *place;
    let same = (given - prescribed).abs() <= rounding(prescribed.abs());
    if given != T::zero() && !same {
        let (given, prescribed) = (given.value(), prescribed.value());
        return Err(Error::PrescribedStart { what, dof, given, prescribed });
    }
    *place = prescribed;
    Ok(())
}
