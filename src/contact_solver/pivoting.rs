//! Principal pivoting: exact for every positive semi-definite W, with a proof if there is no solution.

use super::acceptance::Settings;
use super::structure::Symmetry;
use super::sweeps::{Schedule, Sweeps};
use super::{AdmissibleSet, ContactFailure, ContactProblem, ContactSolver};
use crate::dense::dot;
use crate::real::Real;
use crate::rounding::{rounding, share_of_rounding};

/// Principal pivoting on the dense Delassus operator, including redundant rows: the reference solver.
///
/// The method of Dantzig, van de Panne and Whinston for symmetric W (Cottle, Pang and Stone, The Linear
/// Complementarity Problem, ch. 4), in the factorized form of Goldfarb and Idnani (Math. Program. 27, 1983). The most
/// violated row p is driven: λ_p grows, or falls if it is free and y_p > 0, while the active rows keep y = 0, until
///
/// * y_p = 0: p becomes active, or
/// * an active λ_j = 0: j leaves, and p is driven on, or
/// * neither: λ grows along a direction d with W d = 0, qᵀ d < 0 and d ≥ 0 on unilateral rows. Then no λ makes y ≥ 0,
///   as dᵀ y = dᵀ q: the problem has no solution, and the error names p.
///
/// This is finite, and ties need no rule: rows leave at most until none is left, then p becomes active with λ_p > 0,
/// and ½ λᵀ W λ + qᵀ λ has fallen. That energy is minimal over the active rows, so no active set repeats. Only rows
/// independent of the active ones enter, so the active block is positive definite for every semi-definite W; its
/// Cholesky factor is updated row by row. At each pivot the multipliers are solved again from W and q, with iterative
/// refinement, so errors do not accumulate.
///
/// A pivot costs O(n²) and a problem usually O(n³), with about one pivot per active row; suitable up to a few hundred
/// rows. Of several solutions it finds a basic one: the rows with λ ≠ 0 are independent. Only if these are so nearly
/// dependent that the residual exceeds rounding, Gauss–Seidel sweeps spread the load to the implied rows. The guess
/// is not used, so the multipliers never depend on it.
///
/// An unsymmetric W is rejected ([`ContactFailure::Unsymmetric`]): the factor is a Cholesky factor, and the argument
/// that no set repeats needs an energy.
///
/// Known weakness: steady contact saves no work; in the worst case the number of pivots is exponential (never seen,
/// and limited); a row that is independent only by rounding counts as dependent.
///
/// ```
/// use contact_dynamics::contact_solver::{AdmissibleSet, ContactProblem, Pivoting};
/// use contact_dynamics::ContactSolver;
///
/// // The same contact twice, and one that it repels.
/// let w = [1.0, 1.0, -1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 2.0];
/// let sets = [AdmissibleSet::NonNegative; 3];
/// let problem = ContactProblem::new(&w, &[-1.0, -1.0, 0.5], &sets, &[1e-15; 3]).unwrap();
/// let mut lambda = [0.0_f64; 3];
/// Pivoting::default().solve(&problem, &mut lambda).unwrap();
/// assert!((lambda[0] + lambda[1] - 1.5).abs() < 1e-15 && (lambda[2] - 0.5).abs() < 1e-15);
/// assert!(lambda[0] == 0.0 || lambda[1] == 0.0);
///
/// // Two obstacles closer than the body is thick.
/// let w = [1.0, -1.0, -1.0, 1.0];
/// let problem = ContactProblem::new(&w, &[-1.0, 0.5], &sets[..2], &[1e-15; 2]).unwrap();
/// assert!(Pivoting::default().solve(&problem, &mut lambda[..2]).is_err());
/// ```
#[derive(Clone, Debug, Default)]
pub struct Pivoting<T = f64> {
    basis: Basis<T>,
    status: Vec<Status>,
    sweeps: Sweeps<T>,
}

/// Limit of Gauss–Seidel sweeps if the active block, though independent, is so badly conditioned that implied rows
/// fail the acceptance rule: they then share the load, and the solution is not basic.
const POLISH: usize = 1000;

/// State of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Status {
    /// λ = 0.
    Inactive,
    /// λ = 0, and y = 0 to the rounding of the present active rows.
    Implied,
    /// y = 0.
    Active,
}

/// The active rows, and the Cholesky factor of their block.
#[derive(Clone, Debug, Default)]
struct Basis<T> {
    rows: Vec<usize>,
    /// Row-major lower triangle; stride = size of the problem.
    factor: Vec<T>,
    stride: usize,
    /// Row of the factor that the driven row would get on entering.
    entry: Vec<T>,
    /// Change of the active multipliers for a unit change of the driven one.
    direction: Vec<T>,
    right: Vec<T>,
}

/// Response of the gap of the driven row to its multiplier.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Response<T> {
    /// ∂y_p/∂λ_p; zero if the row depends on the active ones.
    slope: T,
    /// Rounding of the direction's entries, times √W_jj.
    noise: T,
}

impl<T: Real> Basis<T> {
    fn clear(&mut self, size: usize) {
        self.rows.clear();
        self.factor.clear();
        self.factor.reserve_exact(size * size);
        self.factor.resize(size * size, T::zero());
        self.stride = size;
    }

    /// L⁻¹ b in place.
    fn forward(factor: &[T], stride: usize, b: &mut [T]) {
        for i in 0..b.len() {
            let row = &factor[i * stride..=i * stride + i];
            b[i] = (b[i] - dot(&row[..i], &b[..i])) / row[i];
        }
    }

    /// L⁻ᵀ b in place.
    fn backward(factor: &[T], stride: usize, b: &mut [T]) {
        for i in (0..b.len()).rev() {
            let row = &factor[i * stride..=i * stride + i];
            b[i] /= row[i];
            let x = b[i];
            for (b, &l) in b[..i].iter_mut().zip(row) {
                *b -= l * x;
            }
        }
    }

    /// Prepares to drive row p.
    fn drive(&mut self, problem: &ContactProblem<'_, T>, p: usize) -> Response<T> {
        let Self { rows, factor, stride, entry, direction, .. } = self;
        let row = problem.row(p);
        entry.clear();
        entry.extend(rows.iter().map(|&j| row[j]));
        Self::forward(factor, *stride, entry);
        direction.clear();
        direction.extend(entry.iter().map(|&x| -x));
        Self::backward(factor, *stride, direction);
        // The slope is rᵀ W r with r = (direction, 1): the rounding of W is multiplied by r twice.
        let slope = row[p] - dot(entry, entry);
        let size = |(&j, r): (&usize, &T)| problem.delassus(j, j).sqrt() * r.abs();
        let length = row[p].sqrt() + rows.iter().zip(direction.iter()).map(size).sum::<T>();
        let dependent = slope <= rounding(length * length);
        // A direction is known to the rounding of W times its condition; a smaller pivot would produce huge
        // multipliers.
        Response { slope: if dependent { T::zero() } else { slope }, noise: share_of_rounding::<T>() * length }
    }

    /// Makes the driven row active.
    fn enter(&mut self, p: usize, slope: T) {
        let start = self.rows.len() * self.stride;
        let row = self.factor[start..].iter_mut();
        for (l, &x) in row.zip(self.entry.iter().chain(std::iter::once(&slope.sqrt()))) {
            *l = x;
        }
        self.rows.push(p);
    }

    /// Removes the k-th active row: its row of the factor is dropped, and rotations restore the triangle.
    fn leave(&mut self, k: usize) -> usize {
        let Self { rows, factor, stride, .. } = self;
        let row = rows.remove(k);
        let last = rows.len();
        for i in k..last {
            let below = (i + 1) * *stride;
            factor.copy_within(below..=below + i + 1, i * *stride);
        }
        for c in k..last {
            let (a, b) = (factor[c * *stride + c], factor[c * *stride + c + 1]);
            let length = a.hypot(b);
            let (cosine, sine) = (a / length, b / length);
            for i in c..last {
                let at = i * *stride + c;
                let (x, y) = (factor[at], factor[at + 1]);
                factor[at] = cosine * x + sine * y;
                factor[at + 1] = cosine * y - sine * x;
            }
        }
        row
    }

    /// Solves y = 0 on the active rows; other multipliers are unchanged.
    fn close(&mut self, problem: &ContactProblem<'_, T>, multipliers: &mut [T]) {
        let Self { rows, factor, stride, right, .. } = self;
        // The second iteration is iterative refinement.
        for _ in 0..2 {
            right.clear();
            right.extend(rows.iter().map(|&i| problem.gap(i, multipliers)));
            Self::forward(factor, *stride, right);
            Self::backward(factor, *stride, right);
            for (&i, &correction) in rows.iter().zip(right.iter()) {
                multipliers[i] -= correction;
            }
        }
    }

    /// Rounding of y_p: its own, plus the rounding carried over by the active rows.
    fn rounding(&self, problem: &ContactProblem<'_, T>, p: usize, multipliers: &[T]) -> T {
        let carried = self.rows.iter().zip(&self.direction).map(|(&j, r)| r.abs() * problem.rounding(j, multipliers));
        problem.rounding(p, multipliers) + carried.sum::<T>()
    }

    /// The active row that acts most against the driven one.
    fn opponent(&self, problem: &ContactProblem<'_, T>, p: usize) -> usize {
        let size = |k: usize| self.direction[k].abs() * problem.delassus(self.rows[k], self.rows[k]).sqrt();
        let hardest = (0..self.rows.len()).reduce(|hardest, k| if size(k) > size(hardest) { k } else { hardest });
        hardest.map_or(p, |k| self.rows[k])
    }

    /// The largest change of λ_p, in the direction of the sign, before an active multiplier is zero, and the position
    /// of that row.
    fn blocking(
        &self,
        problem: &ContactProblem<'_, T>,
        (sign, noise): (T, T),
        multipliers: &[T],
    ) -> Option<(usize, T)> {
        let mut first: Option<(usize, T, T)> = None;
        for (k, (&j, &r)) in self.rows.iter().zip(&self.direction).enumerate() {
            let r = sign * r;
            let pivot = -r * problem.delassus(j, j).sqrt();
            if problem.sets[j] == AdmissibleSet::NonNegative && pivot > noise {
                let step = multipliers[j].max(T::zero()) / -r;
                // Among ties the largest pivot, for accuracy.
                if first.is_none_or(|(_, least, largest)| step < least || (step == least && pivot > largest)) {
                    first = Some((k, step, pivot));
                }
            }
        }
        first.map(|(k, step, _)| (k, step))
    }
}

impl<T: Real> Pivoting<T> {
    /// The most violated row, scaled by √W_ii.
    fn violated(&self, problem: &ContactProblem<'_, T>, multipliers: &[T]) -> Option<usize> {
        let mut worst: Option<(usize, T)> = None;
        for i in 0..problem.size() {
            let diagonal = problem.delassus(i, i);
            if self.status[i] == Status::Inactive && diagonal > T::zero() {
                let y = problem.gap(i, multipliers);
                let y = if problem.sets[i] == AdmissibleSet::Free { -y.abs() } else { y };
                let scaled = y / diagonal.sqrt();
                if worst.is_none_or(|(_, least)| scaled < least) && y < -problem.rounding(i, multipliers) {
                    worst = Some((i, scaled));
                }
            }
        }
        worst.map(|(i, _)| i)
    }

    /// Drives row p until it is active or found to be implied; adds to `pivots`, up to `limit`.
    fn drive(
        &mut self,
        problem: &ContactProblem<'_, T>,
        p: usize,
        multipliers: &mut [T],
        pivots: &mut usize,
        limit: usize,
    ) -> Result<(), ContactFailure<T>> {
        let Self { basis, status, .. } = self;
        while *pivots < limit {
            let Response { slope, noise } = basis.drive(problem, p);
            let gap = problem.gap(p, multipliers);
            // The multiplier of a free row may fall.
            let sign = if problem.sets[p] == AdmissibleSet::Free && gap > T::zero() { -T::one() } else { T::one() };
            let y = sign * gap;
            if multipliers[p] == T::zero() && y >= -basis.rounding(problem, p, multipliers) {
                status[p] = Status::Implied;
                return Ok(());
            }
            *pivots += 1;
            let closing = (slope > T::zero()).then(|| (-y / slope).max(T::zero()));
            let blocking =
                basis.blocking(problem, (sign, if closing.is_some() { T::zero() } else { noise }), multipliers);
            match (closing, blocking) {
                (None, None) => {
                    return Err(ContactFailure::Contradictory {
                        row: p,
                        other: basis.opponent(problem, p),
                        residual: -y,
                    });
                }
                (closing, Some((k, step))) if closing.is_none_or(|closing| step < closing) => {
                    multipliers[p] += sign * step;
                    let row = basis.leave(k);
                    multipliers[row] = T::zero();
                    status[row] = Status::Inactive;
                    basis.close(problem, multipliers);
                }
                (_, _) => {
                    basis.enter(p, slope);
                    status[p] = Status::Active;
                    basis.close(problem, multipliers);
                    // The active set has changed, so implied rows are checked again.
                    for status in status.iter_mut().filter(|status| **status == Status::Implied) {
                        *status = Status::Inactive;
                    }
                    return Ok(());
                }
            }
        }
        Ok(())
    }
}

impl<T: Real> ContactSolver<T> for Pivoting<T> {
    fn solve(&mut self, problem: &ContactProblem<'_, T>, multipliers: &mut [T]) -> Result<usize, ContactFailure<T>> {
        let size = problem.size();
        multipliers.fill(T::zero());
        problem.check_symmetric()?;
        let acceptance = Settings::default().begin(problem, false, multipliers)?;
        self.basis.clear(size);
        self.status.clear();
        self.status.resize(size, Status::Inactive);
        let mut pivots = 0;
        // Far above any observed count.
        let limit = 100 + 20 * size;
        while pivots < limit {
            match self.violated(problem, multipliers) {
                Some(p) => self.drive(problem, p, multipliers, &mut pivots, limit)?,
                None => break,
            }
        }
        for (lambda, set) in multipliers.iter_mut().zip(problem.sets) {
            *lambda = set.nearest(*lambda);
        }
        let schedule = Schedule { omega: T::one(), sweeps: POLISH, impatient: false };
        if self.sweeps.solve(&acceptance, Symmetry::Symmetric, schedule, &mut pivots, multipliers) {
            return Ok(pivots);
        }
        Err(acceptance.failure(pivots, multipliers))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows 0 and 1 lose their multipliers at once, row 1 by the larger pivot, in whatever order they are listed.
    #[test]
    fn of_ties_the_largest_pivot_leaves() {
        let (w, sets) = ([4.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 1.0], [AdmissibleSet::NonNegative; 3]);
        let problem = ContactProblem::new(&w, &[-1.0; 3], &sets, &[0.0; 3]).unwrap();
        for rows in [vec![0, 1], vec![1, 0]] {
            let basis = Basis { rows, direction: vec![-0.5; 2], ..Basis::default() };
            let (position, step): (usize, f64) = basis.blocking(&problem, (1.0, 1e-9), &[2.0, 2.0, 0.0]).unwrap();
            assert_eq!((basis.rows[position], step.to_bits()), (1, 4.0_f64.to_bits()));
        }
    }
}
