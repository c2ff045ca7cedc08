//! Contact of bodies over MPI ranks: `mpirun -n 3 target/release/ranks [--quick] [--cells N] [--steps N]`; further
//! `model`, `scale`, `fault force|solve|memory|iterations|kill` and `save|resume FOLDER`, the last three with
//! `--solver mumps|petsc` and `--cut slabs|dissection`.
//!
//! Two blocks of hexahedra, one above the other, are thrown at a floor, with friction; every rank assembles its own
//! elements. Each scene is run over the ranks that there are, with MUMPS in each of its ways and with PETSc, and in one
//! piece on rank 0 without ranks; the table says how far the two are apart.

mod bodies;
mod clock;
mod compare;
mod engine;
mod faults;
mod ffi;
mod model;
#[cfg(feature = "petsc")]
mod multigrid;
mod partition;
#[allow(dead_code, clippy::pedantic, reason = "shared with tests/ranks, which uses all of it")]
#[path = "../../../tests/ranks/parts.rs"]
mod parts;
mod restart;
mod scale;
mod share;
mod solver;

use bodies::Blocks;
use contact_dynamics::Result;
use engine::Engine;
use faults::Fault;
use ffi::World;
use partition::Partition;
use std::path::PathBuf;

/// What the command line asks for.
struct Arguments {
    cells: usize,
    steps: usize,
    engine: Engine,
    partition: Partition,
    task: Task,
}

enum Task {
    Table,
    Model,
    Scale,
    Fault(Fault),
    Save(PathBuf),
    Resume(PathBuf),
}

impl Arguments {
    fn read() -> Self {
        let arguments: Vec<String> = std::env::args().collect();
        let word = |name: &str| {
            let place = arguments.iter().position(|argument| argument == name);
            place.and_then(|place| arguments.get(place + 1)).map(String::as_str)
        };
        let number = |name: &str, default: usize| word(name).map_or(default, |word| word.parse().expect("a number"));
        let quick = arguments.iter().any(|argument| argument == "--quick");
        let words: Vec<&str> = arguments.iter().skip(1).take(2).map(String::as_str).collect();
        let task = match words[..] {
            ["model", ..] => Task::Model,
            ["scale", ..] => Task::Scale,
            ["fault", name] => Task::Fault(Fault::named(name).expect("force, solve, memory, iterations or kill")),
            ["save", folder] => Task::Save(folder.into()),
            ["resume", folder] => Task::Resume(folder.into()),
            _ => Task::Table,
        };
        let (cells, steps) = match task {
            Task::Scale if quick => (6, 3),
            Task::Scale => (24, 5),
            _ if quick => (4, 20),
            _ => (6, 30),
        };
        let engine = word("--solver").map_or(Engine::CONDENSING, |name| {
            Engine::named(name).expect("mumps, or petsc where it is built with that feature")
        });
        let partition = match word("--cut") {
            None | Some("slabs") => Partition::Slabs,
            Some("dissection") => Partition::Dissection,
            Some(other) => panic!("slabs or dissection, not {other}"),
        };
        Self { cells: number("--cells", cells), steps: number("--steps", steps), engine, partition, task }
    }
}

fn run(world: World) -> Result<bool> {
    let Arguments { cells, steps, engine, partition, task } = Arguments::read();
    if matches!(task, Task::Scale) {
        return scale::print(cells, steps, world);
    }
    let blocks = Blocks::new(cells);
    if matches!(task, Task::Table) {
        return compare::print_table((cells, steps), &blocks, world);
    }
    let part = partition.cut(&blocks, world)?;
    match task {
        Task::Table | Task::Scale => Ok(true),
        Task::Model => model::print(&blocks, &part),
        Task::Fault(fault) => faults::run(fault, &blocks, &part, engine),
        Task::Save(folder) => restart::save(&folder, &blocks, &part, engine, steps).map(|()| true),
        Task::Resume(folder) => {
            restart::resume(&folder, &blocks, &part, engine, steps).map(|apart| apart < compare::APART)
        }
    }
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
