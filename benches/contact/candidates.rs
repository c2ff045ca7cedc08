//! A million candidates, of which ten thousand press, in explicit steps of a membrane of three million dofs: what it
//! takes to build, and a step beside the same one without contact.

use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{CentralDifference, LinearRows, LinearSystem, Simulation};
use example_support::timing::{Arguments, Ratio, Table, Unit};
use std::time::Instant;

const RATIOS: &[Ratio] = &[Ratio { heading: "/ without contact", to: &["step without contact"] }];

/// Time step: a fifth of the critical one.
const H: f64 = 0.1;

pub(crate) fn measure(arguments: &Arguments) {
    let side = if arguments.quick { 40 } else { 1000 };
    let pressed = if arguments.quick { 10 } else { 100 };
    let (nodes, dofs) = (side * side, 3 * side * side);
    let start = Instant::now();
    let stiffness = membrane(side);
    println!("membrane of {side}² nodes, {dofs} dofs; K in {:.1} s", start.elapsed().as_secs_f64());
    let system = || {
        let load = |_: f64, f: &mut [f64]| f.iter_mut().skip(2).step_by(3).for_each(|f| *f = -1e-3);
        LinearSystem::lumped(vec![1.0; dofs], stiffness.clone()).expect("matrices of one size").load(load)
    };
    let mut free = Simulation::builder(system(), CentralDifference, H).build().expect("a well-posed scene");
    // A patch in the middle lies on the floor, and all the rest of the membrane over a pit.
    let first = (side - pressed) / 2;
    let lies = |node: usize| {
        let inside = |k: usize| (first..first + pressed).contains(&k);
        inside(node % side) && inside(node / side)
    };
    let rows = (0..nodes).fold(LinearRows::new(), |rows, node| {
        rows.unilateral(&[(3 * node + 2, 1.0)], if lies(node) { 0.0 } else { 1e3 })
    });
    let start = Instant::now();
    let mut run =
        Simulation::builder(system(), CentralDifference, H).constraint(rows).build().expect("a well-posed scene");
    println!("{nodes} candidates: built in {:.1} s", start.elapsed().as_secs_f64());
    for _ in 0..3 {
        free.step().expect("a well-posed step");
        run.step().expect("a well-posed step");
    }
    let closed = run.state().contacts().closed().iter().filter(|&&closed| closed).count();
    let mut table = Table::new(Unit::Milli, RATIOS);
    table.row("step without contact", move || free.step().expect("a well-posed step"));
    table.row(format!("step with {closed} contacts closed"), move || run.step().expect("a well-posed step"));
    table.sample(arguments.repeated(7), 1);
    table.print();
    println!("{}\n", resident());
}

/// Springs between neighbors on a square grid, the same in the three directions; all nodes are held by weak ones.
fn membrane(side: usize) -> SparseColMat<usize, f64> {
    let mut entries = Vec::with_capacity(15 * side * side);
    for node in 0..side * side {
        let (i, j) = (node % side, node / side);
        let neighbors = [
            (i > 0).then(|| node - 1),
            (i + 1 < side).then(|| node + 1),
            (j > 0).then(|| node - side),
            (j + 1 < side).then(|| node + side),
        ];
        let count = neighbors.iter().flatten().count() as f64;
        for axis in 0..3 {
            let dof = 3 * node + axis;
            entries.push(Triplet::new(dof, dof, count + 1e-3));
            entries.extend(neighbors.iter().flatten().map(|other| Triplet::new(dof, 3 * other + axis, -1.0)));
        }
    }
    SparseColMat::try_new_from_triplets(3 * side * side, 3 * side * side, &entries).expect("entries within the matrix")
}

/// The largest resident size so far, where the system tells.
fn resident() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    peak.map_or_else(String::new, |peak| format!("peak resident size {}", peak.trim()))
}
