//! Monitors of a run: stability and energy.
//!
//! - `stability`: the largest stable step of a run; `stiffening`: steps that have become too long.
//! - `energy`: the energy of a state and the energy balance of a run; `impacts`: the energy lost in impacts.

pub(super) mod energy;
pub(super) mod impacts;
pub(super) mod stability;
pub(super) mod stiffening;

use crate::contact::ContactJacobian;
use crate::state::ContactState;

/// A solved step, as the energy balance reads it.
pub(crate) struct StepData<'a, T> {
    pub(crate) t: f64,
    /// u, v and a at the time of the state.
    pub(crate) motion: [&'a [T]; 3],
    pub(crate) contacts: &'a ContactState<T>,
    /// The rows of the gaps, and the rows along which the reported forces act.
    pub(crate) g: &'a ContactJacobian<T>,
    pub(crate) forces: &'a ContactJacobian<T>,
    /// The fraction of the step at which those forces act.
    pub(crate) load: f64,
    /// The closed contacts with mass that leave jumps, which contacts were closed at the start of the step, and whether
    /// correctors remove the jumps.
    pub(crate) closed: &'a [usize],
    pub(crate) closed_at_start: &'a [bool],
    pub(crate) is_corrected: bool,
    pub(crate) corrections: T,
    pub(crate) h: f64,
}
