//! Dense matrices of a few rows, written out.

/// A matrix by its rows.
pub(crate) type Matrix = Vec<Vec<f64>>;

/// A matrix of zeros.
pub(crate) fn zeros(rows: usize, columns: usize) -> Matrix {
    vec![vec![0.0; columns]; rows]
}

/// x · y.
pub(crate) fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// Σ |x_i y_i|: the size of what a product is the sum of.
pub(crate) fn size(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| (x * y).abs()).sum()
}

/// A x.
pub(crate) fn product(a: &Matrix, x: &[f64]) -> Vec<f64> {
    a.iter().map(|row| dot(row, x)).collect()
}

/// y += c x.
pub(crate) fn add(y: &mut [f64], c: f64, x: &[f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += c * x);
}

/// A⁻¹ b by elimination with row pivoting; none for a matrix that is singular.
pub(crate) fn solve(mut a: Matrix, mut b: Vec<f64>) -> Option<Vec<f64>> {
    eliminate(&mut a, std::slice::from_mut(&mut b)).then_some(b)
}

/// The same for several b, in their place; says whether the matrix is regular.
pub(crate) fn eliminate(a: &mut Matrix, columns: &mut [Vec<f64>]) -> bool {
    let n = a.len();
    for k in 0..n {
        let best = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs())).unwrap_or(k);
        if a[best][k].abs() < 1e-300 {
            return false;
        }
        a.swap(k, best);
        columns.iter_mut().for_each(|b| b.swap(k, best));
        let (pivots, rest) = a.split_at_mut(k + 1);
        for (row, i) in rest.iter_mut().zip(k + 1..) {
            let factor = row[k] / pivots[k][k];
            add(&mut row[k..], -factor, &pivots[k][k..]);
            columns.iter_mut().for_each(|b| b[i] -= factor * b[k]);
        }
    }
    for b in columns {
        for k in (0..n).rev() {
            let known = dot(&a[k][k + 1..], &b[k + 1..]);
            b[k] = (b[k] - known) / a[k][k];
        }
    }
    true
}
