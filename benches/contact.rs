//! Cost of a step in contact on a block of hex8 elements, beside the bare solve and the step without contact.
//!
//! `cargo bench --bench contact -- [elements a side]…` (default 10 and 20)

use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{
    Automatic, Cholesky, Composite, Factorization, LinearRows, LinearSolver, PersistencyCorrection, Simulation, System,
    TimeIntegrator,
};
use contact_dynamics_scenes::solids::{Material, Solid};
use std::hint::black_box;
use std::time::Instant;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

fn main() {
    let sizes: Vec<usize> = std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
    let sizes = if sizes.is_empty() { vec![10, 20] } else { sizes };
    for n in sizes {
        measure(n);
    }
    plate();
}

/// Ten thousand candidates, five hundred of them pressed: a thick plate on a floor, loaded in the middle.
fn plate() {
    let cells = [100, 100, 4];
    let size = [10.0, 10.0, 0.4];
    let plate = Solid::block(size, cells, MATERIAL);
    let h = 2.0 * size[0] / cells[0] as f64 / MATERIAL.wave_speed();
    let bottom: Vec<usize> = plate.surface_nodes().into_iter().filter(|&node| plate.nodes[node][2] == 0.0).collect();
    let candidates: Vec<usize> = bottom.iter().map(|&node| Solid::<3>::dof(node, 2)).collect();
    // A saucer: only the nodes near the middle touch.
    let gap = |node: usize| {
        let [x, y, _] = plate.nodes[node];
        let square = (x - 5.0).powi(2) + (y - 5.0).powi(2);
        if square < 2.4 { 0.0 } else { 1e-2 * (square - 2.4) }
    };
    let mut rows =
        vec![bare("bare solve, free order", &plate, h, &[]), bare("bare solve, contact last", &plate, h, &candidates)];
    for (name, pressed) in [("step, open", false), ("step, in contact", true)] {
        let contact = bottom.iter().zip(&candidates).fold(LinearRows::new(), |rows, (&node, &dof)| {
            rows.unilateral(&[(dof, 1.0)], if pressed { gap(node) } else { 1e3 })
        });
        let mut run = build(&plate, contact, h, if pressed { -1e-4 } else { 0.0 }, false);
        for _ in 0..10 {
            run.step().expect("a well-posed step");
        }
        let closed = run.state().contacts().closed().iter().filter(|&&closed| closed).count();
        println!("{name}: {closed} of {} candidates closed", candidates.len());
        rows.push(Row {
            name: name.into(),
            run: Box::new(move || run.step().expect("a well-posed step")),
            samples: Vec::new(),
        });
    }
    println!("plate of {cells:?} elements, {} dofs", plate.dofs());
    sample(&mut rows, 9);
}

/// A measured operation: runs once.
struct Row<'a> {
    name: String,
    run: Box<dyn FnMut() + 'a>,
    samples: Vec<f64>,
}

fn measure(n: usize) {
    let block = Solid::block([1.0; 3], [n; 3], MATERIAL);
    let h = 1.0 / n as f64 / MATERIAL.wave_speed();
    let bottom: Vec<usize> = block.surface_nodes().into_iter().filter(|&node| block.nodes[node][2] == 0.0).collect();
    let candidates: Vec<usize> = bottom.iter().map(|&node| Solid::<3>::dof(node, 2)).collect();
    println!("block of {n}³ elements, {} dofs, {} candidates, Courant number 1", block.dofs(), candidates.len());
    let mut rows =
        vec![bare("bare solve, free order", &block, h, &[]), bare("bare solve, contact last", &block, h, &candidates)];
    let stored = Cholesky::default().estimate(effective(&block, h).symbolic(), &[]).expect("memory");
    let product = product(&block);
    for (name, pressed, corrected) in
        [("step, open", false, false), ("step, all closed", true, false), ("step, all closed, corrected", true, true)]
    {
        let mut run = simulation(&block, &candidates, h, pressed, corrected);
        for _ in 0..5 {
            run.step().expect("a well-posed step");
        }
        let closed = run.state().contacts().closed().iter().filter(|&&closed| closed).count();
        assert_eq!(closed, if pressed { candidates.len() } else { 0 });
        rows.push(Row {
            name: name.into(),
            run: Box::new(move || run.step().expect("a well-posed step")),
            samples: Vec::new(),
        });
    }
    rows.push(product);
    rows.push(reading("reading the first factor twice", stored));
    sample(&mut rows, if n > 25 { 5 } else { 15 });
}

/// Reads so many numbers from memory, twice: what a solve would take that does nothing else (upper halves of blocks are
/// stored, and need not be read).
fn reading(name: &str, entries: usize) -> Row<'static> {
    let numbers = vec![1.0_f64; entries];
    let run = move || {
        for _ in 0..2 {
            let mut sums = [0.0; 16];
            for chunk in black_box(&numbers[..]).chunks_exact(16) {
                for (sum, x) in sums.iter_mut().zip(chunk) {
                    *sum += x;
                }
            }
            black_box(sums);
        }
    };
    Row { name: name.into(), run: Box::new(run), samples: Vec::new() }
}

/// One product with K.
fn product(block: &Solid<3>) -> Row<'static> {
    let mut system = block.system::<f64>();
    let (u, v, mut f) = (vec![1.0; block.dofs()], vec![0.0; block.dofs()], vec![0.0; block.dofs()]);
    let run = move || {
        system.force(0.0, black_box(&u), &v, &mut f).expect("linear");
        black_box(&f);
    };
    Row { name: "bare K product".into(), run: Box::new(run), samples: Vec::new() }
}

/// Runs all rows in turn, and prints medians and ratios.
fn sample(rows: &mut [Row<'_>], samples: usize) {
    for sample in 0..=samples {
        for row in &mut *rows {
            let start = Instant::now();
            (row.run)();
            if sample > 0 {
                row.samples.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    println!("{:<32} {:>10} {:>10} {:>14} {:>14}", "", "median ms", "best ms", "/ bare solve", "/ open step");
    let median = |samples: &mut [f64]| {
        samples.sort_by(f64::total_cmp);
        samples[samples.len() / 2]
    };
    let (solve, open) = (median(&mut rows[0].samples), median(&mut rows[2].samples));
    for row in rows {
        let (median, best) = (median(&mut row.samples), row.samples[0]);
        println!("{:<32} {median:>10.3} {best:>10.3} {:>14.2} {:>14.2}", row.name, median / solve, median / open);
    }
    println!();
}

/// The composite scheme's effective matrix.
fn effective(block: &Solid<3>, h: f64) -> SparseColMat<usize, f64> {
    let inertia = Composite.tableau().stages[0].balance.a.z / (h * h);
    let (k, mass) = (block.stiffness::<f64>(), block.lumped_mass::<f64>());
    let mut triplets: Vec<_> = mass.iter().enumerate().map(|(i, m)| Triplet::new(i, i, inertia * m)).collect();
    for j in 0..block.dofs() {
        let k = k.as_ref();
        triplets.extend(k.row_idx_of_col_raw(j).iter().zip(k.val_of_col(j)).map(|(&i, &x)| Triplet::new(i, j, x)));
    }
    SparseColMat::<usize, f64>::try_new_from_triplets(block.dofs(), block.dofs(), &triplets).expect("triplets")
}

/// The solve with that.
fn bare(name: &str, block: &Solid<3>, h: f64, last: &[usize]) -> Row<'static> {
    let a = effective(block, h);
    let mut factor: Box<dyn Factorization<f64>> = Automatic.analyze(a.symbolic(), last).expect("memory");
    factor.factorize(a.as_ref()).expect("positive definite");
    let name = format!("{name} ({:.1} M)", factor.stored_values() as f64 / 1e6);
    let mut x = vec![1.0; block.dofs()];
    let run = move || {
        x.fill(1.0);
        factor.solve(&mut x).expect("a direct solve");
        black_box(&x);
    };
    Row { name, run: Box::new(run), samples: Vec::new() }
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
    let builder = if corrected { builder.corrector(PersistencyCorrection::with_history_projection()) } else { builder };
    builder.build().expect("a well-posed scene")
}
