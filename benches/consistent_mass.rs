//! What a consistent mass costs beside a lumped one: time to build a run, memory, and steps in contact.
//!
//! `cargo bench --bench consistent_mass -- [elements a side]…` (default 10 and 20). A block falls onto the floor with
//! 1, some, or all nodes of its face, composite scheme with its default correction at Courant number 1. The host's own
//! matrices are counted on both sides: a consistent M with them, or without.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{Composite, LinearRows, LinearSystem, Simulation};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{Arguments, median};
use std::time::Instant;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// Steps before the first contact, and those in contact that are timed.
const FREE: usize = 4;
const PRESSED: usize = 12;

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Lumped,
    Consistent,
}

/// What one run took.
struct Cost {
    build: f64,
    /// Bytes, without the host's matrices, after the build and after contact.
    held: [u64; 2],
    free: f64,
    first: f64,
    pressed: f64,
}

fn main() {
    let arguments = Arguments::read(&[10, 20], &[4]);
    for &n in &arguments.sizes {
        let block = Solid::block([1.0; 3], [n; 3], MATERIAL);
        let (k, m) = (block.stiffness::<f64>(), block.consistent_mass());
        let bytes = |a: &SparseColMat<usize, f64>| (16 * a.val().len() + 8 * a.ncols()) as u64;
        let (host, own) = (bytes(&k) + 8 * block.dofs() as u64, bytes(&m));
        let face: Vec<usize> = (0..block.nodes.len()).filter(|&node| block.nodes[node][2] == 0.0).collect();
        let dofs = block.dofs();
        println!(
            "block of {n}³ hex8, {dofs} dofs; K and a lumped M {:.1} MB, a consistent M {:.1} MB",
            mega(host),
            mega(own)
        );
        println!(
            "{:<22} {:>9} {:>10} {:>12} {:>10} {:>16} {:>14}",
            "", "build s", "held MB", "in contact MB", "free ms", "first contact ms", "in contact ms"
        );
        for pressed in [1, 20, 100, face.len()].into_iter().filter(|&count| count <= face.len()) {
            let chosen: Vec<usize> = (0..pressed).map(|k| face[(2 * k + 1) * face.len() / (2 * pressed)]).collect();
            let mut best: [Option<Cost>; 2] = [None, None];
            for _ in 0..arguments.repeated(3) {
                for (best, kind) in best.iter_mut().zip([Kind::Lumped, Kind::Consistent]) {
                    let new = measure(&block, (&k, &m), kind, n, &chosen);
                    *best = Some(match best.take() {
                        Some(old) => old.least(&new),
                        None => new,
                    });
                }
            }
            for (cost, kind) in best.iter().flatten().zip(["lumped", "consistent"]) {
                let name = format!("{kind}, {pressed} pressed");
                let [held, contact] = cost.held.map(|held| mega(held + host));
                let times = [cost.free, cost.first, cost.pressed].map(|seconds| seconds * 1e3);
                let [free, first, pressed] = times;
                println!(
                    "{name:<22} {:>9.3} {held:>10.1} {contact:>12.1} {free:>10.2} {first:>16.1} {pressed:>14.2}",
                    cost.build
                );
            }
            if let [Some(lumped), Some(consistent)] = &best {
                let with = |held: u64, m: u64| (held + host + m) as f64;
                let ratio = |k: usize, m: [u64; 2]| with(consistent.held[k], m[0]) / with(lumped.held[k], m[1]);
                println!(
                    "{:<22} {:>9.2} {:>10.2} {:>12.2} {:>10.2} {:>16.2} {:>14.2}   (M on one side: {:.2})",
                    "  ratio, M on both",
                    consistent.build / lumped.build,
                    ratio(0, [own, own]),
                    ratio(1, [own, own]),
                    consistent.free / lumped.free,
                    consistent.first / lumped.first,
                    consistent.pressed / lumped.pressed,
                    ratio(0, [own, 0]),
                );
            }
        }
        println!();
    }
}

fn measure(
    block: &Solid<3>,
    (k, m): (&SparseColMat<usize, f64>, &SparseColMat<usize, f64>),
    kind: Kind,
    n: usize,
    face: &[usize],
) -> Cost {
    let h = 1.0 / n as f64 / MATERIAL.wave_speed();
    let system = match kind {
        Kind::Lumped => LinearSystem::lumped(block.lumped_mass(), k.clone()),
        Kind::Consistent => LinearSystem::new(m.clone(), k.clone()),
    };
    let system = system.expect("matrices of one size");
    let gap = 1e-3 * h * (FREE as f64 + 0.5);
    let floor =
        face.iter().fold(LinearRows::new(), |rows, &node| rows.unilateral(&[(Solid::<3>::dof(node, 2), 1.0)], gap));
    let velocity = block.uniform([0.0, 0.0, -1e-3]);
    let (mut made, mut build) = (None, 0.0);
    let built = allocation_counter::measure(|| {
        let start = Instant::now();
        let builder = Simulation::builder(system, Composite, h).velocity(velocity).constraint(floor);
        made = Some(builder.build().expect("a well-posed scene"));
        build = start.elapsed().as_secs_f64();
    });
    let mut run = made.expect("built");
    let mut free = Vec::new();
    let step = |run: &mut Simulation<'static, f64>| {
        let start = Instant::now();
        run.step().expect("a well-posed step");
        start.elapsed().as_secs_f64()
    };
    let mut first = 0.0;
    let mut times = Vec::new();
    let stepped = allocation_counter::measure(|| {
        free.extend((0..FREE).map(|_| step(&mut run)));
        first = step(&mut run);
        times.extend((0..PRESSED).map(|_| step(&mut run)));
    });
    let closed = run.state().contacts().closed().iter().filter(|&&closed| closed).count();
    assert!(closed > 0, "the block has left the floor");
    let held = |bytes: i64| u64::try_from(bytes).unwrap_or(0);
    Cost {
        build,
        held: [held(built.bytes_current), held(built.bytes_current + stepped.bytes_current)],
        free: median(&free),
        first,
        pressed: median(&times),
    }
}

impl Cost {
    /// The smaller of the times; memory is the same in each run.
    fn least(self, other: &Self) -> Self {
        Self {
            build: self.build.min(other.build),
            held: self.held,
            free: self.free.min(other.free),
            first: self.first.min(other.first),
            pressed: self.pressed.min(other.pressed),
        }
    }
}

fn mega(bytes: u64) -> f64 {
    bytes as f64 * 1e-6
}
