//! Sweeps over a supernodal factor for one right-hand side, at the speed of reading the factor once.
//!
//! Eight columns of a supernode are processed together: every entry of L is read once, every entry of the vector an
//! eighth as often. The inner loops are separate functions, compiled for the vector units of the machine that they
//! run on; inlined into larger functions, they are not always vectorized.
//!
//! The interior is swept branch by branch of its elimination forest, by several threads with the feature `rayon`,
//! which also share large supernodes.
#![allow(clippy::inline_always)] // only inlined code is compiled for the vector units

use super::cholesky::{RightHandSide, Supernodal, supernodes};
use super::forest::Forest;
use super::plan::Plan;
use crate::scalar::Scalar;
use crate::threads::{self, GRAIN, Threads};
use faer::traits::pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Partial sums of a dot product.
const LANES: usize = 8;

/// Columns of a heavy panel that are swept before threads share the rows below; the fewest rows in a share forward,
/// and columns in a share backward. Multiples of eight, so that groups of columns are the same in all parts.
const BLOCK: usize = 128;
const ROWS: usize = 256;
const SHARE: usize = 16;

/// A factor and its forest.
#[derive(Debug)]
struct Interior<'a, T> {
    factor: Supernodal<'a, T>,
    forest: &'a Forest,
}

/// Forward over a forest: on return the work vector of each supernode holds its unknowns of L y = b, followed by its
/// contribution to the parent. `b` is the right-hand side; column k reads its entry `order[k]`, or k without an
/// order.
pub(crate) fn forest_forward<T: Scalar>(
    factor: Supernodal<'_, T>,
    forest: &Forest,
    b: &[T],
    order: Option<&[usize]>,
    w: &mut [T],
) {
    forward_plan(&forest.plan, &Forward { interior: &Interior { factor, forest }, b, order }, 0, w);
}

/// Backward over a forest: on return the work vector of each supernode holds its unknowns of Lᵀ x = y. On entry the
/// work vectors of the roots hold the solution on the rows below them.
pub(crate) fn forest_backward<T: Scalar>(factor: Supernodal<'_, T>, forest: &Forest, w: &mut [T]) {
    backward_plan(&forest.plan, &Interior { factor, forest }, 0, w);
}

/// Input of forward sweeps.
struct Forward<'a, T> {
    interior: &'a Interior<'a, T>,
    b: &'a [T],
    order: Option<&'a [usize]>,
}

/// `w` starts with the work vector of supernode `from`.
fn forward_plan<T: Scalar>(plan: &Plan, forward: &Forward<'_, T>, from: usize, w: &mut [T]) {
    match plan {
        Plan::Serial(range) => forward_serial(forward, range.clone(), from, w),
        Plan::Stem(branch, stem) => {
            forward_plan(branch, forward, from, w);
            forward_serial(forward, stem.clone(), from, w);
        }
        Plan::Fork(branches, cut) => {
            let offsets = &forward.interior.forest.offsets;
            let (first, second) = w.split_at_mut(offsets[*cut] - offsets[from]);
            crate::threads::join(
                || forward_plan(&branches[0], forward, from, first),
                || forward_plan(&branches[1], forward, *cut, second),
            );
        }
    }
}

fn backward_plan<T: Scalar>(plan: &Plan, interior: &Interior<'_, T>, from: usize, w: &mut [T]) {
    match plan {
        Plan::Serial(range) => backward_serial(interior, range.clone(), from, w),
        Plan::Stem(branch, stem) => {
            backward_serial(interior, stem.clone(), from, w);
            backward_plan(branch, interior, from, w);
        }
        Plan::Fork(branches, cut) => {
            let offsets = &interior.forest.offsets;
            let (first, second) = w.split_at_mut(offsets[*cut] - offsets[from]);
            crate::threads::join(
                || backward_plan(&branches[0], interior, from, first),
                || backward_plan(&branches[1], interior, *cut, second),
            );
        }
    }
}

fn forward_serial<T: Scalar>(forward: &Forward<'_, T>, range: Range<usize>, from: usize, w: &mut [T]) {
    let Forward { interior: Interior { factor, forest }, b, order } = *forward;
    let (base, arch) = (forest.offsets[from], Arch::new());
    for s in range {
        let (below, rest) = w.split_at_mut(forest.offsets[s] - base);
        let panel = Panel::whole(factor, s);
        let own = &mut rest[..panel.rows];
        let (top, update) = own.split_at_mut(panel.size);
        match order {
            Some(order) => top.iter_mut().zip(&order[forest.columns(s)]).for_each(|(x, &dof)| *x = b[dof]),
            None => top.copy_from_slice(&b[forest.columns(s)]),
        }
        update.fill(T::zero());
        for &child in forest.children(s) {
            let update = &below[forest.update(child).start - base..forest.update(child).end - base];
            for (&place, &change) in forest.places(child).iter().zip(update) {
                own[place] += change;
            }
        }
        panel.forward(arch, own);
    }
}

fn backward_serial<T: Scalar>(interior: &Interior<'_, T>, range: Range<usize>, from: usize, w: &mut [T]) {
    let Interior { factor, forest } = interior;
    let (base, arch) = (forest.offsets[from], Arch::new());
    for s in range.rev() {
        let (below, rest) = w.split_at_mut(forest.offsets[s] - base);
        let panel = Panel::whole(factor, s);
        let own = &mut rest[..panel.rows];
        panel.backward(arch, own);
        for &child in forest.children(s) {
            let known = &mut below[forest.update(child).start - base..forest.update(child).end - base];
            for (&place, known) in forest.places(child).iter().zip(known) {
                *known = own[place];
            }
        }
    }
}

/// The part of a supernode that a sweep over some columns visits.
pub(super) struct Panel<'a, T> {
    /// First column, and number of columns.
    pub(super) start: usize,
    pub(super) size: usize,
    /// Rows from the diagonal entry of the first column down.
    pub(super) rows: usize,
    /// Number of entries of a column of the whole supernode.
    stride: usize,
    /// The columns, `stride` apart, starting at the diagonal entry of the first one.
    values: &'a [T],
    /// The rows below the columns of the whole supernode.
    pub(super) pattern: &'a [usize],
}

impl<'a, T> Panel<'a, T> {
    #[inline]
    pub(super) fn new(factor: &Supernodal<'a, T>, supernode: usize, columns: &Range<usize>) -> Self {
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

    /// Column j, starting at its row `from`.
    #[inline]
    pub(super) fn column(&self, j: usize, from: usize) -> &'a [T] {
        &self.values[j * self.stride + from..j * self.stride + self.rows]
    }

    /// Number of rows that are columns of the supernode; the others are `pattern`.
    #[inline]
    fn leading(&self) -> usize {
        self.rows - self.pattern.len()
    }

    /// All of a supernode.
    #[inline]
    fn whole(factor: &Supernodal<'a, T>, supernode: usize) -> Self {
        let symbolic = factor.symbolic;
        Self::new(factor, supernode, &(symbolic.supernode_begin()[supernode]..symbolic.supernode_end()[supernode]))
    }
}

impl<T: Scalar> Panel<'_, T> {
    /// Eliminates the columns: `w` holds their right-hand sides, followed by the right-hand sides of the rows below.
    fn forward(&self, arch: Arch, w: &mut [T]) {
        let threads = if self.is_heavy() { threads::count() } else { 1 };
        if threads == 1 {
            return self.eliminate(arch, 0..self.size, w);
        }
        // Each row has the same sum for any blocks and shares.
        for columns in parts(&(0..self.size), BLOCK) {
            let (done, below) = w.split_at_mut(columns.end);
            self.eliminate(arch, columns.clone(), done);
            let share = below.len().div_ceil(threads).max(ROWS);
            threads::each_chunk(Threads::All, below, share, &|chunk, y| {
                self.subtract(arch, columns.clone(), done, columns.end + chunk * share, y);
            });
        }
    }

    /// Solves for the columns: `w` holds their right-hand sides, followed by the solution on the rows below.
    fn backward(&self, arch: Arch, w: &mut [T]) {
        if !self.is_heavy() {
            return self.substitute(arch, 0..self.size, w);
        }
        // The sums of each column end with its block, with one thread as well. One thread proceeds group by group, to
        // read memory in order.
        let width = if threads::count() == 1 { 8 } else { BLOCK };
        let mut sums = [T::zero(); BLOCK];
        for block in parts(&(0..self.size), BLOCK).rev() {
            let (own, known) = w.split_at_mut(block.end);
            for columns in parts(&block, width).rev() {
                let sums = &mut sums[..columns.len()];
                threads::each_chunk(Threads::All, sums, SHARE, &|chunk, sums| {
                    self.dots(arch, columns.start + chunk * SHARE, block.end, known, sums);
                });
                own[columns.clone()].iter_mut().zip(sums).for_each(|(x, sum)| *x -= *sum);
                self.substitute(arch, columns, own);
            }
        }
    }

    /// Whether the panel deserves more than one thread.
    fn is_heavy(&self) -> bool {
        self.rows * self.size >= GRAIN
    }

    /// Eliminates some columns from `w`, which may end above the last row.
    fn eliminate(&self, arch: Arch, columns: Range<usize>, w: &mut [T]) {
        let [eights, fours] = groups(&columns);
        (columns.start..eights).step_by(8).for_each(|column| self.eliminate_group::<8>(arch, column, w));
        (eights..fours).step_by(4).for_each(|column| self.eliminate_group::<4>(arch, column, w));
        (fours..columns.end).for_each(|column| self.eliminate_group::<1>(arch, column, w));
    }

    /// Solves for some columns with `w`, which may end above the last row.
    fn substitute(&self, arch: Arch, columns: Range<usize>, w: &mut [T]) {
        let [eights, fours] = groups(&columns);
        (fours..columns.end).rev().for_each(|column| self.substitute_group::<1>(arch, column, w));
        (eights..fours).rev().step_by(4).for_each(|last| self.substitute_group::<4>(arch, last - 3, w));
        (columns.start..eights).rev().step_by(8).for_each(|last| self.substitute_group::<8>(arch, last - 7, w));
    }

    /// Subtracts the eliminated columns, whose unknowns are in `x`, from the rows `y` that start at row `from`.
    fn subtract(&self, arch: Arch, columns: Range<usize>, x: &[T], from: usize, y: &mut [T]) {
        let [eights, fours] = groups(&columns);
        (columns.start..eights).step_by(8).for_each(|column| self.subtract_group::<8>(arch, column, x, from, y));
        (eights..fours).step_by(4).for_each(|column| self.subtract_group::<4>(arch, column, x, from, y));
        (fours..columns.end).for_each(|column| self.subtract_group::<1>(arch, column, x, from, y));
    }

    /// Products of the columns starting at `first`, one for each of the `sums`, with the solution `x` on the rows
    /// starting at `from`.
    fn dots(&self, arch: Arch, first: usize, from: usize, x: &[T], sums: &mut [T]) {
        let mut column = first;
        let (eights, rest) = sums.as_chunks_mut();
        for sums in eights {
            *sums = self.dots_group::<8>(arch, column, from, x);
            column += 8;
        }
        let (fours, rest) = rest.as_chunks_mut();
        for sums in fours {
            *sums = self.dots_group::<4>(arch, column, from, x);
            column += 4;
        }
        for (sum, column) in rest.iter_mut().zip(column..) {
            [*sum] = self.dots_group::<1>(arch, column, from, x);
        }
    }

    /// Eliminates N columns: the small triangle, column by column, then the rows below it.
    fn eliminate_group<const N: usize>(&self, arch: Arch, column: usize, w: &mut [T]) {
        let behind = column + N;
        for j in column..behind {
            let l = self.column(j, j);
            let xj = w[j] / l[0];
            w[j] = xj;
            for (x, &l) in w[j + 1..behind].iter_mut().zip(&l[1..]) {
                *x -= l * xj;
            }
        }
        let (done, y) = w.split_at_mut(behind);
        self.subtract_group::<N>(arch, column, done, behind, y);
    }

    #[inline]
    fn subtract_group<const N: usize>(&self, arch: Arch, column: usize, x: &[T], from: usize, y: &mut [T]) {
        let l = std::array::from_fn(|k| self.column(column + k, from));
        arch.dispatch(Subtract::<T, N> { c: std::array::from_fn(|k| x[column + k]), l, y });
    }

    /// Solves for N columns.
    fn substitute_group<const N: usize>(&self, arch: Arch, column: usize, w: &mut [T]) {
        let behind = column + N;
        let sums = self.dots_group::<N>(arch, column, behind, &w[behind..]);
        for (j, dot) in (column..behind).zip(sums).rev() {
            let l = self.column(j, j);
            let mut sum = w[j] - dot;
            for (&x, &l) in w[j + 1..behind].iter().zip(&l[1..]) {
                sum -= l * x;
            }
            w[j] = sum / l[0];
        }
    }

    #[inline]
    fn dots_group<const N: usize>(&self, arch: Arch, column: usize, from: usize, x: &[T]) -> [T; N] {
        let l = std::array::from_fn(|k| self.column(column + k, from));
        arch.dispatch(Dots::<T, N> { l, x })
    }
}

/// Splits a range into parts of `width` columns; the last one may have fewer.
fn parts(columns: &Range<usize>, width: usize) -> impl DoubleEndedIterator<Item = Range<usize>> + use<> {
    let Range { start, end } = *columns;
    (0..columns.len().div_ceil(width)).map(move |part| start + part * width..(start + (part + 1) * width).min(end))
}

/// The ends of the columns that are processed by eights, and by fours.
fn groups(columns: &Range<usize>) -> [usize; 2] {
    [columns.end - columns.len() % 8, columns.end - columns.len() % 4]
}

/// Forward over `columns` for one right-hand side.
pub(crate) fn forward<T: Scalar>(
    factor: &Supernodal<'_, T>,
    columns: Range<usize>,
    RightHandSide { values: x, skipped, scratch }: RightHandSide<'_, T>,
) {
    let arch = Arch::new();
    for supernode in supernodes(factor, &columns) {
        let panel = Panel::new(factor, supernode, &columns);
        let (start, leading) = (panel.start - skipped, panel.leading());
        let w = &mut scratch[..panel.rows];
        w[..leading].copy_from_slice(&x[start..start + leading]);
        w[leading..].fill(T::zero());
        panel.forward(arch, w);
        x[start..start + leading].copy_from_slice(&w[..leading]);
        for (&row, &change) in panel.pattern.iter().zip(&w[leading..]) {
            x[row - skipped] += change;
        }
    }
}

/// Backward over `columns` for one right-hand side; later entries hold the solution.
pub(crate) fn backward<T: Scalar>(
    factor: &Supernodal<'_, T>,
    columns: Range<usize>,
    RightHandSide { values: x, skipped, scratch }: RightHandSide<'_, T>,
) {
    let arch = Arch::new();
    for supernode in supernodes(factor, &columns).rev() {
        let panel = Panel::new(factor, supernode, &columns);
        let (start, size, leading) = (panel.start - skipped, panel.size, panel.leading());
        let w = &mut scratch[..panel.rows];
        w[..leading].copy_from_slice(&x[start..start + leading]);
        for (w, &row) in w[leading..].iter_mut().zip(panel.pattern) {
            *w = x[row - skipped];
        }
        panel.backward(arch, w);
        x[start..start + size].copy_from_slice(&w[..size]);
    }
}

/// `y −= Σ c_k l_k`.
struct Subtract<'a, T, const N: usize> {
    c: [T; N],
    l: [&'a [T]; N],
    y: &'a mut [T],
}

impl<T: Scalar, const N: usize> WithSimd for Subtract<'_, T, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { c, l, y } = self;
        let n = y.len();
        let l = l.map(|l| &l[..n]);
        for (i, y) in y.iter_mut().enumerate() {
            let mut sum = c[0] * l[0][i];
            for k in 1..N {
                sum += c[k] * l[k][i];
            }
            *y -= sum;
        }
    }
}

/// `l_k · x`.
struct Dots<'a, T, const N: usize> {
    l: [&'a [T]; N],
    x: &'a [T],
}

impl<T: Scalar, const N: usize> WithSimd for Dots<'_, T, N> {
    type Output = [T; N];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [T; N] {
        let (x, rest) = self.x.as_chunks::<LANES>();
        let l = self.l.map(|l| l[..self.x.len()].as_chunks::<LANES>());
        let chunks = l.map(|(chunks, _)| &chunks[..x.len()]);
        let mut lanes = [[T::zero(); LANES]; N];
        for (i, x) in x.iter().enumerate() {
            for (lanes, chunks) in lanes.iter_mut().zip(chunks) {
                for (lane, (&l, &x)) in lanes.iter_mut().zip(chunks[i].iter().zip(x)) {
                    *lane += l * x;
                }
            }
        }
        std::array::from_fn(|k| {
            let rest: T = l[k].1.iter().zip(rest).map(|(&l, &x)| l * x).sum();
            lanes[k].iter().copied().sum::<T>() + rest
        })
    }
}
