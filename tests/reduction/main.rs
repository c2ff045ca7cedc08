//! Reduced bodies: modes, statics, states and loads, contact forces, fronts and impacts, friction, exact propagation,
//! what is refused.

mod friction;
mod fronts;
mod impact;
mod modes;
mod propagation;
mod refused;
mod states;
mod statics;
mod strikes;
