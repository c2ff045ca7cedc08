//! Correctors: their equations, what they conserve and give back, and damped bodies.

mod damping;
mod nonsmooth;
mod of_a_host;
mod papers;
mod persistency;
mod projection;
mod release;
mod restitution;
mod work_balance;
