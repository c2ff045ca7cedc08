//! Times: a step and the build beside the full model, and modes of large bodies.

use crate::bars::Table;
use crate::blocks::Block;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::reduction::{Modes, Reduction};
use contact_dynamics::{Factorization, LinearSystem, Newmark, Simulation};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::output::decimal;
use example_support::timing::{effective, factor};
use std::fmt::Write;
use std::hint::black_box;
use std::time::Instant;

const STEEL: Material = Material { young: 210.0, poisson: 0.3, density: 7.8 };

/// Steps before those that are timed: the block is then on the plane.
const BEFORE: usize = 25;

/// The best time of a step among several runs of a few steps in contact, in microseconds.
fn step_time(
    repetitions: usize,
    build: impl Fn() -> contact_dynamics::Result<Simulation<'static, f64>>,
) -> contact_dynamics::Result<f64> {
    let mut best = f64::INFINITY;
    for _ in 0..repetitions {
        let mut run = build()?;
        for _ in 0..BEFORE {
            run.step()?;
        }
        let start = Instant::now();
        for _ in 0..20 {
            run.step()?;
        }
        best = best.min(start.elapsed().as_secs_f64() / 20.0 * 1e6);
        black_box(run.state().displacement());
    }
    Ok(best)
}

/// A step of the block that falls flat, and what comes before the first one.
pub(crate) fn steps(quick: bool) -> Table {
    let (cells, counts, repetitions): (usize, &[usize], usize) =
        if quick { (8, &[20], 2) } else { (64, &[20, 50, 100, 200], 5) };
    let block = Block::plane(cells, 0.0)?;
    let mut table = format!(
        "Block of {cells}² quad4 that falls flat: time of a step in contact (best of {repetitions} runs), and of what \
         comes before the run\n\n\
         | model | unknowns | step, µs | build, ms |\n| --- | --- | --- | --- |\n"
    );
    let full = || {
        let system = LinearSystem::new(block.mass.clone(), block.stiffness.clone())?;
        block.run(system, &block.contact, block.velocity.clone())
    };
    let start = Instant::now();
    black_box(full()?);
    let build = start.elapsed().as_secs_f64() * 1e3;
    let step = step_time(repetitions, full)?;
    writeln!(table, "| full | {} | {} | {} |", block.velocity.len(), decimal(step, 0), decimal(build, 1))?;
    for &count in counts {
        let start = Instant::now();
        let reduction = Reduction::new(block.mass.as_ref(), block.stiffness.as_ref(), &block.contact);
        let body = reduction.softening(2.0).modes(count)?;
        let contact: Vec<usize> = body.contact_dofs().collect();
        let velocity = body.velocity(&block.velocity)?;
        black_box(block.run(body.system()?, &contact, velocity.clone())?);
        let build = start.elapsed().as_secs_f64() * 1e3;
        let step = step_time(repetitions, || block.run(body.system()?, &contact, velocity.clone()))?;
        let unknowns = body.dofs();
        writeln!(table, "| {count} modes | {unknowns} | {} | {} |", decimal(step, 0), decimal(build, 1))?;
    }
    Ok(table)
}

/// Name, consistent mass, stiffness, lumped mass.
type Large = (String, SparseColMat<usize, f64>, SparseColMat<usize, f64>, Vec<f64>);

/// A hundred modes of large bodies, over one factorization of their K + M.
pub(crate) fn modes(quick: bool) -> Table {
    let plate = |cells: usize| {
        let solid = Solid::rectangle([1.0, 1.0], [cells; 2], STEEL);
        (format!("plate of {cells}² quad4"), solid.consistent_mass(), solid.stiffness(), solid.lumped_mass())
    };
    let block = |cells: usize| {
        let solid = Solid::block([1.0; 3], [cells; 3], STEEL);
        (format!("block of {cells}³ hex8"), solid.consistent_mass(), solid.stiffness(), solid.lumped_mass())
    };
    let bar = |elements: usize| {
        let bar = contact_dynamics_scenes::wall_bar::WallBar::bouncing(elements);
        (format!("bar of {elements} elements"), bar.consistent_mass(), bar.stiffness(), bar.mass())
    };
    let bodies: Vec<Large> = match quick {
        true => vec![bar(10_000), plate(70), block(10)],
        false => vec![bar(100_000), plate(223), block(20), block(32)],
    };
    let mut table = String::from(
        "A hundred modes of free bodies: time of one factorization (analysis included), of all modes, and their ratio; \
         factorizations and right-hand sides that they took, and the time of as many in fours over that of one \
         factorization; the worst residual\n\n\
         | body | dofs | rigid | factorization, s | modes, s | ratio | factorizations | solves | solves alone | \
         residual |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (name, mass, stiffness, lumped) in bodies {
        let start = Instant::now();
        let mut factor = factor(&effective(&stiffness, &lumped, &Newmark::trapezoidal(), 1.0), &[]);
        let once = start.elapsed().as_secs_f64();
        let solve = solve_time(&mut *factor, mass.nrows())?;
        drop(factor);
        let start = Instant::now();
        let modes = Modes::lowest(mass.as_ref(), stiffness.as_ref(), &[], 100)?;
        let all = start.elapsed().as_secs_f64();
        writeln!(
            table,
            "| {name} | {} | {} | {} | {} | {} | {} | {} | {} | {:.0e} |",
            mass.nrows(),
            modes.rigid(),
            decimal(once, 3),
            decimal(all, 2),
            decimal(all / once, 1),
            modes.factorizations(),
            modes.solves(),
            decimal(modes.solves() as f64 * solve / once, 1),
            modes.residual()
        )?;
    }
    Ok(table)
}

/// The best time of a right-hand side among four that are solved for together, in seconds.
fn solve_time(factor: &mut dyn Factorization<f64>, dofs: usize) -> contact_dynamics::Result<f64> {
    let right: Vec<f64> = (0..4 * dofs).map(|k| (k as f64).sin()).collect();
    let mut best = f64::INFINITY;
    for _ in 0..4 {
        let mut x = right.clone();
        let start = Instant::now();
        factor.solve(&mut x)?;
        best = best.min(start.elapsed().as_secs_f64() / 4.0);
        black_box(x);
    }
    Ok(best)
}
