//! Cost of a step on a plate of quad4 and blocks of hex8 elements, without contact and with 1, 100 and all candidates
//! pressed, beside the bare solve and the bare K product, in one run.
//!
//! `cargo bench --bench solids -- [elements a side]…` (default blocks of 10 and 20 after the plate of 300 × 300; 30
//! takes four minutes, 40 a quarter of an hour and 8 GB)

use contact_dynamics::{CentralDifference, Cholesky, Composite, LinearRows, Newmark, Real, Simulation, TimeIntegrator};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{self, Arguments, Ratio, Table, Unit};
use example_support::yardsticks;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

const RATIOS: &[Ratio] = &[
    Ratio { heading: "/ bare solve", to: &["bare solve, free"] },
    Ratio { heading: "/ (solve + K)", to: &["bare solve, free", "bare K product"] },
    Ratio { heading: "/ reading twice", to: &["reading the factor twice"] },
    Ratio { heading: "/ its entries", to: &["reading its entries twice"] },
    Ratio { heading: "/ K by rows", to: &["K product by compressed rows"] },
    Ratio { heading: "/ by arrays", to: &["explicit step by arrays"] },
];

fn main() {
    let arguments = Arguments::read(&[10, 20], &[4]);
    let cells = if arguments.quick { 8 } else { 300 };
    let plate = Solid::rectangle([1.0; 2], [cells; 2], MATERIAL);
    scene(&format!("plate of {cells}² quad4"), &plate, cells, &arguments);
    for &n in &arguments.sizes {
        scene(&format!("block of {n}³ hex8"), &Solid::block([1.0; 3], [n; 3], MATERIAL), n, &arguments);
    }
}

fn scene<const D: usize>(name: &str, solid: &Solid<D>, cells: usize, arguments: &Arguments) {
    // Courant number 1.
    let h = 1.0 / cells as f64 / MATERIAL.wave_speed();
    table::<f64, D>(&format!("{name}, {} dofs, f64", solid.dofs()), solid, h, arguments);
    table::<f32, D>(&format!("{name}, {} dofs, f32", solid.dofs()), solid, h, arguments);
}

fn table<T: Real, const D: usize>(name: &str, solid: &Solid<D>, h: f64, arguments: &Arguments) {
    let bottom: Vec<usize> =
        solid.surface_nodes().into_iter().filter(|&node| solid.nodes[node][D - 1] == 0.0).collect();
    let candidates: Vec<usize> = bottom.into_iter().map(|node| Solid::<D>::dof(node, D - 1)).collect();
    let (k, mass) = (solid.stiffness::<T>(), solid.lumped_mass::<T>());
    println!("{name}, {} candidates, Courant number 1", candidates.len());
    let samples = arguments.repeated((200_000 / solid.dofs()).clamp(7, 21));
    // (Operations of small scenes find their memory in the cache in a run as well.)
    let calls = arguments.repeated(100_000 / solid.dofs());

    let mut table = Table::new(Unit::Milli, RATIOS);
    let a = timing::effective(&k, &mass, &Composite, h);
    let factor = timing::factor(&a, &[]);
    let stored = factor.stored_values();
    let millions = |scalars: usize| scalars as f64 / 1e6;
    table.reference(format!("bare solve, free order ({:.1} M)", millions(stored)), timing::solve(factor, solid.dofs()));
    table.reference("bare K product", timing::force(solid.system::<T>()));
    let order = Cholesky::default().order(a.symbolic(), &[]).expect("memory");
    let entries = yardsticks::entries_of_factor(a.symbolic(), &order);
    table.reference("reading the factor twice", yardsticks::reading::<T>(stored));
    table.reference(
        format!("reading its entries twice ({:.1} M)", millions(entries)),
        yardsticks::reading::<T>(entries),
    );
    table.reference("K product by compressed rows", yardsticks::gather(&k));
    table.reference("explicit step by arrays", yardsticks::explicit_by_arrays(&k, &mass, 0.1 * h));
    table.row("central differences", explicit::<T, D>(solid, 0.1 * h));
    let last = timing::factor(&a, &candidates);
    let contact_last = format!("bare solve, contact last ({:.1} M)", millions(last.stored_values()));
    table.row(contact_last, timing::solve(last, solid.dofs()));
    drop(a);
    // Factors of all scenes do not fit into memory: one after the other, beside the bare operations each.
    table.sample(samples, calls);
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] = [|| Box::new(Newmark::trapezoidal()), || Box::new(Composite)];
    for scheme in schemes {
        let all = candidates.len();
        for (contact, pressed) in [
            ("no candidates".to_string(), None),
            ("all open".to_string(), Some(0)),
            ("1 pressed".to_string(), Some(1)),
            ("100 pressed".to_string(), Some(100)),
            (format!("all {all} pressed"), Some(all)),
        ] {
            if pressed.is_some_and(|pressed| pressed > all) {
                continue;
            }
            let mut run = simulation::<T, D>(solid, scheme(), &candidates, h, pressed);
            for _ in 0..5 {
                run.step().expect("a well-posed step");
            }
            let closed = run.state().contacts().closed().iter().filter(|&&closed| closed).count();
            assert_eq!(closed, pressed.unwrap_or(0), "{contact}");
            table.row(format!("{}, {contact}", scheme().name()), move || run.step().expect("a well-posed step"));
            table.sample(samples, calls);
        }
    }
    table.print();
    let rate = 2.0 * (stored * size_of::<T>()) as f64 / table.median("reading the factor twice") / 1e9;
    println!("memory is read at {rate:.1} GB/s\n");
}

/// A step of central differences without contact.
fn explicit<T: Real, const D: usize>(solid: &Solid<D>, h: f64) -> impl FnMut() + use<T, D> {
    let system = solid.system::<T>();
    let mut run = Simulation::builder(system, CentralDifference, h)
        .velocity((0..solid.dofs()).map(|i| T::of(1e-3 * (0.1 * i as f64).sin())).collect())
        .build()
        .expect("a well-posed scene");
    move || run.step().expect("a well-posed step")
}

/// A body that its weight presses on so many nodes of the floor (`None`: without candidates); the others are far above
/// it.
fn simulation<T: Real, const D: usize>(
    solid: &Solid<D>,
    scheme: Box<dyn TimeIntegrator>,
    candidates: &[usize],
    h: f64,
    pressed: Option<usize>,
) -> Simulation<'static, T> {
    let weight: Vec<T> = solid.lumped_mass::<f64>().iter().map(|m| T::of(-1e-3 * m)).collect();
    let loaded = pressed.is_some_and(|pressed| pressed > 0);
    let system = solid.system::<T>();
    // (Without contact the body stays at rest, and no number is subnormal.)
    let system = system.load(move |_, f| {
        if loaded {
            f.iter_mut().zip(&weight).skip(D - 1).step_by(D).for_each(|(f, &w)| *f = w);
        }
    });
    let builder = Simulation::builder(system, scheme, h).uncorrected();
    let builder = match pressed {
        None => builder,
        Some(pressed) => {
            let mut open = vec![T::of(1e3); candidates.len()];
            for k in 0..pressed {
                // Evenly over the face.
                open[(2 * k + 1) * candidates.len() / (2 * pressed)] = T::zero();
            }
            let rows = candidates.iter().zip(open);
            builder
                .constraint(rows.fold(LinearRows::new(), |rows, (&dof, gap)| rows.unilateral(&[(dof, T::one())], gap)))
        }
    };
    builder.build().expect("a well-posed scene")
}
