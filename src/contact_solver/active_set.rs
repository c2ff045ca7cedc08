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
    /// What of y is rounding: in a row's own sum, and with that of the multipliers it is coupled to.
    own: Vec<T>,
    noise: Vec<T>,
}

/// Block exchanges granted without progress before single ones begin.
const BLOCK_TRIES: usize = 3;

impl<T: Real> ContactSolver<T> for ActiveSet<T> {
    fn reserve(&mut self, size: usize) {
        self.factor = DenseCholesky::with_capacity(size);
        self.active = Vec::with_capacity(size);
        self.rows = Vec::with_capacity(size);
        self.solution = Vec::with_capacity(size);
        self.own = Vec::with_capacity(size);
        self.noise = Vec::with_capacity(size);
    }

    fn solve(&mut self, problem: &ContactProblem<'_, T>, multipliers: &mut [T]) -> Result<usize, ContactFailure<T>> {
        let size = problem.size();
        let Self { factor, active, rows, solution, own, noise } = self;
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
            // A multiplier is known to the rounding of its own row, and carries it into the rows it is coupled to: a row of
            // a body at rest beside a body under load must not be judged by its own small numbers.
            own.clear();
            own.extend((0..size).map(|i| problem.rounding(i, multipliers)));
            noise.clear();
            noise.extend((0..size).map(|i| {
                let carried = |j: usize| problem.delassus(i, j).abs() / problem.delassus(j, j) * own[j];
                (0..size).map(|j| if i == j { own[i] } else { carried(j) }).sum::<T>()
            }));
            let violates = |i: usize, multipliers: &[T], active: &[bool]| match problem.bounds[i] {
                Bound::Free => false,
                Bound::NonNegative if active[i] => problem.delassus(i, i) * multipliers[i] < -noise[i],
                Bound::NonNegative => problem.gap(i, multipliers) < -noise[i],
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
    fn rounding_of_a_loaded_row_does_not_exchange_rows_at_rest() {
        // Found by random scenes: the second multiplier is zero to rounding, the first row has no scale of its own.
        let w = [
            1.579_567_724_847_582_6e-6,
            -1.147_454_536_639_987_9e-6,
            0.0,
            -1.147_454_536_639_987_9e-6,
            7.148_794_154_662_025e-6,
            -9.394_326_208_640_901e-8,
            0.0,
            -9.394_326_208_640_901e-8,
            1.753_190_892_225_264_2e-6,
        ];
        let offset = [-6.765_851_609_745_381e-35, 8.129_493_350_609_44e-7, -1.517_144_857_880_793_5e-5];
        let tolerance = [5.3e-37, 2.3e-20, 4.3e-19];
        let problem =
            ContactProblem { delassus: &w, offset: &offset, bounds: &[Bound::NonNegative; 3], tolerance: &tolerance };
        let mut lambda = [0.0_f64; 3];
        let iterations = ActiveSet::default().solve(&problem, &mut lambda).unwrap();
        assert!(iterations <= 4, "{iterations}");
        assert!((lambda[2] - 8.653_620_462_031_572).abs() < 1e-12 && lambda[1].abs() < 1e-12, "{lambda:?}");
    }

    #[test]
    fn dependent_rows_are_named() {
        let failure = solve(&[1.0, 1.0, 1.0, 1.0], &[-1.0, -1.0], &[Bound::NonNegative; 2], &[0.0; 2]);
        assert_eq!(failure, Err(ContactFailure::Dependent { row: 1 }));
    }
}
