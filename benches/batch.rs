//! Many small independent runs: a study of two bars that collide, on one thread and on two, and what a run costs to
//! build beside its steps; blocks with an analysis each, and with one for all.
//!
//! `cargo bench --bench batch -- [elements a bar]…` (default 20, 100 and 400: half a minute). Nothing but the standard
//! library's threads: runs are `Send`.

use contact_dynamics::{Automatic, Cholesky, GeneralizedAlpha, LinearRows, LinearSolver, LinearSystem, Simulation};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{Arguments, median};
use std::hint::black_box;
use std::time::Instant;

fn main() {
    let arguments = Arguments::read(&[20, 100, 400], &[20]);
    let runs = arguments.repeated(1000);
    println!("{runs} runs of two bars that collide, each with a gap of its own, built and advanced");
    println!(
        "{:>9} {:>6} {:>7} {:>9} {:>9} {:>7} {:>12} {:>9} {:>14} {:>12}",
        "elements", "dofs", "steps", "1 thread", "2, s", "ratio", "results", "step, µs", "build, µs", "build/step"
    );
    for &elements in &arguments.sizes {
        study(elements, runs, arguments.repeated(5));
    }
    println!();
    println!(
        "{:<15} {:>6} {:>10} {:>12} {:>14} {:>16} {:>15}",
        "block of hex8", "dofs", "step, µs", "build, µs", "build/step", "sharing: build", "build/step"
    );
    for cells in if arguments.quick { vec![3] } else { vec![4, 6, 10] } {
        blocks(cells, arguments.repeated(9));
    }
}

/// Blocks that stand on a floor, built with the default solver and with one that shares its analyses.
fn blocks(cells: usize, samples: usize) {
    let material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
    let block = Solid::block([1.0; 3], [cells; 3], material);
    let h = 1.0 / cells as f64 / material.wave_speed();
    let floor: Vec<usize> = block.surface_nodes().into_iter().filter(|&node| block.nodes[node][2] == 0.0).collect();
    let build = |system: LinearSystem<'static, f64>, solver: Box<dyn LinearSolver<f64>>| {
        let rows = floor.iter().fold(LinearRows::new(), |rows, &node| rows.unilateral(&[(3 * node + 2, 1.0)], 1e-3));
        Simulation::builder(system, GeneralizedAlpha::chung_hulbert(0.8).expect("a radius"), h)
            .velocity(block.uniform([0.0, 0.0, -1e-3]))
            .constraint(rows)
            .linear_solver(solver)
            .build()
            .expect("the scene is well posed")
    };
    let shared = Cholesky::default().sharing();
    let mut times = [Vec::new(), Vec::new()];
    for sample in 0..=samples {
        let solvers: [Box<dyn LinearSolver<f64>>; 2] = [Box::new(Automatic), Box::new(shared.clone())];
        for (times, solver) in times.iter_mut().zip(solvers) {
            let system = block.system();
            let start = Instant::now();
            black_box(build(system, solver));
            // The first one analyzes.
            if sample > 0 {
                times.push(start.elapsed().as_secs_f64());
            }
        }
    }
    let mut run = build(block.system(), Box::new(Automatic));
    let steps = 100;
    let start = Instant::now();
    (0..steps).for_each(|_| run.step().expect("a well-posed step"));
    let step = start.elapsed().as_secs_f64() / f64::from(steps);
    let [alone, shared] = times.map(|times| median(&times));
    println!(
        "{:<15} {:>6} {:>10.1} {:>12.0} {:>14.1} {:>16.0} {:>15.1}",
        format!("{cells}³"),
        block.dofs(),
        step * 1e6,
        alone * 1e6,
        alone / step,
        shared * 1e6,
        shared / step
    );
}

/// One run of a study.
struct Study {
    bars: Bars,
    steps: usize,
    h: f64,
}

impl Study {
    fn system(&self) -> LinearSystem<'static, f64> {
        self.bars.system()
    }

    fn build(&self, system: LinearSystem<'static, f64>, gap: f64) -> Simulation<'static, f64> {
        let [left, right] = self.bars.contact_dofs();
        Simulation::builder(system, GeneralizedAlpha::chung_hulbert(0.8).expect("a radius"), self.h)
            .velocity((0..self.bars.dofs()).map(|i| if i <= left { 0.1 } else { 0.0 }).collect())
            .constraint(LinearRows::new().unilateral(&[(left, -1.0), (right, 1.0)], gap))
            .build()
            .expect("the scene is well posed")
    }

    /// The last displacements of some runs, summed with weights that tell them apart.
    fn results(&self, runs: std::ops::Range<usize>) -> Vec<f64> {
        let one = |run: usize| {
            let mut simulation = self.build(self.system(), 1e-4 * (1 + run) as f64);
            (0..self.steps).for_each(|_| simulation.step().expect("a well-posed step"));
            simulation.state().displacement().iter().enumerate().map(|(i, u)| (1 + i) as f64 * u).sum()
        };
        runs.map(one).collect()
    }
}

fn study(elements: usize, runs: usize, samples: usize) {
    let bars = Bars::paper(elements);
    let h = bars.element_size(0) / 100.0;
    // Until the waves have run through both bars.
    let study = Study { steps: 4 * elements, h, bars };
    let seconds = |work: &mut dyn FnMut()| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64()
    };
    let (mut alone, mut shared) = (Vec::new(), Vec::new());
    let [mut one, mut two] = [Vec::new(), Vec::new()];
    for _ in 0..samples {
        alone.push(seconds(&mut || one = study.results(0..runs)));
        shared.push(seconds(&mut || {
            two = std::thread::scope(|scope| {
                let second = scope.spawn(|| study.results(runs / 2..runs));
                let mut all = study.results(0..runs / 2);
                all.extend(second.join().expect("no panic"));
                all
            });
        }));
    }
    let same = if one.iter().zip(&two).all(|(x, y)| x.to_bits() == y.to_bits()) { "same bits" } else { "DIFFERENT" };
    let [alone, shared] = [median(&alone), median(&shared)];

    // Without the assembly of K, which is the host's, and one after the other, as a study builds them.
    let builds: Vec<f64> = (0..runs.min(500))
        .map(|_| {
            let mut system = Some(study.system());
            seconds(&mut || drop(black_box(system.take().map(|system| study.build(system, 1e-3)))))
        })
        .collect();
    let build = median(&builds);
    let mut simulation = study.build(study.system(), 1e-3);
    let steps = 20_000_u32;
    let step =
        seconds(&mut || (0..steps).for_each(|_| simulation.step().expect("a well-posed step"))) / f64::from(steps);
    println!(
        "{elements:>9} {:>6} {:>7} {alone:>9.3} {shared:>9.3} {:>7.2} {same:>12} {:>9.2} {:>14.1} {:>12.1}",
        study.bars.dofs(),
        study.steps,
        alone / shared,
        step * 1e6,
        build * 1e6,
        build / step
    );
}
