//! What a run does that names no corrector.

use super::{Anything, Row};
use contact_dynamics::contact::Plane;
use contact_dynamics::{Newmark, NodesOnObstacle, Simulation};
use contact_dynamics_scenes::solids::{Material, Solid};

/// A cube of 4³ elements falls flat on a floor, by the trapezoidal rule.
pub(crate) fn cases(_: bool) -> Result<Vec<Row>, Anything> {
    let case = "block on a floor, trapezoidal rule: energy at the end".into();
    Ok(vec![Row { case, before: "5.926", now: format!("{:.3}", fall()?) }])
}

fn fall() -> Result<f64, Anything> {
    let (cells, speed) = (4, 0.01);
    let material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
    let h = 0.5 / (f64::from(cells) * material.wave_speed());
    let block = Solid::block([1.0; 3], [4; 3], material).lifted(5.5 * h * speed);
    let bottom: Vec<usize> = block.surface_nodes().into_iter().filter(|&node| block.nodes[node][2] < 0.1).collect();
    let floor = Plane::new([0.0; 3], [0.0, 0.0, 1.0])?;
    let mut run = Simulation::builder(block.system(), Newmark::trapezoidal(), h)
        .velocity(block.uniform([0.0, 0.0, -speed]))
        .constraint(NodesOnObstacle::new(floor, &block.nodes, &block.node_dofs(), &bottom)?)
        .build()?;
    let before = run.energy().total();
    run.run_until(4.0 / material.wave_speed(), &mut ())?;
    Ok(run.energy().total() / before)
}
