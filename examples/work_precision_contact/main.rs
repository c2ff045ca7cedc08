//! Error against work in scenes with contact: integrators with corrections and masses, mesh and step refined together.
//!
//! `cargo run --release --example work_precision_contact` prints the tables that `docs/performance.md` is about
//! (`docs/measured/work_precision_contact.md`) and writes them, the figure and all points
//! (`work_precision_contact.csv`), in about five minutes; with `--quick` a few coarse ones.
//!
//! `rows.rs` has what is compared, `scene.rs` how it is measured, `bars.rs`, `block.rs` and `slab.rs` the scenes.

mod bars;
mod block;
mod report;
mod rows;
mod scene;
mod slab;

use bars::{Bouncing, DISSIMILAR, EQUAL};
use block::Block;
use example_support::output::Output;
use example_support::plot::{Axis, Panel, page};
use report::{Results, Targets};
use scene::{Extent, Scene, measure};
use slab::Sticking;
use std::error::Error;

/// A scene, and the decades of its panel: of the seconds, and the lowest of the error.
type Listed<'a> = (&'a dyn Scene, Targets, [i32; 3]);

const fn targets(forces: [f64; 3], rms: f64, energies: [f64; 2]) -> Targets {
    Targets { forces, rms, energies }
}

/// What the tables are about.
const HEAD: &str = "\
Scenes: (a) two equal bars collide; (b) two dissimilar bars, whose force has two plateaus; (c) a bar bounces on a floor
under its weight for two periods; (d) a cube of hex8 elements falls flat on a floor (a quarter of it is computed, for
symmetry); (e) a slab strikes a rough wall obliquely and sticks to it. Errors are those to the exact solution, but in (d)
to a run with a fine mesh.

Errors: \"force\" is the mean error of the contact force, in (e) of the friction, without the points within a step of a
jump of the exact force, \"RMS\" the root mean square with those points, both over the largest exact force and, in (c), over the four
contacts with 0.1 s around each; \"energy\" is what was lost or won at the end, over the energy at the start. All are
means over five phases of the impact inside its step.

Each number is the time, or the number of solves times dofs, that a combination needs to reach the error at the head
of the column: that of the cheapest run on any mesh at any Courant number from 1/4 to 4 (explicit schemes: up to 0.9
of their limit), with straight lines between neighbors in logarithms. Time is that of the run, the fastest of at least
three, without build and factorization. 1 is what the trapezoidal rule with λ_v/λ_a on a lumped mass needs for the
first error of the table. \"Co\" is the Courant number of the fastest run for the middle error, \"least\" the smallest
mean error of the force that was reached within about 3e6 dofs × steps (in (d) 2e5, explicit 2e6), \"–\" means not
reached within that.

Penalties are 10 and 0.1 times the stiffness K_e of the element behind the contact, and α of HHT-α is −0.05 and −0.41:
in the range that implicit and explicit codes in industry use.
";

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("work_precision_contact")?;
    let rows = rows::all();
    let extent = match output.quick {
        true => Extent { courants: vec![0.5, 1.0], phases: vec![0.3], repetitions: 1, timing: 0.0, share: 0.01 },
        false => Extent {
            courants: vec![0.25, 0.5, 1.0, 2.0, 4.0],
            phases: (0..5).map(|k| 0.1 + 0.2 * f64::from(k)).collect(),
            repetitions: 3,
            timing: 0.01,
            share: 1.0,
        },
    };
    let references = rows::UNRELATED.map(|number| &rows[number]);
    let (meshes, finest): (&[usize], _) = if output.quick { (&[4], 6) } else { (&[4, 8, 12, 16, 24], 32) };
    let block = Block::new(meshes, finest, references)?;

    let scenes: [Listed<'_>; 5] = [
        (&EQUAL, targets([0.02, 0.01, 0.005], 0.05, [0.01, 0.001]), [-5, -1, -3]),
        (&DISSIMILAR, targets([0.04, 0.02, 0.01], 0.05, [0.01, 0.001]), [-5, -1, -3]),
        (&Bouncing, targets([0.1, 0.05, 0.02], 0.15, [0.05, 0.01]), [-4, -1, -2]),
        (&block, targets([0.08, 0.06, 0.04], 0.1, [0.02, 0.01]), [-4, -1, -2]),
        (&Sticking, targets([0.04, 0.02, 0.01], 0.1, [0.01, 0.001]), [-5, -1, -3]),
    ];
    let mut csv = String::from(
        "scene,integrator,correction,mass,elements,courant,dofs,steps,solves,seconds,force,force_rms,energy\n",
    );
    println!("{HEAD}");
    let (mut text, mut panels) = (format!("{HEAD}\n"), Vec::new());
    for ((scene, targets, [from, to, lowest]), letter) in scenes.into_iter().zip('a'..) {
        let points = rows.iter().map(|row| measure(scene, row, &extent)).collect();
        let results = Results { letter, key: scene.key(), title: scene.title(), targets, points };
        let table = results.table(&rows);
        println!("{table}");
        text += &(table + "\n");
        csv += &results.csv(&rows);
        let (x, y) = (Axis::decades("seconds", from, to, 1), Axis::decades("mean error of the force", lowest, 0, 1));
        panels.push(results.panel(&rows, x, y));
    }
    println!("{}", block.remark());
    text += &block.remark();
    output.write("work_precision_contact.md", &text)?;
    output.write("work_precision_contact.csv", &csv)?;
    // (The page has room for four: dissimilar bars look like equal ones.)
    panels.remove(1);
    let panels: [Panel; 4] = panels.try_into().map_err(|_| "four panels")?;
    let subtitle = "Mean error of the contact force, best of all meshes and Courant numbers from 1/4 to 4";
    output.write("work_precision_contact.svg", &page("Error against work in impacts", subtitle, &panels)?)
}
