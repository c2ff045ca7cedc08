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
    Automatic, CentralDifference, Composite, Factorization, LinearRows, LinearSolver, LinearSystem, Newmark,
    PersistencyCorrection, Simulation, System, TimeIntegrator,
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
    rows.push(Row { name: "composite step by hand".into(), run: Box::new(by_hand(&bars, h)), samples: Vec::new() });
    rows.push(traffic(&bars, 0.9 * h));
    rows.push(explicit(&bars, 0.9 * h));
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
            factor.solve(&mut x).expect("a direct solve");
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

/// The composite scheme's step of chains in a straight program: what a host would write for this scene alone. Prediction,
/// product with K and forward sweep are one loop, backward sweep and recovery another one.
fn by_hand(bars: &Bars, h: f64) -> impl FnMut(usize) + 'static {
    let dofs = bars.dofs();
    let (stiffness, mass) = (bars.stiffness::<f64>(), bars.lumped_mass::<f64>());
    let entry = |i: usize, j: usize| {
        let rows = stiffness.as_ref().row_idx_of_col_raw(j);
        rows.iter().position(|&row| row == i).map_or(0.0, |at| stiffness.val_of_col(j)[at])
    };
    let diagonal: Vec<f64> = (0..dofs).map(|i| entry(i, i)).collect();
    let beside: Vec<f64> = (0..dofs).map(|i| if i + 1 < dofs { entry(i, i + 1) } else { 0.0 }).collect();
    // L D Lᵀ of 5/2 M/h² + K.
    let (mut lower, mut inverse) = (vec![0.0; dofs], vec![0.0; dofs]);
    for i in 0..dofs {
        let pivot = 2.5 / (h * h) * mass[i] + diagonal[i] - if i > 0 { lower[i - 1] * beside[i - 1] } else { 0.0 };
        (inverse[i], lower[i]) = (pivot.recip(), beside[i] / pivot);
    }
    let still = || vec![0.0; dofs];
    let (mut u, mut u1, mut v, mut v1, mut x, mut a) = (still(), still(), still(), still(), still(), still());
    u.iter_mut().enumerate().for_each(|(i, u)| *u = 1e-3 * (0.1 * i as f64).sin());
    u1.copy_from_slice(&u);
    move |calls| {
        for _ in 0..calls {
            let predicted = |i: usize| u[i] + 0.6 * (u[i] - u1[i]) + h * (0.8 * v[i] - 0.4 * v1[i]);
            let (mut before, mut now, mut last) = (0.0, predicted(0), 0.0);
            for i in 0..dofs {
                let next = if i + 1 < dofs { predicted(i + 1) } else { 0.0 };
                let pull = diagonal[i] * now + beside[i] * next + if i > 0 { beside[i - 1] * before } else { 0.0 };
                last = -pull - if i > 0 { lower[i - 1] * last } else { 0.0 };
                x[i] = last;
                (before, now) = (now, next);
            }
            let mut d = 0.0;
            for i in (0..dofs).rev() {
                d = x[i] * inverse[i] - lower[i] * d;
                let new = u[i] + 0.6 * (u[i] - u1[i]) + h * (0.8 * v[i] - 0.4 * v1[i]) + d;
                let rate = (1.5 * (new - u[i]) - 0.5 * (u[i] - u1[i])) / h;
                a[i] = 2.5 / (h * h) * d;
                (u1[i], u[i]) = (u[i], new);
                (v1[i], v[i]) = (v[i], rate);
            }
            black_box((&u, &v, &a));
        }
    }
}

/// One product with K and one pass over the vectors of an explicit step: its limit.
fn traffic(bars: &Bars, h: f64) -> Row<'static> {
    let dofs = bars.dofs();
    let mut system = bars.system::<f64>();
    let inverse: Vec<f64> = bars.lumped_mass::<f64>().iter().map(|m| m.recip()).collect();
    let still = || vec![0.0; dofs];
    let (mut u, mut v, mut a, mut f) = (still(), still(), still(), still());
    let step = move |calls| {
        for _ in 0..calls {
            system.force(0.0, black_box(&u), &v, &mut f).expect("linear");
            let rates = v.iter_mut().zip(&mut a).zip(inverse.iter().zip(&f));
            for (u, ((v, a), (inverse, f))) in u.iter_mut().zip(rates) {
                *u += h * (*v + 0.5 * h * *a);
                *v += 0.5 * h * (*a + inverse * f);
                *a = inverse * f;
            }
            black_box((&u, &v, &a));
        }
    };
    Row { name: "K product and vectors".into(), run: Box::new(step), samples: Vec::new() }
}

/// A step of central differences without contact.
fn explicit(bars: &Bars, h: f64) -> Row<'static> {
    let mut run = Simulation::builder(bars.system::<f64>(), CentralDifference, h)
        .velocity((0..bars.dofs()).map(|i| 1e-3 * (i as f64 * 0.1).sin()).collect())
        .build()
        .expect("the scene is well posed");
    let step = move |calls| {
        for _ in 0..calls {
            run.step().expect("the scene is well posed");
        }
    };
    Row { name: "central differences".into(), run: Box::new(step), samples: Vec::new() }
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
