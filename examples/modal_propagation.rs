//! Reduced bars in steps that are exact between contacts, beside a scheme: the error of the contact force, and energy.
//!
//! `cargo run --release --example modal_propagation -- --output target/modal_propagation` prints the tables of
//! `docs/measured/reduction.md`; with `--quick` phases and modes are fewer.

use contact_dynamics::reduction::Boundary;
use contact_dynamics::{Bathe, TimeIntegrator};
use contact_dynamics_scenes::propagated;
use contact_dynamics_scenes::reduced::{Model, PARENT, Struck, TAPER, bounces, wall_exact, wall_impact};
use example_support::output::Output;
use example_support::output::decimal;
use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::fmt::Write;

/// ρ∞-Bathe without dissipation.
fn bathe() -> Box<dyn TimeIntegrator> {
    Box::new(Bathe::with_radius(1.0).expect("a radius in [0, 1]"))
}

/// Elements of parents whose own dispersion is small; that of schemes hides that of `PARENT`.
const FINE: usize = 4 * PARENT;

/// Steps, and as many of them in a contact of the paper's bars.
const STEPS: [(f64, f64); 2] = [(1e-3, 200.0), (2.5e-4, 800.0)];

fn cells(struck: Struck) -> String {
    format!("{} ({} %) | {}", decimal(struck.error, 4), decimal(100.0 * struck.overshoot, 1), decimal(struck.energy, 5))
}

/// The cell of a step that is refused.
fn refusal(error: &contact_dynamics::Error, rest: &str) -> String {
    match error {
        contact_dynamics::Error::Parameter { value, .. } => format!("refused: ω_r h = {}{rest}", decimal(*value, 2)),
        other => format!("{other}{rest}"),
    }
}

/// The paper's bar against a wall, and the bar that bounces.
fn walls(phases: &[f64], counts: &[usize]) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Paper's bar against a wall: mean error of the force, mean over the phases (worst overshoot), and the largest \
         share of the energy that an impact changes; energy of the bouncing bar after six periods, with as many steps \
         a contact.\n\n\
         | r | steps | model | h = 1 ms | energy | h = 0.25 ms | energy | bouncing, 200 steps | 800 steps |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for &count in counts {
        for boundary in [Boundary::Tapered, Boundary::Untapered] {
            let model = Model::Reduced(boundary);
            let mut rows = Vec::new();
            for elements in [FINE, PARENT] {
                let mut cells_of_row = Vec::new();
                for (h, _) in STEPS {
                    let struck = propagated::wall(elements, count, boundary, h, phases);
                    cells_of_row.push(struck.map_or_else(|refused| refusal(&refused, " |"), cells));
                }
                for (_, steps) in STEPS {
                    let bounced = propagated::bounces(elements, count, boundary, steps);
                    cells_of_row.push(
                        bounced.map_or_else(|refused| refusal(&refused, ""), |bounced| decimal(bounced.energy, 4)),
                    );
                }
                rows.push((format!("exact, {elements} elements"), cells_of_row));
            }
            let mut scheme = Vec::new();
            for (h, _) in STEPS {
                scheme.push(cells(wall_impact(count + 1, model, bathe, h, (phases, TAPER))?));
            }
            for (_, steps) in STEPS {
                scheme.push(decimal(bounces(count + 1, model, bathe, steps)?.energy, 4));
            }
            rows.push((format!("ρ∞-Bathe(1), {PARENT} elements"), scheme));
            for (name, row) in rows {
                writeln!(table, "| {count} | {name} | {} | {} |", model.name(), row.join(" | "))?;
            }
        }
    }
    Ok(table)
}

/// The error against the number of modes and the step.
fn resolution(phases: &[f64], counts: &[usize]) -> Result<String, Box<dyn Error>> {
    let exact = wall_exact(1e-3, 0.0);
    let (start, end) = exact.contact_intervals()[0];
    let duration = end - start;
    let mut table = String::from(
        "The same, tapered, in exact steps: mean error times ω_c T, T the duration of contact (worst overshoot), and \
         ω_c h.\n\n\
         | r | ω_c T | h = 2 ms | h = 1 ms | h = 0.5 ms | h = 0.25 ms |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    for &count in counts {
        // ω_k = k π c/L of a free bar, and T = 2 L/c.
        let cutoff = TAU * count as f64 / duration;
        let mut cells = Vec::new();
        for h in [2e-3, 1e-3, 5e-4, 2.5e-4] {
            let highest = TAU * (count - 1) as f64 / duration * h;
            if highest > PI {
                cells.push(format!("refused: ω_r h = {}", decimal(highest, 2)));
                continue;
            }
            let Struck { error, overshoot, .. } = propagated::wall(FINE, count, Boundary::Tapered, h, phases)?;
            let [error, overshoot] = [decimal(error * cutoff * duration, 2), decimal(100.0 * overshoot, 1)];
            cells.push(format!("{error} ({overshoot} %), {}", decimal(cutoff * h, 2)));
        }
        writeln!(table, "| {count} | {} | {} |", decimal(cutoff * duration, 0), cells.join(" | "))?;
    }
    Ok(table)
}

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("modal_propagation")?;
    let count = if output.quick { 2 } else { 10 };
    let phases: Vec<f64> = (0..count).map(|k| (f64::from(k) + 0.5) / f64::from(count)).collect();
    let [few, many]: [&[usize]; 2] =
        if output.quick { [&[20], &[10, 20]] } else { [&[20, 50, 100], &[10, 20, 40, 80, 100, 160]] };
    let page = [walls(&phases, few)?, resolution(&phases, many)?].join("\n");
    println!("{page}");
    output.write("modal_propagation.md", &page)
}
