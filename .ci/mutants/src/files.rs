//! Files that are read and written, with errors that name them.

use std::fs;
use std::path::Path;

pub fn failed(what: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}", what.display())
}

pub fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|error| failed(path, &error))
}

/// Writes a file unless it is there already: its time tells cargo whether to compile it again.
pub fn put(path: &Path, content: &[u8]) -> Result<(), String> {
    if fs::read(path).is_ok_and(|there| there == content) {
        return Ok(());
    }
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|error| failed(folder, &error))?;
    }
    fs::write(path, content).map_err(|error| failed(path, &error))
}
