//! Products of sparse matrices and vectors.
#![allow(clippy::inline_always)] // only inlined code is compiled for the vector units

use super::vector::Accumulate;
use crate::scalar::Scalar;
use faer::sparse::SparseColMatRef;
use faer::traits::pulp::{Arch, Simd, WithSimd};

/// `y += c A x`, any A.
#[inline]
pub(crate) fn product<T: Scalar>(c: T, a: SparseColMatRef<'_, usize, T>, x: &[T], y: &mut [T]) {
    for (j, &xj) in x.iter().enumerate() {
        let cx = c * xj;
        for (&i, &value) in a.row_idx_of_col_raw(j).iter().zip(a.val_of_col(j)) {
            y[i] += value * cx;
        }
    }
}

/// `y = c A x` or `y += c A x` for symmetric A (both triangles stored): columns are read as rows.
#[inline]
pub(crate) fn symmetric_product<T: Scalar>(
    c: T,
    a: SparseColMatRef<'_, usize, T>,
    x: &[T],
    y: &mut [T],
    put: Accumulate,
) {
    let (pointers, rows, values) = (a.col_ptr(), a.row_idx(), a.val());
    for (yj, range) in y.iter_mut().zip(pointers.windows(2)) {
        let mut sum = T::zero();
        for (&i, &value) in rows[range[0]..range[1]].iter().zip(&values[range[0]..range[1]]) {
            sum += value * x[i];
        }
        match put {
            Accumulate::Replace => *yj = c * sum,
            Accumulate::Add => *yj += c * sum,
        }
    }
}

/// A tridiagonal symmetric matrix: the diagonal, and the off-diagonal entries.
#[derive(Clone, Copy, Debug)]
pub struct Tridiagonal<'a, T> {
    pub diagonal: &'a [T],
    pub beside: &'a [T],
}

/// `y = c A x` or `y += c A x` for tridiagonal symmetric A.
#[inline]
pub(crate) fn tridiagonal_product<T: Scalar>(c: T, a: Tridiagonal<'_, T>, x: &[T], y: &mut [T], put: Accumulate) {
    Arch::new().dispatch(TridiagonalProduct { c, a, x, y, put });
}

struct TridiagonalProduct<'a, T> {
    c: T,
    a: Tridiagonal<'a, T>,
    x: &'a [T],
    y: &'a mut [T],
    put: Accumulate,
}

impl<T: Scalar> WithSimd for TridiagonalProduct<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { c, a: Tridiagonal { diagonal, beside }, x, y, put } = self;
        let n = x.len();
        let ended = |j: usize| {
            let before = if j > 0 { beside[j - 1] * x[j - 1] } else { T::zero() };
            let own = before + diagonal[j] * x[j];
            if j + 1 < n { own + beside[j] * x[j + 1] } else { own }
        };
        let (first, last) = (ended(0), ended(n - 1));
        let write = |y: &mut T, sum: T| match put {
            Accumulate::Replace => *y = c * sum,
            Accumulate::Add => *y += c * sum,
        };
        if n > 2 {
            let inner = n - 2;
            let [before, behind] = [&beside[..inner], &beside[1..=inner]];
            let [left, middle, right] = [&x[..inner], &x[1..=inner], &x[2..]];
            let diagonal = &diagonal[1..=inner];
            for (j, y) in y[1..=inner].iter_mut().enumerate() {
                write(y, before[j] * left[j] + diagonal[j] * middle[j] + behind[j] * right[j]);
            }
        }
        write(&mut y[0], first);
        if n > 1 {
            write(&mut y[n - 1], last);
        }
    }
}

/// Consecutive columns with one pattern (a supervariable, or a part of one), each with entries on all of them:
/// usually the dofs of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Supervariable {
    /// The first column.
    pub column: u32,
    /// How many columns: one to three.
    pub width: u8,
    /// The rows below the columns form groups of this many consecutive rows: the width, or one.
    pub group: u8,
    /// Start of the list of these groups; it ends at the start of the next one.
    pub first: u32,
}

impl Supervariable {
    /// Number of entries of its columns at and below its block, with so many groups of rows below.
    pub(crate) fn entries(self, groups: usize) -> usize {
        let width = usize::from(self.width);
        width * (width + groups * usize::from(self.group))
    }
}

/// Where the entries of a symmetric matrix at and below the diagonal are read.
#[derive(Clone, Copy, Debug)]
pub enum LowerEntries<'a, T> {
    /// In a matrix with both triangles.
    Matrix(SparseColMatRef<'a, usize, T>),
    /// One after the other, column by column, from the first of some columns on; of each supervariable the whole block
    /// on the diagonal.
    Packed(&'a [T]),
}

/// Some columns of a symmetric matrix, read from the diagonal down.
#[derive(Clone, Copy, Debug)]
pub struct LowerColumns<'a, T> {
    pub entries: LowerEntries<'a, T>,
    /// The supervariables of the columns, and the following one.
    pub supervariables: &'a [Supervariable],
    /// The first rows of the groups of all supervariables of the matrix.
    pub groups: &'a [u32],
    /// Supervariables of higher levels are left out. All are multiplied if there are no levels.
    pub levels: (&'a [u8], u8),
}

/// `y += c A x` for the entries of a symmetric A in these columns, at and below the diagonal, and their mirror
/// images. `y` starts at the first of the columns.
#[inline]
pub(crate) fn lower_product<T: Scalar>(c: T, columns: LowerColumns<'_, T>, x: &[T], y: &mut [T]) {
    Arch::new().dispatch(LowerProduct { c, columns, x, y });
}

struct LowerProduct<'a, T> {
    c: T,
    columns: LowerColumns<'a, T>,
    x: &'a [T],
    y: &'a mut [T],
}

impl<T: Scalar> WithSimd for LowerProduct<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let LowerColumns { supervariables, groups, levels: (levels, highest), .. } = self.columns;
        let start = supervariables[0].column as usize;
        let mut at = 0;
        for (number, pair) in supervariables.windows(2).enumerate() {
            let Supervariable { column, width, group, first } = pair[0];
            let (column, groups) = (column as usize, &groups[first as usize..pair[1].first as usize]);
            if levels.get(number).is_some_and(|level| *level > highest) {
                at += pair[0].entries(groups.len());
                continue;
            }
            match (width, group) {
                (3, 3) => self.supervariable::<3, 3>(column, groups, [start, at]),
                (2, 2) => self.supervariable::<2, 2>(column, groups, [start, at]),
                (3, _) => self.supervariable::<3, 1>(column, groups, [start, at]),
                (2, _) => self.supervariable::<2, 1>(column, groups, [start, at]),
                (_, _) => self.supervariable::<1, 1>(column, groups, [start, at]),
            }
            at += pair[0].entries(groups.len());
        }
    }
}

impl<T: Scalar> LowerProduct<'_, T> {
    /// W columns, whose rows below form groups of G, with their first packed entry at `at`. Each entry is read once for
    /// its row and its column.
    #[inline(always)]
    fn supervariable<const W: usize, const G: usize>(
        &mut self,
        column: usize,
        groups: &[u32],
        [start, at]: [usize; 2],
    ) {
        let Self { c, columns, x, y } = self;
        let height = W + groups.len() * G;
        // The entries of a column are in ascending order of rows: the last ones are below the block.
        let tails: [&[T]; W] = match columns.entries {
            LowerEntries::Matrix(matrix) => std::array::from_fn(|k| {
                let end = matrix.col_ptr()[column + k + 1];
                &matrix.val()[end - height..end]
            }),
            LowerEntries::Packed(values) => std::array::from_fn(|k| &values[at + k * height..at + (k + 1) * height]),
        };
        let own: [T; W] = std::array::from_fn(|k| x[column + k]);
        let pushed = own.map(|x| *c * x);
        let mut sums = [[T::zero(); G]; W];
        let mut ends: [T; W] = std::array::from_fn(|k| (0..W).fold(T::zero(), |sum, l| sum + tails[k][l] * own[l]));
        let tails = tails.map(|tail| &tail[W..].as_chunks::<G>().0[..groups.len()]);
        for (i, &row) in groups.iter().enumerate() {
            let row = row as usize;
            let (x, y) = (&x[row..row + G], &mut y[row - start..row - start + G]);
            let mut added = [T::zero(); G];
            for ((sums, tail), &pushed) in sums.iter_mut().zip(&tails).zip(&pushed) {
                for l in 0..G {
                    sums[l] += tail[i][l] * x[l];
                    added[l] += tail[i][l] * pushed;
                }
            }
            y.iter_mut().zip(added).for_each(|(y, added)| *y += added);
        }
        for k in 0..W {
            ends[k] += sums[k].iter().copied().sum::<T>();
            y[column - start + k] += *c * ends[k];
        }
    }
}
