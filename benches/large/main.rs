//! Large bodies with thousands of contacts, without a factorization: time of a step, memory of a run.
//!
//! - `cargo bench --features rayon --bench large -- [cells a side]…` (default 20 to 130): a slab of cubes falls on
//!   a wavy floor.
//! - `-- heap [cells a side]…` (default 20 to 100): ten slabs lie on each other, all their nodes pressed.
//! - `-- courant [cells a side]` (default 40): the slab with a weight, in steps of Courant numbers up to 64, beside the
//!   factor; the figure goes to `target/large/courant.svg`.
//! - `-- exact [cells a side]` (default 46, 1e5 dofs): forces beside those by a factor and W.
//! - `-- explicit [cells a side]…` (default 60 and 100): the slab by CD-Lagrange, beside its steps without contact.
//! - `-- flat [cells a side]…` (default 10, 20 and 40): the slab, without lateral strain, on a flat floor, beside the
//!   exact solution; `in_mujoco.py` and `in_kratos.py` run the same scene by MuJoCo and by Kratos.
//! - `-- picture [cells a side]` (default 100): the slab some time after first contact, in `target/large/slab.vtu`, which
//!   `picture.py` draws with ParaView.

mod grid;
mod picture;

use contact_dynamics::contact::GapFunction;
use contact_dynamics::contact_solver::Assembly;
use contact_dynamics::mass::Redistribution;
use contact_dynamics::{
    ActiveSet, CdLagrange, Cholesky, ConjugateGradients, GeneralizedAlpha, LinearRows, LinearSystem, Mass, Preset,
    Result, Simulation, SimulationBuilder, System, TimeIntegrator, mass,
};
use contact_dynamics_scenes::solids::Material;
use example_support::plot::{Axis, BLUE, Curve, Panel, SKY, VERMILION, pair};
use example_support::timing::{Arguments, median};
use grid::Grid;
use std::f64::consts::PI;
use std::time::Instant;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

/// Velocity of a fall: strains are of this order.
const SPEED: f64 = 0.01;

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let is_given = |word: &str| std::env::args().any(|argument| argument == word);
    println!("a pass over a gigabyte of memory takes {:.3} s on one thread", bandwidth());
    if is_given("heap") {
        Ok(heaps(&Arguments::read(&[20, 40, 60, 80, 100], &[4]))?)
    } else if is_given("courant") {
        courants(&Arguments::read(&[40], &[6]))
    } else if is_given("exact") {
        Ok(exact(&Arguments::read(&[46], &[6]))?)
    } else if is_given("explicit") {
        Ok(explicit(&Arguments::read(&[60, 100], &[6]))?)
    } else if is_given("flat") {
        Ok(flat(&Arguments::read(&[10, 20, 40], &[6]))?)
    } else if is_given("picture") {
        picture(&Arguments::read(&[100], &[6]))
    } else {
        Ok(slabs(&Arguments::read(&[20, 40, 60, 80, 100, 130], &[6]))?)
    }
}

/// Time to read a gigabyte that is in no cache.
fn bandwidth() -> f64 {
    let values = vec![1.0_f64; 1 << 24];
    let start = Instant::now();
    let sums = values.chunks_exact(8).fold([0.0; 8], |sums, chunk| std::array::from_fn(|k| sums[k] + chunk[k]));
    assert!(std::hint::black_box(sums)[0] > 0.0);
    start.elapsed().as_secs_f64() * 8.0
}

/// The largest memory of this process so far, in GiB; NaN where the system does not tell.
fn memory() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    let kib = line.and_then(|line| line.split_whitespace().nth(1)).and_then(|kib| kib.parse::<f64>().ok());
    kib.unwrap_or(f64::NAN) / f64::from(1 << 20)
}

/// A slab whose thickness is three tenths of its sides.
fn slab(cells: usize) -> Grid {
    Grid { cells: [cells, cells, (3 * cells).div_ceil(10)], size: 1.0, material: MATERIAL }
}

/// The size of a step with this Courant number.
fn step(grid: &Grid, courant: f64) -> f64 {
    courant * grid.size / MATERIAL.wave_speed()
}

/// A slab that falls on a floor with waves, whose crests it touches after two steps.
fn falling(grid: &Grid, h: f64) -> Result<SimulationBuilder<'static, f64>> {
    Ok(thrown((grid, lumped(grid)?), GeneralizedAlpha::default(), h))
}

/// The same slab with a weight that keeps it on the floor.
fn pressed(grid: &Grid, h: f64) -> Result<SimulationBuilder<'static, f64>> {
    let mass = grid.mass();
    let weight: Vec<f64> = (0..).zip(&mass).map(|(dof, m)| if dof % 3 == 2 { -SPEED * m } else { 0.0 }).collect();
    let system = LinearSystem::lumped(mass, grid.stiffness())?.load(move |_, f| f.copy_from_slice(&weight));
    Ok(thrown((grid, system), GeneralizedAlpha::default(), h))
}

/// A slab and its system, by any scheme.
fn thrown(
    (grid, system): (&Grid, LinearSystem<'static, f64>),
    scheme: impl TimeIntegrator + 'static,
    h: f64,
) -> SimulationBuilder<'static, f64> {
    let velocity: Vec<f64> = (0..grid.dofs()).map(|dof| if dof % 3 == 2 { -SPEED } else { 0.0 }).collect();
    let (height, wave) = (0.04, 6.0 * PI / grid.cells[0] as f64);
    let waves = |place: [usize; 3]| {
        let at = [place[0] as f64, place[1] as f64];
        move |_: f64, u: &[f64], v: &[f64], gradient: &mut [f64]| {
            let [(sx, cx), (sy, cy)] = [0, 1].map(|axis| (wave * (at[axis] + u[axis])).sin_cos());
            gradient.copy_from_slice(&[-height * wave * cx * sy, -height * wave * sx * cy, 1.0]);
            let bends = sx * sy * (v[0] * v[0] + v[1] * v[1]) - 2.0 * cx * cy * v[0] * v[1];
            [u[2] + height * (1.0 - sx * sy) + 1.5 * SPEED * h, 0.0, height * wave * wave * bends]
        }
    };
    let mut bottom = grid.bottom();
    let dofs = |place: [usize; 3]| [0, 1, 2].map(|axis| 3 * grid.node(place) + axis);
    let first = bottom.next().expect("a node at the bottom");
    let floor =
        bottom.fold(GapFunction::new(&dofs(first), waves(first)), |floor, place| floor.and(&dofs(place), waves(place)));
    Simulation::builder(system, scheme, h).velocity(velocity).constraint(floor)
}

/// What some steps cost.
struct Cost {
    /// Median time of a step.
    time: f64,
    closed: usize,
    /// Products for contact, a step.
    products: f64,
}

fn closed(run: &Simulation<'_, f64>) -> usize {
    run.state().contacts().closed().iter().filter(|&&closed| closed).count()
}

fn cost(run: &mut Simulation<'_, f64>, steps: usize) -> Result<Cost> {
    let before = run.statistics().contact_products;
    let mut times = Vec::new();
    for _ in 0..steps {
        let start = Instant::now();
        run.step()?;
        times.push(start.elapsed().as_secs_f64());
    }
    let products = (run.statistics().contact_products - before) as f64 / steps as f64;
    Ok(Cost { time: median(&times), closed: closed(run), products })
}

/// Prints what a run costs: without contact, in the step of first contact, and later; returns the cost of late steps.
fn row(name: &str, dofs: usize, builder: impl FnOnce() -> Result<SimulationBuilder<'static, f64>>) -> Result<Cost> {
    let builder = builder()?;
    let start = Instant::now();
    let mut run = builder.build()?;
    let build = start.elapsed().as_secs_f64();
    // A step without contact, and the first with contact, unless the run begins with it.
    let mut alone = [f64::NAN; 2];
    while closed(&run) == 0 {
        let start = Instant::now();
        run.step()?;
        alone[usize::from(closed(&run) > 0)] = start.elapsed().as_secs_f64();
    }
    cost(&mut run, 8)?;
    let late = cost(&mut run, 5)?;
    let Cost { time, closed, products } = late;
    let [open, first] = alone.map(|own| if own.is_nan() { "–".into() } else { format!("{own:.3}") });
    println!(
        "{name:<12} {dofs:>8} {closed:>7} {products:>9.1} {open:>8} {first:>8} {time:>8.3} {build:>8.1} {:>9.2}",
        memory()
    );
    Ok(late)
}

fn header() {
    println!(
        "Chung-Hulbert with default corrections, conjugate gradients but where a factor is named; Courant number 1 but \
         where another is"
    );
    println!(
        "{:<12} {:>8} {:>7} {:>9} {:>8} {:>8} {:>8} {:>8} {:>9}",
        "scene", "dofs", "closed", "products", "open, s", "first, s", "step, s", "build, s", "peak, GiB"
    );
}

fn slabs(arguments: &Arguments) -> Result<()> {
    header();
    let mut before = None;
    for &cells in &arguments.sizes {
        let grid = slab(cells);
        let builder = || Ok(falling(&grid, step(&grid, 1.0))?.linear_solver(ConjugateGradients::default()));
        let Cost { time, .. } = row(&format!("slab {cells}"), grid.dofs(), builder)?;
        if let Some((dofs, last)) = before.replace((grid.dofs() as f64, time)) {
            let exponent = f64::ln(time / last) / f64::ln(grid.dofs() as f64 / dofs);
            println!("{:<12} twice the dofs take {:.2} times as long", "", 2.0_f64.powf(exponent));
        }
    }
    Ok(())
}

/// Ten slabs of three elements, each on the next; the lowest lies on a floor. All fall.
fn heaps(arguments: &Arguments) -> Result<()> {
    header();
    for &cells in &arguments.sizes {
        let grid = Grid { cells: [cells, cells, 3], size: 1.0, material: MATERIAL };
        let (dofs, nodes) = (grid.dofs(), 4);
        let heap = || {
            let mut rows = LinearRows::new();
            for slab in 0..10 {
                for place in grid.bottom() {
                    let below = 3 * grid.node(place) + 2;
                    let own = (slab * dofs + below, 1.0);
                    rows = match slab {
                        0 => rows.unilateral(&[own], 0.5 * SPEED),
                        _ => rows.unilateral(&[own, ((slab - 1) * dofs + below + 3 * (nodes - 1), -1.0)], 0.0),
                    };
                }
            }
            // A weight of the size of the first impact.
            let mass: Vec<f64> = (0..10).flat_map(|_| grid.mass()).collect();
            let weight: Vec<f64> =
                mass.iter().enumerate().map(|(dof, m)| if dof % 3 == 2 { -SPEED * m } else { 0.0 }).collect();
            let system = LinearSystem::lumped(mass, grid.stack(10))?.load(move |_, f| f.copy_from_slice(&weight));
            let velocity = (0..10 * dofs).map(|dof| if dof % 3 == 2 { -SPEED } else { 0.0 }).collect();
            let builder = Simulation::builder(system, GeneralizedAlpha::default(), step(&grid, 1.0));
            Ok(builder.velocity(velocity).constraint(rows).linear_solver(ConjugateGradients::default()))
        };
        row(&format!("heap {cells}"), 10 * dofs, heap)?;
    }
    Ok(())
}

/// Prints a table, and draws the last size: a step in contact, and its products for contact.
fn courants(arguments: &Arguments) -> std::result::Result<(), Box<dyn std::error::Error>> {
    header();
    let mut drawn = [const { Vec::new() }; 3];
    for &cells in &arguments.sizes {
        let grid = slab(cells);
        drawn.iter_mut().for_each(Vec::clear);
        for courant in [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0] {
            for factor in [false, true] {
                let builder = || {
                    let builder = pressed(&grid, step(&grid, courant))?;
                    Ok(match factor {
                        true => builder.linear_solver(Cholesky::default()),
                        false => builder.linear_solver(ConjugateGradients::default()),
                    })
                };
                let name = format!("{} {courant}", if factor { "factor" } else { "cg" });
                let Cost { time, products, .. } = row(&name, grid.dofs(), builder)?;
                drawn[usize::from(factor)].push((courant.log10(), time.log10()));
                if !factor {
                    drawn[2].push((courant.log10(), products.log10()));
                }
            }
        }
    }
    let [iteration, factor, products] = drawn;
    let curve = |label: &str, color, points| Curve { label: Some(label.into()), color, width: 7, points };
    let panel = |title: &str, y, curves| Panel {
        title: title.into(),
        x: Axis::decades("Courant number", 0, 2, 1),
        y,
        curves,
        note: None,
    };
    let first = products.first().map_or(0.0, |point| point.1);
    let figure = pair(
        "Long steps of a slab on a wavy floor",
        "Conjugate gradients, with a coarse space from a Courant number of eight on, and a factor.",
        &[
            panel(
                "A step in contact",
                Axis::decades("time (s)", -2, 1, 1),
                vec![curve("factor", VERMILION, factor), curve("conjugate gradients", BLUE, iteration)],
            ),
            panel(
                "Products for contact",
                Axis::decades("products a step", 1, 4, 1),
                vec![
                    curve("as the Courant number", SKY, vec![(0.0, first), (2.0, first + 2.0)]),
                    curve("conjugate gradients", BLUE, products),
                ],
            ),
        ],
    )?;
    let folder = std::path::Path::new("target/large");
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("courant.svg"), figure)?;
    Ok(())
}

/// The largest difference of a force from that by a factor and W, relative to the largest force.
fn exact(arguments: &Arguments) -> Result<()> {
    println!("Chung-Hulbert with default corrections, Courant number 1");
    for &cells in &arguments.sizes {
        let grid = slab(cells);
        let builder = || falling(&grid, step(&grid, 1.0));
        let mut iterates = builder()?.linear_solver(ConjugateGradients::default()).build()?;
        let solver = ActiveSet::default().with_assembly(Assembly::Always);
        let mut solves = builder()?.linear_solver(Cholesky::default()).contact_solver(solver).build()?;
        for number in 1..=8 {
            iterates.step()?;
            solves.step()?;
            let [own, other] = [&iterates, &solves].map(|run| run.state().contacts().forces());
            let largest = other.iter().fold(0.0, |most: f64, force| most.max(*force));
            let apart = own.iter().zip(other).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
            println!(
                "{} dofs, step {number}: {} closed, forces apart by {:.1e}",
                grid.dofs(),
                closed(&iterates),
                apart / largest.max(f64::MIN_POSITIVE)
            );
        }
    }
    Ok(())
}

/// Writes the slab when waves have gone through three quarters of its thickness.
fn picture(arguments: &Arguments) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let folder = std::path::Path::new("target/large");
    std::fs::create_dir_all(folder)?;
    for &cells in &arguments.sizes {
        let grid = slab(cells);
        let mut run = falling(&grid, step(&grid, 1.0))?.linear_solver(ConjugateGradients::default()).build()?;
        for _ in 0..2 + 3 * grid.cells[2] / 4 {
            run.step()?;
        }
        picture::write(&folder.join("slab.vtu"), &grid, &run)?;
        println!("{} dofs, {} closed: target/large/slab.vtu", grid.dofs(), closed(&run));
    }
    Ok(())
}

fn lumped(grid: &Grid) -> Result<LinearSystem<'static, f64>> {
    LinearSystem::lumped(grid.mass(), grid.stiffness())
}

/// The slab without mass on its lower side, as [`Preset::explicit`] wants it.
fn massless(grid: &Grid) -> Result<LinearSystem<'static, f64>> {
    let stiffness = grid.stiffness();
    let contact: Vec<usize> =
        grid.bottom().flat_map(|place| [0, 1, 2].map(|axis| 3 * grid.node(place) + axis)).collect();
    let groups: Vec<usize> = (0..grid.dofs()).map(|dof| dof % 3).collect();
    let by = Redistribution::Tapered { neighbors: stiffness.symbolic(), fraction: 0.15 };
    let mass = mass::redistribute(&grid.mass(), &contact, &groups, by)?;
    LinearSystem::lumped(mass, stiffness)
}

/// Times of steps before and after the first contact, and the largest change of the energy.
fn explicit(arguments: &Arguments) -> Result<()> {
    println!("CD-Lagrange, Courant number 0.5");
    println!(
        "{:<16} {:>8} {:>7} {:>9} {:>8} {:>8} {:>7} {:>15} {:>9}",
        "mass", "dofs", "closed", "products", "open, s", "step, s", "ratio", "energy changes", "peak, GiB"
    );
    for (&cells, preset) in arguments.sizes.iter().flat_map(|cells| [(cells, false), (cells, true)]) {
        let grid = slab(cells);
        let mut run = if preset {
            thrown((&grid, massless(&grid)?), CdLagrange, step(&grid, 0.5)).correctors(Preset::explicit().correctors())
        } else {
            thrown((&grid, lumped(&grid)?), CdLagrange, step(&grid, 0.5)).uncorrected()
        }
        .build()?;
        let start = run.energy().total();
        let (mut open, mut pressed, mut most, mut change) = (Vec::new(), Vec::new(), 0, 0.0_f64);
        while pressed.len() < arguments.repeated(60) {
            let begin = Instant::now();
            run.step()?;
            let time = begin.elapsed().as_secs_f64();
            let closed = closed(&run);
            most = most.max(closed);
            change = change.max((run.energy().total() / start - 1.0).abs());
            if most == 0 { &mut open } else { &mut pressed }.push(time);
        }
        let products = run.statistics().contact_products as f64 / pressed.len() as f64;
        let [open, pressed] = [&open, &pressed].map(|times| median(times));
        println!(
            "{:<16} {:>8} {most:>7} {products:>9.1} {open:>8.4} {pressed:>8.4} {:>7.2} {:>13.2} % {:>9.2}",
            if preset { "none at contact" } else { "lumped" },
            grid.dofs(),
            pressed / open,
            100.0 * change,
            memory()
        );
    }
    Ok(())
}

/// A slab with Poisson's ratio 0 on a flat floor is a bar of thickness H: for 2 H/c the floor carries ρ c times velocity
/// and area, then the slab leaves with the velocity of the fall. Both are 1 in the table.
fn flat(arguments: &Arguments) -> Result<()> {
    println!(
        "{:<13} {:>8} {:>8} {:>8} {:>8} {:>8} {:>11} {:>14}",
        "scheme", "dofs", "Courant", "open, s", "step, s", "rebound", "mean force", "largest force"
    );
    for &cells in &arguments.sizes {
        let grid = Grid { material: Material { poisson: 0.0, ..MATERIAL }, ..slab(cells) };
        let area = grid.cells[0] * grid.cells[1];
        for (scheme, courant) in [("Chung-Hulbert", 1.0), ("CD-Lagrange", 0.5), ("preset", 0.5)] {
            let h = courant * grid.size / grid.material.wave_speed();
            let system = match scheme {
                "preset" => massless(&grid)?,
                _ => lumped(&grid)?,
            };
            let Mass::Lumped(mass) = system.mass() else { unreachable!("all masses are lumped") };
            let mass = mass.to_vec();
            let gap = 1.5 * SPEED * h;
            let floor = grid
                .bottom()
                .fold(LinearRows::new(), |rows, place| rows.unilateral(&[(3 * grid.node(place) + 2, 1.0)], gap));
            let velocity = (0..grid.dofs()).map(|dof| if dof % 3 == 2 { -SPEED } else { 0.0 }).collect();
            let mut run = match scheme {
                "Chung-Hulbert" => Simulation::builder(system, GeneralizedAlpha::default(), h)
                    .linear_solver(ConjugateGradients::default()),
                "CD-Lagrange" => Simulation::builder(system, CdLagrange, h).uncorrected(),
                _ => Simulation::builder(system, CdLagrange, h).correctors(Preset::explicit().correctors()),
            }
            .velocity(velocity)
            .constraint(floor)
            .build()?;
            let momentum = |run: &Simulation<'_, f64>| {
                let downward = mass.iter().zip(run.state().velocity()).skip(2).step_by(3);
                downward.map(|(mass, velocity)| mass * velocity).sum::<f64>()
            };
            let (mut times, mut forces) = ([Vec::new(), Vec::new()], Vec::new());
            let mut last = momentum(&run);
            for _ in 0..grid.cells[2] * if courant < 1.0 { 6 } else { 3 } {
                let start = Instant::now();
                run.step()?;
                let time = start.elapsed().as_secs_f64();
                times[usize::from(closed(&run) > 0)].push(time);
                let now = momentum(&run);
                forces.push((now - last) / (h * SPEED * area as f64));
                last = now;
            }
            forces.retain(|force| force.abs() > 0.01);
            let largest = forces.iter().fold(0.0, |most: f64, force| most.max(*force));
            let [open, pressed] = times.map(|times| median(&times));
            println!(
                "{scheme:<13} {:>8} {courant:>8.1} {open:>8.4} {pressed:>8.4} {:>8.3} {:>11.3} {largest:>14.3}",
                grid.dofs(),
                last / (SPEED * mass.iter().skip(2).step_by(3).sum::<f64>()),
                forces.iter().sum::<f64>() / forces.len() as f64
            );
        }
    }
    Ok(())
}
