//! Steps of two blocks whose meshes do not match, one pressed on the other, with and without friction: nodes on facets
//! and weighted gaps, beside the bare solve, one refactorization and the step apart.

use super::{MATERIAL, closed};
use contact_dynamics::contact::ContactConstraint;
use contact_dynamics::{Automatic, LinearSolver, Newmark, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::solids::Solid;
use contact_dynamics_scenes::stacks::Stack;
use example_support::timing::{self, Arguments, Ratio, Table, Unit};

/// Steps before those that are measured.
const WARM_UP: usize = 8;
const FRICTION: f64 = 0.3;

const RATIOS: &[Ratio] = &[
    Ratio { heading: "/ refactorization", to: &["refactorization"] },
    Ratio { heading: "/ bare solve", to: &["bare solve, free order"] },
    Ratio { heading: "/ open step", to: &["step, open, mortar"] },
];

pub(super) fn measure(arguments: &Arguments) {
    for n in if arguments.quick { vec![3] } else { vec![9, 17, 29] } {
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
    let mut factor = Automatic.analyze(a.symbolic(), &[]).expect("memory");
    table.row("refactorization", move || factor.factorize(a.as_ref()).expect("positive definite"));
    let (apart, together) = (stack(0.9), stack(0.0));
    let mortar = |stack: &Stack<3>, mu| Box::new(stack.mortar(true).expect("surfaces").friction(mu));
    let nodes = |passes, mu| Box::new(together.nodes_on_facets(passes).expect("surfaces").friction(mu));
    let runs: [(&str, &Stack<3>, Box<dyn ContactConstraint<f64>>); 7] = [
        ("step, open, mortar", &apart, mortar(&apart, 0.0)),
        ("nodes on facets, one pass", &together, nodes(1, 0.0)),
        ("nodes on facets, one pass, mu 0.3", &together, nodes(1, FRICTION)),
        ("nodes on facets, two passes", &together, nodes(2, 0.0)),
        ("nodes on facets, two passes, mu 0.3", &together, nodes(2, FRICTION)),
        ("mortar", &together, mortar(&together, 0.0)),
        ("mortar, mu 0.3", &together, mortar(&together, FRICTION)),
    ];
    // Two passes make redundant rows, with which friction takes many seconds a step on the finer meshes.
    let is_too_long = |name: &str| n > 9 && name == "nodes on facets, two passes, mu 0.3";
    for (name, stack, contact) in runs.into_iter().filter(|(name, ..)| !is_too_long(name)) {
        let mut run = build(stack, contact, h);
        for _ in 0..WARM_UP {
            run.step().expect("a well-posed step");
        }
        let before = *run.statistics();
        run.step().expect("a well-posed step");
        let iterations = run.statistics().contact_iterations - before.contact_iterations;
        let products = run.statistics().contact_products - before.contact_products;
        println!("{name}: {} closed, {iterations} iterations with W and {products} products in a step", closed(&run));
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
