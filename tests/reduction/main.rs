//! Reduced bodies: modes, statics, states and loads, contact forces, what is refused.

mod impact;
mod modes;
mod refused;
mod states;
mod statics;
