//! The table: each scene over the ranks that there are, with each solver, and in one piece without ranks.

use crate::bodies::{Blocks, Scene};
use crate::clock::Spent;
use crate::engine::Engine;
use crate::ffi::World;
use crate::partition::{Part, Partition};
use crate::share::{Share, host};
use contact_dynamics::{Result, Simulation};
use std::time::Instant;

/// Ranks and one piece are farther apart than this: something is wrong. (Rounding makes 1e-13.)
pub const APART: f64 = 1e-10;

/// The same where ranks iterate and one piece does not: contact is solved to eleven digits of the forces.
const APART_BY_ITERATION: f64 = 1e-9;

/// Motion and contact forces at the end of a run, whole on rank 0.
pub struct End {
    motion: [Vec<f64>; 3],
    forces: Vec<f64>,
    energy: f64,
}

/// What a run over ranks has taken.
pub struct Taken {
    /// Seconds of the build, and of a step, of the slowest rank.
    pub build: f64,
    pub step: f64,
    /// Of a step: seconds by phase, the mean of all ranks; bytes of all ranks; calls and iterations.
    pub spent: Spent,
    /// Contacts that press in the end.
    pub pressed: usize,
}

pub fn run_alone(blocks: &Blocks, scene: Scene, steps: usize) -> Result<(End, f64)> {
    let mut run = blocks.alone(scene)?.build()?;
    let start = Instant::now();
    (0..steps).try_for_each(|_| run.step())?;
    let seconds = start.elapsed().as_secs_f64() / steps as f64;
    Ok((end_with(&mut run, |values| Ok(values.to_vec()))?, seconds))
}

/// The end of a run over ranks.
pub fn end(run: &mut Simulation<'_, f64>, share: &Share) -> Result<End> {
    end_with(run, |values| {
        let mut whole = Vec::new();
        share.gather(values, &mut whole)?;
        Ok(whole)
    })
}

fn end_with(run: &mut Simulation<'_, f64>, whole: impl Fn(&[f64]) -> Result<Vec<f64>>) -> Result<End> {
    let energy = run.energy().total();
    let state = run.state();
    let motion = [whole(state.displacement())?, whole(state.velocity())?, whole(state.acceleration())?];
    Ok(End { motion, forces: state.contacts().forces().to_vec(), energy })
}

pub fn run_over_ranks(
    blocks: &Blocks,
    scene: Scene,
    part: &Part,
    engine: Engine,
    steps: usize,
) -> Result<(End, Taken)> {
    let share = &part.share;
    let world = share.world;
    let start = Instant::now();
    let mut run = blocks.on_rank(scene, part, engine)?.build()?;
    let build = start.elapsed().as_secs_f64();
    // (All begin at the same time.)
    world.max(&mut [0.0]).map_err(|failed| host("max", failed))?;
    share.clock.take();
    let start = Instant::now();
    (0..steps).try_for_each(|_| run.step())?;
    let spent = share.clock.take();
    let a_step = 1.0 / steps as f64;
    let mut slowest = [build, start.elapsed().as_secs_f64() * a_step, spent.calls * a_step, spent.iterations * a_step];
    world.max(&mut slowest).map_err(|failed| host("max", failed))?;
    let [a, b, c, d] = spent.seconds.map(|seconds| seconds * a_step / world.size as f64);
    let mut sums = [a, b, c, d, spent.bytes * a_step];
    world.sum(&mut sums).map_err(|failed| host("sum", failed))?;
    let ([a, b, c, d, bytes], [build, step, calls, iterations]) = (sums, slowest);
    let spent = Spent { seconds: [a, b, c, d], bytes, calls, iterations };
    let pressed = run.state().contacts().forces().iter().filter(|&&force| force > 0.0).count();
    let end = end(&mut run, share)?;
    check_forces(share, &end.forces)?;
    Ok((end, Taken { build, step, spent, pressed }))
}

/// Contact forces are the same on all ranks to the bit.
fn check_forces(share: &Share, forces: &[f64]) -> Result<()> {
    let mut first = forces.to_vec();
    share.broadcast(&mut first)?;
    let apart = first.iter().zip(forces).any(|(x, y)| x.to_bits() != y.to_bits());
    assert!(!apart, "rank {} has other contact forces than rank 0", share.world.rank);
    Ok(())
}

/// The largest difference of any value, over the largest of its kind.
pub fn difference(expected: &End, found: &End) -> f64 {
    let kinds = |end: &End| {
        let mut kinds = end.motion.to_vec();
        kinds.extend([end.forces.clone(), vec![end.energy]]);
        kinds
    };
    let apart = |(expected, found): (Vec<f64>, Vec<f64>)| {
        let size = expected.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
        let most = expected.iter().zip(&found).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        if most > 0.0 { most / size } else { 0.0 }
    };
    kinds(expected).into_iter().zip(kinds(found)).map(apart).fold(0.0, f64::max)
}

/// The solvers that a scene is run with: all of them on slabs, where rows are on all ranks on parts by dissection.
fn engines(scene: Scene, partition: Partition) -> Vec<Engine> {
    if scene == Scene::Explicit {
        return vec![Engine::CONDENSING];
    }
    let fits = |engine: &Engine| match partition {
        // (A thousand times multigrid a step: once will do.)
        Partition::Slabs => scene != Scene::LargeStrains || engine.factorizes(),
        Partition::Dissection => engine.is_distributed(),
    };
    Engine::all().into_iter().filter(fits).collect()
}

/// Prints the table; whether ranks and one piece are alike.
pub fn print_table((cells, steps): (usize, usize), blocks: &Blocks, world: World) -> Result<bool> {
    let is_root = world.rank == 0;
    if is_root {
        let (dofs, rows) = (blocks.solid.dofs(), 3 * blocks.contact_nodes().len());
        let ranks = world.size;
        println!(
            "{ranks} ranks, two blocks of {cells}³ elements, {dofs} dofs, {rows} contact dofs, {steps} steps; times of \
             phases in ms\n"
        );
        println!(
            "| scene | cut | solver | build, s | step, ms | forces | solver | messages | rest | sent, kB | calls | CG \
             | pressed | in one piece, ms | apart |"
        );
        println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    }
    let parts = [Partition::Slabs, Partition::Dissection].map(|partition| (partition, partition.cut(blocks, world)));
    let mut alike = true;
    for scene in Scene::ALL {
        let alone = if is_root { Some(run_alone(blocks, scene, steps)?) } else { None };
        for (partition, part) in &parts {
            let Ok(part) = part else { return Ok(false) };
            for engine in engines(scene, *partition) {
                let (end, taken) = run_over_ranks(blocks, scene, part, engine, steps)?;
                let Some((expected, serial)) = &alone else { continue };
                let apart = difference(expected, &end);
                alike &= apart < if engine.factorizes() { APART } else { APART_BY_ITERATION };
                let name = if scene == Scene::Explicit { "none" } else { engine.name() };
                println!(
                    "| {} | {} | {name} | {} | {} | {:.1} | {apart:.0e} |",
                    scene.name(),
                    partition.name(),
                    columns(&taken),
                    taken.pressed,
                    1e3 * serial,
                );
            }
        }
    }
    Ok(alike)
}

/// Times and messages as columns of a table.
pub fn columns(Taken { build, step, spent, .. }: &Taken) -> String {
    let Spent { seconds: [rest, forces, solver, messages], bytes, calls, iterations } = spent;
    let [step, forces, solver, messages, rest] = [step, forces, solver, messages, rest].map(|seconds| 1e3 * seconds);
    let sent = 1e-3 * bytes;
    format!(
        "{build:.2} | {step:.1} | {forces:.1} | {solver:.1} | {messages:.1} | {rest:.1} | {sent:.0} | {calls:.0} | \
         {iterations:.0}"
    )
}
