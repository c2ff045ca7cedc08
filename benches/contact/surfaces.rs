//! Steps of two blocks whose meshes do not match, one pressed on the other: nodes on facets and weighted gaps, beside
//! the bare solve and the step apart.

use super::{MATERIAL, RATIOS, closed};
use contact_dynamics::contact::ContactConstraint;
use contact_dynamics::{Newmark, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::solids::Solid;
use contact_dynamics_scenes::stacks::Stack;
use example_support::timing::{self, Arguments, Table, Unit};

/// Steps before those that are measured.
const WARM_UP: usize = 8;

pub(super) fn measure(arguments: &Arguments) {
    for n in if arguments.quick { vec![3] } else { vec![9, 19, 29] } {
        scene(n, arguments);
    }
}

/// Two blocks of four layers, of n and n + 1 elements a side.
fn scene(n: usize, arguments: &Arguments) {
    let stack = |gap: f64| {
        let bodies = [n, n + 1].map(|n| Solid::block([1.0; 3], [n, n, 4], MATERIAL));
        Stack::new(bodies, gap, |x| x)
    };
    let h = 1.0 / n as f64 / MATERIAL.wave_speed();
    let solid = stack(0.0).solid;
    println!("blocks of {n}² × 4 and {}² × 4 elements, {} dofs, trapezoidal rule, corrected", n + 1, solid.dofs());
    let mut table = Table::new(Unit::Milli, RATIOS);
    let a = timing::effective(&solid.stiffness::<f64>(), &solid.lumped_mass(), &Newmark::trapezoidal(), h);
    table.row("bare solve, free order", timing::solve(timing::factor(&a, &[]), solid.dofs()));
    let mortar = |stack: &Stack<3>| stack.mortar(true).expect("surfaces");
    let nodes = |stack: &Stack<3>, passes: usize| stack.nodes_on_facets(passes).expect("surfaces");
    let (apart, together) = (stack(0.9), stack(0.0));
    let runs: [(&str, &Stack<3>, Box<dyn ContactConstraint<f64>>); 4] = [
        ("step, open, mortar", &apart, Box::new(mortar(&apart))),
        ("nodes on facets, one pass", &together, Box::new(nodes(&together, 1))),
        ("nodes on facets, two passes", &together, Box::new(nodes(&together, 2))),
        ("mortar", &together, Box::new(mortar(&together))),
    ];
    for (name, stack, contact) in runs {
        let mut run = build(stack, contact, h);
        for _ in 0..WARM_UP {
            run.step().expect("a well-posed step");
        }
        println!("{name}: {} rows closed", closed(&run));
        table.row(name, move || run.step().expect("a well-posed step"));
    }
    let [samples, calls] = [if n > 20 { 5 } else { 15 }, 10_000 / solid.dofs()].map(|times| arguments.repeated(times));
    table.sample(samples, calls);
    table.print();
    println!();
}

/// The lower block stands on the ground, and the weight of the upper one presses on it: rows close all over, and no
/// step that is measured solves for dofs that were never pressed before.
fn build(stack: &Stack<3>, contact: Box<dyn ContactConstraint<f64>>, h: f64) -> Simulation<'static, f64> {
    let solid = &stack.solid;
    let mass = solid.lumped_mass::<f64>();
    let weight: Vec<f64> =
        stack.velocity_of_upper([0.0, 0.0, -1e-3]).iter().zip(&mass).map(|(g, mass)| g * mass).collect();
    let mut system = solid.system::<f64>().load(move |_, f| f.copy_from_slice(&weight));
    for node in (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0) {
        for axis in 0..3 {
            system = system.fix(3 * node + axis).expect("a dof of the body");
        }
    }
    Simulation::builder(system, Newmark::trapezoidal(), h)
        .constraint(contact)
        .corrector(PersistencyCorrection::with_history_projection())
        .build()
        .expect("a well-posed scene")
}
