//! Contact of bodies over MPI ranks: `mpirun -n 3 target/release/ranks [--quick] [--cells N] [--steps N]`; further
//! `model`, `fault force|solve|memory|kill` and `save|resume FOLDER`.
//!
//! Two blocks of hexahedra, one above the other, are thrown at a floor, with friction; every rank assembles its own
//! elements. Each scene is run over the ranks that there are, with MUMPS in each of its ways, and in one piece on rank 0
//! without ranks; the table says how far the two are apart.

mod bodies;
mod faults;
mod ffi;
mod model;
mod restart;
mod share;
mod solver;

use bodies::{Blocks, Scene};
use contact_dynamics::{Result, Simulation};
use contact_dynamics_scenes::ranks::Cut;
use faults::Fault;
use ffi::{Input, World};
use share::{Share, host};
use solver::Way;
use std::path::PathBuf;
use std::sync::Arc;

/// What the command line asks for.
struct Arguments {
    cells: usize,
    steps: usize,
    task: Task,
}

enum Task {
    Table,
    Model,
    Fault(Fault),
    Save(PathBuf),
    Resume(PathBuf),
}

impl Arguments {
    fn read() -> Self {
        let arguments: Vec<String> = std::env::args().collect();
        let number = |name: &str, default: usize| {
            let place = arguments.iter().position(|argument| argument == name);
            place.and_then(|place| arguments.get(place + 1)?.parse().ok()).unwrap_or(default)
        };
        let quick = arguments.iter().any(|argument| argument == "--quick");
        let (cells, steps) = if quick { (4, 20) } else { (6, 30) };
        let words: Vec<&str> = arguments.iter().skip(1).take(2).map(String::as_str).collect();
        let task = match words[..] {
            ["model", ..] => Task::Model,
            ["fault", name] => Task::Fault(Fault::named(name).expect("force, solve, memory or kill")),
            ["save", folder] => Task::Save(folder.into()),
            ["resume", folder] => Task::Resume(folder.into()),
            _ => Task::Table,
        };
        Self { cells: number("--cells", cells), steps: number("--steps", steps), task }
    }
}

/// Motion and contact forces at the end of a run.
struct End {
    motion: [Vec<f64>; 3],
    forces: Vec<f64>,
    energy: f64,
}

/// What a run over ranks has taken, of the slowest rank.
struct Taken {
    /// Seconds of the build, and of a step.
    build: f64,
    step: f64,
    /// Of a step: seconds in messages, bytes sent by all ranks, calls.
    waiting: f64,
    bytes: f64,
    calls: f64,
    pressed: f64,
}

fn run_alone(blocks: &Blocks, scene: Scene, steps: usize) -> Result<(End, f64)> {
    let mut run = blocks.alone(scene)?.build()?;
    let start = std::time::Instant::now();
    (0..steps).try_for_each(|_| run.step())?;
    let seconds = start.elapsed().as_secs_f64() / steps as f64;
    Ok((end(&mut run, <[f64]>::to_vec), seconds))
}

fn end(run: &mut Simulation<'_, f64>, whole: impl Fn(&[f64]) -> Vec<f64>) -> End {
    let energy = run.energy().total();
    let state = run.state();
    let motion = [state.displacement(), state.velocity(), state.acceleration()].map(whole);
    End { motion, forces: state.contacts().forces().to_vec(), energy }
}

fn run_over_ranks(
    blocks: &Blocks,
    scene: Scene,
    (cut, share): (&Cut<3>, &Arc<Share>),
    way: Way,
    steps: usize,
) -> Result<(End, Taken)> {
    let world = share.world;
    let start = world.time();
    let mut run = blocks.on_rank(scene, (cut, share), way)?.build()?;
    let built = world.time();
    share.cost.take();
    (0..steps).try_for_each(|_| run.step())?;
    let taken = (world.time() - built) / steps as f64;
    let [bytes, calls, waiting] = share.cost.take().map(|value| value / steps as f64);
    let mut slowest = [built - start, taken, waiting, calls];
    world.max(&mut slowest).map_err(|failed| host("max", failed))?;
    let mut sum = [bytes];
    world.sum(&mut sum).map_err(|failed| host("sum", failed))?;
    let pressed = run.state().contacts().forces().iter().filter(|&&force| force > 0.0).count() as f64;
    let [build, step, waiting, calls] = slowest;
    let whole = |values: &[f64]| {
        let mut whole = Vec::new();
        share.gather(values, &mut whole).expect("rank 0 is there");
        whole
    };
    let end = end(&mut run, whole);
    check_forces(share, &end.forces)?;
    Ok((end, Taken { build, step, waiting, bytes: sum[0], calls, pressed }))
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
fn difference(expected: &End, found: &End) -> f64 {
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

fn ways(scene: Scene) -> Vec<(&'static str, Way)> {
    let way = |input, condenses| Way { input, condenses };
    let all = vec![
        ("matrix on rank 0", way(Input::Root, false)),
        ("rank 0, Schur complement", way(Input::Root, true)),
        ("rows on all ranks", way(Input::Distributed, false)),
        ("all ranks, Schur complement", way(Input::Distributed, true)),
    ];
    if scene == Scene::Explicit { vec![("no solver", all[0].1)] } else { all }
}

fn run(world: World) -> Result<bool> {
    let Arguments { cells, steps, task } = Arguments::read();
    let blocks = Blocks::new(cells);
    let cut = Cut::new(&blocks.solid, &blocks.contact_nodes(), world.rank, world.size);
    let share = Arc::new(Share::new(world, &cut.owners, cut.known()).map_err(|failed| host("share", failed))?);
    let way = Way { input: Input::Distributed, condenses: true };
    match task {
        Task::Table => print_table((cells, steps), &blocks, (&cut, &share)),
        Task::Model => model::print(&blocks, (&cut, &share)),
        Task::Fault(fault) => faults::run(fault, &blocks, (&cut, &share)),
        Task::Save(folder) => restart::save(&folder, &blocks, (&cut, &share), way, steps).map(|()| true),
        Task::Resume(folder) => {
            restart::resume(&folder, &blocks, (&cut, &share), way, steps).map(|apart| apart < 1e-10)
        }
    }
}

/// Prints the table; whether ranks and one piece are alike.
fn print_table((cells, steps): (usize, usize), blocks: &Blocks, part: (&Cut<3>, &Arc<Share>)) -> Result<bool> {
    let world = part.1.world;
    let is_root = world.rank == 0;
    if is_root {
        let (dofs, rows) = (blocks.solid.dofs(), 3 * blocks.contact_nodes().len());
        println!(
            "{} ranks, two blocks of {cells}³ elements, {dofs} dofs, {rows} contact dofs, {steps} steps\n",
            world.size
        );
        println!(
            "| scene | MUMPS | build, s | step, ms | in messages, ms | sent, kB | calls | pressed | in one piece, ms | apart |"
        );
        println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    }
    let mut alike = true;
    for scene in Scene::ALL {
        let alone = if is_root { Some(run_alone(blocks, scene, steps)?) } else { None };
        for (name, way) in ways(scene) {
            let (end, taken) = run_over_ranks(blocks, scene, part, way, steps)?;
            let Some((expected, serial)) = &alone else { continue };
            let apart = difference(expected, &end);
            alike &= apart < 1e-10;
            let Taken { build, step, waiting, bytes, calls, pressed } = taken;
            println!(
                "| {} | {name} | {build:.2} | {:.1} | {:.1} | {:.0} | {calls:.0} | {pressed:.0} | {:.1} | {apart:.0e} |",
                scene.name(),
                1e3 * step,
                1e3 * waiting,
                1e-3 * bytes,
                1e3 * serial,
            );
        }
    }
    Ok(alike)
}

fn main() {
    let world = World::initialize();
    let result = run(world);
    match result {
        Ok(true) => world.finalize(),
        Ok(false) => {
            eprintln!("rank {}: this is not what was expected", world.rank);
            world.abort(1);
        }
        Err(error) => {
            eprintln!("rank {}: {error}", world.rank);
            world.abort(1);
        }
    }
}
