//! Runs with friction, against closed forms.

mod bed;
mod bodies;
mod drum;
mod generalized;
mod incline;
mod laws;
mod paths;
mod published;
mod random;
mod refused;
mod resumed;
mod reversals;
mod slab;
mod solids;
mod systems;
mod tangents;
mod turning;
mod well;

use contact_dynamics::{LinearSystem, Result, Simulation, SimulationBuilder, TimeIntegrator};
use contact_dynamics_scenes::schemes::{self, Listed};
use contact_dynamics_scenes::sparse::diagonal;

/// Gravity of the scenes.
const GRAVITY: f64 = 10.0;

/// The schemes by which a multiplier can impose contact.
fn schemes() -> impl Iterator<Item = Listed> {
    schemes::all().into_iter().filter(Listed::takes_multipliers)
}

/// Masses without springs, each under a constant force.
fn masses(masses: Vec<f64>, forces: Vec<f64>) -> Result<LinearSystem<'static, f64>> {
    let none = diagonal(&vec![0.0; masses.len()]);
    Ok(LinearSystem::lumped(masses, none)?.load(move |_, f| f.copy_from_slice(&forces)))
}

/// A scheme's run of masses.
fn run(
    system: LinearSystem<'static, f64>,
    scheme: Box<dyn TimeIntegrator>,
    h: f64,
    velocity: Vec<f64>,
) -> SimulationBuilder<'static, f64> {
    Simulation::builder(system, scheme, h).velocity(velocity)
}
