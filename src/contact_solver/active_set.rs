//! Primal–dual active set with a finite safeguard: exact up to rounding.

use super::{Bound, ContactFailure, ContactProblem, ContactSolver};
use crate::dense::DenseCholesky;
use crate::real::Real;

/// Primal–dual active set (semismooth Newton) on the dense Delassus operator, safeguarded by Murty's least-index rule.
///
/// Every iteration solves the equality problem of the active rows and exchanges all rows that violate a sign. Plain,
/// this can cycle; following Júdice and Pires (Computers & Operations Research 21, 1994) exchanges of whole blocks go
/// on only while the number of violations falls, otherwise a single row, the last one, is exchanged until it falls
/// again. That is finite for every positive definite W. Steady contact takes one iteration.
#[derive(Clone, Debug, Default)]
pub struct ActiveSet<T = f64> {
    factor: DenseCholesky<T>,
    active: Vec<bool>,
    rows: Vec<usize>,
    solution: Vec<T>,
}

/// Block exchanges granted without progress before single ones begin.
const BLOCK_TRIES: usize = 3;

impl<T: Real> ContactSolver<T> for ActiveSet<T> {
    fn reserve(&mut self, size: usize) {
        self.factor = DenseCholesky::with_capacity(size);
        self.active = Vec::with_capacity(size);
        self.rows = Vec::with_capacity(size);
        self.solution = Vec::with_capacity(size);
    }

    fn solve(&mut self, problem: &ContactProblem<'_, T>, multipliers: &mut [T]) -> Result<usize, ContactFailure<T>> {
        let size = problem.size();
        let Self { factor, active, rows, solution } = self;
        active.clear();
        active.extend(multipliers.iter().zip(problem.bounds).map(|(&l, &b)| b == Bound::Free || l > T::zero()));
        let (mut fewest, mut tries) = (usize::MAX, BLOCK_TRIES);
        // Single exchanges are finite but may be many; this bound is far above anything seen.
        let limit = 100 + 20 * size;
        for iteration in 1..=limit {
            rows.clear();
            rows.extend((0..size).filter(|&i| active[i]));
            factor
                .factorize(rows.len(), |i, j| problem.delassus(rows[i], rows[j]))
                .map_err(|i| ContactFailure::Dependent { row: rows[i] })?;
            solution.clear();
            solution.extend(rows.iter().map(|&i| -problem.offset[i]));
            factor.solve(solution);
            multipliers.fill(T::zero());
            for (&i, &lambda) in rows.iter().zip(solution.iter()) {
                multipliers[i] = lambda;
            }
            let violates = |i: usize, multipliers: &[T], active: &[bool]| match problem.bounds[i] {
                Bound::Free => false,
                Bound::NonNegative if active[i] => {
                    problem.delassus(i, i) * multipliers[i] < -problem.rounding(i, multipliers)
                }
                Bound::NonNegative => problem.gap(i, multipliers) < -problem.rounding(i, multipliers),
            };
            let violations = (0..size).filter(|&i| violates(i, multipliers, active));
            let (count, last) = violations.fold((0, 0), |(count, _), i| (count + 1, i));
            if count == 0 {
                for (lambda, bound) in multipliers.iter_mut().zip(problem.bounds) {
                    if *bound == Bound::NonNegative {
                        *lambda = lambda.max(T::zero());
                    }
                }
                return Ok(iteration);
            }
            if count < fewest {
                (fewest, tries) = (count, BLOCK_TRIES);
            } else {
                tries = tries.saturating_sub(1);
            }
            if tries > 0 {
                // Inactive rows first: their gaps need the old multipliers of the active ones only.
                for i in 0..size {
                    if violates(i, multipliers, active) {
                        active[i] = !active[i];
                    }
                }
            } else {
                active[last] = !active[last];
            }
        }
        let (row, residual) = problem.residual(multipliers);
        Err(ContactFailure::NotConverged { iterations: limit, row, residual })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solve(w: &[f64], q: &[f64], bounds: &[Bound], guess: &[f64]) -> Result<Vec<f64>, ContactFailure<f64>> {
        let tolerance = vec![1e-13; q.len()];
        let problem = ContactProblem { delassus: w, offset: q, bounds, tolerance: &tolerance };
        let mut lambda = guess.to_vec();
        let mut solver = ActiveSet::default();
        solver.solve(&problem, &mut lambda)?;
        assert!(problem.residual(&lambda).1 < 1e-12, "{lambda:?}");
        Ok(lambda)
    }

    #[test]
    fn guess_does_not_change_the_solution() {
        // A row that repels another one: activating both is wrong.
        let w = [1.0, 0.9, 0.9, 1.0];
        for guess in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
            let lambda = solve(&w, &[-1.0, -0.5], &[Bound::NonNegative; 2], &guess).unwrap();
            assert!((lambda[0] - 1.0).abs() < 1e-15 && lambda[1] == 0.0, "{lambda:?}");
        }
    }

    #[test]
    fn free_rows_may_pull() {
        let lambda = solve(&[2.0, 0.0, 0.0, 2.0], &[1.0, 1.0], &[Bound::Free, Bound::NonNegative], &[0.0; 2]).unwrap();
        assert!((lambda[0] + 0.5).abs() < 1e-15 && lambda[1] == 0.0, "{lambda:?}");
    }

    #[test]
    fn a_problem_on_which_block_exchanges_cycle_is_solved() {
        // Found by search: exchanging all violating rows at once repeats after three iterations.
        let w = [
            [13.1, -5.0, -11.0, 3.0, 12.0],
            [-5.0, 17.1, 7.0, 3.0, 0.0],
            [-11.0, 7.0, 10.1, -3.0, -9.0],
            [3.0, 3.0, -3.0, 10.1, 2.0],
            [12.0, 0.0, -9.0, 2.0, 13.1],
        ];
        let lambda = solve(&w.concat(), &[4.0, -2.0, -4.0, -2.0, 1.0], &[Bound::NonNegative; 5], &[0.0; 5]).unwrap();
        assert!(lambda.iter().all(|&l| l >= 0.0) && lambda.iter().any(|&l| l > 0.0), "{lambda:?}");
    }

    #[test]
    fn dependent_rows_are_named() {
        let failure = solve(&[1.0, 1.0, 1.0, 1.0], &[-1.0, -1.0], &[Bound::NonNegative; 2], &[0.0; 2]);
        assert_eq!(failure, Err(ContactFailure::Dependent { row: 1 }));
    }
}
