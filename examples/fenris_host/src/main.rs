//! Bodies of the finite-element crate fenris in impact: mesh, elements, materials and assembly are fenris's, time and
//! contact are contact-dynamics'.
//!
//! `cargo run --release --manifest-path examples/fenris_host/Cargo.toml` runs a slab against a wall (exact force), a
//! disc thrown at a floor with friction, and a rubber block at large strains; with `--quick` on coarse meshes.
//! `--output DIR` is where the report goes. What lies between the two crates is glue.rs; elastic.rs asks fenris for
//! matrices, hyperelastic.rs is a `System` that asks fenris for force and tangent.

mod block;
mod disc;
mod elastic;
mod glue;
mod hyperelastic;
mod scene;
mod slab;

use example_support::output::Output;
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("fenris_host")?;
    let [across, cells, hexahedra] = if output.quick { [3, 12, 1] } else { [10, 40, 4] };
    let text = format!("{}\n{}\n{}", slab::report(across)?, disc::report(cells)?, block::report(hexahedra)?);
    println!("{text}");
    output.write("report.md", &text)
}
