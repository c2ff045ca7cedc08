//! A hex8 block dropped on a floor, flat, on an edge and on a corner: contact forces, iterations, conservation, cost.
//!
//! `cargo run --release --example block_drop` prints a table and writes it; n = 10 and 20, and 30
//! flat; with `--quick` n = 5.

use contact_dynamics_scenes::drops::{Drop, LANDINGS};
use example_support::output::Output;
use std::fmt::Write;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let output = Output::from_command_line("block_drop")?;
    let sizes: &[usize] = if output.quick { &[5] } else { &[10, 20, 30] };
    let mut table = String::from(
        "| block | dofs | candidates | pressed | largest force / ρcvA | contact c/2L | iterations, steady | energy \
         | momentum | penetration | open ms | contact ms | ratio |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for &cells in sizes {
        // At n = 30 a step takes 0.1 s: the short one.
        for &landing in if cells < 30 { &LANDINGS[..] } else { &LANDINGS[..1] } {
            let f = Drop { cells, landing, courant: 1.0 }.run()?;
            let [open, contact] = f.milliseconds;
            writeln!(
                table,
                "| {cells}³ {landing:?} | {} | {} | {} | {:.3} | {:.2} | {}, {} | {:.3} | {:.0e} | {:.0e} | {open:.2} \
                 | {contact:.2} | {:.2} |",
                f.dofs,
                f.candidates,
                f.pressed,
                f.largest_force,
                f.duration,
                f.iterations,
                f.steady_iterations,
                f.energy,
                f.momentum,
                f.penetration,
                contact / open,
            )?;
        }
    }
    println!("{table}");
    output.write("block_drop.md", &table)
}
