//! A drill string in a curved well, pulled out and run in: hundreds of contacts with friction along a rod.
//!
//! `cargo run --release --example rod_in_well` prints the tables of `docs/measured/rod_in_well.md` and writes them
//! and a figure (`rod_in_well.svg`); with `--quick` elements are few and runs are short.
//!
//! `drag.rs` compares the hook load with the soft string; `wave.rs` has the front of a wave that friction stops;
//! `cost.rs` the time of a step beside a bare solve; `figure.rs` the figure.

mod cost;
mod drag;
mod figure;
mod wave;

use contact_dynamics::Result;
use example_support::output::Output;
use std::error::Error;
use std::fmt::Write;

fn main() -> std::result::Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("rod_in_well")?;
    let mut page = String::new();
    let tables: [fn(bool) -> Result<String>; 3] = [drag::table, wave::table, cost::table];
    for table in tables {
        let table = table(output.quick)?;
        println!("{table}");
        writeln!(page, "{table}")?;
    }
    output.write("rod_in_well.md", &page)?;
    output.write("rod_in_well.svg", &figure::figure(output.quick)?)
}
