//! Monitors of a run: stability and energy.
//!
//! - `stability`: the largest stable step of a run; `stiffening`: steps that have become too long.
//! - `energy`: the energy of a state and the energy balance of a run; `impacts`: the energy lost in impacts.

pub(super) mod energy;
pub(super) mod impacts;
pub(super) mod stability;
pub(super) mod stiffening;
