//! Reduced bodies: modes, statics, states and loads, contact forces, friction, exact propagation, what is refused.

mod friction;
mod impact;
mod modes;
mod propagation;
mod refused;
mod states;
mod statics;
