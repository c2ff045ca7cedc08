//! Cost of a step of the two-bar scene beside the bare triangular solve and the bare K product, in one run.
//!
//! `cargo bench --bench step -- [elements a bar]…` (default 20 to a million: about three minutes) prints medians and
//! ratios for `f64` and `f32`. The machine may be shared: the samples of all rows are interleaved, and only ratios
//! within one run mean something elsewhere.

use contact_dynamics::faer::dyn_stack::{MemBuffer, MemStack};
use contact_dynamics::faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, SymmetricOrdering, factorize_symbolic_cholesky,
};
use contact_dynamics::faer::{Conj, MatMut, Par, Side, Spec};
use contact_dynamics::{
    CentralDifference, Composite, LinearRows, LinearSystem, Newmark, PersistencyCorrection, Real, Simulation,
    TimeIntegrator,
};
use contact_dynamics_scenes::Bars;
use example_support::timing::{self, Arguments, Ratio, Table, Unit};
use example_support::yardsticks;
use std::hint::black_box;

const RATIOS: &[Ratio] = &[
    Ratio { heading: "/ bare solve", to: &["bare solve"] },
    Ratio { heading: "/ (solve + K)", to: &["bare solve", "bare K product"] },
    Ratio { heading: "/ (solve + rows)", to: &["bare solve", "K product by compressed rows"] },
    Ratio { heading: "/ by hand", to: &["composite step by hand"] },
    Ratio { heading: "/ Newmark by hand", to: &["Newmark step by hand"] },
    Ratio { heading: "/ (K + vectors)", to: &["K product and vectors"] },
];

fn main() {
    let arguments = Arguments::read(&[20, 100, 400, 1_000, 10_000, 100_000, 1_000_000], &[20]);
    for &n in &arguments.sizes {
        table::<f64>("f64", n, &arguments, |table, bars, h| {
            let a = timing::effective(&bars.stiffness::<f64>(), &bars.lumped_mass(), &Composite, h);
            table.row("bare solve, faer's own sweeps", faer_solve(&a));
        });
        table::<f32>("f32", n, &arguments, |_, _, _| {});
    }
}

fn table<T: Real>(scalar: &str, n: usize, arguments: &Arguments, more: impl FnOnce(&mut Table<'static>, &Bars, f64)) {
    let bars = Bars::paper(n);
    // Courant number 1 on the mesh of the table.
    let h = bars.element_size(0) / 100.0;
    let a = timing::effective(&bars.stiffness::<T>(), &bars.lumped_mass(), &Composite, h);
    let factor = timing::factor(&a, &[]);
    let stored = factor.stored_values();
    let mut table = Table::new(Unit::Micro, RATIOS);
    table.reference("bare solve", timing::solve(factor, bars.dofs()));
    table.reference("bare K product", timing::force(bars.system::<T>()));
    table.reference("K product by compressed rows", yardsticks::gather(&bars.stiffness::<T>()));
    table.reference("composite step by hand", yardsticks::composite_by_hand::<T>(&bars, h));
    table.reference("Newmark step by hand, closed, corrected", yardsticks::newmark_by_hand::<T>(&bars, h));
    let limit = yardsticks::explicit_limit(bars.system::<T>(), 0.9 * h);
    table.reference("K product and vectors", limit);
    drop(a);
    // Large scenes do not fit into memory all together.
    let (samples, calls) = (arguments.repeated((6_000_000 / n).clamp(15, 60)), arguments.repeated(200_000 / n));
    let apart = n > 100_000;
    let sample = |table: &mut Table<'static>, last: bool| {
        if apart || last {
            table.sample(samples, calls);
        }
    };
    more(&mut table, &bars, h);
    table.row("reading the factor twice", yardsticks::reading::<T>(stored));
    sample(&mut table, false);
    table.row("central differences", steps(explicit::<T>(&bars, 0.9 * h)));
    sample(&mut table, false);
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] = [|| Box::new(Composite), || Box::new(Newmark::trapezoidal())];
    for scheme in schemes {
        for (contact, correction) in [("open", false), ("open", true), ("closed", false), ("closed", true)] {
            let run = pressed::<T>(&bars, scheme(), contact == "closed", correction, h);
            let name = format!("{}, {contact}{}", scheme().name(), if correction { ", corrected" } else { "" });
            table.row(name, steps(run));
            sample(&mut table, false);
        }
    }
    sample(&mut table, !apart);
    println!("two bars of {n} elements, {} dofs, {scalar}", bars.dofs());
    table.print();
    println!();
}

fn steps<T: Real>(mut run: Simulation<'static, T>) -> impl FnMut() + 'static {
    move || run.step().expect("the scene is well posed")
}

/// The same solve with faer's L D Lᵀ and faer's sweeps: what our own are measured against.
fn faer_solve(a: &SparseColMat<usize, f64>) -> impl FnMut() + 'static {
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
    move || {
        x.fill(1.0);
        let rhs = MatMut::from_column_major_slice_mut(&mut x, symbolic.nrows(), 1);
        let factor = LdltRef::<usize, f64>::new(&symbolic, &values);
        factor.solve_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(&mut memory));
        black_box(&x);
    }
}

/// Central differences without contact.
fn explicit<T: Real>(bars: &Bars, h: f64) -> Simulation<'static, T> {
    Simulation::builder(bars.system::<T>(), CentralDifference, h)
        .velocity((0..bars.dofs()).map(|i| T::of(1e-3 * (i as f64 * 0.1).sin())).collect())
        .build()
        .expect("the scene is well posed")
}

/// Bars that vibrate slightly while loads at the far ends press them together (closed), or far apart (open).
fn pressed<T: Real>(
    bars: &Bars,
    scheme: Box<dyn TimeIntegrator>,
    closed: bool,
    correction: bool,
    h: f64,
) -> Simulation<'static, T> {
    let dofs = bars.dofs();
    let [left, right] = bars.contact_dofs();
    let force = 1.0;
    let system: LinearSystem<'static, T> = bars.system();
    let system =
        if closed { system.load(move |_, f| (f[0], f[dofs - 1]) = (T::of(force), T::of(-force))) } else { system };
    // Statically compressed: u falls linearly from the far end to the contact.
    let shortening = force / (bars.young[0] * bars.area) * bars.element_size(0);
    let u = (0..dofs)
        .map(|i| T::of(if i <= left { shortening * (left - i) as f64 } else { -shortening * (i - right) as f64 }))
        .collect();
    let builder = Simulation::builder(system, scheme, h)
        .displacement(if closed { u } else { vec![T::zero(); dofs] })
        .velocity(
            (0..dofs)
                .map(|i| T::of(1e-3 * (i as f64 * 0.1).sin() * f64::from(u8::from(i != left && i != right))))
                .collect(),
        )
        .constraint(
            LinearRows::new()
                .unilateral(&[(left, -T::one()), (right, T::one())], T::of(if closed { 0.0 } else { 1e3 })),
        );
    let builder = match correction {
        true => builder.corrector(PersistencyCorrection::with_history_projection()),
        false => builder.uncorrected(),
    };
    builder.build().expect("the scene is well posed")
}
