//! The file that a run leaves, from which another one goes on bit for bit.

use crate::Result;
use crate::history::History;
use crate::options::{Options, Target};
use crate::scene;
use contact_dynamics::Checkpoint;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Write};
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
        replace(path, |file| file.write_all(&bytes))
            .map_err(|error| format!("the checkpoint {} cannot be written: {error}", path.display()).into())
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

/// Puts a file in the place of one that there may be, once it is written whole: if that fails, on a full disk for
/// instance, the old one is as it was, and nothing is left beside it.
fn replace(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    let unfinished = path.with_extension("unfinished");
    let written = File::create(&unfinished).and_then(|mut file| {
        write(&mut file)?;
        file.sync_all()
    });
    let replaced = written.and_then(|()| std::fs::rename(&unfinished, path));
    if replaced.is_err() {
        // (It is of no use to anybody; the first error is the one to tell.)
        _ = std::fs::remove_file(&unfinished);
    }
    replaced
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with an old file in it.
    fn folder(name: &str) -> (std::path::PathBuf, std::path::PathBuf) {
        let folder = std::env::temp_dir().join(format!("drop-test-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("checkpoint.bin");
        std::fs::write(&path, "old").unwrap();
        (folder, path)
    }

    fn files(folder: &Path) -> Vec<std::ffi::OsString> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect()
    }

    #[test]
    fn a_disk_that_is_full_after_any_byte_leaves_the_old_file() {
        let (folder, path) = folder("any-byte");
        let bytes = b"a checkpoint of some length";
        for room in 0..bytes.len() {
            let error = replace(&path, |file| {
                file.write_all(&bytes[..room])?;
                Err(io::ErrorKind::StorageFull.into())
            });
            assert_eq!(error.unwrap_err().kind(), io::ErrorKind::StorageFull);
            assert_eq!(std::fs::read(&path).unwrap(), b"old");
            assert_eq!(files(&folder), ["checkpoint.bin"]);
        }
        replace(&path, |file| file.write_all(bytes)).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), bytes);
        assert_eq!(files(&folder), ["checkpoint.bin"]);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    /// The device that is always full in the place of the unfinished file.
    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_device_leaves_the_old_file() {
        let (folder, path) = folder("full-device");
        std::os::unix::fs::symlink("/dev/full", path.with_extension("unfinished")).unwrap();
        let error = replace(&path, |file| file.write_all(b"new")).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(files(&folder), ["checkpoint.bin"]);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
