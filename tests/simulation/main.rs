//! Simulations: start, steps and their size, supports, Newton's method, energy, and all that is refused or fails.

mod absolute_time;
mod energy;
mod explicit_massless;
mod failures;
mod finite;
mod jumps;
mod limits;
mod many_contacts;
mod massless;
mod massless_momentum;
mod messages;
mod newton;
mod properties;
mod quiet_input;
mod random_scenes;
mod stability;
mod start;
mod start_at_rest;
mod step_control;
mod step_size;
mod stiffening;
mod supports;
