//! Products of sparse matrices and vectors.

use crate::scalar::Scalar;
use faer::sparse::SparseColMatRef;

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

/// `y = A x` for symmetric A (both triangles stored): columns are read as rows, and `put` writes each sum.
#[inline]
pub(crate) fn symmetric_product<T: Scalar>(
    a: SparseColMatRef<'_, usize, T>,
    x: &[T],
    y: &mut [T],
    put: impl Fn(&mut T, T),
) {
    let (pointers, rows, values) = (a.col_ptr(), a.row_idx(), a.val());
    for (yj, range) in y.iter_mut().zip(pointers.windows(2)) {
        let mut sum = T::zero();
        for (&i, &value) in rows[range[0]..range[1]].iter().zip(&values[range[0]..range[1]]) {
            sum += value * x[i];
        }
        put(yj, sum);
    }
}
