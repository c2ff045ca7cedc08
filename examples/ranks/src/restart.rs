//! Checkpoints: `ranks save <folder>` writes one file a rank in the middle of a run, `ranks resume <folder>` reads
//! them, over any number of ranks, goes on, and compares with a run in one piece that never stopped.

use crate::bodies::{Blocks, Scene};
use crate::compare::{difference, end, run_alone};
use crate::engine::Engine;
use crate::partition::Part;
use crate::share::host;
use contact_dynamics::{Checkpoint, Error, Result};
use std::path::{Path, PathBuf};

const SCENE: Scene = Scene::LargeStrains;

fn file_error(error: impl std::error::Error + Send + Sync + 'static) -> Error {
    Error::Host { callback: "file", source: error.into() }
}

fn file(folder: &Path, rank: usize) -> PathBuf {
    folder.join(format!("part.{rank}"))
}

/// Runs half of the steps, and writes.
pub fn save(folder: &Path, blocks: &Blocks, part: &Part, engine: Engine, steps: usize) -> Result<()> {
    let share = &part.share;
    let mut run = blocks.on_rank(SCENE, part, engine)?.build()?;
    (0..steps / 2).try_for_each(|_| run.step())?;
    std::fs::create_dir_all(folder).map_err(file_error)?;
    // (A file of more ranks than now would be taken for a part.)
    let old = file(folder, share.world.size + share.world.rank);
    std::fs::remove_file(old).ok();
    let bytes = postcard::to_stdvec(&(&share.known, run.checkpoint())).map_err(file_error)?;
    std::fs::write(file(folder, share.world.rank), bytes).map_err(file_error)?;
    println!("rank {} has saved t = {}", share.world.rank, run.time());
    Ok(())
}

/// Reads what any number of ranks has written, and runs the other half: how far from a run that never stopped.
pub fn resume(folder: &Path, blocks: &Blocks, part: &Part, engine: Engine, steps: usize) -> Result<f64> {
    let share = &part.share;
    let mut parts = Vec::new();
    while let Ok(bytes) = std::fs::read(file(folder, parts.len())) {
        let (known, checkpoint): (Vec<usize>, Checkpoint<f64>) = postcard::from_bytes(&bytes).map_err(file_error)?;
        parts.push((checkpoint, known));
    }
    let whole = Checkpoint::joined(&parts, share.dofs)?;
    let mut run = blocks.on_rank(SCENE, part, engine)?.resume_from(whole.part(&share.known)?).build()?;
    (0..steps - steps / 2).try_for_each(|_| run.step())?;
    let end = end(&mut run, share)?;
    let mut apart = [0.0];
    if share.world.rank == 0 {
        apart[0] = difference(&run_alone(blocks, SCENE, steps)?.0, &end);
        println!("read from {} ranks by {}: {:.0e} apart", parts.len(), share.world.size, apart[0]);
    }
    share.world.broadcast(&mut apart).map_err(|failed| host("broadcast", failed))?;
    Ok(apart[0])
}
