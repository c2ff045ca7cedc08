//! Bodies reduced to a few modes and their contact dofs: how right the contact force is, and what it costs.
//!
//! `cargo run --release --example reduction -- --output target/reduction` prints the tables of
//! `docs/measured/reduction.md` and writes them and a figure; with `--quick` steps, phases and bodies are fewer.
//!
//! `bars.rs` has bars against a wall and each other, `fronts.rs` the taper in closed form, `blocks.rs` blocks in the
//! plane and in space, `equal_time.rs` these over the time of a run, `ball.rs` Hertz' impact, `pair.rs` two blocks,
//! `ring.rs` a ring, `softenings.rs` other softenings of these three, `strikes.rs` what their tables have in common,
//! `cost.rs` times, `figure.rs` the force over time.

mod ball;
mod bars;
mod blocks;
mod cost;
mod equal_time;
mod figure;
mod fronts;
mod pair;
mod ring;
mod softenings;
mod strikes;

use example_support::output::Output;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("reduction")?;
    let quick = output.quick;
    let (equal_times, drawn) = equal_time::tables(quick)?;
    let tables = [
        bars::wall(quick)?,
        bars::exponents(quick)?,
        fronts::fronts(quick)?,
        bars::resolution(quick)?,
        bars::pairs(quick)?,
        blocks::plane(quick)?,
        blocks::space(quick)?,
        equal_times,
        ball::ball(quick)?,
        pair::pair(quick)?,
        ring::thrown(quick)?,
        softenings::softenings(quick)?,
        cost::steps(quick)?,
        cost::modes(quick)?,
    ];
    let page = tables.join("\n");
    println!("{page}");
    output.write("reduction.md", &page)?;
    output.write("equal_time.svg", &drawn)?;
    output.write("reduction.svg", &figure::figure()?)
}
