//! Large allocations that return an error instead of aborting, and scratch memory that can be cloned.

use crate::error::{Error, Result};
use crate::real::Real;
use faer::dyn_stack::{MemBuffer, StackReq};

/// A zero vector of `rows · columns` entries. Pages are touched when they are first written, not here.
pub(crate) fn zeros<T: Real>(rows: usize, columns: usize, what: &'static str) -> Result<Vec<T>> {
    reserve::<T>(rows, columns, what)?;
    Ok(vec![T::zero(); rows * columns])
}

/// An empty vector with room for `rows · columns` entries.
pub(crate) fn reserve<T>(rows: usize, columns: usize, what: &'static str) -> Result<Vec<T>> {
    let size = rows.checked_mul(columns).ok_or(Error::OutOfMemory { what })?;
    let mut vector = Vec::new();
    vector.try_reserve_exact(size).map_err(|_| Error::OutOfMemory { what })?;
    Ok(vector)
}

/// Gives a vector `rows · columns` entries, new ones zero; its memory at least doubles when it must grow.
pub(crate) fn grow<T: Real>(vector: &mut Vec<T>, rows: usize, columns: usize, what: &'static str) -> Result<()> {
    let size = rows.checked_mul(columns).ok_or(Error::OutOfMemory { what })?;
    vector.try_reserve(size.saturating_sub(vector.len())).map_err(|_| Error::OutOfMemory { what })?;
    vector.resize(size, T::zero());
    Ok(())
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
        assert!(matches!(zeros::<f64>(usize::MAX, 2, "x"), Err(Error::OutOfMemory { what: "x" })));
        assert!(matches!(zeros::<f64>(1 << 40, 1 << 20, "x"), Err(Error::OutOfMemory { .. })));
        assert_eq!(zeros::<f32>(2, 2, "x").unwrap(), [0.0; 4]);
    }
}
