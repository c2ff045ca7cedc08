//! Cost of a step of the two-bar scene beside the bare triangular solve and the bare K product, in one run.
//!
//! `cargo bench --bench step` prints medians in microseconds and ratios. The machine may be shared: the samples of all
//! rows are interleaved, and only ratios within one run mean something elsewhere.

use contact_dynamics::faer::dyn_stack::{MemBuffer, MemStack};
use contact_dynamics::faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use contact_dynamics::faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, SymmetricOrdering, factorize_symbolic_cholesky,
};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::faer::{Conj, MatMut, Par, Side, Spec};
use contact_dynamics::{
    Automatic, Composite, Factorization, LinearRows, LinearSolver, LinearSystem, Newmark, PersistencyCorrection,
    Simulation, System, TimeIntegrator,
};
use contact_dynamics_scenes::Bars;
use std::hint::black_box;
use std::time::Instant;

/// One thing that is timed: `calls` repetitions a sample.
struct Row<'a> {
    name: String,
    run: Box<dyn FnMut(usize) + 'a>,
    samples: Vec<f64>,
}

const SAMPLES: usize = 60;

fn main() {
    // `cargo test --benches` passes --test: run once, to see that it works.
    let quick = std::env::args().any(|argument| argument == "--test");
    for n in [100, 1_000, 10_000] {
        table(n, if quick { 1 } else { 200_000 / n }, if quick { 1 } else { SAMPLES });
    }
}

fn table(n: usize, calls: usize, samples: usize) {
    let bars = Bars::paper(n);
    // Courant number 1 on the mesh of the table.
    let h = bars.element_size(0) / 100.0;
    let mut rows = bare(&bars, h);
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] = [|| Box::new(Composite), || Box::new(Newmark::trapezoidal())];
    for scheme in schemes {
        for (contact, correction) in [("open", false), ("open", true), ("closed", false), ("closed", true)] {
            let mut run = pressed(&bars, scheme(), contact == "closed", correction, h);
            let name = format!("{}, {contact}{}", scheme().name(), if correction { ", corrected" } else { "" });
            let step = move |calls| {
                for _ in 0..calls {
                    run.step().expect("the scene is well posed");
                }
            };
            rows.push(Row { name, run: Box::new(step), samples: Vec::new() });
        }
    }
    for row in &mut rows {
        (row.run)(calls); // warm up
    }
    for _ in 0..samples {
        for row in &mut rows {
            let start = Instant::now();
            (row.run)(calls);
            row.samples.push(start.elapsed().as_secs_f64() / calls as f64 * 1e6);
        }
    }
    println!("two bars of {n} elements, {} dofs", bars.dofs());
    println!("{:<36} {:>10} {:>10} {:>16} {:>14}", "", "median µs", "best µs", "/ bare solve", "/ (solve + K)");
    let (solve, product) = (median(&mut rows[0].samples), median(&mut rows[1].samples));
    for row in &mut rows {
        let (median, best) = (median(&mut row.samples), row.samples[0]);
        println!(
            "{:<36} {median:>10.2} {best:>10.2} {:>16.2} {:>14.2}",
            row.name,
            median / solve,
            median / (solve + product)
        );
    }
    println!();
}

fn median(samples: &mut [f64]) -> f64 {
    samples.sort_by(f64::total_cmp);
    samples[samples.len() / 2]
}

/// The solve with the composite scheme's effective matrix, and the product with K.
fn bare(bars: &Bars, h: f64) -> Vec<Row<'static>> {
    let dofs = bars.dofs();
    let stiffness = bars.stiffness::<f64>();
    let mass = bars.lumped_mass::<f64>();
    let mut triplets: Vec<_> = (0..dofs).map(|i| Triplet::new(i, i, 2.5 / (h * h) * mass[i])).collect();
    for j in 0..dofs {
        let entries = stiffness.as_ref();
        for (&i, &value) in entries.row_idx_of_col_raw(j).iter().zip(entries.val_of_col(j)) {
            triplets.push(Triplet::new(i, j, value));
        }
    }
    let effective = SparseColMat::<usize, f64>::try_new_from_triplets(dofs, dofs, &triplets).expect("valid triplets");
    let mut factor: Box<dyn Factorization<f64>> = Automatic.analyze(effective.symbolic(), &[]).expect("a small matrix");
    factor.factorize(effective.as_ref()).expect("positive definite");
    let mut x = vec![1.0; dofs];
    let solve = move |calls| {
        for _ in 0..calls {
            x.fill(1.0);
            factor.solve(&mut x);
            black_box(&x);
        }
    };
    let faer = faer_solve(&effective);
    let mut system = bars.system::<f64>();
    let (u, v, mut f) = (vec![1.0; dofs], vec![0.0; dofs], vec![0.0; dofs]);
    let product = move |calls| {
        for _ in 0..calls {
            system.force(0.0, black_box(&u), &v, &mut f).expect("linear");
            black_box(&f);
        }
    };
    let row = |name: &str, run: Box<dyn FnMut(usize)>| Row { name: name.into(), run, samples: Vec::new() };
    vec![
        row("bare solve", Box::new(solve)),
        row("bare K product", Box::new(product)),
        row("bare solve, faer's own sweeps", Box::new(faer)),
    ]
}

/// The same solve with faer's L D Lᵀ and faer's sweeps: what our own are measured against.
fn faer_solve(a: &SparseColMat<usize, f64>) -> impl FnMut(usize) + 'static {
    let a = a.as_ref();
    let parameters = CholeskySymbolicParams::default();
    let symbolic = factorize_symbolic_cholesky(a.symbolic(), Side::Lower, SymmetricOrdering::Amd, parameters)
        .expect("a small matrix");
    let mut values = vec![0.0; symbolic.len_val()];
    let scratch = symbolic
        .factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Spec::default())
        .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
    let mut memory = MemBuffer::new(scratch);
    let (regularization, stack) = (LdltRegularization::default(), MemStack::new(&mut memory));
    symbolic
        .factorize_numeric_ldlt(&mut values, a, Side::Lower, regularization, Par::Seq, stack, Spec::default())
        .expect("positive definite");
    let mut x = vec![1.0; a.nrows()];
    move |calls| {
        for _ in 0..calls {
            x.fill(1.0);
            let rhs = MatMut::from_column_major_slice_mut(&mut x, symbolic.nrows(), 1);
            let factor = LdltRef::<usize, f64>::new(&symbolic, &values);
            factor.solve_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(&mut memory));
            black_box(&x);
        }
    }
}

/// Bars that vibrate slightly while loads at the far ends press them together (closed), or far apart (open).
fn pressed(
    bars: &Bars,
    scheme: Box<dyn TimeIntegrator>,
    closed: bool,
    correction: bool,
    h: f64,
) -> Simulation<'static, f64> {
    let dofs = bars.dofs();
    let [left, right] = bars.contact_dofs();
    let force = 1.0;
    let system: LinearSystem<'static, f64> = bars.system();
    let system = if closed { system.load(move |_, f| (f[0], f[dofs - 1]) = (force, -force)) } else { system };
    // Statically compressed: u falls linearly from the far end to the contact.
    let shortening = force / (bars.young[0] * bars.area) * bars.element_size(0);
    let u: Vec<f64> = (0..dofs)
        .map(|i| if i <= left { shortening * (left - i) as f64 } else { -shortening * (i - right) as f64 })
        .collect();
    let builder = Simulation::builder(system, scheme, h)
        .displacement(if closed { u } else { vec![0.0; dofs] })
        .velocity(
            (0..dofs).map(|i| 1e-3 * (i as f64 * 0.1).sin() * f64::from(u8::from(i != left && i != right))).collect(),
        )
        .constraint(LinearRows::new().unilateral(&[(left, -1.0), (right, 1.0)], if closed { 0.0 } else { 1e3 }));
    let builder = match correction {
        true => builder.corrector(PersistencyCorrection::with_history_projection()),
        false => builder,
    };
    builder.build().expect("the scene is well posed")
}
