//! Cost of a step of a nonlinear body beside what an iteration cannot do without: force, tangent, factorization, solve.
//!
//! `cargo bench --bench newton -- [elements a side]…` (default 6 and 10)

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{Automatic, Composite, Factorization, LinearSolver, Newton, Simulation, System, TangentWeights};
use contact_dynamics_scenes::hyperelastic::Hyperelastic;
use contact_dynamics_scenes::large::{Scene, Throw};
use example_support::timing::{self, Arguments};
use std::hint::black_box;
use std::time::Instant;

fn main() {
    for cells in Arguments::read(&[6, 10], &[2]).sizes {
        measure(cells);
    }
}

/// A measured operation: runs once and says how many iterations it took.
struct Row {
    name: &'static str,
    run: Box<dyn FnMut() -> u64>,
    samples: Vec<f64>,
    iterations: u64,
}

fn row(name: &'static str, run: impl FnMut() -> u64 + 'static) -> Row {
    Row { name, run: Box::new(run), samples: Vec::new(), iterations: 0 }
}

/// The parts of an iteration come first.
const PARTS: usize = 4;

fn measure(cells: usize) {
    let throw = Throw { cells, gravity: 0.0, speed: 0.02, ..Throw::default() };
    let far = Throw { height: 1e3, ..throw }.cube();
    let near = Throw { gravity: 0.05, height: 0.0, spin: 0.0, slide: 0.0, angle: 0.0, ..throw }.cube();
    let (dofs, candidates) = (far.body.dofs(), far.nodes.len());
    println!("cube of {cells}³ hex8 elements, {dofs} dofs, {candidates} candidates, neo-Hookean, Courant number 1");
    let fill = |axes: &[usize]| {
        let last: Vec<usize> = far.nodes.iter().flat_map(|node| axes.iter().map(move |axis| 3 * node + axis)).collect();
        let factor: Box<dyn Factorization<f64>> = Automatic.analyze(far.body.pattern(), &last).expect("memory");
        factor.stored_values() as f64 / 1e6
    };
    let [free, one, all] = [fill(&[]), fill(&[2]), fill(&[0, 1, 2])];
    println!("fill: {free:.2} M free, {one:.2} M with one dof a candidate last, {all:.2} M with all their dofs last");
    let mut rows = parts(&far);
    for (name, scene, newton) in [
        ("step away, full", &far, Newton::full()),
        ("step away, modified", &far, Newton::modified()),
        ("step in contact, full", &near, Newton::full()),
        ("step in contact, modified", &near, Newton::modified()),
    ] {
        let mut run = start(scene, newton);
        for _ in 0..5 {
            run.step().expect("a well-posed step");
        }
        rows.push(row(name, move || {
            let before = run.statistics().newton_iterations;
            run.step().expect("a well-posed step");
            run.statistics().newton_iterations - before
        }));
    }
    sample(&mut rows, if cells > 8 { 9 } else { 25 });
}

fn start(scene: &Scene<Hyperelastic<3>, 3>, newton: Newton) -> Simulation<'static, f64> {
    scene.builder(Box::new(Composite)).expect("a scene").newton(newton).build().expect("a well-posed scene")
}

/// Force, tangent, factorization and solve of a body in a state of some deformation.
fn parts(scene: &Scene<Hyperelastic<3>, 3>) -> Vec<Row> {
    let mut run = start(scene, Newton::full());
    for _ in 0..5 {
        run.step().expect("a well-posed step");
    }
    let (u, v) = (run.state().displacement().to_vec(), run.state().velocity().to_vec());
    let mut body = scene.body.clone();
    let mut values = vec![0.0; body.pattern().row_idx().len()];
    let weights = TangentWeights::new(1.0, 0.0);
    body.tangent(0.0, &u, &v, weights, &mut values).expect("an admissible state");
    let mut a = SparseColMat::<usize, f64>::new(body.pattern().to_owned().expect("memory"), values.clone());
    let inertia = 2.5 / (scene.h * scene.h);
    for dof in 0..u.len() {
        let mass = body.particles.mass[dof];
        *a.get_mut(dof, dof).expect("a diagonal") += inertia * mass;
    }
    let mut factor = Automatic.analyze(a.symbolic(), &[]).expect("memory");
    factor.factorize(a.as_ref()).expect("positive definite");
    let mut solver = Automatic.analyze(a.symbolic(), &[]).expect("memory");
    solver.factorize(a.as_ref()).expect("positive definite");
    let (mut force, mut x) = (vec![0.0; u.len()], vec![1.0; u.len()]);
    let mut other = scene.body.clone();
    let (place, speed) = (u.clone(), v.clone());
    vec![
        row("force", move || {
            other.force(0.0, &place, &speed, &mut force).expect("an admissible state");
            black_box(&force);
            1
        }),
        row("tangent", move || {
            body.tangent(0.0, &u, &v, weights, &mut values).expect("an admissible state");
            black_box(&values);
            1
        }),
        row("factorization", move || {
            factor.factorize(a.as_ref()).expect("positive definite");
            1
        }),
        row("bare solve", move || {
            x.fill(1.0);
            solver.solve(&mut x).expect("a direct solve");
            black_box(&x);
            1
        }),
    ]
}

/// Runs all rows in turn, and prints medians and ratios.
fn sample(rows: &mut [Row], samples: u32) {
    for sample in 0..=samples {
        for row in &mut *rows {
            let start = Instant::now();
            let iterations = (row.run)();
            if sample > 0 {
                row.samples.push(start.elapsed().as_secs_f64() * 1e3);
                row.iterations += iterations;
            }
        }
    }
    println!("{:<28} {:>10} {:>12} {:>22}", "", "median ms", "iterations", "/ (iterations × parts)");
    let medians: Vec<f64> = rows.iter().map(|row| timing::median(&row.samples)).collect();
    let whole: f64 = medians[..PARTS].iter().sum();
    for (index, (row, median)) in rows.iter().zip(&medians).enumerate() {
        if index < PARTS {
            println!("{:<28} {median:>10.3} {:>12} {:>22.2}", row.name, "", median / whole);
        } else {
            let iterations = row.iterations as f64 / f64::from(samples);
            println!("{:<28} {median:>10.3} {iterations:>12.2} {:>22.2}", row.name, median / (iterations * whole));
        }
    }
    println!();
}
