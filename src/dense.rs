//! Cholesky factorization of the small dense matrices of contact: Delassus operators and S = G M⁻¹ Gᵀ.
//!
//! The size is the number of closed contacts. Rows that share no body leave zeros, and these are skipped, so that the
//! diagonal S of a lumped mass costs next to nothing.

use crate::real::Real;

/// Lower factor L of a symmetric positive definite matrix, kept with its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct DenseCholesky<T> {
    size: usize,
    /// Row-major lower triangle, stride = size.
    l: Vec<T>,
    /// First nonzero column of each row of L (its skyline).
    first: Vec<usize>,
}

impl<T: Real> DenseCholesky<T> {
    pub(crate) fn with_capacity(size: usize) -> Self {
        Self { size: 0, l: Vec::with_capacity(size * size), first: Vec::with_capacity(size) }
    }

    /// Factorizes the matrix with entries `entry(i, j)`, j ≤ i.
    ///
    /// A pivot that keeps less than `size · 16 eps` of its diagonal entry is a dependent row: `Err(row)`.
    pub(crate) fn factorize(&mut self, size: usize, entry: impl Fn(usize, usize) -> T) -> Result<(), usize> {
        self.size = size;
        self.l.clear();
        self.l.resize(size * size, T::zero());
        self.first.clear();
        let dependent = T::of(16.0 * size as f64) * T::epsilon();
        for i in 0..size {
            let (done, rest) = self.l.split_at_mut(i * size);
            let row = &mut rest[..=i];
            for (j, x) in row.iter_mut().enumerate() {
                *x = entry(i, j);
            }
            let diagonal = row[i];
            let first = row.iter().position(|x| *x != T::zero()).unwrap_or(i);
            for j in first..i {
                let start = first.max(self.first[j]);
                let other = &done[j * size..=j * size + j];
                let mut sum = row[j];
                for k in start..j {
                    sum -= row[k] * other[k];
                }
                row[j] = sum / other[j];
            }
            let pivot = row[first..i].iter().fold(diagonal, |p, &x| p - x * x);
            // Written so that NaN is refused too.
            if !(pivot > dependent * diagonal && pivot.is_finite()) {
                return Err(i);
            }
            row[i] = pivot.sqrt();
            self.first.push(first);
        }
        Ok(())
    }

    /// Solves L Lᵀ x = b in place.
    pub(crate) fn solve(&self, x: &mut [T]) {
        let n = self.size;
        for i in 0..n {
            let row = &self.l[i * n..=i * n + i];
            let mut sum = x[i];
            for k in self.first[i]..i {
                sum -= row[k] * x[k];
            }
            x[i] = sum / row[i];
        }
        for i in (0..n).rev() {
            let row = &self.l[i * n..=i * n + i];
            x[i] /= row[i];
            let xi = x[i];
            for k in self.first[i]..i {
                x[k] -= row[k] * xi;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::DenseCholesky;

    #[test]
    fn solves_with_a_skyline_and_names_the_dependent_row() {
        let a = [[4.0, 0.0, 2.0], [0.0, 3.0, 0.0], [2.0, 0.0, 5.0]];
        let mut factor = DenseCholesky::with_capacity(3);
        factor.factorize(3, |i, j| a[i][j]).unwrap();
        let mut x = [8.0_f64, 3.0, 12.0];
        factor.solve(&mut x);
        for (x, expected) in x.iter().zip([1.0, 1.0, 2.0]) {
            assert!((x - expected).abs() < 1e-15);
        }
        let singular = [[1.0, 2.0], [2.0, 4.0 + 1e-15]];
        assert_eq!(factor.factorize(2, |i, j| singular[i][j]), Err(1));
        assert_eq!(factor.factorize(1, |_, _| f64::NAN), Err(0));
    }
}
