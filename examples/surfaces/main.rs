//! Surfaces whose meshes do not match: nodes on facets beside weighted gaps.
//!
//! `cargo run --release --example surfaces` prints the tables and writes them; `--quick` fewer and coarser meshes.

mod by_chance;
mod corners;
mod curved_patch;
mod folding;
mod hertz;
mod ironing;
mod patch;
mod rebound;
mod rings;
mod ties;

use example_support::output::Output;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("surfaces")?;
    let quick = output.quick;
    let tables = [
        patch::table(quick)?,
        curved_patch::table(quick)?,
        ties::table(quick)?,
        hertz::table(quick)?,
        ironing::table(quick)?,
        rings::table(quick)?,
        rebound::table(quick)?,
        folding::table(quick)?,
        corners::table(quick)?,
        by_chance::table(quick)?,
    ]
    .join("\n");
    println!("{tables}");
    output.write("surfaces.md", &tables)
}
