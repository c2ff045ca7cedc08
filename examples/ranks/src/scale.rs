//! `ranks scale`: a step of a body that is large enough to gain by ranks, and of one that grows with them.

use crate::bodies::{Blocks, Scene};
use crate::compare::{columns, run_over_ranks};
use crate::engine::Engine;
use crate::ffi::World;
use crate::partition::Partition;
use contact_dynamics::Result;

/// Prints a line for each solver of a body of `cells`³ elements (strong scaling: the same for any number of ranks), and
/// of one that is as many times as long as there are ranks (weak scaling).
pub fn print(cells: usize, steps: usize, world: World) -> Result<bool> {
    let is_root = world.rank == 0;
    if is_root && world.size == 1 {
        println!(
            "| elements | dofs | ranks | scene | solver | build, s | step, ms | forces | solver | messages | rest \
             | sent, kB | calls | CG |"
        );
        println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    }
    let heights = if world.size == 1 { vec![1] } else { vec![1, world.size] };
    for scene in [Scene::Linear, Scene::LargeStrains] {
        for height in &heights {
            // Large strains assemble, and factorize in every iteration of Newton's method: a smaller body will do.
            let cells = if scene == Scene::LargeStrains { cells / 2 } else { cells };
            let cells = [cells, cells, height * cells];
            let blocks = Blocks::tower(cells);
            let part = Partition::Slabs.cut(&blocks, world)?;
            for engine in Engine::all().into_iter().filter(|engine| engine.is_distributed()) {
                let (_, taken) = run_over_ranks(&blocks, scene, &part, engine, steps)?;
                if is_root {
                    let (cells, dofs) = (cells.map(|count| count.to_string()).join(" × "), part.share.dofs);
                    let (scene, ranks, name) = (scene.name(), world.size, engine.name());
                    println!("| {cells} | {dofs} | {ranks} | {scene} | {name} | {} |", columns(&taken));
                }
            }
        }
    }
    Ok(true)
}
