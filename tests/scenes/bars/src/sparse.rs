//! Matrices written down entry by entry, and what tests do with them; masses and springs made of them.

use contact_dynamics::faer::sparse::{SparseColMat, SparseColMatRef, Triplet};
use contact_dynamics::{Factorization, LinearSolver, LinearSystem, Real};
use std::ops::Range;

/// Row, column and value.
pub type Entry = (usize, usize, f64);

/// A square matrix of the entries; those of one place are added in their order.
pub fn matrix<T: Real>(n: usize, entries: impl IntoIterator<Item = Entry>) -> SparseColMat<usize, T> {
    rectangular(n, n, entries)
}

/// The same with rows and columns.
pub fn rectangular<T: Real>(
    rows: usize,
    columns: usize,
    entries: impl IntoIterator<Item = Entry>,
) -> SparseColMat<usize, T> {
    let triplets: Vec<_> = entries.into_iter().map(|(i, j, x)| Triplet::new(i, j, x)).collect();
    let a = SparseColMat::try_new_from_triplets(rows, columns, &triplets).expect("places in the matrix");
    let (pattern, values) = a.into_parts();
    SparseColMat::new(pattern, values.into_iter().map(T::of).collect())
}

/// A diagonal matrix.
pub fn diagonal<T: Real>(values: &[f64]) -> SparseColMat<usize, T> {
    matrix(values.len(), values.iter().enumerate().map(|(i, &x)| (i, i, x)))
}

/// The entries of a matrix, column by column.
pub fn entries(a: &SparseColMat<usize, f64>) -> Vec<Entry> {
    let a = a.as_ref();
    let column = |j: usize| a.row_idx_of_col_raw(j).iter().zip(a.val_of_col(j)).map(move |(&i, &x)| (i, j, x));
    (0..a.ncols()).flat_map(column).collect()
}

/// Rows and columns of a range, of a sum of matrices with weights.
pub fn block(range: &Range<usize>, sum: &[(f64, &SparseColMat<usize, f64>)]) -> SparseColMat<usize, f64> {
    let inside = |&(i, j, _): &Entry| range.contains(&i) && range.contains(&j);
    let of = |&(weight, a): &(f64, &SparseColMat<usize, f64>)| {
        entries(a).into_iter().filter(inside).map(move |(i, j, x)| (i - range.start, j - range.start, weight * x))
    };
    matrix(range.len(), sum.iter().flat_map(of))
}

/// A x.
pub fn product(a: SparseColMatRef<'_, usize, f64>, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; a.nrows()];
    for (j, &xj) in x.iter().enumerate() {
        for (&i, &value) in a.row_idx_of_col_raw(j).iter().zip(a.val_of_col(j)) {
            y[i] += value * xj;
        }
    }
    y
}

/// The factors of a matrix, no dofs last.
pub fn factorized<T: Real>(solver: &dyn LinearSolver<T>, a: &SparseColMat<usize, T>) -> Box<dyn Factorization<T>> {
    let mut factor = solver.analyze(a.symbolic(), &[]).expect("a pattern that the solver takes");
    factor.factorize(a.as_ref()).expect("a regular matrix");
    factor
}

/// The entries of a symmetric element of two dofs: both diagonal ones, and both off the diagonal.
pub fn element(i: usize, j: usize, [diagonal, off]: [f64; 2]) -> [Entry; 4] {
    [(i, i, diagonal), (j, j, diagonal), (i, j, off), (j, i, off)]
}

/// The entries of a spring between two dofs.
pub fn spring(i: usize, j: usize, k: f64) -> [Entry; 4] {
    element(i, j, [k, -k])
}

/// The entries of springs between each of n dofs and the next.
pub fn springs(n: usize, k: f64) -> impl Iterator<Item = Entry> {
    (1..n).flat_map(move |i| spring(i - 1, i, k))
}

/// Masses without springs.
pub fn free(masses: &[f64]) -> LinearSystem<'static, f64> {
    LinearSystem::lumped(masses.to_vec(), diagonal(&vec![0.0; masses.len()])).expect("positive masses")
}
