//! Conjugate gradients beside Cholesky factorization: blocks of hex8 elements at Courant numbers from 0.5 to 50.
//!
//! `cargo bench --bench iterative -- [elements a side]…` (default 10 and 20; 30 takes a minute, 40 several and 3 GB);
//! `cargo bench --bench iterative -- --test` is quick.

use contact_dynamics::contact::Plane;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{
    Cholesky, Composite, ConjugateGradients, Factorization, LinearSolver, Newmark, NodesOnObstacle,
    PersistencyCorrection, Simulation,
};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing;
use std::hint::black_box;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
const COURANT: [f64; 7] = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let sizes: Vec<usize> = arguments.iter().filter_map(|argument| argument.parse().ok()).collect();
    let sizes = match (sizes.is_empty(), arguments.iter().any(|argument| argument == "--test")) {
        (false, _) => sizes,
        (true, true) => vec![3],
        (true, false) => vec![10, 20],
    };
    for n in sizes {
        measure(n);
    }
    books(if arguments.iter().any(|argument| argument == "--test") { 3 } else { 6 });
}

/// What a tolerance does to a run: a block bounces off a tilted floor, by the trapezoidal rule. Energy and momentum
/// along the floor are over those of the start, u over the largest.
fn books(cells: usize) {
    let block = Solid::block([1.0; 3], [cells; 3], MATERIAL);
    let h = 1.0 / cells as f64 / MATERIAL.wave_speed();
    let floor = Plane::new([0.0, 0.0, -0.02], [0.2, 0.0, 1.0]).expect("a plane");
    let (dofs, surface) = (block.node_dofs(), block.surface_nodes());
    let sideways: Vec<f64> = block.uniform([0.0, 1.0, 0.0]);
    let run = |solver: Box<dyn LinearSolver<f64>>| {
        let contact = NodesOnObstacle::new(floor, &block.nodes, &dofs, &surface).expect("nodes of the block");
        let mut run = Simulation::builder(block.system(), Newmark::trapezoidal(), h)
            .velocity(block.uniform([0.0, 0.1, -0.1]))
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection())
            .linear_solver(solver)
            .build()
            .expect("a well-posed scene");
        let (energy, momentum) = (run.energy().total(), run.momentum(&sideways).expect("one entry a dof"));
        let mut largest = 0.0_f64;
        for _ in 0..20 * cells {
            run.step().expect("a well-posed step");
            largest = largest.max((run.momentum(&sideways).expect("one entry a dof") / momentum - 1.0).abs());
        }
        let energy = run.energy().total() / energy;
        (run.state().displacement().to_vec(), energy, largest, run.statistics().contact_changes)
    };
    let (exact, energy, drift, changes) = run(Box::<Cholesky>::default());
    println!(
        "block of {cells}³ hex8 on a floor, {} steps at Courant number 1, {changes} changes of contact",
        20 * cells
    );
    println!(
        "{:<12} {:>11} {:>18} {:>16} {:>18}",
        "tolerance", "iterations", "energy − Cholesky's", "momentum drift", "u − Cholesky's"
    );
    println!("{:<12} {:>11} {:>18} {drift:>16.0e}", "Cholesky", "", "");
    let scale = exact.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 0.0] {
        let solver = ConjugateGradients::default().tolerance(tolerance).expect("a tolerance");
        let (u, own, drift, _) = run(Box::new(solver));
        let difference = u.iter().zip(&exact).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / scale;
        let iterations = cost(&solver, &effective(&block, h), 1).iterations;
        println!(
            "{tolerance:<12.0e} {iterations:>11} {:>18.0e} {drift:>16.0e} {difference:>18.0e}",
            (own - energy).abs()
        );
    }
}

/// The composite scheme's effective matrix.
fn effective(block: &Solid<3>, h: f64) -> SparseColMat<usize, f64> {
    timing::effective(&block.stiffness(), &block.lumped_mass(), &Composite, h)
}

/// Milliseconds of factorization and solve, iterations and millions of scalars.
struct Cost {
    factor: f64,
    solve: f64,
    iterations: usize,
    scalars: f64,
}

fn cost(solver: &dyn LinearSolver<f64>, a: &SparseColMat<usize, f64>, samples: usize) -> Cost {
    let mut factor: Box<dyn Factorization<f64>> = solver.analyze(a.symbolic(), &[]).expect("memory");
    let factorize =
        timing::best_milliseconds(samples.min(3), || factor.factorize(a.as_ref()).expect("positive definite"));
    // All frequencies alike, as impacts leave them.
    let mut seed = 1_u64;
    let mut noise = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let b: Vec<f64> = (0..a.ncols()).map(|_| noise()).collect();
    let mut x = b.clone();
    let solve = timing::best_milliseconds(samples, || {
        x.copy_from_slice(&b);
        factor.solve(&mut x).expect("positive definite");
        black_box(&x);
    });
    Cost { factor: factorize, solve, iterations: factor.iterations(), scalars: factor.stored_values() as f64 / 1e6 }
}

/// The Courant number at which a time that grows with it reaches a limit, between those measured.
fn crossing(times: &[f64], limit: f64) -> String {
    match times.iter().position(|time| *time > limit) {
        None => format!("beyond {}", COURANT[COURANT.len() - 1]),
        Some(0) => format!("below {}", COURANT[0]),
        Some(k) => {
            let share = (limit / times[k - 1]).ln() / (times[k] / times[k - 1]).ln();
            format!("{:.1}", COURANT[k - 1] * (COURANT[k] / COURANT[k - 1]).powf(share))
        }
    }
}

fn measure(n: usize) {
    let block = Solid::block([1.0; 3], [n; 3], MATERIAL);
    let samples = if n > 25 { 5 } else { 15 };
    let h = |courant: f64| courant / n as f64 / MATERIAL.wave_speed();
    let direct = cost(&Cholesky::default(), &effective(&block, h(1.0)), 2 * samples);
    println!("block of {n}³ hex8: {} dofs", block.dofs());
    println!(
        "Cholesky: {:.3} M scalars, factorization {:.1} ms, solve {:.3} ms",
        direct.scalars, direct.factor, direct.solve
    );
    println!(
        "{:<14} {:>8} {:>11} {:>10} {:>10}    Cholesky / this: scalars, factor, solve",
        "", "Courant", "iterations", "factor ms", "solve ms"
    );
    let (mut times, mut setup, solver) = (Vec::new(), 0.0, ConjugateGradients::default());
    for courant in COURANT {
        let own = cost(&solver, &effective(&block, h(courant)), samples);
        println!(
            "{:<14} {courant:>8} {:>11} {:>10.1} {:>10.3} {:>19.1} {:>8.1} {:>7.2}",
            "Gauss-Seidel",
            own.iterations,
            own.factor,
            own.solve,
            direct.scalars / own.scalars,
            direct.factor / own.factor,
            direct.solve / own.solve
        );
        times.push(own.solve);
        setup = own.factor;
    }
    let each = crossing(&times, direct.solve);
    let hundred = crossing(&times, direct.solve + (direct.factor - setup) / 100.0);
    println!("Gauss-Seidel: as fast at Courant number {each}, 100 solves with a factorization at {hundred}");
    println!();
}
