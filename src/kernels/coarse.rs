//! Products with a coarse space: vectors of nodes against vectors of aggregates of nodes.

use crate::scalar::Scalar;
use std::ops::Range;

/// A matrix of blocks of `size`², with a row for each node and a column for each aggregate, stored row by row; each
/// block is stored column by column.
#[derive(Clone, Copy, Debug)]
pub struct NodeRows<'a, T> {
    pub size: usize,
    pub pointers: &'a [usize],
    pub columns: &'a [u32],
    pub values: &'a [T],
}

/// `sums += Aᵀ x` for some rows, with x from the first of them on.
#[inline]
pub(crate) fn gather<T: Scalar>(a: NodeRows<'_, T>, rows: Range<usize>, x: &[T], sums: &mut [T]) {
    match a.size {
        3 => gather_blocks::<T, 3>(a, rows, x, sums),
        2 => gather_blocks::<T, 2>(a, rows, x, sums),
        _ => gather_blocks::<T, 1>(a, rows, x, sums),
    }
}

/// `x −= A weights` for some rows, with x from the first of them on.
#[inline]
pub(crate) fn subtract<T: Scalar>(a: NodeRows<'_, T>, rows: Range<usize>, weights: &[T], x: &mut [T]) {
    match a.size {
        3 => subtract_blocks::<T, 3>(a, rows, weights, x),
        2 => subtract_blocks::<T, 2>(a, rows, weights, x),
        _ => subtract_blocks::<T, 1>(a, rows, weights, x),
    }
}

#[inline]
fn gather_blocks<T: Scalar, const B: usize>(a: NodeRows<'_, T>, rows: Range<usize>, x: &[T], sums: &mut [T]) {
    for (row, x) in rows.zip(x.as_chunks::<B>().0) {
        let range = a.pointers[row]..a.pointers[row + 1];
        let blocks = a.values[range.start * B * B..range.end * B * B].chunks_exact(B * B);
        for (&column, block) in a.columns[range].iter().zip(blocks) {
            let own: [T; B] = std::array::from_fn(|c| (0..B).map(|r| block[c * B + r] * x[r]).sum());
            for (sum, own) in sums[column as usize * B..][..B].iter_mut().zip(own) {
                *sum += own;
            }
        }
    }
}

#[inline]
fn subtract_blocks<T: Scalar, const B: usize>(a: NodeRows<'_, T>, rows: Range<usize>, weights: &[T], x: &mut [T]) {
    for (row, x) in rows.zip(x.as_chunks_mut::<B>().0) {
        let range = a.pointers[row]..a.pointers[row + 1];
        let blocks = a.values[range.start * B * B..range.end * B * B].chunks_exact(B * B);
        let mut own = *x;
        for (&column, block) in a.columns[range].iter().zip(blocks) {
            let weights = &weights[column as usize * B..][..B];
            for c in 0..B {
                for r in 0..B {
                    own[r] -= block[c * B + r] * weights[c];
                }
            }
        }
        *x = own;
    }
}
