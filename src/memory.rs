//! Large allocations that may fail: an error instead of an abort.

use crate::error::{Error, Result};
use crate::real::Real;

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
