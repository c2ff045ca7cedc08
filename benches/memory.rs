//! Memory that a simulation takes, relative to what it cannot do without: one factor, and the matrices as the host gave
//! them.
//!
//! `cargo bench --bench memory -- [elements a side]…` (default 10, 20 and 30). Counted are the bytes asked for, not
//! pages touched; a vector that grows counts twice while it does.

use contact_dynamics::{
    Automatic, CentralDifference, Composite, Factorization, LinearRows, LinearSolver, LinearSystem, Newmark, Real,
    Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{self, Arguments};

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// Steps whose allocations are counted, after as many that may still start up.
const STEPS: usize = 5;

fn main() {
    let arguments = Arguments::read(&[10, 20, 30], &[4]);
    for &n in &arguments.sizes {
        let block = Solid::block([1.0; 3], [n; 3], MATERIAL);
        table::<f64>("f64", &block, n);
        table::<f32>("f32", &block, n);
    }
}

fn table<T: Real>(scalar: &str, block: &Solid<3>, n: usize) {
    let h = 1.0 / n as f64 / MATERIAL.wave_speed();
    let dofs = block.dofs();
    let bottom = (0..block.nodes.len()).filter(|&node| block.nodes[node][2] == 0.0);
    let face: Vec<usize> = bottom.map(|node| Solid::<3>::dof(node, 2)).collect();
    let (k, mass) = (block.stiffness::<T>(), block.lumped_mass::<T>());
    let host = (dofs + 1 + k.row_idx().len()) * size_of::<usize>() + (k.val().len() + dofs) * size_of::<T>();
    println!("block of {n}³ hex8, {dofs} dofs, {} candidates, {scalar}; K and M {:.1} MB", face.len(), mega(host));
    println!(
        "{:<38} {:>9} {:>9} {:>9} {:>16} {:>16} {:>12}",
        "", "factor MB", "peak MB", "held MB", "peak / (f + K,M)", "held / (f + K,M)", "allocations"
    );
    let a = timing::effective(&k, &mass, &Composite, h);
    for (name, last) in [("analysis and factor alone, free order", &[][..]), ("the same, contact last", &face)] {
        let mut made = None;
        let counted = allocation_counter::measure(|| {
            let mut factor: Box<dyn Factorization<T>> = Automatic.analyze(a.symbolic(), last).expect("memory");
            factor.factorize(a.as_ref()).expect("positive definite");
            made = Some(factor);
        });
        let factor = made.map_or(0, |factor| factor.stored_values() * size_of::<T>());
        let [peak, held] = [counted.bytes_max, bytes(counted.bytes_current)].map(|own| own + host as u64);
        print_row(name, factor, host, [peak, held], None);
    }
    drop(a);
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 3] =
        [|| Box::new(Newmark::trapezoidal()), || Box::new(Composite), || Box::new(CentralDifference)];
    for scheme in schemes {
        for candidates in [&[][..], &face] {
            let system = LinearSystem::lumped(mass.clone(), k.clone()).expect("matrices of one size");
            simulation(scheme(), system, host, candidates, 0.3 * h);
        }
    }
    println!();
}

/// A body that falls onto the floor with its whole face.
fn simulation<T: Real>(
    scheme: Box<dyn TimeIntegrator>,
    system: LinearSystem<'static, T>,
    host: usize,
    candidates: &[usize],
    h: f64,
) {
    let contact = if candidates.is_empty() { "free" } else { "face on the floor" };
    let name = format!("{}, {contact}", scheme.name());
    let dofs = contact_dynamics::System::dofs(&system);
    let velocity = (0..dofs).map(|dof| T::of(if dof % 3 == 2 { -1e-3 } else { 0.0 })).collect();
    let rows = candidates
        .iter()
        .fold(LinearRows::new(), |rows, &dof| rows.unilateral(&[(dof, T::one())], T::of(1e-3 * h * 1.5)));
    let mut made = None;
    let built = allocation_counter::measure(|| {
        let builder = Simulation::builder(system, scheme, h).velocity(velocity).uncorrected();
        let builder = if candidates.is_empty() { builder } else { builder.constraint(rows) };
        made = Some(builder.build().expect("a well-posed scene"));
    });
    let Some(mut run) = made else { return };
    let factor = run.factor_size() * size_of::<T>();
    let advance = |run: &mut Simulation<'static, T>| {
        allocation_counter::measure(|| (0..STEPS).for_each(|_| run.step().expect("a well-posed step")))
    };
    let (started, steps) = (advance(&mut run), advance(&mut run));
    let now = bytes(built.bytes_current);
    // The host's matrices were there before.
    let peak = built.bytes_max.max(now + started.bytes_max) + host as u64;
    let held = now.saturating_add_signed(started.bytes_current + steps.bytes_current) + host as u64;
    print_row(&name, factor, host, [peak, held], Some(steps.count_total));
}

fn print_row(name: &str, factor: usize, host: usize, [peak, held]: [u64; 2], allocations: Option<u64>) {
    let [peak, held, least] = [peak as f64, held as f64, (factor + host) as f64];
    let allocations = allocations.map_or(String::new(), |count| count.to_string());
    println!(
        "{name:<38} {:>9.1} {:>9.1} {:>9.1} {:>16.2} {:>16.2} {allocations:>12}",
        mega(factor),
        peak * 1e-6,
        held * 1e-6,
        peak / least,
        held / least,
    );
}

fn mega(bytes: usize) -> f64 {
    bytes as f64 * 1e-6
}

/// What is held cannot be negative.
fn bytes(current: i64) -> u64 {
    u64::try_from(current).unwrap_or(0)
}
