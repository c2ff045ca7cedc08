//! Sweeps over a supernodal factor for several interleaved right-hand sides: the entries of a row are adjacent in
//! memory, so every entry of L is read once for all of them and multiplies a whole vector.
//!
//! If a factor exceeds the caches, the time of a solve is the time to read it: eight right-hand sides take little
//! longer than one.
#![allow(clippy::inline_always)] // only inlined code is compiled for the vector units

use super::cholesky::{Supernodal, supernodes};
use super::sweep::Panel;
use crate::scalar::Scalar;
use faer::traits::pulp::{Arch, Simd, WithSimd};

/// Columns of a supernode that are processed together: with eight right-hand sides their multipliers stay in
/// registers.
const GROUP: usize = 4;

/// Number of right-hand sides in a sweep, and in a narrower one.
pub(crate) const WIDEST: usize = 8;
const NARROW: usize = 4;

/// Solves in place for the columns of `rhs`, at most `WIDEST`, with the trailing block of the factor that starts at
/// column `first`. `order` lists the rows of `rhs` in elimination order; `memory` has `WIDEST` values for each of them
/// and for each row of the tallest supernode.
#[inline]
pub(crate) fn solve<T: Scalar>(
    factor: &Supernodal<'_, T>,
    first: usize,
    order: Option<&[usize]>,
    rhs: &mut [T],
    memory: &mut [T],
) {
    match rhs.len() <= NARROW * (factor.symbolic.nrows() - first) {
        true => solve_together::<T, NARROW>(factor, first, order, rhs, memory),
        false => solve_together::<T, WIDEST>(factor, first, order, rhs, memory),
    }
}

fn solve_together<T: Scalar, const W: usize>(
    factor: &Supernodal<'_, T>,
    first: usize,
    order: Option<&[usize]>,
    rhs: &mut [T],
    memory: &mut [T],
) {
    let (columns, arch) = (first..factor.symbolic.nrows(), Arch::new());
    let row = |k: usize| order.map_or(k, |order| order[k]);
    let (x, w) = memory.as_chunks_mut::<W>().0.split_at_mut(columns.len());
    x.fill([T::zero(); W]);
    for (lane, rhs) in rhs.chunks_exact(columns.len()).enumerate() {
        x.iter_mut().enumerate().for_each(|(k, x)| x[lane] = rhs[row(k)]);
    }
    let supernodes = supernodes(factor, &columns);
    for s in supernodes.clone() {
        forward(&Panel::new(factor, s, &columns), arch, first, x, w);
    }
    for s in supernodes.rev() {
        backward(&Panel::new(factor, s, &columns), arch, first, x, w);
    }
    for (lane, rhs) in rhs.chunks_exact_mut(columns.len()).enumerate() {
        x.iter().enumerate().for_each(|(k, x)| rhs[row(k)] = x[lane]);
    }
}

/// Eliminates the columns of a supernode; `x` starts at column `first`.
fn forward<T: Scalar, const W: usize>(
    panel: &Panel<'_, T>,
    arch: Arch,
    first: usize,
    x: &mut [[T; W]],
    w: &mut [[T; W]],
) {
    let (start, size) = (panel.start - first, panel.size);
    let w = &mut w[..panel.rows];
    w[..size].copy_from_slice(&x[start..start + size]);
    w[size..].fill([T::zero(); W]);
    let grouped = size - size % GROUP;
    (0..grouped).step_by(GROUP).for_each(|column| eliminate::<T, W, GROUP>(panel, arch, column, w));
    (grouped..size).for_each(|column| eliminate::<T, W, 1>(panel, arch, column, w));
    x[start..start + size].copy_from_slice(&w[..size]);
    for (&row, change) in panel.pattern.iter().zip(&w[size..]) {
        x[row - first].iter_mut().zip(change).for_each(|(x, change)| *x += *change);
    }
}

/// Solves for the columns of a supernode; `x` starts at column `first`.
fn backward<T: Scalar, const W: usize>(
    panel: &Panel<'_, T>,
    arch: Arch,
    first: usize,
    x: &mut [[T; W]],
    w: &mut [[T; W]],
) {
    let (start, size) = (panel.start - first, panel.size);
    let w = &mut w[..panel.rows];
    w[..size].copy_from_slice(&x[start..start + size]);
    w[size..].iter_mut().zip(panel.pattern).for_each(|(w, &row)| *w = x[row - first]);
    let grouped = size - size % GROUP;
    (grouped..size).rev().for_each(|column| substitute::<T, W, 1>(panel, arch, column, w));
    (0..grouped).step_by(GROUP).rev().for_each(|column| substitute::<T, W, GROUP>(panel, arch, column, w));
    x[start..start + size].copy_from_slice(&w[..size]);
}

/// Eliminates N columns.
#[inline]
fn eliminate<T: Scalar, const W: usize, const N: usize>(
    panel: &Panel<'_, T>,
    arch: Arch,
    column: usize,
    w: &mut [[T; W]],
) {
    let l = std::array::from_fn(|k| panel.column(column + k, column));
    arch.dispatch(Eliminate::<T, W, N> { l, w: &mut w[column..] });
}

/// Solves for N columns.
#[inline]
fn substitute<T: Scalar, const W: usize, const N: usize>(
    panel: &Panel<'_, T>,
    arch: Arch,
    column: usize,
    w: &mut [[T; W]],
) {
    let l = std::array::from_fn(|k| panel.column(column + k, column));
    arch.dispatch(Substitute::<T, W, N> { l, w: &mut w[column..] });
}

/// The small triangle, column by column, then the rows below it: `w −= Σ l_k w_k`.
struct Eliminate<'a, T, const W: usize, const N: usize> {
    /// The columns, starting at the row of the first one, like `w`.
    l: [&'a [T]; N],
    w: &'a mut [[T; W]],
}

impl<T: Scalar, const W: usize, const N: usize> WithSimd for Eliminate<'_, T, W, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { l, w } = self;
        let l = l.map(|l| &l[..w.len()]);
        let (own, below) = w.split_at_mut(N);
        let mut c = [[T::zero(); W]; N];
        for k in 0..N {
            let mut row = own[k];
            for j in 0..k {
                subtract(&mut row, l[j][k], &c[j]);
            }
            c[k] = row.map(|x| x / l[k][k]);
            own[k] = c[k];
        }
        for (i, row) in below.iter_mut().enumerate() {
            let mut sum = *row;
            for k in 0..N {
                subtract(&mut sum, l[k][N + i], &c[k]);
            }
            *row = sum;
        }
    }
}

/// The sums over the rows below, `Σ l_k w`, then the small triangle.
struct Substitute<'a, T, const W: usize, const N: usize> {
    l: [&'a [T]; N],
    w: &'a mut [[T; W]],
}

impl<T: Scalar, const W: usize, const N: usize> WithSimd for Substitute<'_, T, W, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { l, w } = self;
        let l = l.map(|l| &l[..w.len()]);
        let (own, below) = w.split_at_mut(N);
        let mut rest: [[T; W]; N] = std::array::from_fn(|k| own[k]);
        for (i, row) in below.iter().enumerate() {
            for k in 0..N {
                subtract(&mut rest[k], l[k][N + i], row);
            }
        }
        for k in (0..N).rev() {
            for j in k + 1..N {
                let known = own[j];
                subtract(&mut rest[k], l[k][j], &known);
            }
            own[k] = rest[k].map(|x| x / l[k][k]);
        }
    }
}

/// `x −= l c`.
#[inline(always)]
fn subtract<T: Scalar, const W: usize>(x: &mut [T; W], l: T, c: &[T; W]) {
    for (x, &c) in x.iter_mut().zip(c) {
        *x -= l * c;
    }
}
