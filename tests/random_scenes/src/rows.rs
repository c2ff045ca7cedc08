//! Scenes by chance on rows: bodies, contacts, loads and supports with every scheme, correction, law and solver, run
//! twice in ways that must agree, looked at in every step; what fails is made as small as it can be.
//!
//! Scenes of surfaces are in `by_chance`. `cargo run --release --example random_scenes` goes through both.

mod apart;
mod bodies;
mod build;
mod contacts;
mod draw;
mod nonlinear;
mod recipe;
mod rubber;
mod run;
mod shrink;
mod twins;
mod watch;

pub use draw::KINDS;
pub use nonlinear::Nonlinear;
pub use recipe::{Precision, Recipe, Twin};
pub use run::{Finding, Verdict};
pub use shrink::shrunk;
