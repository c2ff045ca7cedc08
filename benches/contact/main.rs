//! Cost of a step in contact on a block of hex8 elements beside the bare solve and the step without contact, and of the
//! work on the interface alone: condensation, responses, the contact solver.
//!
//! `cargo bench --bench contact -- [elements a side]…` (default 10 and 20) takes over ten minutes for all of it; a part
//! alone is asked for by name: `-- blocks` for the above and a plate with ten thousand candidates, `-- pressed` for
//! steps with few and many pressed contacts, `-- impact` for steps in which hundreds change, `-- nonlinear` for
//! iterations with contact, `-- surfaces` for meshes that do not match, `-- search` for a hundred thousand facets, `--
//! candidates` for a million candidates.

mod candidates;
mod impact;
mod nonlinear;
mod pressed;
mod search;
mod surfaces;

use contact_dynamics::contact_solver::{ActiveSet, AdmissibleSet, ContactProblem, ContactSolver};
use contact_dynamics::{Composite, Factorization, LinearRows, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{self, Arguments, Ratio, Table, Unit};
use example_support::yardsticks;
use std::cell::RefCell;
use std::hint::black_box;
use std::rc::Rc;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

const RATIOS: &[Ratio] = &[
    Ratio { heading: "/ bare solve", to: &["bare solve, free"] },
    Ratio { heading: "/ open step", to: &["step, open"] },
];

const INTERFACE: &[Ratio] = &[Ratio { heading: "/ bare solve", to: &["bare solve"] }];

/// A part of the bench that can be asked for by name.
type Part = (&'static str, fn(&Arguments));

fn main() {
    let arguments = Arguments::read(&[10, 20], &[4]);
    let parts: [Part; 7] = [
        ("blocks", blocks),
        ("pressed", pressed::measure),
        ("impact", impact::measure),
        ("nonlinear", nonlinear::measure),
        ("surfaces", surfaces::measure),
        ("search", search::measure),
        ("candidates", candidates::measure),
    ];
    let asked = |word: &str| std::env::args().any(|argument| argument == word);
    let alone = parts.iter().any(|(word, _)| asked(word));
    for (word, measure) in parts {
        if asked(word) || !alone {
            measure(&arguments);
        }
    }
}

/// Blocks with their whole bottom pressed, the work on the interface alone, and the plate.
fn blocks(arguments: &Arguments) {
    for &n in &arguments.sizes {
        measure(n, arguments);
    }
    plate(arguments);
}

/// Ten thousand candidates, five hundred of them pressed: a thick plate on a floor, loaded in the middle.
fn plate(arguments: &Arguments) {
    let cells = if arguments.quick { [10, 10, 1] } else { [100, 100, 4] };
    let size = [10.0, 10.0, 0.4];
    let plate = Solid::block(size, cells, MATERIAL);
    let h = 2.0 * size[0] / cells[0] as f64 / MATERIAL.wave_speed();
    let (bottom, candidates) = lowest(&plate);
    // A saucer: only the nodes near the middle touch.
    let gap = |node: usize| {
        let [x, y, _] = plate.nodes[node];
        let square = (x - 5.0).powi(2) + (y - 5.0).powi(2);
        if square < 2.4 { 0.0 } else { 1e-2 * (square - 2.4) }
    };
    let mut table = Table::new(Unit::Milli, RATIOS);
    bare(&mut table, &plate, &candidates, h);
    for (name, pressed) in [("step, open", false), ("step, in contact", true)] {
        let contact = bottom.iter().zip(&candidates).fold(LinearRows::new(), |rows, (&node, &dof)| {
            rows.unilateral(&[(dof, 1.0)], if pressed { gap(node) } else { 1e3 })
        });
        let mut run = build(&plate, contact, h, if pressed { -1e-4 } else { 0.0 }, false);
        for _ in 0..10 {
            run.step().expect("a well-posed step");
        }
        println!("{name}: {} of {} candidates closed", closed(&run), candidates.len());
        table.row(name, move || run.step().expect("a well-posed step"));
    }
    println!("plate of {cells:?} elements, {} dofs", plate.dofs());
    table.sample(arguments.repeated(9), 1);
    table.print();
    println!();
}

/// The nodes at the bottom and their vertical dofs.
fn lowest(solid: &Solid<3>) -> (Vec<usize>, Vec<usize>) {
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0).collect();
    let dofs = bottom.iter().map(|&node| Solid::<3>::dof(node, 2)).collect();
    (bottom, dofs)
}

fn closed(run: &Simulation<'_, f64>) -> usize {
    run.state().contacts().closed().iter().filter(|&&closed| closed).count()
}

/// Adds the solves with the composite scheme's effective matrix; returns the number of scalars in the first factor, and
/// the second one once more.
fn bare(table: &mut Table<'_>, solid: &Solid<3>, last: &[usize], h: f64) -> (usize, Box<dyn Factorization<f64>>) {
    let a = timing::effective(&solid.stiffness::<f64>(), &solid.lumped_mass(), &Composite, h);
    let [free, behind] = [&[][..], last].map(|last| timing::factor(&a, last));
    let stored = free.stored_values();
    for (name, factor) in [("bare solve, free order", free), ("bare solve, contact last", behind)] {
        let name = format!("{name} ({:.1} M)", factor.stored_values() as f64 / 1e6);
        table.row(name, timing::solve(factor, solid.dofs()));
    }
    (stored, timing::factor(&a, last))
}

fn measure(n: usize, arguments: &Arguments) {
    let block = Solid::block([1.0; 3], [n; 3], MATERIAL);
    let h = 1.0 / n as f64 / MATERIAL.wave_speed();
    let (_, candidates) = lowest(&block);
    println!("block of {n}³ elements, {} dofs, {} candidates, Courant number 1", block.dofs(), candidates.len());
    let mut table = Table::new(Unit::Milli, RATIOS);
    let (stored, factor) = bare(&mut table, &block, &candidates, h);
    for (name, pressed, corrected) in
        [("step, open", false, false), ("step, all closed", true, false), ("step, all closed, corrected", true, true)]
    {
        let mut run = simulation(&block, &candidates, h, pressed, corrected);
        for _ in 0..5 {
            run.step().expect("a well-posed step");
        }
        assert_eq!(closed(&run), if pressed { candidates.len() } else { 0 });
        table.row(name, move || run.step().expect("a well-posed step"));
    }
    table.row("bare K product", timing::force(block.system::<f64>()));
    table.row("reading the first factor twice", yardsticks::reading::<f64>(stored));
    // Operations of small scenes find their memory in the cache in a run as well.
    let [samples, calls] = [if n > 25 { 5 } else { 15 }, 100_000 / block.dofs()].map(|times| arguments.repeated(times));
    table.sample(samples, calls);
    table.print();
    interface(factor, block.dofs(), candidates.len(), [samples, calls]);
    println!();
}

/// The work of contact alone, with a factor that eliminates so many candidates last and all of them pressed.
fn interface(mut factor: Box<dyn Factorization<f64>>, dofs: usize, candidates: usize, [samples, calls]: [usize; 2]) {
    println!("the interface alone, contact last");
    let unit = |row: usize| (0..candidates).map(move |k| f64::from(u8::from(k == row)));
    let all: Vec<f64> = (0..candidates).flat_map(unit).collect();
    let mut w = all.clone();
    factor.condensation().expect("Cholesky condenses").solve(&mut w).expect("a factor");
    let factor = Rc::new(RefCell::new(factor));
    let mut table = Table::new(Unit::Milli, INTERFACE);
    let (mut x, ends) = (vec![1.0; dofs], Rc::new(RefCell::new(vec![0.0; candidates])));
    let own = Rc::clone(&factor);
    table.reference("bare solve", {
        move || {
            x.fill(1.0);
            own.borrow_mut().solve(&mut x).expect("a direct solve");
            black_box(&x);
        }
    });
    let (own, out, rhs) = (Rc::clone(&factor), Rc::clone(&ends), vec![1.0; dofs]);
    table.row("condense", move || {
        let mut factor = own.borrow_mut();
        factor
            .condensation()
            .expect("Cholesky condenses")
            .condense(black_box(&rhs), &mut out.borrow_mut())
            .expect("a direct solve");
    });
    let (own, mut solution) = (Rc::clone(&factor), vec![0.0; dofs]);
    table.row("expand", move || {
        let mut factor = own.borrow_mut();
        factor.condensation().expect("Cholesky condenses").expand(&ends.borrow(), &mut solution).expect("a factor");
        black_box(&solution);
    });
    for columns in [1, 16, candidates] {
        let (own, forces) = (Rc::clone(&factor), all[..columns.min(candidates) * candidates].to_vec());
        let mut work = forces.clone();
        table.row(format!("responses to {columns} contacts"), move || {
            work.copy_from_slice(&forces);
            own.borrow_mut().condensation().expect("Cholesky condenses").solve(&mut work).expect("a factor");
            black_box(&work);
        });
    }
    // One step's approach everywhere: all press. First with nothing known of W, then as in the steps after.
    let w = Rc::new(w);
    for (name, known) in [("contact solver, first time", false), ("contact solver, nothing changed", true)] {
        let (w, mut solver) = (Rc::clone(&w), ActiveSet::default());
        let (offset, sets) = (vec![-1.0; candidates], vec![AdmissibleSet::NonNegative; candidates]);
        let (tolerance, mut multipliers) = (vec![1e-14; candidates], vec![0.0; candidates]);
        table.row(format!("{name}, {candidates} rows"), move || {
            if !known {
                multipliers.fill(0.0);
            }
            let problem = ContactProblem::new(&w, &offset, &sets, &tolerance).unwrap().with_version(u64::from(known));
            solver.solve(&problem, &mut multipliers).expect("a definite operator");
            black_box(&multipliers);
        });
    }
    table.sample(samples, calls);
    table.print();
}

/// The block on a floor, pressed on it by its weight, or high above it.
fn simulation(
    block: &Solid<3>,
    candidates: &[usize],
    h: f64,
    pressed: bool,
    corrected: bool,
) -> Simulation<'static, f64> {
    let gap = if pressed { 0.0 } else { 1e3 };
    let contact = candidates.iter().fold(LinearRows::new(), |rows, &dof| rows.unilateral(&[(dof, 1.0)], gap));
    build(block, contact, h, if pressed { -1e-3 } else { 0.0 }, corrected)
}

/// A body under gravity in contact.
fn build(
    body: &Solid<3>,
    contact: LinearRows<'static, f64>,
    h: f64,
    gravity: f64,
    corrected: bool,
) -> Simulation<'static, f64> {
    let mass = body.lumped_mass::<f64>();
    let system = body.system::<f64>().load(move |_, f| {
        for (f, m) in f.iter_mut().zip(&mass).skip(2).step_by(3) {
            *f = gravity * m;
        }
    });
    let builder = Simulation::builder(system, Composite, h).constraint(contact);
    let builder = if corrected {
        builder.corrector(PersistencyCorrection::with_history_projection())
    } else {
        builder.uncorrected()
    };
    builder.build().expect("a well-posed scene")
}
