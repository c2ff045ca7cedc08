//! Elimination orders: approximate minimum degree for the interior, the dofs of contact behind it.

use crate::error::{Error, Result};
use faer::Side;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};

/// The symbolic factorization with `last` (ascending) eliminated last: of several orders the one with the least fill.
pub(super) fn symbolic_cholesky(
    pattern: SymbolicSparseColMatRef<'_, usize>,
    last: &[usize],
) -> Result<SymbolicCholesky<usize>> {
    if last.is_empty() {
        return factorize(pattern, SymmetricOrdering::Amd);
    }
    let degree = minimum_degree(pattern)?;
    let best = with_order(pattern, &moved_last(&degree, last))?;
    // Structures as thin as a chain are eliminated toward the contact; a plate or a solid is not worth the try.
    match best.raw() {
        SymbolicCholeskyRaw::Supernodal(_) => Ok(best),
        SymbolicCholeskyRaw::Simplicial(_) => {
            let other = with_order(pattern, &moved_last(&toward(pattern, last), last))?;
            Ok(if other.len_val() < best.len_val() { other } else { best })
        }
    }
}

fn out_of_memory<E>(_: E) -> Error {
    Error::OutOfMemory { what: "a sparse Cholesky factor" }
}

fn factorize(
    pattern: SymbolicSparseColMatRef<'_, usize>,
    ordering: SymmetricOrdering<'_, usize>,
) -> Result<SymbolicCholesky<usize>> {
    factorize_symbolic_cholesky(pattern, Side::Lower, ordering, CholeskySymbolicParams::default())
        .map_err(out_of_memory)
}

fn with_order(pattern: SymbolicSparseColMatRef<'_, usize>, order: &[usize]) -> Result<SymbolicCholesky<usize>> {
    let mut inverse = vec![0; order.len()];
    for (place, &dof) in order.iter().enumerate() {
        inverse[dof] = place;
    }
    factorize(pattern, SymmetricOrdering::Custom(PermRef::new_checked(order, &inverse, order.len())))
}

/// Approximate minimum degree.
fn minimum_degree(pattern: SymbolicSparseColMatRef<'_, usize>) -> Result<Vec<usize>> {
    let n = pattern.nrows();
    let (mut order, mut inverse) = (vec![0; n], vec![0; n]);
    let scratch = amd::order_maybe_unsorted_scratch::<usize>(n, pattern.row_idx().len());
    let mut memory = MemBuffer::try_new(scratch).map_err(out_of_memory)?;
    let stack = MemStack::new(&mut memory);
    amd::order_maybe_unsorted(&mut order, &mut inverse, pattern, amd::Control::default(), stack)
        .map_err(out_of_memory)?;
    Ok(order)
}

/// The same order with the dofs of `last` behind the others.
fn moved_last(order: &[usize], last: &[usize]) -> Vec<usize> {
    let is_last = |dof: &usize| last.binary_search(dof).is_ok();
    let interior = order.iter().copied().filter(|dof| !is_last(dof));
    interior.chain(order.iter().copied().filter(is_last)).collect()
}

/// Each connected part from the dofs farthest from `last` (in the graph of the matrix) to those nearest.
fn toward(pattern: SymbolicSparseColMatRef<'_, usize>, last: &[usize]) -> Vec<usize> {
    let n = pattern.nrows();
    let mut order = Vec::with_capacity(n);
    let mut reached = vec![false; n];
    // Backward: a breadth-first walk from the contact dofs of one part after the other.
    for start in last.iter().copied().chain(0..n) {
        if reached[start] {
            continue;
        }
        let mut next = order.len();
        reached[start] = true;
        order.push(start);
        while let Some(&dof) = order.get(next) {
            next += 1;
            for &neighbor in pattern.row_idx_of_col_raw(dof) {
                if !reached[neighbor] {
                    reached[neighbor] = true;
                    order.push(neighbor);
                }
            }
        }
    }
    order.reverse();
    order
}
