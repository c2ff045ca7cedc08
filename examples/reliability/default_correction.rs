//! What a run does that names no corrector.

use super::{Anything, Row};
use contact_dynamics::contact::Plane;
use contact_dynamics::{Composite, Newmark, NodesOnObstacle, Simulation, TimeIntegrator};
use contact_dynamics_scenes::solids::{Material, Solid};

/// A cube of 4³ elements falls flat on a floor.
pub(crate) fn cases(_: bool) -> Result<Vec<Row>, Anything> {
    let schemes: [(Box<dyn TimeIntegrator>, &str); 2] =
        [(Box::new(Newmark::trapezoidal()), "@TR@"), (Box::new(Composite), "@C@")];
    schemes
        .into_iter()
        .map(|(scheme, before)| {
            let case = format!("block on a floor, {}: energy at the end", scheme.name());
            Ok(Row { case, before, now: format!("{:.3}", fall(scheme)?) })
        })
        .collect()
}

fn fall(scheme: Box<dyn TimeIntegrator>) -> Result<f64, Anything> {
    let (cells, speed) = (4, 0.01);
    let material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
    let h = 0.5 / (f64::from(cells) * material.wave_speed());
    let block = Solid::block([1.0; 3], [4; 3], material).lifted(5.5 * h * speed);
    let bottom: Vec<usize> = block.surface_nodes().into_iter().filter(|&node| block.nodes[node][2] < 0.1).collect();
    let floor = Plane::new([0.0; 3], [0.0, 0.0, 1.0])?;
    let mut run = Simulation::builder(block.system(), scheme, h)
        .velocity(block.uniform([0.0, 0.0, -speed]))
        .constraint(NodesOnObstacle::new(floor, &block.nodes, &block.node_dofs(), &bottom)?)
        .build()?;
    let before = run.energy().total();
    run.run_until(4.0 / material.wave_speed(), &mut ())?;
    Ok(run.energy().total() / before)
}
