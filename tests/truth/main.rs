//! Whole runs of the crate beside those of a second, slow implementation of the time step, which is written from the
//! theory and shares no code with it but the rows of the schemes: every scheme, with every correction, law of contact
//! and friction that goes with it. What is refused is listed here too: a new scheme or correction falls out of the
//! tables, and fails, until it is written down what it goes with.

mod changes;
mod friction;
#[allow(clippy::pedantic, reason = "numerics, with the lints of tests/scenes")]
mod independent;
mod laws;
mod massless;
mod newton;
mod rigid;
mod sweep;
