//! Cholesky factorization of the small dense matrices of contact, including semidefinite ones: Delassus operators and
//! S = G M⁻¹ Gᵀ. LU for unsymmetric Delassus operators.
//!
//! The size is the number of closed contacts. Rows that share no body give zeros, which are skipped, so the diagonal
//! S of a lumped mass has almost no cost; large full matrices use faer's blocked kernel. Redundant contacts make the
//! matrix semidefinite: the least-norm solution is then returned.

use crate::memory::Scratch;
use crate::real::{Kernels, Real};
use crate::rounding::{rounding, share_of_rounding};

/// Lower factor L of a symmetric positive semidefinite matrix, or L U of a general one, with its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct DenseCholesky<T> {
    size: usize,
    /// Size × size: the lower triangle of L row by row, or column by column if it is blocked; for LU both triangles
    /// row by row.
    l: Vec<T>,
    /// First nonzero column of each row of L (its skyline); for LU the rows in the order of their pivots.
    first: Vec<usize>,
    /// Diagonal of the matrix; for LU the scale of each row and column.
    diagonal: Vec<T>,
    /// Rows that do not depend on earlier ones. The columns of L of dependent rows are zero.
    independent: Vec<usize>,
    kind: Kind,
    /// Factor of LᵀL on the independent columns, if there are dependent ones.
    normal: Vec<T>,
    reduced: Vec<T>,
    /// The inverse of the order of an LU.
    inverse: Vec<usize>,
    scratch: Scratch,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Kind {
    #[default]
    Skyline,
    Blocked,
    General,
}

/// Smallest size for the blocked kernel.
const BLOCKED: usize = 48;

impl<T: Real> DenseCholesky<T> {
    /// Factorizes the matrix with entries `entry(i, j)`, j ≤ i.
    ///
    /// A row is dependent if its pivot is less than `size · 64 ε` of its diagonal entry, or at most the rounding of
    /// the combination of rows that the pivot measures. `Err(row)` if the matrix is not finite or not semidefinite
    /// there.
    pub(crate) fn factorize(&mut self, size: usize, entry: impl Fn(usize, usize) -> T) -> Result<(), usize> {
        let fill = |i: usize, row: &mut [T]| row.iter_mut().enumerate().for_each(|(j, x)| *x = entry(i, j));
        self.factorize_rows(size, 0.0, fill)
    }

    /// The same with `fill(i, row)`, which writes the entries j ≤ i of row i. A row is dependent also if its pivot is
    /// less than the share `least` of its diagonal entry.
    pub(crate) fn factorize_rows(
        &mut self,
        size: usize,
        least: f64,
        mut fill: impl FnMut(usize, &mut [T]),
    ) -> Result<(), usize> {
        let Self { l, first, diagonal, independent, kind, reduced, scratch, .. } = self;
        self.size = size;
        l.clear();
        l.reserve_exact(size * size);
        l.resize(size * size, T::zero());
        first.clear();
        diagonal.clear();
        let mut profile = 0;
        for i in 0..size {
            let row = &mut l[i * size..=i * size + i];
            fill(i, row);
            diagonal.push(row[i]);
            first.push(row.iter().position(|x| *x != T::zero()).unwrap_or(i));
            profile += i - first[i];
            if !(row[i] >= T::zero() && T::all_finite(row)) {
                return Err(i);
            }
        }
        let dependent = rounding(T::of(size as f64)).max(T::of(least));
        let suspect = share_of_rounding::<T>().max(dependent);
        independent.clear();
        if size >= BLOCKED && profile > size * size / 4 {
            *kind = Kind::Blocked;
            for i in 0..size {
                for j in 0..i {
                    l[i + j * size] = l[i * size + j];
                }
            }
            let memory = scratch.get(<T as Kernels>::dense_cholesky_scratch(size));
            let sound = |l: &[T], i: usize| l[i + i * size] * l[i + i * size] > suspect * diagonal[i];
            if T::dense_cholesky(size, l, memory) && (0..size).all(|i| sound(l, i)) {
                independent.extend(0..size);
                return Ok(());
            }
            // Failed: factorize again row by row from the start, because the kernel has overwritten both triangles.
            for i in 0..size {
                fill(i, &mut l[i * size..=i * size + i]);
            }
        }
        *kind = Kind::Skyline;
        for i in 0..size {
            let (done, rest) = l.split_at_mut(i * size);
            let row = &mut rest[..=i];
            for j in first[i]..i {
                let start = first[i].max(first[j]);
                let other = &done[j * size..=j * size + j];
                row[j] = match other[j] > T::zero() {
                    true => (row[j] - dot(&row[start..j], &other[start..j])) / other[j],
                    false => T::zero(),
                };
            }
            let pivot = row[first[i]..i].iter().fold(diagonal[i], |p, &x| p - x * x);
            // A pivot above the rounding of its own diagonal entry may still be rounding of earlier rows, amplified
            // by their pivots.
            let sound = pivot > dependent * diagonal[i]
                && (pivot > suspect * diagonal[i] || {
                    let length =
                        combination(done, &row[..i], size, independent, diagonal, reduced) + diagonal[i].sqrt();
                    pivot > rounding(length * length)
                });
            if sound {
                row[i] = pivot.sqrt();
                independent.push(i);
            } else {
                row[i] = T::zero();
            }
        }
        self.normal.clear();
        Ok(())
    }

    /// Factorizes a general matrix with entries `entry(i, j)` and a nonnegative diagonal by LU with partial pivoting.
    /// Rows and columns are scaled by powers of two near the roots of the diagonal, relative to its largest entry: in
    /// units that differ by a power of two the digits are the same.
    ///
    /// If a pivot is lost in rounding, the matrix is singular: the factor cannot be used to solve. `Err(row)` as from
    /// [`factorize`](Self::factorize).
    pub(crate) fn factorize_general(&mut self, size: usize, entry: impl Fn(usize, usize) -> T) -> Result<(), usize> {
        let Self { l, first: order, diagonal: scale, independent, inverse, kind, scratch, .. } = self;
        (self.size, *kind) = (size, Kind::General);
        let own = |i: usize| entry(i, i);
        if let Some(i) = (0..size).find(|&i| !(own(i) >= T::zero() && own(i).is_finite())) {
            return Err(i);
        }
        let exponent = |i: usize| i32::from(own(i).integer_decode().1);
        let largest = (0..size).map(exponent).max().unwrap_or(0);
        scale.clear();
        scale.extend((0..size).map(|i| T::of(2.0).powi((largest - exponent(i)) / 2)));
        l.clear();
        l.reserve_exact(size * size);
        for i in 0..size {
            l.extend((0..size).map(|j| entry(i, j) * scale[i] * scale[j]));
            if !T::all_finite(&l[i * size..]) {
                return Err(i);
            }
        }
        for list in [&mut *order, inverse] {
            list.clear();
            list.resize(size, 0);
        }
        let memory = scratch.get(T::dense_lu_scratch(size));
        T::dense_lu(size, l, [order, inverse], memory);
        // Written so that NaN, from a zero diagonal, counts as singular.
        let root = |i: usize| own(i).sqrt() * scale[i];
        let dependent = rounding(T::of(size as f64));
        let is_sound = |&k: &usize| l[k * size + k].abs() > dependent * root(k) * root(order[k]);
        independent.clear();
        independent.extend((0..size).take_while(is_sound));
        Ok(())
    }

    /// Solves with the scaled factors: x = D L⁻¹U⁻¹ P D b.
    fn solve_general(&mut self, x: &mut [T]) {
        let Self { size, l, first: order, diagonal: scale, reduced, .. } = self;
        reduced.clear();
        reduced.extend(order.iter().map(|&i| x[i] * scale[i]));
        T::dense_lu_solve(*size, l, reduced);
        for ((x, &scale), &solution) in x.iter_mut().zip(&*scale).zip(&*reduced) {
            *x = solution * scale;
        }
    }

    /// Whether some row depends on the others.
    pub(crate) fn is_singular(&self) -> bool {
        self.independent.len() < self.size
    }

    /// Factorizes LᵀL on the independent columns.
    fn factorize_normal(&mut self) {
        let Self { size, l, independent, normal, reduced, .. } = self;
        let (n, rank) = (*size, independent.len());
        normal.clear();
        normal.reserve_exact(rank * rank);
        normal.resize(rank * rank, T::zero());
        let mut count = 0;
        for k in 0..n {
            // Entries of L above the diagonal are not defined.
            count += usize::from(independent.get(count) == Some(&k));
            reduced.clear();
            reduced.extend(independent[..count].iter().map(|&i| l[k * n + i]));
            for (a, &x) in reduced.iter().enumerate().filter(|(_, x)| **x != T::zero()) {
                T::axpy(x, &reduced[..=a], &mut normal[a * rank..=a * rank + a]);
            }
        }
        for a in 0..rank {
            let (done, row) = normal.split_at_mut(a * rank);
            for b in 0..a {
                let other = &done[b * rank..=b * rank + b];
                row[b] = (row[b] - dot(&row[..b], &other[..b])) / other[b];
            }
            row[a] = (row[a] - dot(&row[..a], &row[..a])).sqrt();
        }
    }

    /// Solves A x = b in place; for a singular A the least-norm x of least residual. Not defined for a singular general
    /// factorization.
    pub(crate) fn solve(&mut self, x: &mut [T]) {
        let n = self.size;
        if self.kind == Kind::General {
            self.solve_general(x);
            return;
        }
        if self.kind == Kind::Blocked {
            T::dense_cholesky_solve(n, &self.l, x);
            return;
        }
        if self.is_singular() {
            self.solve_least_norm(x);
            return;
        }
        for i in 0..n {
            let row = &self.l[i * n..=i * n + i];
            x[i] = (x[i] - dot(&row[self.first[i]..i], &x[self.first[i]..i])) / row[i];
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

    /// A⁺ b = L (LᵀL)⁻² Lᵀ b.
    fn solve_least_norm(&mut self, x: &mut [T]) {
        if self.normal.is_empty() {
            self.factorize_normal();
        }
        let Self { size, l, independent, normal, reduced, .. } = self;
        let (n, rank) = (*size, independent.len());
        reduced.clear();
        reduced.extend(independent.iter().map(|&i| (i..n).map(|k| l[k * n + i] * x[k]).sum::<T>()));
        for _ in 0..2 {
            for a in 0..rank {
                let row = &normal[a * rank..=a * rank + a];
                reduced[a] = (reduced[a] - dot(&row[..a], &reduced[..a])) / row[a];
            }
            for a in (0..rank).rev() {
                let row = &normal[a * rank..=a * rank + a];
                reduced[a] /= row[a];
                let value = reduced[a];
                for (k, &entry) in row[..a].iter().enumerate() {
                    reduced[k] -= entry * value;
                }
            }
        }
        for (k, x) in x.iter_mut().enumerate() {
            let columns = independent.iter().zip(reduced.iter()).take_while(|(i, _)| **i <= k);
            *x = columns.map(|(&i, &value)| l[k * n + i] * value).sum();
        }
    }
}

/// Length Σ |r_j| √A_jj of the combination r of independent rows that is nearest to a row, from the row's entries of
/// L: r = L⁻ᵀ l. The pivot is the remainder of A for their difference, and the rounding of A enters it multiplied by
/// the square of this length.
fn combination<T: Real>(l: &[T], row: &[T], size: usize, independent: &[usize], diagonal: &[T], r: &mut Vec<T>) -> T {
    r.clear();
    r.extend(independent.iter().map(|&j| row[j]));
    for k in (0..r.len()).rev() {
        let other = &l[independent[k] * size..];
        r[k] /= other[independent[k]];
        let value = r[k];
        for (r, &j) in r[..k].iter_mut().zip(independent) {
            *r -= value * other[j];
        }
    }
    r.iter().zip(independent).map(|(r, &j)| r.abs() * diagonal[j].sqrt()).sum()
}

/// Σ x y in four partial sums, which the processor can compute in parallel.
pub(crate) fn dot<T: Real>(x: &[T], y: &[T]) -> T {
    let (mut sums, split) = ([T::zero(); 4], x.len() - x.len() % 4);
    for (x, y) in x[..split].chunks_exact(4).zip(y[..split].chunks_exact(4)) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    let rest = x[split..].iter().zip(&y[split..]).map(|(&x, &y)| x * y).sum::<T>();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::DenseCholesky;

    #[test]
    fn solves_with_a_skyline() {
        let a = [[4.0, 0.0, 2.0], [0.0, 3.0, 0.0], [2.0, 0.0, 5.0]];
        let mut factor = DenseCholesky::default();
        factor.factorize(3, |i, j| a[i][j]).unwrap();
        let mut x = [8.0_f64, 3.0, 12.0];
        factor.solve(&mut x);
        for (x, expected) in x.iter().zip([1.0, 1.0, 2.0]) {
            assert!((x - expected).abs() < 1e-15);
        }
        assert_eq!(factor.factorize(1, |_, _| f64::NAN), Err(0));
        assert_eq!(factor.factorize(2, |i, j| if i == j { i as f64 - 1.0 } else { 0.0 }), Err(0));
    }

    /// B Bᵀ with B of n × rank.
    fn product(n: usize, rank: usize) -> Vec<Vec<f64>> {
        let b = |i: usize, k: usize| ((i * 7 + k * 13 + i * k) % 11) as f64 - 5.0 + if i == k { 40.0 } else { 0.0 };
        (0..n).map(|i| (0..n).map(|j| (0..rank).map(|k| b(i, k) * b(j, k)).sum()).collect()).collect()
    }

    #[test]
    fn general_matrices_are_solved_with_and_singular_ones_found() {
        for n in [1, 2, 5, 40, 90] {
            // A weak diagonal, and units that differ by rows and columns: (unit i) a (unit j).
            let unit = |i: usize| [1.0, 1e6, 1e-20][i % 3];
            let a = |i: usize, j: usize| {
                let regular = if i == j { 1e-9 } else { ((i * 13 + j * 7 + i * j * j) % 101) as f64 - 50.0 };
                unit(i) * unit(j) * regular
            };
            let x: Vec<f64> = (0..n).map(|i| (1.0 + i as f64).sin() / unit(i)).collect();
            let mut b: Vec<f64> = (0..n).map(|i| (0..n).map(|j| a(i, j) * x[j]).sum()).collect();
            let mut factor = DenseCholesky::default();
            factor.factorize_general(n, a).unwrap();
            assert!(!factor.is_singular());
            factor.solve(&mut b);
            for (i, (b, x)) in b.iter().zip(&x).enumerate() {
                assert!((b - x).abs() * unit(i) < 1e-9, "{n}, row {i}: {b} {x}");
            }
        }
        let mut factor = DenseCholesky::default();
        // The third row is the sum of the others.
        let a = [[2.0, 1.0, 0.5], [-1.0, 3.0, 0.1], [1.0, 4.0, 0.6]];
        factor.factorize_general(3, |i, j| a[i][j]).unwrap();
        assert!(factor.is_singular());
        factor.factorize_general(2, |_, _| 0.0).unwrap();
        assert!(factor.is_singular());
        assert_eq!(factor.factorize_general(2, |i, _| if i == 1 { f64::NAN } else { 1.0 }), Err(1));
        assert_eq!(factor.factorize_general(2, |i, j| if i == j { i as f64 - 1.0 } else { 0.0 }), Err(0));
    }

    #[test]
    fn general_factors_have_the_same_digits_in_other_units() {
        for n in [1, 2, 3, 9, 40, 90] {
            let a = |i: usize, j: usize| ((i * 13 + j * 7 + i * j * j) as f64).sin() + if i == j { 2.0 } else { 0.0 };
            let solution = |unit: f64| -> Vec<u64> {
                let mut factor = DenseCholesky::default();
                factor.factorize_general(n, |i, j| unit * a(i, j)).unwrap();
                let mut x: Vec<f64> = (0..n).map(|i| unit * (i as f64).cos()).collect();
                factor.solve(&mut x);
                x.iter().map(|x| x.to_bits()).collect()
            };
            for power in [-59, 61, 1] {
                assert_eq!(solution(1.0), solution(2.0_f64.powi(power)), "{n}, {power}");
            }
        }
    }

    #[test]
    fn least_norm_and_full_rank_at_every_size() {
        for (n, rank) in [(1, 1), (7, 7), (7, 3), (60, 60), (60, 59), (100, 40)] {
            let a = product(n, rank);
            let times =
                |x: &[f64]| -> Vec<f64> { a.iter().map(|r| r.iter().zip(x).map(|(a, x)| a * x).sum()).collect() };
            let largest = a.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
            let z: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
            // x = A z is in the range of A, hence the solution of least norm of A x = A A z.
            let x = times(&z);
            let mut solution = times(&x);
            let mut factor = DenseCholesky::default();
            factor.factorize(n, |i, j| a[i][j]).unwrap();
            assert_eq!(factor.is_singular(), rank < n);
            factor.solve(&mut solution);
            let norm = x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let worst = solution.iter().zip(&x).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            assert!(worst < 1e-7 * norm.max(largest), "{n} {rank}: {worst:e} of {norm:e}");
        }
    }
}
