//! Friction against closed forms: oblique impact, a bar that slides on a rough bed, blocks, oscillators, wheels, discs,
//! elastic bodies.
//!
//! `cargo run --release --example friction` prints the tables and writes them and a figure (`friction.svg`), in two
//! minutes; with `--quick` meshes are coarse and phases few.
//!
//! `rows.rs` has what is compared; `slab.rs` the oblique impact, `bed.rs` the bar, `exact.rs` the small cases,
//! `bodies.rs` two slabs and a ball moved sideways, `ball.rs` a ball thrown at a floor.

mod ball;
mod bed;
mod bodies;
mod exact;
mod rows;
mod slab;

use example_support::output::Output;
use std::error::Error;
use std::fmt::Write;

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("friction")?;
    let mut page = String::new();
    let tables: [fn(bool) -> Vec<String>; 5] = [slab::tables, bed::tables, exact::tables, bodies::tables, ball::tables];
    for tables in tables {
        for table in tables(output.quick) {
            println!("{table}");
            writeln!(page, "{table}")?;
        }
    }
    output.write("friction.md", &page)?;
    output.write("friction.svg", &slab::figure()?)
}
