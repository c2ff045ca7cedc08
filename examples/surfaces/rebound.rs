//! The same rings against a reference of finer elements and steps: how they leave each other.

use super::rings::{CONTACTS, END, Rings, SPEED};
use contact_dynamics::EnergyMomentum;
use example_support::output::decimal;
use std::error::Error;
use std::fmt::Write;

/// What a collision has done to the first ring.
#[derive(Clone, Copy, Debug)]
struct Rebound {
    /// Velocity of its center, over that before.
    velocity: [f64; 2],
    /// Its angular momentum about its center, over m r v.
    spin: f64,
    /// Time from the first hundredth of the impulse along the way to the last.
    duration: f64,
}

/// In the middle of the wall.
const RADIUS: f64 = 35.0;

/// Elements across, around each ring, and the step.
type Mesh = (usize, [usize; 2], f64);

/// Errors of velocity, spin and duration.
pub(crate) fn table(quick: bool) -> Result<String, Box<dyn Error>> {
    let (reference, meshes): (Mesh, &[Mesh]) = match quick {
        true => ((3, [48, 48], 1.0), &[(2, [32, 24], 1.0)]),
        false => ((8, [192, 192], 0.125), &[(3, [64, 90], 0.5), (6, [128, 180], 0.25)]),
    };
    let rings = |(across, [left, right], h): Mesh| format!("{across}, {left}, {right} | {h}");
    let exact = rebound(reference, "mortar")?;
    let mut table = String::from(
        "The same by the energy–momentum scheme, against finer rings: velocity of the center of the first ring after \
         the collision over that before, its angular momentum about its center over m r v, and the time from the first \
         hundredth of the impulse to the last; then the errors of these\n\n\
         | elements across, around | step | contact | velocity | spin | duration |\n\
         | --- | --- | --- | --- | --- | --- |\n",
    );
    let [along, across] = exact.velocity.map(|v| decimal(v, 4));
    writeln!(
        table,
        "| {} | mortar | {along}, {across} | {} | {} |",
        rings(reference),
        decimal(exact.spin, 4),
        decimal(exact.duration, 2)
    )?;
    let percent = |error: f64| format!("{} %", decimal(100.0 * error, 1));
    for &mesh in meshes {
        for contact in CONTACTS {
            let Rebound { velocity, spin, duration } = rebound(mesh, contact)?;
            let error = [0, 1].map(|axis| velocity[axis] - exact.velocity[axis]);
            let size = exact.velocity[0].hypot(exact.velocity[1]);
            writeln!(
                table,
                "| {} | {contact} | {} | {} | {} |",
                rings(mesh),
                percent(error[0].hypot(error[1]) / size),
                percent(spin / exact.spin - 1.0),
                percent(duration / exact.duration - 1.0)
            )?;
        }
    }
    Ok(table)
}

fn rebound((across, around, h): Mesh, contact: &str) -> Result<Rebound, Box<dyn Error>> {
    let rings = Rings::new(across, around);
    let mut run = rings.thrown(rings.contact(contact)?, Box::new(EnergyMomentum), h)?;
    let Rings { solid, split, .. } = &rings;
    let mass = solid.lumped_mass::<f64>();
    let whole: f64 = mass.iter().take(2 * split).step_by(2).sum();
    let mean = |of_dofs: &[f64]| {
        let sum = |axis: usize| (0..*split).map(|node| mass[2 * node] * of_dofs[2 * node + axis]).sum::<f64>();
        [0, 1].map(|axis| sum(axis) / whole)
    };
    let mut speeds = vec![(0.0, SPEED)];
    while run.time() < END {
        run.step()?;
        speeds.push((run.time(), mean(run.state().velocity())[0]));
    }
    let (u, v) = (run.state().displacement(), run.state().velocity());
    let (moved, velocity) = (mean(u), mean(v));
    let spin: f64 = (0..*split)
        .map(|node| {
            let arm = [0, 1].map(|axis| solid.nodes[node][axis] + u[2 * node + axis] - moved[axis]);
            mass[2 * node] * (arm[0] * v[2 * node + 1] - arm[1] * v[2 * node])
        })
        .sum();
    // When the speed has changed by a share of its whole change.
    let at = |share: f64| {
        let target = SPEED + share * (velocity[0] - SPEED);
        let after = speeds.iter().position(|&(_, speed)| speed <= target).unwrap_or(1).max(1);
        let ((start, fast), (end, slow)) = (speeds[after - 1], speeds[after]);
        start + (end - start) * (fast - target) / (fast - slow)
    };
    Ok(Rebound {
        velocity: velocity.map(|v| v / SPEED),
        spin: spin / (whole * RADIUS * SPEED),
        duration: at(0.99) - at(0.01),
    })
}
