//! What elimination orders cost and save: fill, analysis, factorization and solve, with and without a face in contact.
//!
//! `cargo bench --bench ordering -- [elements a side]…` (default 10 and 20; 30 takes minutes)

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::linear_solver::Ordering;
use contact_dynamics::{Cholesky, Composite, Factorization, LinearSolver};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{self, Arguments};
use std::hint::black_box;
use std::time::Instant;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

fn main() {
    let arguments = Arguments::read(&[10, 20], &[4]);
    for &n in &arguments.sizes {
        let block = Solid::block([1.0; 3], [n; 3], MATERIAL);
        let samples = arguments.repeated(if n > 25 { 3 } else { 9 });
        measure(&format!("block of {n}³ hex8"), &block, 1.0 / n as f64, samples);
    }
    if arguments.quick {
        return;
    }
    let ball = Solid::quarter_ball(1.0, [12, 12, 20], 0.02, MATERIAL);
    measure("quarter of a ball, 12 × 12 × 20 hex8", &ball, 0.02, 9);
    let plate = Solid::block([10.0, 10.0, 0.4], [60, 60, 3], MATERIAL);
    measure("thick plate, 60 × 60 × 3 hex8", &plate, 0.1, 5);
    let beam = Solid::block([1.0, 1.0, 100.0], [3, 3, 300], MATERIAL);
    measure("slender beam, 3 × 3 × 300 hex8", &beam, 0.33, 9);
    measure("plate of 300² quad4", &Solid::rectangle([1.0; 2], [300; 2], MATERIAL), 1.0 / 300.0, 5);
    measure("disc of 100² quad4", &Solid::disc(1.0, 100, MATERIAL), 0.02, 9);
}

/// All orders, free and with the lowest nodes last, with the composite scheme's matrix at Courant number one.
fn measure<const D: usize>(name: &str, solid: &Solid<D>, size: f64, samples: usize) {
    let h = size / MATERIAL.wave_speed();
    let a = timing::effective(&solid.stiffness::<f64>(), &solid.lumped_mass(), &Composite, h);
    let places: Vec<[f64; 3]> = solid
        .nodes
        .iter()
        .flat_map(|node| (0..D).map(|_| std::array::from_fn(|axis| if axis < D { node[axis] } else { 0.0 })))
        .collect();
    let height = |node: &usize| solid.nodes[*node][D - 1];
    let surface = solid.surface_nodes();
    let [low, high] = [f64::min, f64::max].map(|fold| surface.iter().map(height).reduce(fold).expect("nodes"));
    let lowest = surface.into_iter().filter(|node| height(node) <= low + 0.02 * (high - low));
    let contact: Vec<usize> = lowest.map(|node| Solid::<D>::dof(node, D - 1)).collect();
    println!("{name}: {} dofs", solid.dofs());
    for last in [&[][..], &contact] {
        println!(
            "{:<28} {:>9} {:>12} {:>12} {:>10}    minimum degree / this: fill, factor, solve",
            format!("{} dofs last", last.len()),
            "scalars M",
            "analysis ms",
            "factor ms",
            "solve ms"
        );
        let orders = [
            ("minimum degree", Ordering::MinimumDegree),
            ("nested dissection", Ordering::NestedDissection),
            ("by coordinates", Ordering::Coordinates(places.clone())),
            ("automatic", Ordering::Automatic),
        ];
        let mut rows: Vec<_> = orders.into_iter().map(|(name, order)| Row::new(name, order, &a, last)).collect();
        for sample in 0..=samples {
            for row in &mut rows {
                row.sample(&a, sample > 0);
            }
        }
        let figures: Vec<[f64; 4]> = rows.iter().map(Row::figures).collect();
        for (row, [fill, analysis, factor, solve]) in rows.iter().zip(&figures) {
            let [first, _, first_factor, first_solve] = figures[0];
            println!(
                "{:<28} {fill:>9.3} {analysis:>12.1} {factor:>12.1} {solve:>10.3}    {:.2}  {:.2}  {:.2}",
                row.name,
                first / fill,
                first_factor / factor,
                first_solve / solve,
            );
        }
    }
    println!();
}

/// An order with its measured times.
struct Row {
    name: &'static str,
    factor: Box<dyn Factorization<f64>>,
    x: Vec<f64>,
    /// Analysis, factorization, solve.
    times: [Vec<f64>; 3],
}

impl Row {
    fn new(name: &'static str, order: Ordering, a: &SparseColMat<usize, f64>, last: &[usize]) -> Self {
        let solver = Cholesky::ordered(order);
        let analyses = (0..3).map(|_| time(|| solver.estimate(a.symbolic(), last).expect("memory")));
        let analyses = analyses.collect();
        let factor = solver.analyze(a.symbolic(), last).expect("memory");
        Self { name, factor, x: vec![1.0; a.nrows()], times: [analyses, Vec::new(), Vec::new()] }
    }

    fn sample(&mut self, a: &SparseColMat<usize, f64>, counts: bool) {
        let factor = time(|| self.factor.factorize(a.as_ref()).expect("positive definite"));
        let solve = time(|| {
            self.x.fill(1.0);
            self.factor.solve(&mut self.x).expect("a direct solve");
            black_box(&self.x);
        });
        if counts {
            self.times[1].push(factor);
            self.times[2].push(solve);
        }
    }

    /// Scalars of the factor in millions, medians of the times.
    fn figures(&self) -> [f64; 4] {
        let [analysis, factor, solve] = self.times.each_ref().map(|samples| timing::median(samples));
        [self.factor.stored_values() as f64 / 1e6, analysis, factor, solve]
    }
}

/// Milliseconds.
fn time<R>(run: impl FnOnce() -> R) -> f64 {
    let start = Instant::now();
    black_box(run());
    start.elapsed().as_secs_f64() * 1e3
}
