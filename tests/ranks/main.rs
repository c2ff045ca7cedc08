//! Bodies over ranks, which are threads here: the same motion as in one piece, and failures of which all hear.

mod bodies;
#[cfg(feature = "serde")]
mod checkpoint;
mod equal;
mod failures;
#[allow(clippy::pedantic, reason = "numerics, with the lints of tests/scenes")]
mod parts;
mod refusals;
