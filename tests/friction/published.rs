//! Status, slip and force of a state belong to one instant: Coulomb's law holds between them.

use super::schemes;
use contact_dynamics::contact::{NodesOnObstacle, Plane};
use contact_dynamics::{ContactState, ContactStatus, LinearSystem, Preset, Simulation, TimeIntegrator};
use contact_dynamics_scenes::solids::{Material, Solid};

const FRICTION: f64 = 0.3;
const H: f64 = 1e-3;
const PHASES: [f64; 4] = [0.1, 0.35, 0.5, 0.8];

/// Raises to what a state publishes the largest violations of Coulomb's law: slip of what sticks (per speed), friction
/// that is not μ p of what slides or is not against its slip, and friction beyond the cone (per force); counts what
/// sticks and slides.
fn look(contacts: &ContactState<f64>, worst: &mut [f64; 4], seen: &mut [u32; 2]) {
    let length = |x: &[f64]| x.iter().fold(0.0_f64, |length, x| length.hypot(*x));
    let force = 10.0;
    for contact in 0..contacts.ids().len() {
        let (f, slip, p) = (contacts.friction_forces(contact), contacts.slip(contact), contacts.forces()[contact]);
        let along: f64 = f.iter().zip(slip).map(|(f, slip)| f * slip).sum();
        worst[3] = worst[3].max((length(f) - FRICTION * p) / force);
        match contacts.status(contact) {
            ContactStatus::Sticking => {
                seen[0] += 1;
                worst[0] = worst[0].max(length(slip));
            }
            ContactStatus::Sliding => {
                seen[1] += 1;
                worst[1] = worst[1].max((length(f) - FRICTION * p).abs() / force);
                worst[2] = worst[2].max((along + length(f) * length(slip)).abs() / force);
            }
            _ => {}
        }
    }
}

/// A block of elements thrown at a slant onto a flat floor, sticking or sliding, by a scheme with a phase of the impact.
fn thrown(
    scheme: Box<dyn TimeIntegrator>,
    system: LinearSystem<'static, f64>,
    solid: &Solid<2>,
    (along, phase): (f64, f64),
) -> Simulation<'static, f64> {
    let nodes: Vec<_> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][1] == 0.0).collect();
    let floor = Plane::new([0.0, -(10.0 + phase) * H], [0.0, 1.0]).unwrap();
    let contact = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &nodes).unwrap().friction(FRICTION);
    Simulation::builder(system, scheme, H).velocity(solid.uniform([along, -1.0])).constraint(contact).build().unwrap()
}

/// Takes 150 steps from each start and checks all that is published.
fn check(name: &str, run: impl Fn((f64, f64)) -> Simulation<'static, f64>) {
    let (mut worst, mut seen) = ([0.0_f64; 4], [0; 2]);
    for start in [1.0, 4.0].into_iter().flat_map(|along| PHASES.map(|phase| (along, phase))) {
        let mut run = run(start);
        for _ in 0..150 {
            run.step().unwrap();
            look(run.state().contacts(), &mut worst, &mut seen);
        }
    }
    // (Velocities that are differences of displacements have the rounding of these, 1e-2, over the step.)
    assert!(worst.iter().all(|&worst| worst < 1e-13), "{name}: {worst:?}");
    assert!(seen[0] > 5 && seen[1] > 500, "{name}: {seen:?}");
}

#[test]
fn status_slip_and_force_fit_one_another() {
    let solid = Solid::rectangle([1.0, 0.5], [4, 2], Material { young: 1e3, poisson: 0.3, density: 1.0 });
    for scheme in schemes() {
        check(&scheme.name(), |start| thrown((scheme.make)(), solid.system(), &solid, start));
    }
    // Without mass on the contact nodes.
    let lumped = solid.lumped_mass::<f64>().into_iter().enumerate();
    let mass: Vec<_> = lumped.map(|(dof, m)| if solid.nodes[dof / 2][1] == 0.0 { 0.0 } else { m }).collect();
    for preset in [Preset::smooth(), Preset::conservative(), Preset::explicit()] {
        let system = || LinearSystem::lumped(mass.clone(), solid.stiffness()).unwrap();
        check(&format!("{preset:?}"), |start| thrown(preset.integrator(), system(), &solid, start));
    }
}
