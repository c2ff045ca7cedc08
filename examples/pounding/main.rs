//! Pounding: two frames of different periods, a gap, one earthquake, and nine ways to let them collide.
//!
//! `cargo run --release --example pounding` prints the tables of `docs/measured/pounding.md` and writes them and a
//! figure (`pounding.svg`); with `--quick` the ground shakes for four seconds, and references are coarse.
//!
//! `models.rs` has what is compared; `tables.rs` the figures of all models at their references, their errors by the
//! step, what the stiffness of a contact does, and the restitution of damped laws; `decks.rs` two bridge decks (`deck_models.rs`);
//! `figure.rs` the figure.

#[allow(clippy::pedantic, reason = "numerics, with the lints of tests/scenes")]
mod deck_models;
mod decks;
mod figure;
mod models;
mod tables;

use example_support::output::Output;
use std::error::Error;
use std::fmt::Write;

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("pounding")?;
    let study = tables::Study::new(output.quick);
    let mut page = String::new();
    for table in study.tables()?.into_iter().chain([decks::Bridge::new(output.quick).table()?, tables::restitutions()])
    {
        println!("{table}");
        writeln!(page, "{table}")?;
    }
    output.write("pounding.md", &page)?;
    output.write("pounding.svg", &figure::figure(&study)?)
}
