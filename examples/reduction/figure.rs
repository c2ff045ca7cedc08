//! The figure: contact force of the paper's bar on a wall, twenty modes.

use crate::bars::{TAPERED, bathe};
use contact_dynamics::reduction::Boundary;
use contact_dynamics_scenes::reduced::{Model, TAPER, wall_exact, wall_force};
use example_support::plot::{Axis, BLUE, Curve, DARK, Panel, RGBColor, VERMILION, banner};
use std::error::Error;

/// Step, and modes.
const H: f64 = 2.5e-4;
const MODES: usize = 20;

pub(crate) fn figure() -> Result<String, Box<dyn Error>> {
    let exact = wall_exact(H, 0.5);
    let (start, end) = exact.contact_intervals()[0];
    let largest = exact.contact_force(0.5 * (start + end));
    let curve = |label: &str, color: RGBColor, width: u32, points: Vec<(f64, f64)>| Curve {
        label: Some(label.into()),
        color,
        width,
        points,
    };
    let run = |model| -> Result<Vec<(f64, f64)>, Box<dyn Error>> {
        let (forces, _) = wall_force(MODES + 1, model, bathe, H, (0.5, TAPER))?;
        Ok(forces.into_iter().map(|(t, force)| (t, force / largest)).collect())
    };
    let step = vec![(0.0, 0.0), (start, 0.0), (start, 1.0), (end, 1.0), (end, 0.0), (0.4, 0.0)];
    let panel = Panel {
        title: format!("Contact force over its exact value: a bar of {MODES} modes strikes a wall, h = 0.25 ms"),
        x: Axis::linear("time (s)", 0.05..0.35, &[0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35]),
        y: Axis::linear("F/F₀", -0.1..2.1, &[0.0, 0.5, 1.0, 1.5, 2.0]),
        curves: vec![
            curve("untapered", VERMILION, 4, run(Model::Reduced(Boundary::Untapered))?),
            curve("exact", DARK, 5, step),
            curve("tapered", BLUE, 8, run(TAPERED)?),
        ],
        note: None,
    };
    banner(&panel)
}
