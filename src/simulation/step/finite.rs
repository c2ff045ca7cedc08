//! The last check of a state before it is accepted: all of it is finite.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::state::{ContactState, Motion, State};

/// The dofs of a motion that are checked.
#[derive(Clone, Copy)]
pub(crate) enum Extent<'d> {
    All,
    /// Dofs that have changed since all dofs were found finite.
    At([&'d [usize]; 2]),
}

/// Refuses displacements, velocities and accelerations that are NaN or infinite; t and h belong to the step.
pub(crate) fn check_motion<T: Real>(t: f64, h: f64, motion: [&[T]; 3], extent: Extent<'_>) -> Result<()> {
    for (what, values) in ["the displacement", "the velocity", "the acceleration"].into_iter().zip(motion) {
        let wrong = match extent {
            Extent::All if T::all_finite(values) => None,
            Extent::All => values.iter().position(|x| !x.is_finite()),
            Extent::At(dofs) => dofs.into_iter().flatten().copied().find(|&dof| !values[dof].is_finite()),
        };
        if let Some(dof) = wrong {
            return Err(Error::StepNotFinite { t, h, what, dof, value: values[dof].value() });
        }
    }
    Ok(())
}

/// Refuses numbers of contacts that are NaN or infinite; t is the time of the state.
pub(crate) fn check_contacts<T: Real>(t: f64, contacts: &ContactState<T>) -> Result<()> {
    let ContactState { ids, lambda, lambda_raw, gap, impulse, lambda_v, lambda_a, dissipated, .. } = contacts;
    let fields = [
        ("the gap", gap),
        ("the multiplier", lambda_raw),
        ("the contact force", lambda),
        ("λ_v", lambda_v),
        ("λ_a", lambda_a),
        ("the impulse", impulse),
        ("the dissipated energy", dissipated),
    ];
    for (what, values) in fields {
        if T::all_finite(values) {
            continue;
        }
        if let Some(row) = values.iter().position(|x| !x.is_finite()) {
            // Tangential rows of contacts with friction follow the contacts.
            let contact = ids[contacts.tangents.owner(row)];
            return Err(Error::ContactNotFinite { t, what, contact, value: values[row].value() });
        }
    }
    Ok(())
}

/// Refuses a state that is NaN or infinite anywhere.
pub(crate) fn check_state<T: Real>(h: f64, state: &State<T>) -> Result<()> {
    let Motion { t, u, v, a } = &state.motion;
    check_motion(*t, h, [u, v, a], Extent::All)?;
    check_motion(*t, h, [u, state.velocity(), state.acceleration()], Extent::All)?;
    check_contacts(*t, &state.contacts)
}
