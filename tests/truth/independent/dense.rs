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
    let n = b.len();
    for k in 0..n {
        let best = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))?;
        if a[best][k].abs() < 1e-300 {
            return None;
        }
        a.swap(k, best);
        b.swap(k, best);
        let (pivots, rest) = a.split_at_mut(k + 1);
        let (solved, open) = b.split_at_mut(k + 1);
        for (row, b) in rest.iter_mut().zip(open) {
            let factor = row[k] / pivots[k][k];
            add(&mut row[k..], -factor, &pivots[k][k..]);
            *b -= factor * solved[k];
        }
    }
    for k in (0..n).rev() {
        let known = dot(&a[k][k + 1..], &b[k + 1..]);
        b[k] = (b[k] - known) / a[k][k];
    }
    Some(b)
}
