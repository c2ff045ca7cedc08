//! Error against work in scenes with contact: integrators with corrections and masses, mesh and step refined together.
//!
//! `cargo run --release --example work_precision_contact` prints the tables of `docs/performance.md` and writes them,
//! the figure and all points (`work_precision_contact.csv`), in about four minutes; with `--quick` a few coarse ones.
//!
//! `rows.rs` has what is compared, `scene.rs` how it is measured, `bars.rs` and `block.rs` the scenes.

mod bars;
mod block;
mod report;
mod rows;
mod scene;

use bars::{Bouncing, DISSIMILAR, EQUAL};
use block::Block;
use contact_dynamics_scenes::output::Output;
use contact_dynamics_scenes::plot::{Axis, Panel, page};
use report::{Results, Targets};
use scene::{Extent, Scene, measure};
use std::error::Error;

/// A scene, and the decades of its panel: of the seconds, and the lowest of the error.
type Listed<'a> = (&'a dyn Scene, Targets, [i32; 3]);

const fn targets(forces: [f64; 3], rms: f64, energies: [f64; 2]) -> Targets {
    Targets { forces, rms, energies }
}

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

    let scenes: [Listed<'_>; 4] = [
        (&EQUAL, targets([0.02, 0.01, 0.005], 0.05, [0.01, 0.001]), [-5, -1, -3]),
        (&DISSIMILAR, targets([0.04, 0.02, 0.01], 0.05, [0.01, 0.001]), [-5, -1, -3]),
        (&Bouncing, targets([0.1, 0.05, 0.02], 0.15, [0.05, 0.01]), [-4, -1, -2]),
        (&block, targets([0.08, 0.06, 0.04], 0.1, [0.02, 0.01]), [-4, -1, -2]),
    ];
    let mut csv = String::from(
        "scene,integrator,correction,mass,elements,courant,dofs,steps,solves,seconds,force,force_rms,energy\n",
    );
    let (mut text, mut panels) = (String::new(), Vec::new());
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
    let panels: [Panel; 4] = panels.try_into().map_err(|_| "four panels")?;
    let subtitle = "Mean error of the contact force, best of all meshes and Courant numbers from 1/4 to 4";
    output.write("work_precision_contact.svg", &page("Error against work in impacts", subtitle, &panels)?)
}
