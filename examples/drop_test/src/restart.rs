//! The file that a run leaves, from which another one goes on bit for bit.

use crate::Result;
use crate::history::History;
use crate::options::{Options, Target};
use crate::scene;
use contact_dynamics::Checkpoint;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What is in the file, behind [`MAGIC`].
#[derive(Debug, Serialize, Deserialize)]
pub struct Saved {
    pub options: Options,
    /// Of the mesh files.
    prints: Vec<u64>,
    pub history: History,
    /// Time and file of each picture.
    pub pictures: Vec<(f64, String)>,
    pub checkpoint: Checkpoint<f64>,
}

/// How the file begins; its number changes with what is in it.
const MAGIC: &[u8] = b"drop-test 1\n";

impl Saved {
    pub fn new(
        options: &Options,
        history: History,
        pictures: Vec<(f64, String)>,
        checkpoint: Checkpoint<f64>,
    ) -> Result<Self> {
        let mut options = options.clone();
        // Found again from wherever the next run starts.
        options.mesh = Some(scene::part(&options).canonicalize()?);
        if let Target::Part(path) = &mut options.onto {
            *path = path.canonicalize()?;
        }
        Ok(Self { prints: prints(&options)?, options, history, pictures, checkpoint })
    }

    /// Writes the file whole or not at all.
    pub fn write(&self, path: &Path) -> Result<()> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(postcard::to_stdvec(self)?);
        let unfinished = path.with_extension("unfinished");
        std::fs::write(&unfinished, bytes)?;
        Ok(std::fs::rename(&unfinished, path)?)
    }

    pub fn read(path: &Path) -> Result<Self> {
        let shown = path.display();
        let bytes = std::fs::read(path).map_err(|error| format!("the checkpoint {shown} cannot be read: {error}"))?;
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| {
            format!(
                "{shown} is no checkpoint of this version of drop-test: take a file checkpoint.bin that it has written"
            )
        })?;
        let saved: Self =
            postcard::from_bytes(rest).map_err(|error| format!("the checkpoint {shown} is damaged: {error}"))?;
        if prints(&saved.options)? != saved.prints {
            return Err(format!("a mesh has changed since {shown} was written: run from the start").into());
        }
        Ok(saved)
    }
}

/// A number for the content of each mesh file (FNV-1a).
fn prints(options: &Options) -> Result<Vec<u64>> {
    let mut paths = vec![scene::part(options)];
    if let Target::Part(path) = &options.onto {
        paths.push(path.clone());
    }
    let print = |path: &std::path::PathBuf| -> Result<u64> {
        let bytes =
            std::fs::read(path).map_err(|error| format!("the mesh {} cannot be read: {error}", path.display()))?;
        Ok(bytes
            .iter()
            .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)))
    };
    paths.iter().map(print).collect()
}
