//! Hertz' impact: one degree of freedom under a power law, and an elastic ball of hex8 elements on a rigid plane.
//!
//! `cargo run --release --example hertz` prints both tables and writes them; `--quick` with coarse meshes.

use contact_dynamics::contact::Plane;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{
    Composite, ContactLaw, LinearRows, LinearSystem, Newmark, NodesOnObstacle, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::reference::PowerLawImpact;
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::output::Output;
use std::error::Error;
use std::f64::consts::PI;
use std::fmt::Write;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("hertz")?;
    let mut table = String::from("One degree of freedom, errors of the largest force and of the duration\n\n");
    table += "| scheme | steps in contact | force | duration |\n| --- | --- | --- | --- |\n";
    for steps in [50, 100, 200] {
        for scheme in [|| Box::new(Newmark::trapezoidal()) as Box<dyn TimeIntegrator>, || Box::new(Composite) as _] {
            let [force, duration] = single(scheme(), steps)?;
            writeln!(table, "| {} | {steps} | {force:.1e} | {duration:.1e} |", scheme().name())?;
        }
    }
    table += "\nA quarter of an elastic ball (ν = 0.3), relative to Hertz, whose theory is that of a small contact \
              radius a\n\n";
    table += "| a/R | elements across a | dofs | candidates | largest force | duration | energy |\n";
    table += "| --- | --- | --- | --- | --- | --- | --- |\n";
    let quick = [(0.15, 3, [8, 8, 12])];
    let full = [(0.15, 10, [16, 16, 24]), (0.075, 10, [17, 17, 25]), (0.04, 10, [18, 18, 26])];
    for &(contact, across, cells) in if output.quick { &quick[..] } else { &full[..] } {
        let Ball { dofs, candidates, force, duration, energy } = ball(contact, across, cells)?;
        writeln!(table, "| {contact} | {across} | {dofs} | {candidates} | {force:.3} | {duration:.3} | {energy:.3} |")?;
    }
    println!("{table}");
    output.write("hertz.md", &table)
}

/// Errors of force and duration of a mass on Hertz' law, the impact half a step off the grid.
fn single(scheme: Box<dyn TimeIntegrator>, steps: u32) -> Result<[f64; 2], Box<dyn Error>> {
    let exact = PowerLawImpact { mass: 2.0, stiffness: 100.0, exponent: 1.5, velocity: 1.0 };
    let h = exact.duration() / f64::from(steps);
    let gap = 5.5 * h;
    let none = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 0.0)])?;
    let law = ContactLaw::PowerLaw { stiffness: exact.stiffness, exponent: exact.exponent };
    let mut run = Simulation::builder(LinearSystem::lumped(vec![exact.mass], none)?, scheme, h)
        .velocity(vec![-exact.velocity])
        .constraint(LinearRows::new().row(law, &[(0, 1.0)], gap))
        .build()?;
    let (mut force, mut touch, mut release) = (0.0_f64, 0.0, 0.0);
    let mut before = gap;
    while release == 0.0 {
        run.step()?;
        let now = run.gaps()[0];
        let crossing = run.time() - h * now / (now - before);
        match (before > 0.0, now > 0.0) {
            (true, false) => touch = crossing,
            (false, true) => release = crossing,
            _ => {}
        }
        (before, force) = (now, force.max(run.state().contacts().forces()[0]));
    }
    Ok([(force / exact.force() - 1.0).abs(), ((release - touch) / exact.duration() - 1.0).abs()])
}

struct Ball {
    dofs: usize,
    candidates: usize,
    /// Relative to Hertz.
    force: f64,
    duration: f64,
    energy: f64,
}

/// An elastic ball that falls on a plane at the speed for which Hertz' contact radius is `contact`, with so many
/// elements across that radius; a quarter of it, with symmetry on two planes.
fn ball(contact: f64, across: usize, cells: [usize; 3]) -> Result<Ball, Box<dyn Error>> {
    let radius = 1.0;
    let finest = contact / across as f64;
    let solid = Solid::quarter_ball(radius, cells, finest, MATERIAL);
    let exact = {
        let mass = MATERIAL.density * 4.0 / 3.0 * PI * radius.powi(3);
        let ContactLaw::PowerLaw { stiffness, exponent } = ContactLaw::hertz(MATERIAL.plane_modulus(), radius) else {
            return Err("Hertz' law is a power law".into());
        };
        // The speed at which the contact radius becomes √(R δ).
        let depth: f64 = contact * contact / radius;
        let velocity = (depth.powf(2.5) * stiffness / (1.25 * mass)).sqrt();
        PowerLawImpact { mass, stiffness, exponent, velocity }
    };
    let h = exact.duration() / 200.0;
    let mut system = solid.system::<f64>();
    for (node, place) in solid.nodes.iter().enumerate() {
        for axis in (0..2).filter(|&axis| place[axis].abs() < 1e-12) {
            system = system.fix(3 * node + axis)?;
        }
    }
    let near = |&n: &usize| {
        let [x, y, z] = solid.nodes[n];
        z < radius && x.hypot(y) < 2.0 * contact
    };
    let candidates: Vec<_> = solid
        .surface_nodes()
        .into_iter()
        .filter(near)
        // Of the sides, only the curved one: the others are planes of symmetry inside of the ball.
        .filter(|&n| {
            let [x, y, z] = solid.nodes[n];
            ((x * x + y * y + (z - radius).powi(2)).sqrt() - radius).abs() < 1e-9
        })
        .collect();
    let count = candidates.len();
    let plane = Plane::new([0.0, 0.0, -2.5 * h * exact.velocity], [0.0, 0.0, 1.0])?;
    let mut run = Simulation::builder(system, Composite, h)
        .velocity(solid.uniform([0.0, 0.0, -exact.velocity]))
        .constraint(NodesOnObstacle::new(plane, &solid.nodes, &solid.node_dofs(), &candidates)?)
        .build()?;
    let start = run.energy().total();
    let (mut force, mut first, mut last) = (0.0_f64, f64::INFINITY, 0.0);
    while run.time() < 1.4 * exact.duration() {
        run.step()?;
        let total: f64 = run.state().contacts().forces().iter().sum();
        if total > 0.0 {
            (first, last) = (f64::min(first, run.time() - h), run.time());
        }
        force = force.max(4.0 * total);
    }
    Ok(Ball {
        dofs: solid.dofs(),
        candidates: count,
        force: force / exact.force(),
        duration: (last - first) / exact.duration(),
        energy: run.energy().total() / start,
    })
}
