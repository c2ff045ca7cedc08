//! Products and eigenvalues of dense matrices in `f64`, by faer's kernels on one thread: the dense work of an
//! eigensolver.

use faer::diag::DiagMut;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::evd::{ComputeEigenvectors, SelfAdjointEvdParams, self_adjoint_evd, self_adjoint_evd_scratch};
use faer::linalg::matmul::matmul;
use faer::{Accum, Auto, MatMut, MatRef, Par, Spec};

/// `out = Aᵀ B` of matrices with `rows` rows, all column by column.
pub(crate) fn transposed_product(rows: usize, a: &[f64], b: &[f64], out: &mut [f64]) {
    let (m, n) = (a.len() / rows, b.len() / rows);
    let left = MatRef::from_column_major_slice(a, rows, m);
    let right = MatRef::from_column_major_slice(b, rows, n);
    if n < m {
        // The kernel copies the left factor into its own layout, so that should be the one with few columns.
        let mut transposed = vec![0.0; out.len()];
        let product = MatMut::from_column_major_slice_mut(&mut transposed, n, m);
        matmul(product, Accum::Replace, right.transpose(), left, 1.0, Par::Seq);
        out.iter_mut().enumerate().for_each(|(k, x)| *x = transposed[k % m * n + k / m]);
        return;
    }
    let out = MatMut::from_column_major_slice_mut(out, m, n);
    matmul(out, Accum::Replace, left.transpose(), right, 1.0, Par::Seq);
}

/// `out += factor A B`, A with `rows` rows and as many columns as B has rows, all column by column.
pub(crate) fn add_product(factor: f64, rows: usize, a: &[f64], b: &[f64], out: &mut [f64]) {
    let (inner, n) = (a.len() / rows, out.len() / rows);
    let left = MatRef::from_column_major_slice(a, rows, inner);
    let right = MatRef::from_column_major_slice(b, inner, n);
    let out = MatMut::from_column_major_slice_mut(out, rows, n);
    matmul(out, Accum::Add, left, right, factor, Par::Seq);
}

/// Ascending eigenvalues, and eigenvectors (column by column, in the same order), of a symmetric matrix whose lower
/// triangle is read; `None` if the iteration does not converge.
pub(crate) fn symmetric_eigen(size: usize, a: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let (mut values, mut vectors) = (vec![0.0; size], vec![0.0; size * size]);
    // By QR: faer's divide and conquer (0.24) leaves residuals of 1e-10 for multiple eigenvalues.
    let mut parameters = <SelfAdjointEvdParams as Auto<f64>>::auto();
    parameters.recursion_threshold = usize::MAX;
    let parameters = Spec::new(parameters);
    let scratch = self_adjoint_evd_scratch::<f64>(size, ComputeEigenvectors::Yes, Par::Seq, parameters);
    let mut memory = MemBuffer::try_new(scratch).ok()?;
    let result = self_adjoint_evd(
        MatRef::from_column_major_slice(a, size, size),
        DiagMut::from_slice_mut(&mut values),
        Some(MatMut::from_column_major_slice_mut(&mut vectors, size, size)),
        Par::Seq,
        MemStack::new(&mut memory),
        parameters,
    );
    result.ok().map(|()| (values, vectors))
}
