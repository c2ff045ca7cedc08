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

/// Resizes a vector to `rows · columns` entries, new ones zero. It gets no more memory than for these.
pub(crate) fn grow<T: Zero + Clone>(
    vector: &mut Vec<T>,
    rows: usize,
    columns: usize,
    what: &'static str,
) -> Result<()> {
    let size = rows.checked_mul(columns).ok_or(Error::OutOfMemory { what, bytes: None })?;
    vector.try_reserve_exact(size.saturating_sub(vector.len())).map_err(|_| refused::<T>(size, what))?;
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
    /// Size and alignment of the buffer.
    room: Option<StackReq>,
}

impl Scratch {
    /// Scratch of at least this size and alignment; allocates if there is less.
    pub(crate) fn get(&mut self, required: StackReq) -> &mut MemBuffer {
        let room = self.room.map_or(required, |room| room.or(required));
        if self.room != Some(room) {
            (self.buffer, self.room) = (None, Some(room));
        }
        self.buffer.get_or_insert_with(|| MemBuffer::new(room))
    }
}

impl Clone for Scratch {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl std::fmt::Debug for Scratch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Scratch({} bytes)", self.room.map_or(0, |room| room.size_bytes()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::dyn_stack::MemStack;

    /// What one alignment leaves free another one may need.
    #[test]
    fn scratch_has_room_for_all_alignments() {
        let mut scratch = Scratch::default();
        for (bytes, alignment) in [(1024, 64), (1056, 8), (1000, 128)] {
            let memory = scratch.get(StackReq::new_aligned::<u8>(bytes, alignment));
            let (_, rest) = MemStack::new(memory).make_aligned_uninit::<u8>(bytes, alignment);
            assert!(rest.len_bytes() < 1200);
        }
    }

    #[test]
    fn absurd_sizes_are_errors() {
        assert!(matches!(zeros::<f64>(usize::MAX, 2, "x"), Err(Error::OutOfMemory { what: "x", bytes: None })));
        let error = zeros::<f32>(1 << 40, 1 << 20, "x").unwrap_err();
        assert!(matches!(error, Error::OutOfMemory { bytes: Some(bytes), .. } if bytes == 1 << 62), "{error}");
        assert_eq!(error.to_string(), "no memory for x: 4611686018427387904 bytes were asked for");
        assert_eq!(zeros::<f32>(2, 2, "x").unwrap(), [0.0; 4]);
    }
}
