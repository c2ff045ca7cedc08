//! Sweeps over a supernodal factor for one right-hand side, at the speed of reading the factor once.
//!
//! Four columns of a supernode go together: every entry of L is read once, every entry of the vector a quarter as often. The
//! loops are plain; pulp compiles them for the vector units of the machine that they run on.
#![allow(clippy::inline_always)] // what is not inlined is not compiled for these

use super::Real;
use super::kernels::{Columns, Supernodal, supernodes};
use faer::traits::pulp::Arch;
use std::ops::Range;

/// Columns that go together.
const WIDTH: usize = 4;

/// Sums that are kept side by side in a dot product.
const LANES: usize = 8;

/// Forward over `columns` for one right-hand side.
pub(super) fn forward<T: Real>(factor: &Supernodal<'_, T>, columns: Range<usize>, x: Columns<'_, T>) {
    Arch::new().dispatch(
        #[inline(always)]
        || forward_with(factor, columns, x),
    );
}

/// Backward over `columns` for one right-hand side; entries behind them hold the solution.
pub(super) fn backward<T: Real>(factor: &Supernodal<'_, T>, columns: Range<usize>, x: Columns<'_, T>) {
    Arch::new().dispatch(
        #[inline(always)]
        || backward_with(factor, columns, x),
    );
}

/// The part of a supernode that a sweep over some columns visits.
struct Panel<'a, T> {
    /// First column, and number of columns.
    start: usize,
    size: usize,
    /// Rows from the first column's on.
    rows: usize,
    /// Entries of a column of the whole supernode, and the columns from the first one on, each from the first row on.
    stride: usize,
    values: &'a [T],
    /// The rows that do not follow the columns of the supernode.
    pattern: &'a [usize],
}

impl<'a, T> Panel<'a, T> {
    #[inline(always)]
    fn new(factor: &Supernodal<'a, T>, supernode: usize, columns: &Range<usize>) -> Self {
        let symbolic = factor.symbolic;
        let (begin, behind) = (symbolic.supernode_begin()[supernode], symbolic.supernode_end()[supernode]);
        let pattern = symbolic.supernode(supernode).pattern();
        let (start, end) = (columns.start.max(begin), columns.end.min(behind));
        let stride = behind - begin + pattern.len();
        let first = symbolic.col_ptr_for_val()[supernode] + (start - begin) * (stride + 1);
        let last = symbolic.col_ptr_for_val()[supernode + 1];
        let rows = stride - (start - begin);
        Self { start, size: end - start, rows, stride, values: &factor.values[first..last], pattern }
    }

    /// Column j from its row `from` on.
    #[inline(always)]
    fn column(&self, j: usize, from: usize) -> &'a [T] {
        &self.values[j * self.stride + from..j * self.stride + self.rows]
    }

    /// How many rows follow the first one directly; the others are `pattern`.
    #[inline(always)]
    fn leading(&self) -> usize {
        self.rows - self.pattern.len()
    }
}

#[inline(always)]
fn forward_with<T: Real>(
    factor: &Supernodal<'_, T>,
    columns: Range<usize>,
    Columns { values: x, skipped, scratch }: Columns<'_, T>,
) {
    for supernode in supernodes(factor, &columns) {
        let panel = Panel::new(factor, supernode, &columns);
        let (start, size, leading) = (panel.start - skipped, panel.size, panel.leading());
        let w = &mut scratch[..panel.rows];
        w[..leading].copy_from_slice(&x[start..start + leading]);
        w[leading..].fill(T::zero());
        let mut column = 0;
        while column + WIDTH <= size {
            // The small triangle, column by column, then the rows below it.
            for j in column..column + WIDTH {
                let l = panel.column(j, j);
                let xj = w[j] / l[0];
                w[j] = xj;
                for (x, &l) in w[j + 1..column + WIDTH].iter_mut().zip(&l[1..]) {
                    *x -= l * xj;
                }
            }
            let (done, rest) = w.split_at_mut(column + WIDTH);
            let l: [&[T]; WIDTH] = std::array::from_fn(|k| panel.column(column + k, column + WIDTH));
            subtract(std::array::from_fn(|k| done[column + k]), l, rest);
            column += WIDTH;
        }
        for j in column..size {
            let l = panel.column(j, j);
            let xj = w[j] / l[0];
            w[j] = xj;
            for (x, &l) in w[j + 1..].iter_mut().zip(&l[1..]) {
                *x -= l * xj;
            }
        }
        x[start..start + leading].copy_from_slice(&w[..leading]);
        for (&row, &change) in panel.pattern.iter().zip(&w[leading..]) {
            x[row - skipped] += change;
        }
    }
}

#[inline(always)]
fn backward_with<T: Real>(
    factor: &Supernodal<'_, T>,
    columns: Range<usize>,
    Columns { values: x, skipped, scratch }: Columns<'_, T>,
) {
    for supernode in supernodes(factor, &columns).rev() {
        let panel = Panel::new(factor, supernode, &columns);
        let (start, size, leading) = (panel.start - skipped, panel.size, panel.leading());
        let w = &mut scratch[..panel.rows];
        w[..leading].copy_from_slice(&x[start..start + leading]);
        for (w, &row) in w[leading..].iter_mut().zip(panel.pattern) {
            *w = x[row - skipped];
        }
        // The columns that are no group of four are the last ones, as forward.
        let groups = size - size % WIDTH;
        for j in (groups..size).rev() {
            let l = panel.column(j, j);
            w[j] = (w[j] - dot(&l[1..], &w[j + 1..])) / l[0];
        }
        let mut column = groups;
        while column > 0 {
            column -= WIDTH;
            let l: [&[T]; WIDTH] = std::array::from_fn(|k| panel.column(column + k, column + WIDTH));
            let sums = dots(l, &w[column + WIDTH..]);
            for k in (0..WIDTH).rev() {
                let j = column + k;
                let l = panel.column(j, j);
                let mut sum = w[j] - sums[k];
                for (&x, &l) in w[j + 1..column + WIDTH].iter().zip(&l[1..]) {
                    sum -= l * x;
                }
                w[j] = sum / l[0];
            }
        }
        x[start..start + size].copy_from_slice(&w[..size]);
    }
}

/// `y −= Σ c_k l_k`.
#[inline(always)]
fn subtract<T: Real>(c: [T; WIDTH], l: [&[T]; WIDTH], y: &mut [T]) {
    let n = y.len();
    let [l0, l1, l2, l3] = l.map(|l| &l[..n]);
    for (i, y) in y.iter_mut().enumerate() {
        *y -= (c[0] * l0[i] + c[1] * l1[i]) + (c[2] * l2[i] + c[3] * l3[i]);
    }
}

/// `l_k · x`.
#[inline(always)]
fn dots<T: Real>(l: [&[T]; WIDTH], x: &[T]) -> [T; WIDTH] {
    let n = x.len();
    let l = l.map(|l| &l[..n]);
    let mut lanes = [[T::zero(); LANES]; WIDTH];
    let whole = n - n % LANES;
    for i in (0..whole).step_by(LANES) {
        let x = &x[i..i + LANES];
        for (lanes, l) in lanes.iter_mut().zip(l) {
            let l = &l[i..i + LANES];
            for k in 0..LANES {
                lanes[k] += l[k] * x[k];
            }
        }
    }
    std::array::from_fn(|k| {
        let rest: T = l[k][whole..].iter().zip(&x[whole..]).map(|(&l, &x)| l * x).sum();
        lanes[k].iter().copied().sum::<T>() + rest
    })
}

#[inline(always)]
fn dot<T: Real>(x: &[T], y: &[T]) -> T {
    let mut lanes = [T::zero(); LANES];
    let (a, b) = (x.chunks_exact(LANES), y.chunks_exact(LANES));
    let rest: T = a.remainder().iter().zip(b.remainder()).map(|(&x, &y)| x * y).sum();
    for (x, y) in a.zip(b) {
        for k in 0..LANES {
            lanes[k] += x[k] * y[k];
        }
    }
    lanes.iter().copied().sum::<T>() + rest
}
