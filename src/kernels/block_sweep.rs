//! Sweeps over a supernodal factor for several right-hand sides together, by products of dense blocks; a single one
//! is passed to `sweep`.

use super::cholesky::{Columns, Supernodal, supernodes};
use super::sweep;
use crate::scalar::Scalar;
use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::prelude::{Reborrow, ReborrowMut};
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::{Accum, MatMut, MatRef, Par};
use std::ops::Range;

/// The forward sweep over `columns`.
#[inline]
pub(crate) fn forward<T: Scalar>(
    factor: &Supernodal<'_, T>,
    columns: Range<usize>,
    Columns { values, skipped, scratch }: Columns<'_, T>,
) {
    let height = factor.symbolic.nrows() - skipped;
    let width = values.len().checked_div(height).unwrap_or(0);
    if width == 1 {
        return sweep::forward(factor, columns, Columns { values, skipped, scratch });
    }
    for supernode in supernodes(factor, &columns) {
        let panel = Panel::new(factor, supernode, &columns);
        let mut x = MatMut::from_column_major_slice_mut(values, height, width);
        let mut top = x.rb_mut().subrows_mut(panel.start - skipped, panel.size);
        solve_lower_triangular_in_place(panel.top, top.rb_mut(), Par::Seq);
        let count = panel.below.nrows();
        let mut product = MatMut::from_column_major_slice_mut(&mut scratch[..count * width], count, width);
        matmul(product.rb_mut(), Accum::Replace, panel.below, top.rb(), T::one(), Par::Seq);
        for (x, product) in values.chunks_exact_mut(height).zip(scratch.chunks_exact(count.max(1))) {
            for (row, &product) in panel.rows().zip(product) {
                x[row - skipped] -= product;
            }
        }
    }
}

/// The backward sweep over `columns`; later entries hold the solution.
#[inline]
pub(crate) fn backward<T: Scalar>(
    factor: &Supernodal<'_, T>,
    columns: Range<usize>,
    Columns { values, skipped, scratch }: Columns<'_, T>,
) {
    let height = factor.symbolic.nrows() - skipped;
    let width = values.len().checked_div(height).unwrap_or(0);
    if width == 1 {
        return sweep::backward(factor, columns, Columns { values, skipped, scratch });
    }
    for supernode in supernodes(factor, &columns).rev() {
        let panel = Panel::new(factor, supernode, &columns);
        let count = panel.below.nrows();
        for (x, gathered) in values.chunks_exact(height).zip(scratch.chunks_exact_mut(count.max(1))) {
            for (row, gathered) in panel.rows().zip(gathered) {
                *gathered = x[row - skipped];
            }
        }
        let gathered = MatRef::from_column_major_slice(&scratch[..count * width], count, width);
        let mut x = MatMut::from_column_major_slice_mut(values, height, width);
        let mut top = x.rb_mut().subrows_mut(panel.start - skipped, panel.size);
        matmul(top.rb_mut(), Accum::Add, panel.below.transpose(), gathered, -T::one(), Par::Seq);
        solve_upper_triangular_in_place(panel.top.transpose(), top, Par::Seq);
    }
}

/// The part of a supernode that a sweep over some columns visits.
struct Panel<'a, T> {
    /// First column, and number of columns.
    start: usize,
    size: usize,
    /// The lower triangle on these columns, and the rows below it.
    top: MatRef<'a, T>,
    below: MatRef<'a, T>,
    /// Number of the rows below that directly follow the columns; the others are `pattern`.
    following: usize,
    pattern: &'a [usize],
}

impl<'a, T> Panel<'a, T> {
    fn new(factor: &Supernodal<'a, T>, supernode: usize, columns: &Range<usize>) -> Self {
        let node = SupernodalLltRef::new(factor.symbolic, factor.values).supernode(supernode);
        let (begin, block) = (node.start(), node.val());
        let (start, end) = (columns.start.max(begin), columns.end.min(begin + block.ncols()));
        let (first, last) = (start - begin, end - begin);
        Self {
            start,
            size: end - start,
            top: block.submatrix(first, first, end - start, end - start),
            below: block.submatrix(last, first, block.nrows() - last, end - start),
            following: block.ncols() - last,
            pattern: node.pattern(),
        }
    }

    /// The rows below the panel, in the order of the rows of `below`.
    fn rows(&self) -> impl Iterator<Item = usize> {
        let behind = self.start + self.size;
        (behind..behind + self.following).chain(self.pattern.iter().copied())
    }
}
