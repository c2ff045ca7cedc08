//! Iterations of Newton's method with and without contact: a thin neo-Hookean block all of whose bottom nodes press.

use contact_dynamics::contact::Plane;
use contact_dynamics::{Newmark, NodesOnObstacle, Simulation};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::large::MATERIAL;
use contact_dynamics_scenes::solids::Solid;
use example_support::timing::{self, Arguments};
use std::time::Instant;

pub(crate) fn measure(arguments: &Arguments) {
    let sides: &[usize] = if arguments.quick { &[4] } else { &[10, 20, 30] };
    println!("thin block of n × n × 4 elements, neo-Hookean, trapezoidal rule, full Newton: time of an iteration");
    println!("{:<6} {:>8} {:>8} {:>12} {:>12} {:>8}", "n", "dofs", "pressed", "away ms", "contact ms", "ratio");
    for &side in sides {
        let solid = Solid::block([side as f64 * 0.1, side as f64 * 0.1, 0.4], [side, side, 4], MATERIAL);
        let [(away, _), (contact, pressed)] = [1e3, 0.0].map(|height| iteration(&solid, height, arguments));
        let ratio = contact / away;
        println!("{side:<6} {:>8} {pressed:>8} {away:>12.2} {contact:>12.2} {ratio:>8.2}", solid.dofs());
    }
    println!();
}

/// Milliseconds of an iteration, and the number of contacts that press.
fn iteration(solid: &Solid<3>, height: f64, arguments: &Arguments) -> (f64, usize) {
    let h = 0.1 / MATERIAL.wave_speed();
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0).collect();
    let floor = Plane::new([0.0, 0.0, -height], [0.0, 0.0, 1.0]).expect("a plane");
    let contact = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom).expect("nodes of the block");
    let body = Hyperelastic::new(solid, Law::NeoHookean).gravity([0.0, 0.0, -0.05]);
    let builder = Simulation::builder(body, Newmark::trapezoidal(), h).constraint(contact);
    let mut run = builder.build().expect("a well-posed scene");
    run.step().expect("a well-posed step");
    let mut samples = Vec::new();
    for _ in 0..arguments.repeated(5) {
        let before = run.statistics().newton_iterations;
        let start = Instant::now();
        run.step().expect("a well-posed step");
        let iterations = (run.statistics().newton_iterations - before).max(1);
        samples.push(start.elapsed().as_secs_f64() * 1e3 / iterations as f64);
    }
    let pressed = run.state().contacts().closed().iter().filter(|&&closed| closed).count();
    (timing::median(&samples), pressed)
}
