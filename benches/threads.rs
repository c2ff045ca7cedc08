//! What threads bring: factorization, solve and step by one thread and by more, and whether the results are the same.
//!
//! `cargo bench --features rayon --bench threads -- [elements a side]…` (default 10, 20 and 30)

use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{ByBody, Cholesky, Composite, Factorization, LinearRows, LinearSolver, Simulation, System};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{self, Arguments};
use std::hint::black_box;
use std::time::Instant;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

fn main() {
    let arguments = Arguments::read(&[10, 20, 30], &[8]);
    let available = std::thread::available_parallelism().map_or(2, usize::from).max(2);
    println!("one thread beside {available}; medians in ms");
    println!("{:<44} {:>9} {:>9} {:>7}   results", "", "one", "more", "ratio");
    for &n in &arguments.sizes {
        let repetitions = arguments.repeated((300 / n).min(15));
        let block = Solid::block([1.0; 3], [n; 3], MATERIAL);
        let a = timing::effective(&block.stiffness::<f64>(), &block.lumped_mass(), &Composite, step_size(n));
        let face: Vec<usize> = block
            .surface_nodes()
            .into_iter()
            .filter(|&node| block.nodes[node][2] == 0.0)
            .map(|node| Solid::<3>::dof(node, 2))
            .collect();
        let blocks = [("block", &a, 1), ("two blocks, a factor each", &twice(&a), 2)];
        for (name, a, bodies) in blocks {
            let runs = [1, available].map(|threads| linear(threads, bodies, a, repetitions));
            report(&format!("{name} of {n}³: factorization"), [&runs[0][0], &runs[1][0]]);
            report(&format!("{name} of {n}³: solve"), [&runs[0][1], &runs[1][1]]);
        }
        let runs = [1, available].map(|threads| product(threads, &block, 10 * repetitions));
        report(&format!("block of {n}³: product with K"), [&runs[0], &runs[1]]);
        let runs = [1, available].map(|threads| steps(threads, &block, &face, step_size(n), repetitions));
        report(&format!("block of {n}³: step, {} nodes pressed", face.len()), [&runs[0], &runs[1]]);
    }
}

/// Courant number 1.
fn step_size(n: usize) -> f64 {
    1.0 / n as f64 / MATERIAL.wave_speed()
}

/// What was measured: milliseconds, and the numbers found.
struct Measured {
    milliseconds: f64,
    numbers: Vec<f64>,
}

fn report(name: &str, [one, more]: [&Measured; 2]) {
    let difference = one.numbers.iter().zip(&more.numbers).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    let scale = one.numbers.iter().map(|x| x.abs()).fold(0.0, f64::max);
    let same = one.numbers.iter().zip(&more.numbers).all(|(x, y)| x.to_bits() == y.to_bits());
    let results = if same { "the same bits".into() } else { format!("differ by {:.0e}", difference / scale) };
    let (one, more) = (one.milliseconds, more.milliseconds);
    println!("{name:<44} {one:>9.2} {more:>9.2} {:>7.2}   {results}", one / more);
}

fn in_pool<R: Send>(threads: usize, run: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").install(run)
}

/// Factorization and solve.
fn linear(threads: usize, bodies: usize, a: &SparseColMat<usize, f64>, repetitions: usize) -> [Measured; 2] {
    in_pool(threads, || {
        let mut factor: Box<dyn Factorization<f64>> = match bodies {
            1 => Cholesky::default().analyze(a.symbolic(), &[]),
            _ => ByBody::default().analyze(a.symbolic(), &[]),
        }
        .expect("memory");
        let factorization = median(repetitions.min(5), || factor.factorize(a.as_ref()).expect("positive definite"));
        let mut x = vec![0.0; a.nrows()];
        let solve = median(3 * repetitions, || {
            x.iter_mut().zip(1..).for_each(|(x, i)| *x = f64::from(i).sin());
            factor.solve(&mut x).expect("a factor");
            black_box(&x);
        });
        [Measured { milliseconds: factorization, numbers: x.clone() }, Measured { milliseconds: solve, numbers: x }]
    })
}

/// The force of the block: a product with K.
fn product(threads: usize, block: &Solid<3>, repetitions: usize) -> Measured {
    in_pool(threads, || {
        let mut system = block.system::<f64>();
        let u: Vec<f64> = (0..block.dofs()).map(|i| (0.1 * i as f64).sin()).collect();
        let (v, mut f) = (vec![0.0; u.len()], vec![0.0; u.len()]);
        let milliseconds = median(repetitions, || {
            system.force(0.0, black_box(&u), &v, &mut f).expect("a linear system");
            black_box(&f);
        });
        Measured { milliseconds, numbers: f }
    })
}

/// Steps of the composite scheme with a face on the floor.
fn steps(threads: usize, block: &Solid<3>, face: &[usize], h: f64, repetitions: usize) -> Measured {
    in_pool(threads, || {
        let contact = face.iter().fold(LinearRows::new(), |rows, &dof| rows.unilateral(&[(dof, 1.0)], 0.0));
        let mass = block.lumped_mass::<f64>();
        let system = block.system::<f64>().load(move |_, f| {
            f.iter_mut().zip(&mass).skip(2).step_by(3).for_each(|(f, m)| *f = -1e-3 * m);
        });
        let mut run = Simulation::builder(system, Composite, h)
            .constraint(contact)
            .uncorrected()
            .build()
            .expect("a well-posed scene");
        let milliseconds = median(repetitions, || run.step().expect("a well-posed step"));
        Measured { milliseconds, numbers: run.state().displacement().to_vec() }
    })
}

/// The median time in milliseconds of so many runs after a first one.
fn median(runs: usize, mut run: impl FnMut()) -> f64 {
    run();
    let times: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    timing::median(&times)
}

/// Two bodies with this matrix each.
fn twice(a: &SparseColMat<usize, f64>) -> SparseColMat<usize, f64> {
    let n = a.ncols();
    let entries =
        (0..n).flat_map(|j| a.as_ref().row_idx_of_col_raw(j).iter().zip(a.val_of_col(j)).map(move |e| (e, j)));
    let triplets: Vec<_> =
        entries.flat_map(|((&i, &x), j)| [Triplet::new(i, j, x), Triplet::new(i + n, j + n, x)]).collect();
    SparseColMat::try_new_from_triplets(2 * n, 2 * n, &triplets).expect("valid triplets")
}
