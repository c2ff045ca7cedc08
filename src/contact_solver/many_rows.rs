//! Equality problems of many active rows, W_AA x = b, by conjugate gradients, without cubic cost.
//!
//! The preconditioner is a factorized sparse approximate inverse (Kolotilin and Yeremin, SIAM J. Matrix Anal. Appl.
//! 14, 1993): H with a few entries per row, such that H W Hᵀ is near the identity. A contact is coupled most to its
//! neighbors, so a row of H needs only the rows of W with the largest coupling to its own; the number of iterations
//! then does not grow with the number of rows.

use super::ContactProblem;
use super::structure::Structure;
use crate::dense::dot;
use crate::real::Real;
use crate::rounding::{half_digits, rounding};

/// Entries in a row of the approximate inverse, at most.
const WIDTH: usize = 20;

/// Iteration limit; beyond it the dense factor is used.
const ITERATIONS: usize = 300;

/// Restarts of conjugate gradients from the recomputed residual.
const REFINEMENTS: usize = 3;

/// W on the active rows, with its approximate inverse.
#[derive(Clone, Debug, Default)]
pub(super) struct ManyRows<T> {
    /// H by rows: the start of each row, and the places (in the list of active rows) and values of its entries.
    starts: Vec<usize>,
    places: Vec<usize>,
    values: Vec<T>,
    /// 1/√W_ii of the active rows.
    scale: Vec<T>,
    /// Coupling to each earlier row, while a row of H is chosen.
    near: Vec<(T, usize)>,
    /// Lower factor of the block of W for a row of H, row by row.
    block: Vec<T>,
    /// Vectors of the iteration, one entry per active row: residual, preconditioned residual, H r, b.
    residual: Vec<T>,
    preconditioned: Vec<T>,
    inner: Vec<T>,
    right: Vec<T>,
    /// Direction and its product, one entry per row of the problem.
    direction: Vec<T>,
    product: Vec<T>,
}

impl<T: Real> ManyRows<T> {
    /// Computes the approximate inverse for the active `rows` (ascending). Returns false if some row depends on its
    /// neighbors.
    pub(super) fn prepare(&mut self, problem: &ContactProblem<'_, T>, structure: &Structure, rows: &[usize]) -> bool {
        let Self { starts, places, values, scale, near, block, .. } = self;
        starts.clear();
        places.clear();
        values.clear();
        scale.clear();
        starts.push(0);
        // Lower bound of a pivot, in a block scaled to a unit diagonal.
        let least = half_digits();
        for (k, &row) in rows.iter().enumerate() {
            let own = problem.row(row);
            if own[row] <= T::zero() || !own[row].is_finite() {
                return false;
            }
            scale.push(own[row].sqrt().recip());
            near.clear();
            let first = rows[..k].partition_point(|&i| i < structure.range(row).start);
            let before = rows[first..k].iter().zip(&scale[first..]).zip(first..);
            near.extend(before.map(|((&i, &s), j)| ((own[i] * s).abs(), j)));
            if near.len() >= WIDTH {
                // The most coupled rows; of equal ones the first.
                let order = |a: &(T, usize), b: &(T, usize)| b.0.value().total_cmp(&a.0.value()).then(a.1.cmp(&b.1));
                near.select_nth_unstable_by(WIDTH - 2, order);
                near.truncate(WIDTH - 1);
            }
            near.retain(|(size, _)| *size > T::zero());
            let first = places.len();
            places.extend(near.iter().map(|(_, j)| *j));
            places[first..].sort_unstable();
            places.push(k);
            let members = &places[first..];
            if !factorize(members, |i, j| problem.row(rows[i])[rows[j]] * scale[i] * scale[j], least, block) {
                return false;
            }
            // The last row of the inverse of L, scaled back: H_k W_block H_kᵀ = 1.
            let size = members.len();
            values.resize(first + size, T::zero());
            let h = &mut values[first..];
            h[size - 1] = T::one();
            for i in (0..size).rev() {
                h[i] /= block[i * size + i];
                let value = h[i];
                for j in 0..i {
                    h[j] -= block[i * size + j] * value;
                }
            }
            for (h, &j) in h.iter_mut().zip(members) {
                *h *= scale[j];
            }
            starts.push(places.len());
        }
        true
    }

    /// Solves for `x`, which holds b on entry, to rounding. Returns the number of iterations, or `None` if they do
    /// not end; x is then still b.
    pub(super) fn solve(
        &mut self,
        problem: &ContactProblem<'_, T>,
        structure: &Structure,
        rows: &[usize],
        x: &mut [T],
    ) -> Option<usize> {
        let (count, size) = (rows.len(), problem.size());
        for vector in [&mut self.residual, &mut self.preconditioned, &mut self.inner] {
            vector.clear();
            vector.resize(count, T::zero());
        }
        for vector in [&mut self.direction, &mut self.product] {
            vector.clear();
            vector.resize(size, T::zero());
        }
        let mut b = std::mem::take(&mut self.right);
        b.resize(count, T::zero());
        b.copy_from_slice(x);
        x.fill(T::zero());
        self.residual.copy_from_slice(&b);
        let start = self.norm();
        let mut iterations = 0;
        let mut solved = start == T::zero();
        for _ in 0..REFINEMENTS {
            if solved {
                break;
            }
            // As accurate as the recurrence allows.
            let goal = T::epsilon() * start;
            match self.iterate((problem, structure), rows, x, goal, ITERATIONS - iterations) {
                Some(spent) => iterations += spent,
                None => break,
            }
            solved = self.refresh((problem, structure), rows, &b, x);
        }
        if !solved {
            x.copy_from_slice(&b);
        }
        self.right = b;
        solved.then_some(iterations)
    }

    /// The norm of the residual, with rows scaled by the roots of their diagonal.
    fn norm(&self) -> T {
        self.residual.iter().zip(&self.scale).map(|(&r, &s)| (r * s) * (r * s)).sum::<T>().sqrt()
    }

    /// Updates x until the residual is at most `goal`.
    fn iterate(
        &mut self,
        (problem, structure): (&ContactProblem<'_, T>, &Structure),
        rows: &[usize],
        x: &mut [T],
        goal: T,
        limit: usize,
    ) -> Option<usize> {
        let mut before = T::zero();
        for iteration in 0..limit {
            if self.norm() <= goal {
                return Some(iteration);
            }
            self.precondition();
            let now = dot(&self.residual, &self.preconditioned);
            let share = if iteration == 0 { T::zero() } else { now / before };
            before = now;
            for (&row, &z) in rows.iter().zip(&self.preconditioned) {
                self.direction[row] = z + share * self.direction[row];
            }
            self.multiply(problem, structure, rows);
            let curvature = rows.iter().map(|&row| self.direction[row] * self.product[row]).sum::<T>();
            // W is not positive definite along the direction, or a value is NaN.
            let sound = curvature > T::zero() && now > T::zero();
            if !sound {
                return None;
            }
            let length = now / curvature;
            for ((&row, x), r) in rows.iter().zip(x.iter_mut()).zip(&mut self.residual) {
                *x += length * self.direction[row];
                *r -= length * self.product[row];
            }
        }
        None
    }

    /// Hᵀ H r.
    fn precondition(&mut self) {
        let Self { starts, places, values, residual, preconditioned, inner, .. } = self;
        for (range, inner) in starts.windows(2).zip(inner.iter_mut()) {
            let range = range[0]..range[1];
            *inner = places[range.clone()].iter().zip(&values[range]).map(|(&j, &h)| h * residual[j]).sum();
        }
        preconditioned.fill(T::zero());
        for (range, &inner) in starts.windows(2).zip(inner.iter()) {
            let range = range[0]..range[1];
            for (&j, &h) in places[range.clone()].iter().zip(&values[range]) {
                preconditioned[j] += h * inner;
            }
        }
    }

    /// The product of W with the direction on the active rows. Only the lower triangle of W is read.
    fn multiply(&mut self, problem: &ContactProblem<'_, T>, structure: &Structure, rows: &[usize]) {
        let Self { direction, product, .. } = self;
        product.fill(T::zero());
        for &row in rows {
            let (first, p) = (structure.range(row).start, direction[row]);
            let left = &problem.row(row)[first..=row];
            let sum = dot(left, &direction[first..=row]);
            T::axpy(p, &left[..row - first], &mut product[first..row]);
            product[row] += sum;
        }
    }

    /// Recomputes the residual; returns whether every equation is met to the rounding of its terms.
    fn refresh(
        &mut self,
        (problem, structure): (&ContactProblem<'_, T>, &Structure),
        rows: &[usize],
        b: &[T],
        x: &[T],
    ) -> bool {
        let Self { direction, residual, .. } = self;
        direction.fill(T::zero());
        for (&row, &x) in rows.iter().zip(x) {
            direction[row] = x;
        }
        let mut met = true;
        for ((&row, &b), r) in rows.iter().zip(b).zip(residual.iter_mut()) {
            let range = structure.range(row);
            let (own, direction) = (&problem.row(row)[range.clone()], &direction[range]);
            *r = b - dot(own, direction);
            let terms = b.abs() + own.iter().zip(direction).map(|(w, x)| (*w * *x).abs()).sum::<T>();
            met &= r.abs() <= rounding(terms);
        }
        direction.fill(T::zero());
        met
    }
}

/// Cholesky factor of a block with a unit diagonal into `l`, row by row; returns whether every pivot exceeds `least`.
fn factorize<T: Real>(members: &[usize], entry: impl Fn(usize, usize) -> T, least: T, l: &mut Vec<T>) -> bool {
    let size = members.len();
    l.clear();
    l.resize(size * size, T::zero());
    for i in 0..size {
        let (done, row) = l.split_at_mut(i * size);
        let mut pivot = T::one();
        for j in 0..i {
            let other = &done[j * size..=j * size + j];
            let value = (entry(members[i], members[j]) - dot(&row[..j], &other[..j])) / other[j];
            row[j] = value;
            pivot -= value * value;
        }
        let sound = pivot > least;
        if !sound {
            return false;
        }
        row[i] = pivot.sqrt();
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact_solver::AdmissibleSet;
    use crate::dense::DenseCholesky;

    /// The flexibility of nodes on a square grid: decays with their distance, as on the surface of a body.
    fn flexibility(side: usize, range: f64) -> Vec<f64> {
        let n = side * side;
        let place = |i: usize| [(i % side) as f64, (i / side) as f64];
        let unit = |i: usize| if i.is_multiple_of(5) { 1e3 } else { 1.0 };
        let entry = |i: usize, j: usize| {
            let distance = (place(i)[0] - place(j)[0]).hypot(place(i)[1] - place(j)[1]);
            unit(i) * unit(j) * (if i == j { 1.02 } else { 1.0 }) * (-distance / range).exp()
        };
        (0..n * n).map(|e| entry(e / n, e % n)).collect()
    }

    fn problem<'a>(w: &'a [f64], q: &'a [f64], sets: &'a [AdmissibleSet]) -> ContactProblem<'a, f64> {
        ContactProblem::new(w, q, sets, q).unwrap()
    }

    #[test]
    fn solves_to_rounding_in_iterations_that_do_not_grow() {
        for range in [0.5, 2.0, 6.0] {
            let mut most = [0; 2];
            for (side, most) in [12, 24].into_iter().zip(&mut most) {
                let n = side * side;
                let (w, b) = (flexibility(side, range), (0..n).map(|i| (i as f64).sin()).collect::<Vec<_>>());
                let sets = vec![AdmissibleSet::Free; n];
                let problem = problem(&w, &b, &sets);
                let rows: Vec<usize> = (0..n).filter(|i| i % 7 != 3).collect();
                let mut many = ManyRows::default();
                let mut structure = Structure::default();
                structure.find(&problem);
                assert!(many.prepare(&problem, &structure, &rows));
                let mut x: Vec<f64> = rows.iter().map(|&i| b[i]).collect();
                *most = many.solve(&problem, &structure, &rows, &mut x).unwrap();
                let mut factor = DenseCholesky::default();
                factor.factorize(rows.len(), |i, j| w[rows[i] * n + rows[j]]).unwrap();
                let mut direct: Vec<f64> = rows.iter().map(|&i| b[i]).collect();
                factor.solve(&mut direct);
                for (k, &i) in rows.iter().enumerate() {
                    let scale = w[i * n + i].sqrt().recip();
                    assert!((x[k] - direct[k]).abs() < 1e-10 * scale, "{range} {side}: {} {}", x[k], direct[k]);
                }
            }
            assert!(most[1] <= most[0] + 6 && most[1] < 40, "{range}: {most:?}");
        }
    }

    #[test]
    fn dependent_rows_are_left_to_the_dense_factor() {
        let (side, n) = (6, 36);
        let mut w = flexibility(side, 2.0);
        // Row 20 equals row 19.
        for j in 0..n {
            w[20 * n + j] = w[19 * n + j];
        }
        for j in 0..n {
            w[j * n + 20] = w[j * n + 19];
        }
        let (q, sets, rows) = (vec![0.0; n], vec![AdmissibleSet::Free; n], (0..n).collect::<Vec<_>>());
        let prepares = |w: &[f64]| {
            let (problem, mut structure) = (problem(w, &q, &sets), Structure::default());
            structure.find(&problem);
            ManyRows::default().prepare(&problem, &structure, &rows)
        };
        assert!(!prepares(&w));
        w[5 * n + 5] = 0.0;
        assert!(!prepares(&w));
    }
}
