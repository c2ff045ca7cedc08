//! Large allocations that return an error instead of aborting, and scratch memory that can be cloned.

use crate::error::{Error, Result};
use faer::dyn_stack::{MemBuffer, StackReq};
use num_traits::Zero;

/// A zero vector of `rows · columns` entries.
pub(crate) fn zeros<T: Zero + Clone>(rows: usize, columns: usize, what: &'static str) -> Result<Vec<T>> {
    let mut vector = Vec::new();
    grow(&mut vector, rows, columns, what)?;
    Ok(vector)
}

/// An empty vector with capacity for `rows · columns` entries.
pub(crate) fn reserve<T>(rows: usize, columns: usize, what: &'static str) -> Result<Vec<T>> {
    let size = rows.checked_mul(columns).ok_or(Error::OutOfMemory { what, bytes: None })?;
    let mut vector = Vec::new();
    vector.try_reserve_exact(size).map_err(|_| refused::<T>(size, what))?;
    Ok(vector)
}

/// Reserves capacity for additional entries; the capacity at least doubles when it must grow.
pub(crate) fn make_room<T>(vector: &mut Vec<T>, entries: usize, what: &'static str) -> Result<()> {
    vector.try_reserve(entries).map_err(|_| refused::<T>(vector.len().saturating_add(entries), what))
}

/// Resizes a vector to `rows · columns` entries, new ones zero; nonzero capacity at least doubles when it must grow.
pub(crate) fn grow<T: Zero + Clone>(
    vector: &mut Vec<T>,
    rows: usize,
    columns: usize,
    what: &'static str,
) -> Result<()> {
    let size = rows.checked_mul(columns).ok_or(Error::OutOfMemory { what, bytes: None })?;
    match vector.capacity() {
        0 => *vector = reserve(size, 1, what)?,
        _ => make_room(vector, size.saturating_sub(vector.len()), what)?,
    }
    vector.resize(size, T::zero());
    Ok(())
}

/// Replaces the entries of a vector by those of another one.
pub(crate) fn copy<T: Copy>(vector: &mut Vec<T>, of: &[T], what: &'static str) -> Result<()> {
    vector.clear();
    make_room(vector, of.len(), what)?;
    vector.extend_from_slice(of);
    Ok(())
}

/// Checks that `rows · columns` entries could be allocated, before code of a host or a library allocates them that
/// cannot return an error.
pub(crate) fn probe<T>(rows: usize, columns: usize, what: &'static str) -> Result<()> {
    reserve::<T>(rows, columns, what).map(|_| ())
}

fn refused<T>(entries: usize, what: &'static str) -> Error {
    Error::OutOfMemory { what, bytes: entries.checked_mul(size_of::<T>()) }
}

/// Scratch memory for faer's kernels; a clone starts empty.
#[derive(Default)]
pub(crate) struct Scratch {
    buffer: Option<MemBuffer>,
    bytes: usize,
}

impl Scratch {
    /// Scratch of at least this size; allocates if there is less.
    pub(crate) fn get(&mut self, required: StackReq) -> &mut MemBuffer {
        let bytes = required.unaligned_bytes_required();
        if bytes > self.bytes {
            (self.buffer, self.bytes) = (None, bytes);
        }
        self.buffer.get_or_insert_with(|| MemBuffer::new(required))
    }
}

impl Clone for Scratch {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl std::fmt::Debug for Scratch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Scratch({} bytes)", self.bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absurd_sizes_are_errors() {
        assert!(matches!(zeros::<f64>(usize::MAX, 2, "x"), Err(Error::OutOfMemory { what: "x", bytes: None })));
        let error = zeros::<f32>(1 << 40, 1 << 20, "x").unwrap_err();
        assert!(matches!(error, Error::OutOfMemory { bytes: Some(bytes), .. } if bytes == 1 << 62), "{error}");
        assert_eq!(error.to_string(), "no memory for x: 4611686018427387904 bytes were asked for");
        assert_eq!(zeros::<f32>(2, 2, "x").unwrap(), [0.0; 4]);
    }
}
