//! Approximate minimum degree (Amestoy, Davis and Duff, SIAM J. Matrix Anal. Appl. 17, 1996).

use crate::error::{Error, Result};
use faer::Index;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

/// The order in which the rows of a pattern are eliminated.
pub(super) fn minimum_degree<I: Index>(pattern: SymbolicSparseColMatRef<'_, I>) -> Result<Vec<I>> {
    let n = pattern.nrows();
    let (mut order, mut inverse) = (vec![I::truncate(0); n], vec![I::truncate(0); n]);
    let scratch = amd::order_maybe_unsorted_scratch::<I>(n, pattern.row_idx().len());
    let mut memory = MemBuffer::try_new(scratch).map_err(out_of_memory)?;
    let stack = MemStack::new(&mut memory);
    amd::order_maybe_unsorted(&mut order, &mut inverse, pattern, amd::Control::default(), stack)
        .map_err(out_of_memory)?;
    Ok(order)
}

pub(super) fn out_of_memory<E>(_: E) -> Error {
    Error::OutOfMemory { what: "a sparse Cholesky factor", bytes: None }
}
