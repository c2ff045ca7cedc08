//! Two equal blocks that touch: one factor for both beside a factor for each (`ByBody`).
//!
//! `cargo bench --bench bodies -- [elements a side]…` (default 10 and 16)

use contact_dynamics::{Automatic, ByBody, Composite, LinearRows, LinearSolver, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{self, Arguments};
use std::time::Instant;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

fn main() {
    for n in Arguments::read(&[10, 16], &[4]).sizes {
        measure(n);
    }
}

fn solver(apart: bool) -> Box<dyn LinearSolver<f64>> {
    if apart { Box::new(ByBody::default()) } else { Box::new(Automatic) }
}

fn measure(n: usize) {
    let lower = Solid::block([1.0; 3], [n; 3], MATERIAL);
    let count = lower.nodes.len();
    let blocks = lower.with(Solid::block([1.0; 3], [n; 3], MATERIAL).moved([0.0, 0.0, 1.0]));
    let h = 1.0 / n as f64 / MATERIAL.wave_speed();
    let layer = (n + 1) * (n + 1);
    let pairs: Vec<[usize; 2]> = (0..layer).map(|k| [count - layer + k, count + k].map(|node| 3 * node + 2)).collect();
    let mut interface: Vec<usize> = pairs.iter().flatten().copied().collect();
    interface.sort_unstable();

    // The effective matrix of the composite scheme.
    let a = timing::effective(&blocks.stiffness::<f64>(), &blocks.lumped_mass(), &Composite, h);

    println!(
        "two blocks of {n}³ elements, {} dofs, {} pairs, median ms of one factor, of a factor each",
        a.ncols(),
        layer
    );
    let mut times = vec![[Vec::new(), Vec::new()]; 5];
    let mut factors = [false, true].map(|apart| {
        let mut factor = solver(apart).analyze(a.symbolic(), &interface).expect("memory");
        factor.factorize(a.as_ref()).expect("positive definite");
        factor
    });
    let mut runs = [false, true].map(|apart| {
        let rows = pairs
            .iter()
            .fold(LinearRows::new(), |rows, &[first, second]| rows.unilateral(&[(first, -1.0), (second, 1.0)], 0.0));
        // The upper block moves down: pressed.
        let speed = |dof: usize| if dof >= 3 * count && dof % 3 == 2 { -1e-3 } else { 0.0 };
        Simulation::builder(blocks.system(), Composite, h)
            .velocity((0..blocks.dofs()).map(speed).collect())
            .constraint(rows)
            .corrector(PersistencyCorrection::with_history_projection())
            .linear_solver(solver(apart))
            .build()
            .expect("a well-posed scene")
    });
    for run in &mut runs {
        for _ in 0..5 {
            run.step().expect("a well-posed step");
        }
    }
    let mut x = vec![1.0; a.ncols()];
    for sample in 0..=if n > 12 { 7 } else { 15 } {
        for (i, apart) in [(0, false), (1, true)] {
            let mut clock = |row: usize, work: &mut dyn FnMut()| {
                let start = Instant::now();
                work();
                if sample > 0 {
                    times[row][i].push(start.elapsed().as_secs_f64() * 1e3);
                }
            };
            clock(0, &mut || drop(solver(apart).analyze(a.symbolic(), &interface).expect("memory")));
            clock(1, &mut || factors[i].factorize(a.as_ref()).expect("positive definite"));
            x.fill(1.0);
            clock(2, &mut || factors[i].solve(&mut x).expect("a direct solve"));
            let mut ends = vec![0.0; interface.len()];
            x.fill(1.0);
            clock(3, &mut || {
                let condensed = factors[i].condensation().expect("Cholesky condenses");
                condensed.condense(&x, &mut ends).expect("a factor");
                condensed.expand(&ends, &mut x).expect("a factor");
            });
            clock(4, &mut || runs[i].step().expect("a well-posed step"));
        }
    }
    for (name, [one, apart]) in
        ["analyze", "factorize", "solve", "condense and expand", "step, corrected"].into_iter().zip(&times)
    {
        let (one, apart) = (timing::median(one), timing::median(apart));
        println!("{name:<20} {one:>10.3} {apart:>10.3}   ratio {:.2}", apart / one);
    }
    let sizes = factors.each_ref().map(|factor| factor.stored_values() as f64 / 1e6);
    println!("{:<20} {:>10.3} {:>10.3}\n", "values, millions", sizes[0], sizes[1]);
}
