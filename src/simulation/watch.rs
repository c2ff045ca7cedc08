//! What is watched while a run goes on.
//!
//! - `stability`: the step size up to which a run is stable; `stiffening`: steps that have become too long.
//! - `energy`: the energy of a state and the energy balance of a run; `impacts`: what impacts take of it.

pub(super) mod energy;
pub(super) mod impacts;
pub(super) mod stability;
pub(super) mod stiffening;
