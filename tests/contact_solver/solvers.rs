//! The contact solvers on their own: against each other, against closed forms, and where they must refuse.

use contact_dynamics::contact_solver::{
    ActiveSet, AdmissibleSet, ContactFailure, ContactProblem, ContactSolver, GaussSeidel, Pivoting,
};
use contact_dynamics::{Error, LinearRows, Newmark, Real, Simulation};
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::sparse::free;

#[derive(Clone, Debug)]
struct Problem<T = f64> {
    delassus: Vec<T>,
    offset: Vec<T>,
    sets: Vec<AdmissibleSet>,
    tolerance: Vec<T>,
}

impl<T: Real> Problem<T> {
    fn unilateral(delassus: &[f64], offset: &[f64]) -> Self {
        Self {
            delassus: delassus.iter().map(|&x| T::of(x)).collect(),
            offset: offset.iter().map(|&x| T::of(x)).collect(),
            sets: vec![AdmissibleSet::NonNegative; offset.len()],
            tolerance: vec![T::zero(); offset.len()],
        }
    }

    fn view(&self) -> ContactProblem<'_, T> {
        let Self { delassus, offset, sets, tolerance } = self;
        ContactProblem::new(delassus, offset, sets, tolerance).unwrap()
    }

    fn gaps(&self, multipliers: &[T]) -> Vec<T> {
        (0..self.offset.len()).map(|i| self.view().gap(i, multipliers)).collect()
    }

    fn scale(&self) -> T {
        self.offset.iter().fold(T::zero(), |scale, q| scale.max(q.abs()))
    }

    /// The residual as a fraction of the largest |q_i|.
    fn residual(&self, multipliers: &[T]) -> f64 {
        assert!(multipliers.iter().zip(&self.sets).all(|(&l, &b)| b == AdmissibleSet::Free || l >= T::zero()));
        assert!(multipliers.iter().all(|l| l.is_finite()));
        (self.view().residual(multipliers).1 / self.scale().max(T::min_positive_value())).value()
    }
}

/// W = B Bᵀ, column-major.
fn gram(rows: &[Vec<f64>]) -> Vec<f64> {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    rows.iter().flat_map(|a| rows.iter().map(|b| product(a, b))).collect()
}

/// W = B Bᵀ with rows of B in units that differ by decades, and a q that makes some λ*, y* ≥ 0 a solution.
///
/// B has `rank` random rows of `columns` entries, then sums and differences of these. Many columns make W well
/// conditioned, as Gauss–Seidel needs; with as few as `rank` or less it is as ill conditioned as random matrices are.
fn random(random: &mut Congruential, size: usize, rank: usize, columns: usize, free: f64) -> (Problem, Vec<f64>) {
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for i in 0..size {
        let row = if i < rank {
            (0..columns).map(|_| random.within(-1.0, 1.0)).collect()
        } else {
            let (a, b) = (&rows[i % rank], &rows[(7 * i + 3) % rank]);
            let sign = if random.unit() < 0.5 { 1.0 } else { -1.0 };
            a.iter().zip(b).map(|(a, b)| a + 0.5 * sign * b).collect()
        };
        rows.push(row);
    }
    for row in &mut rows {
        let unit = 10_f64.powf(random.within(-1.0, 1.0));
        for x in row {
            *x *= unit;
        }
    }
    let delassus = gram(&rows);
    let (mut sets, mut multipliers, mut gaps) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..size {
        let diagonal: f64 = delassus[i * (size + 1)];
        let (kind, value) = (random.unit(), random.within(0.2, 1.0));
        let (bound, lambda, gap) = if kind < free {
            (AdmissibleSet::Free, if random.unit() < 0.5 { value } else { -value }, 0.0)
        } else if random.unit() < 0.5 {
            (AdmissibleSet::NonNegative, value, 0.0)
        } else {
            (AdmissibleSet::NonNegative, 0.0, value)
        };
        sets.push(bound);
        multipliers.push(lambda / diagonal.sqrt());
        gaps.push(gap * diagonal.sqrt());
    }
    let product = |i: usize| (0..size).map(|j| delassus[i + j * size] * multipliers[j]).sum::<f64>();
    let offset = (0..size).map(|i| gaps[i] - product(i)).collect();
    (Problem { delassus, offset, sets, tolerance: vec![0.0; size] }, gaps)
}

fn solve<T: Real>(
    solver: &mut dyn ContactSolver<T>,
    problem: &Problem<T>,
    guess: &[T],
) -> Result<(Vec<T>, usize), ContactFailure<T>> {
    let mut multipliers = guess.to_vec();
    let iterations = solver.solve(&problem.view(), &mut multipliers)?;
    Ok((multipliers, iterations))
}

/// Name, solver, and how far its y may be from the solution's, as a fraction of the largest |q_i|.
type Listed<T> = (&'static str, Box<dyn ContactSolver<T>>, f64);

/// Congruential rows can be nearly redundant as well, which is where Gauss–Seidel is slow.
const SWEEPS: usize = 100_000;

/// The solvers that take redundant rows.
fn general<T: Real>() -> Vec<Listed<T>> {
    vec![
        ("Gauss-Seidel", Box::new(GaussSeidel::default().sweeps(SWEEPS)), 1e-9),
        ("relaxed Gauss-Seidel", Box::new(GaussSeidel::new(1.3).unwrap().sweeps(SWEEPS)), 1e-9),
        ("pivoting", Box::new(Pivoting::default()), 1e-12),
        ("active set", Box::new(ActiveSet::default()), 1e-12),
    ]
}

fn assert_solves(listed: &mut Listed<f64>, problem: &Problem, gaps: &[f64], guess: &[f64]) {
    let (name, solver, accuracy) = listed;
    let (multipliers, _) =
        solve(&mut **solver, problem, guess).unwrap_or_else(|e| panic!("{name}: {e:?}, {problem:?}"));
    let residual = problem.residual(&multipliers);
    assert!(residual <= 1e-12, "{name}: residual {residual:e}, {problem:?}");
    for (y, expected) in problem.gaps(&multipliers).iter().zip(gaps) {
        let error = (y - expected).abs() / problem.scale();
        assert!(error <= *accuracy, "{name}: error of y {error:e}, {problem:?}");
    }
}

#[test]
fn solvers_agree_on_independent_rows() {
    let (mut numbers, mut solvers) = (Congruential(1), general());
    for size in 1..=40 {
        for free in [0.0, 0.3] {
            let (problem, gaps) = random(&mut numbers, size, size, 2 * size + 2, free);
            for listed in &mut solvers {
                assert_solves(listed, &problem, &gaps, &vec![0.0; size]);
            }
        }
    }
}

#[test]
fn solvers_agree_on_redundant_rows() {
    let (mut numbers, mut solvers) = (Congruential(2), general());
    for size in 2..=40_usize {
        for (rank, free) in [(size.div_ceil(2), 0.0), (size - 1, 0.0), (size.div_ceil(3), 0.2), (1, 0.1)] {
            let (problem, gaps) = random(&mut numbers, size, rank, 2 * rank + 2, free);
            for listed in &mut solvers {
                assert_solves(listed, &problem, &gaps, &vec![0.0; size]);
            }
        }
    }
}

#[test]
fn exact_and_gradient_solvers_bear_bad_condition() {
    let mut numbers = Congruential(3);
    let mut solvers = general();
    solvers.retain(|(name, ..)| !name.contains("Gauss"));
    for size in 2..=40_usize {
        for (columns, free) in [(size, 0.0), (size - 1, 0.0), (size.div_ceil(2), 0.2)] {
            let (problem, gaps) = random(&mut numbers, size, size, columns, free);
            for listed in &mut solvers {
                assert_solves(listed, &problem, &gaps, &vec![0.0; size]);
            }
        }
    }
}

/// Nearly dependent rows, free ones among them, and far more rows than rank: where rounding can mislead pivots.
#[test]
fn pivoting_bears_nearly_dependent_rows() {
    let (mut numbers, mut solver) = (Congruential(12), Pivoting::default());
    for case in 0..1500_usize {
        let size = 1 + case % 60;
        let columns = [6, size / 2 + 1, 3 * size / 4 + 1][case % 3];
        let (problem, gaps) =
            random(&mut numbers, size, (3 * size).div_ceil(5), columns, [0.0, 0.2, 0.5, 0.2][case % 4]);
        let (found, pivots) =
            solve(&mut solver, &problem, &vec![0.0; size]).unwrap_or_else(|e| panic!("case {case}: {e:?}"));
        assert!(problem.residual(&found) <= 1e-12 && pivots <= 2 * size, "case {case}: {pivots} pivots");
        for (y, expected) in problem.gaps(&found).iter().zip(&gaps) {
            assert!((y - expected).abs() <= 1e-9 * problem.scale(), "case {case}: y {y:e}, not {expected:e}");
        }
    }
}

/// Two bilateral rows (1, 0) and (1, ε) hold (0, 1) with multipliers of 1/ε, known to eps/ε²: the contact must help.
#[test]
fn pivoting_shares_the_load_where_the_active_rows_know_too_little() {
    for e in [1e-5, 1.3e-5, 1.7e-5, 2e-5, 3e-5, 5e-5] {
        let problem = Problem {
            sets: vec![AdmissibleSet::Free, AdmissibleSet::Free, AdmissibleSet::NonNegative],
            ..Problem::<f64>::unilateral(&[1.0, 1.0, 0.0, 1.0, 1.0 + e * e, e, 0.0, e, 1.0], &[0.0, -0.7 * e, -0.7])
        };
        let (found, _) = solve(&mut Pivoting::default(), &problem, &[0.0; 3]).unwrap();
        let y = problem.gaps(&found)[2];
        assert!(y > -1e-12 && (found[2] == 0.0 || y < 1e-12), "{y:e} {found:?}");
    }
}

/// Small whole numbers, many of them zero: ties in every ratio, rows at λ = y = 0, equal and opposite rows.
#[test]
fn pivoting_solves_degenerate_problems() {
    let mut numbers = Congruential(4);
    for case in 0..3000 {
        let (size, columns) = (1 + case % 16, 1 + case % 5);
        let digit = |numbers: &mut Congruential, low: f64, high: f64| numbers.within(low, high + 1.0).floor();
        let rows: Vec<Vec<f64>> =
            (0..size).map(|_| (0..columns).map(|_| digit(&mut numbers, -1.0, 1.0)).collect()).collect();
        let delassus = gram(&rows);
        let mut multipliers = vec![0.0; size];
        let mut offset = vec![0.0; size];
        for i in 0..size {
            let value = digit(&mut numbers, 0.0, 2.0);
            *(if numbers.unit() < 0.5 { &mut multipliers[i] } else { &mut offset[i] }) = value;
        }
        let gaps = offset.clone();
        for i in 0..size {
            offset[i] -= (0..size).map(|j| delassus[i + j * size] * multipliers[j]).sum::<f64>();
        }
        let problem = Problem::unilateral(&delassus, &offset);
        let (found, pivots) = solve(&mut Pivoting::default(), &problem, &vec![0.0; size]).unwrap();
        assert!(pivots <= 2 * size, "{pivots} pivots for {size} rows");
        for (y, expected) in problem.gaps(&found).iter().zip(&gaps) {
            assert!((y - expected).abs() <= 1e-12, "{problem:?}");
        }
        assert!(found.iter().all(|&lambda| lambda >= 0.0));
        assert!(found.iter().filter(|&&lambda| lambda > 0.0).count() <= columns, "a basic solution");
    }
}

/// W, q, sets and λ.
type Case = ([f64; 4], [f64; 2], [AdmissibleSet; 2], [f64; 2]);

#[test]
fn closed_forms() {
    let free = [AdmissibleSet::Free, AdmissibleSet::NonNegative];
    let both = [AdmissibleSet::NonNegative; 2];
    let cases: [Case; 7] = [
        // Both closed; the second opened by the first; both open.
        ([2.0, 1.0, 1.0, 2.0], [-4.0, -5.0], both, [1.0, 2.0]),
        ([1.0, 0.9, 0.9, 1.0], [-1.0, -0.5], both, [1.0, 0.0]),
        ([1.0, 0.9, 0.9, 1.0], [0.0, 0.5], both, [0.0, 0.0]),
        // A bilateral row may pull, alone and against a contact.
        ([2.0, 0.0, 0.0, 2.0], [1.0, 1.0], free, [-0.5, 0.0]),
        ([2.0, 1.0, 1.0, 2.0], [1.0, -1.0], free, [-1.0, 1.0]),
        // A contact that touches without pressure.
        ([1.0, 0.0, 0.0, 1.0], [0.0, -1.0], both, [0.0, 1.0]),
        // A row without W and with an open gap is none.
        ([0.0, 0.0, 0.0, 4.0], [1.0, -2.0], both, [0.0, 0.5]),
    ];
    for (name, mut solver, _) in general::<f64>() {
        for (delassus, offset, sets, expected) in cases {
            let problem = Problem { sets: sets.to_vec(), ..Problem::unilateral(&delassus, &offset) };
            let (found, _) = solve(&mut *solver, &problem, &[0.0; 2]).unwrap();
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-11, "{name}: {found:?}, not {expected:?}");
            }
            // (Where no row misses anything it is the first.)
            assert_eq!(problem.view().residual(&expected), (0, 0.0), "{expected:?}");
        }
        // A loaded string: λ_i = i (n + 1 − i)/2.
        let size = 9;
        let entry = |i: usize, j: usize| [2.0, -1.0].get(i.abs_diff(j)).copied().unwrap_or(0.0);
        let string: Vec<f64> = (0..size * size).map(|k| entry(k / size, k % size)).collect();
        let (found, _) = solve(&mut *solver, &Problem::unilateral(&string, &[-1.0; 9]), &[0.0; 9]).unwrap();
        for (i, found) in (1..).zip(&found) {
            assert!((found - f64::from(i * (10 - i)) / 2.0).abs() < 1e-10, "{name}: {found}");
        }
        // One contact many times: the sum is determined.
        let (found, _) = solve(&mut *solver, &Problem::unilateral(&[2.0; 49], &[-6.0; 7]), &[0.0; 7]).unwrap();
        assert!((found.iter().sum::<f64>() - 3.0).abs() < 1e-11, "{name}: {found:?}");
        // Beside a row without W, which touches, or is open.
        for gap in [0.0, 1.0] {
            let entry = |e: usize| if e % 8 < 7 && e / 8 < 7 { 2.0 } else { 0.0 };
            let mut offset = [-6.0; 8];
            offset[7] = gap;
            let beside = Problem::unilateral(&(0..64).map(entry).collect::<Vec<_>>(), &offset);
            let (found, _) = solve(&mut *solver, &beside, &[0.0; 8]).unwrap();
            assert!((found.iter().sum::<f64>() - 3.0).abs() < 1e-11 && found[7] == 0.0, "{name}: {found:?}");
        }
        // Clamped without play: only the difference is determined.
        let clamped = Problem::unilateral(&[1.0, -1.0, -1.0, 1.0], &[-1.0, 1.0]);
        let (found, _) = solve(&mut *solver, &clamped, &[0.0; 2]).unwrap();
        assert!((found[0] - found[1] - 1.0).abs() < 1e-11, "{name}: {found:?}");
        assert_eq!(solve(&mut *solver, &Problem::unilateral(&[], &[]), &[]), Ok((vec![], 0)), "{name}");
    }
}

#[test]
fn free_rows_twice_are_one_if_they_agree() {
    let twice =
        |q: f64| Problem::<f64> { sets: vec![AdmissibleSet::Free; 2], ..Problem::unilateral(&[2.0; 4], &[4.0, q]) };
    for (name, mut solver, _) in general::<f64>() {
        let (found, _) = solve(&mut *solver, &twice(4.0), &[0.0; 2]).unwrap();
        assert!((found[0] + found[1] + 2.0).abs() < 1e-11, "{name}: {found:?}");
        assert!(solve(&mut *solver, &twice(4.0001), &[0.0; 2]).is_err(), "{name}");
    }
    assert_eq!(solve(&mut Pivoting::default(), &twice(4.0), &[0.0; 2]), Ok((vec![-2.0, 0.0], 1)));
}

#[test]
fn pivoting_judges_a_row_at_rest_beside_a_loaded_one() {
    // The second multiplier is zero to rounding, the first row has no scale of its own.
    let problem = Problem::<f64>::unilateral(
        &[1.58e-6, -1.15e-6, 0.0, -1.15e-6, 7.15e-6, -9.39e-8, 0.0, -9.39e-8, 1.75e-6],
        &[-6.8e-35, 9.39e-8 * 8.7, -1.75e-6 * 8.7],
    );
    let (found, pivots) = solve(&mut Pivoting::default(), &problem, &[0.0; 3]).unwrap();
    assert!((found[2] - 8.7).abs() < 1e-13 && found[1] < 1e-13 && found[0] < 1e-13, "{found:?}");
    assert!(problem.gaps(&found)[0] > -1e-35 && pivots <= 3, "{pivots}");
}

#[test]
fn guess_does_not_change_the_result() {
    let (mut numbers, mut solvers) = (Congruential(5), general());
    for (size, rank) in [(1, 1), (5, 5), (12, 12), (12, 6), (30, 20)] {
        let (problem, gaps) = random(&mut numbers, size, rank, 2 * rank + 2, 0.2);
        let wild: Vec<f64> = (0..size).map(|_| numbers.within(-100.0, 100.0)).collect();
        for listed in &mut solvers {
            for guess in [vec![0.0; size], vec![1.0; size], wild.clone(), vec![f64::NAN; size]] {
                assert_solves(listed, &problem, &gaps, &guess);
            }
        }
        for (name, mut solver, _) in general::<f64>() {
            let (solution, cold) = solve(&mut *solver, &problem, &vec![0.0; size]).unwrap();
            let (_, warm) = solve(&mut *solver, &problem, &solution).unwrap();
            // Pivoting starts anew, the active set makes sure.
            let fine = match name {
                "pivoting" => warm == cold,
                "active set" => warm == 1 || rank < size && warm <= cold + 2,
                _ => warm == 0,
            };
            assert!(fine, "{name}: {warm} after {cold}");
        }
    }
}

#[test]
fn units_do_not_matter() {
    // Powers of two: the arithmetic is the same to the last bit.
    let (problem, _) = random(&mut Congruential(6), 20, 15, 32, 0.2);
    for (length, force) in [(-40, 30), (-300, -250), (-300, -320)].map(|(l, f)| (2_f64.powi(l), 2_f64.powi(f))) {
        let mut scaled = problem.clone();
        scaled.delassus.iter_mut().for_each(|w| *w *= length / force);
        scaled.offset.iter_mut().for_each(|q| *q *= length);
        for (name, mut solver, _) in general::<f64>() {
            let (found, iterations) = solve(&mut *solver, &problem, &[0.0; 20]).unwrap();
            let found = found.iter().map(|&lambda| lambda * force).collect();
            assert_eq!(solve(&mut *solver, &scaled, &[0.0; 20]), Ok((found, iterations)), "{name}, {length:e}");
        }
    }
}

#[test]
fn single_precision_runs() {
    let mut numbers = Congruential(7);
    for size in 1..=30_usize {
        for rank in [size, size.div_ceil(2)] {
            let (exact, gaps) = random(&mut numbers, size, rank, 2 * rank + 2, 0.2);
            let mut problem = Problem::<f32>::unilateral(&exact.delassus, &exact.offset);
            problem.sets.clone_from(&exact.sets);
            for (name, mut solver, _) in general::<f32>() {
                // Redundant rows of W, rounded to f32, contradict each other by as much.
                let (found, _) =
                    solve(&mut *solver, &problem, &vec![0.0; size]).unwrap_or_else(|e| panic!("{name} {e:?}"));
                assert!(problem.residual(&found) < 5e-5, "{name}: {:e}", problem.residual(&found));
                for (&y, gap) in problem.gaps(&found).iter().zip(&gaps) {
                    let error = (f64::from(y) - gap).abs() / exact.scale();
                    assert!(error < 2e-4, "{name}: {error:e}");
                }
            }
        }
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let (problem, _) = random(&mut Congruential(8), 6, 6, 14, 0.2);
    for (name, mut solver, _) in general::<f64>() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for at in 0..36 {
                let mut broken = problem.clone();
                broken.delassus[at] = bad;
                let failure = solve(&mut *solver, &broken, &[0.0; 6]);
                assert!(matches!(failure, Err(ContactFailure::NotConverged { .. })), "{name}: {failure:?}");
            }
            for at in 0..6 {
                let mut broken = problem.clone();
                broken.offset[at] = bad;
                let failure = solve(&mut *solver, &broken, &[0.0; 6]);
                let refused = matches!(failure, Err(ContactFailure::NotConverged { row, .. }) if row == at);
                assert!(refused, "{name}: {failure:?}");
            }
        }
        // Finite numbers, but λ would be 1e400.
        assert!(solve(&mut *solver, &Problem::unilateral(&[1e-200], &[-1e200]), &[0.0]).is_err(), "{name}");
        // The memory is fit for use afterward.
        solve(&mut *solver, &problem, &[0.0; 6]).unwrap();
    }
}

#[test]
fn problems_without_a_solution_are_refused() {
    let mut numbers = Congruential(9);
    let mut solvers: Vec<Listed<f64>> = vec![
        ("Gauss-Seidel", Box::new(GaussSeidel::default().sweeps(300)), 0.0),
        ("pivoting", Box::new(Pivoting::default()), 0.0),
        ("active set", Box::new(ActiveSet::default()), 0.0),
    ];
    for (name, solver, _) in &mut solvers {
        let exact = matches!(*name, "pivoting" | "active set");
        // Nothing acts on the second row, and it is closed.
        let stuck = Problem::unilateral(&[1.0, 0.0, 0.0, 0.0], &[-1.0, -2.0]);
        let failure = solve(&mut **solver, &stuck, &[0.0; 2]);
        assert_eq!(failure, Err(ContactFailure::NotConverged { iterations: 0, row: 1, residual: 2.0 }), "{name}");
        let stuck = Problem { sets: vec![AdmissibleSet::Free], ..Problem::unilateral(&[0.0], &[2.0]) };
        assert!(solve(&mut **solver, &stuck, &[0.0]).is_err(), "{name}");
        // Less space than the body takes.
        let stuck = Problem::unilateral(&[1.0, -1.0, -1.0, 1.0], &[-1.0, 0.9]);
        assert!(solve(&mut **solver, &stuck, &[0.0; 2]).is_err(), "{name}");
        for size in 2..=40 {
            // The last row is the negative sum of the others, weighted; likewise its offset, and a bit less.
            let mut rows: Vec<Vec<f64>> =
                (1..size).map(|_| (0..2 * size).map(|_| numbers.within(-1.0, 1.0)).collect()).collect();
            let mut offset: Vec<f64> = (1..size).map(|_| numbers.within(-1.0, 1.0)).collect();
            // Rows without weight have no part in the contradiction.
            let mut weights: Vec<f64> = (1..size).map(|_| (numbers.within(-0.5, 1.0)).max(0.0)).collect();
            weights[0] += 0.1;
            let sum = |column: usize| weights.iter().zip(&rows).map(|(w, row)| w * row[column]).sum::<f64>();
            let opposite = (0..2 * size).map(|column| -sum(column)).collect();
            offset.push(-0.01 - weights.iter().zip(&offset).map(|(w, q)| w * q).sum::<f64>());
            rows.push(opposite);
            let problem = Problem::unilateral(&gram(&rows), &offset);
            let failure = solve(&mut **solver, &problem, &vec![0.0; size]);
            // The exact solvers say that there is no solution, the iterative ones that they have found none.
            let told = matches!(failure, Err(ContactFailure::Contradictory { row, other, .. }) if row != other);
            assert!(failure.is_err() && told == exact, "{name}: {failure:?}");
        }
    }
}

/// The last row is a negative combination of the others, and cannot be met by a share of the offsets: however small
/// this is beside the condition of W, in whatever unit each row is, nobody accepts it. Without the share all is well.
#[test]
fn small_contradictions_among_nearly_dependent_rows_are_no_rounding() {
    let (mut numbers, mut active, mut pivoting) = (Congruential(13), ActiveSet::default(), Pivoting::default());
    let (mut refused, mut solved) = (0, 0);
    for case in 0..3000_usize {
        let size = 2 + case % 12;
        let spread = [0.0, 1.0, 2.0, 4.0][case % 4];
        // Masses of a lumped system, over decades.
        let inverse: Vec<f64> = (0..=size).map(|_| 10_f64.powf(numbers.within(-spread, spread) / 2.0)).collect();
        let mut rows: Vec<Vec<f64>> =
            (1..size).map(|_| inverse.iter().map(|m| m * numbers.within(-1.0, 1.0)).collect()).collect();
        let mut offset: Vec<f64> = (1..size).map(|_| numbers.within(-1.0, 1.0)).collect();
        let weights: Vec<f64> = (1..size).map(|_| numbers.within(0.1, 1.0)).collect();
        let sum = |column: usize| weights.iter().zip(&rows).map(|(w, row)| w * row[column]).sum::<f64>();
        rows.push((0..=size).map(|column| -sum(column)).collect());
        let share = 10_f64.powf(numbers.within(-3.5, 0.0));
        let room = weights.iter().zip(&offset).map(|(w, q)| w * q).sum::<f64>();
        let contradicted = case % 2 == 0;
        offset.push(if contradicted { -share - room } else { -room });
        let problem = Problem::unilateral(&gram(&rows), &offset);
        for guess in [vec![0.0; size], vec![1.0; size]] {
            let (found, reference) = (solve(&mut active, &problem, &guess), solve(&mut pivoting, &problem, &guess));
            if contradicted {
                assert!(found.is_err() && reference.is_err(), "case {case}: {found:?} {reference:?}");
                refused += 1;
            } else {
                let residual = problem.residual(&found.unwrap_or_else(|e| panic!("case {case}: {e:?}")).0);
                assert!(residual < 1e-6, "case {case}: {residual:e}");
                solved += 1;
            }
        }
    }
    assert!(refused == 3000 && solved == 3000);
}

/// Equalities of which each is there twice, by rows that differ by a small angle, as of nodes that face each other and
/// lie each on facets of the other. Gaps that differ by less than anyone could notice are shared; more is refused.
#[test]
fn equalities_that_nearly_agree_are_met_as_well_as_can_be() {
    let mut numbers = Congruential(29);
    for case in 0..400_usize {
        let pairs = 1 + case % 6;
        let angle = 10_f64.powf(numbers.within(-12.0, -8.5));
        let mut twice = |angle: f64, of: Vec<f64>| -> Vec<f64> {
            of.iter().map(|x| x + angle * numbers.within(-1.0, 1.0)).collect()
        };
        let mut base = Congruential(1000 + case as u64);
        let rows: Vec<Vec<f64>> =
            (0..pairs).map(|_| (0..2 * pairs + 2).map(|_| base.within(-1.0, 1.0)).collect()).collect();
        let others: Vec<Vec<f64>> = rows.iter().map(|row| twice(angle, row.clone())).collect();
        let gaps: Vec<f64> = (0..pairs).map(|_| base.within(-1.0, 1.0)).collect();
        for (share, agrees) in [(0.0, true), (1e-9, true), (1e-5, false)] {
            let largest = gaps.iter().fold(0.0_f64, |most, gap| most.max(gap.abs()));
            let offset: Vec<f64> = gaps.iter().copied().chain(gaps.iter().map(|gap| gap + share * largest)).collect();
            let all: Vec<Vec<f64>> = rows.iter().chain(&others).cloned().collect();
            let mut problem = Problem::unilateral(&gram(&all), &offset);
            problem.sets.fill(AdmissibleSet::Free);
            match (solve(&mut ActiveSet::default(), &problem, &vec![0.0; 2 * pairs]), agrees) {
                (Ok((lambda, _)), true) => {
                    // (Equal gaps of rows that differ contradict each other by the angle.)
                    let residual = problem.residual(&lambda);
                    assert!(residual < 0.51 * share + 1e-8, "case {case}, share {share:e}: {residual:e}");
                }
                (Err(ContactFailure::Contradictory { .. }), false) => {}
                (found, _) => panic!("case {case}, share {share:e}, angle {angle:e}: {found:?}"),
            }
        }
    }
}

/// Many rows that all push one another, in single precision: what the sums of hundreds of terms lose is no violation.
#[test]
fn single_precision_judges_many_coupled_rows() {
    for size in [100, 400, 900] {
        for coupling in [0.01, 0.5] {
            let entry = |k: usize| coupling + if k.is_multiple_of(size + 1) { 1.0 - coupling } else { 0.0 };
            let delassus: Vec<f64> = (0..size * size).map(entry).collect();
            // λ* = 1 + sin² i where pressed, y* = 0.1 at each third row.
            let open = |i: usize| i % 3 == 2;
            let exact: Vec<f64> =
                (0..size).map(|i| if open(i) { 0.0 } else { 1.0 + (i as f64).sin().powi(2) }).collect();
            let total: f64 = exact.iter().sum();
            let offset: Vec<f64> = (0..size)
                .map(|i| if open(i) { 0.1 } else { 0.0 } - coupling * total - (1.0 - coupling) * exact[i])
                .collect();
            let problem = Problem::<f32>::unilateral(&delassus, &offset);
            let (found, iterations) =
                solve(&mut ActiveSet::default(), &problem, &vec![0.0; size]).unwrap_or_else(|e| panic!("{e:?}"));
            assert!(iterations < 12, "{size} rows, {coupling}: {iterations} iterations");
            assert!(problem.residual(&found) < 1e-5, "{size} rows, {coupling}: {:e}", problem.residual(&found));
        }
    }
}

#[test]
fn limits_are_kept_and_told() {
    let (problem, _) = random(&mut Congruential(10), 20, 20, 42, 0.0);
    let mut multipliers = [0.0; 20];
    let failure = GaussSeidel::default().sweeps(3).solve(&problem.view(), &mut multipliers);
    let (worst, expected) = problem.view().residual(&multipliers);
    let Err(ContactFailure::NotConverged { iterations: 3, row, residual }) = failure else {
        panic!("{failure:?}");
    };
    assert!(row == worst && (residual - expected).abs() < 1e-12 * problem.scale());
    let rough = solve(&mut GaussSeidel::default().tolerance(1e-3).unwrap(), &problem, &[0.0; 20]).unwrap();
    let fine = solve(&mut GaussSeidel::default(), &problem, &[0.0; 20]).unwrap();
    assert!(rough.1 < fine.1 && problem.residual(&rough.0) <= 1e-3, "{} {}", rough.1, fine.1);
    for refused in [0.0, 2.0, -1.0, f64::NAN] {
        assert!(GaussSeidel::<f64>::new(refused).is_err());
    }
    for refused in [-1e-3, 1.0, f64::NAN] {
        assert!(GaussSeidel::<f64>::default().tolerance(refused).is_err());
    }
}

/// A solver keeps its memory: it solves a problem for the second time without an allocation.
#[test]
fn solving_again_allocates_nothing() {
    let (problem, _) = random(&mut Congruential(11), 25, 18, 40, 0.2);
    for (name, mut solver, _) in general::<f64>() {
        let mut multipliers = [0.0; 25];
        solver.solve(&problem.view(), &mut multipliers).unwrap();
        multipliers.fill(0.0);
        let counted = allocation_counter::measure(|| {
            solver.solve(&problem.view(), &mut multipliers).unwrap();
        });
        assert_eq!(counted.count_total, 0, "{name}");
    }
}

/// A solver for contacts that push alone.
#[derive(Debug)]
struct PushOnly;

impl ContactSolver<f64> for PushOnly {
    fn admits(&self, set: AdmissibleSet) -> bool {
        set == AdmissibleSet::NonNegative
    }

    fn solve(
        &mut self,
        problem: &ContactProblem<'_, f64>,
        multipliers: &mut [f64],
    ) -> Result<usize, ContactFailure<f64>> {
        Pivoting::default().solve(problem, multipliers)
    }
}

#[test]
fn laws_that_a_solver_does_not_take_are_refused() {
    let build = |rows: LinearRows<'static, f64>| {
        let solver: Box<dyn ContactSolver<f64>> = Box::new(PushOnly);
        Simulation::builder(free(&[1.0]), Newmark::trapezoidal(), 0.1).constraint(rows).contact_solver(solver).build()
    };
    build(LinearRows::new().unilateral(&[(0, 1.0)], 1.0)).unwrap();
    match build(LinearRows::new().equality(&[(0, 1.0)], 0.0)) {
        Err(Error::Incompatible { part, .. }) => {
            assert!(part.contains("Equality") && part.contains("PushOnly"), "{part}");
        }
        other => panic!("{other:?}"),
    }
}

/// Strings on obstacles that they leave one node after another: what leaves at the same time is exchanged together, so
/// that many strings take as many iterations as the longest.
#[test]
fn contacts_that_open_one_after_another_are_exchanged_side_by_side() {
    let longest = 9;
    let size = (1..=longest).sum::<usize>();
    let (mut delassus, mut offset) = (vec![0.0; size * size], vec![0.0; size]);
    let mut first = 0;
    for n in 1..=longest {
        let at = |i: usize| (i + 1) as f64 / (n + 1) as f64;
        for i in 0..n {
            offset[first + i] = at(i) * at(i);
            for j in 0..n {
                delassus[(first + i) * size + first + j] = at(i.min(j)) * (1.0 - at(i.max(j)));
            }
        }
        first += n;
    }
    let sets = vec![AdmissibleSet::NonNegative; size];
    let problem = Problem { delassus, offset, sets, tolerance: vec![0.0; size] };
    let (found, iterations) = solve(&mut ActiveSet::default(), &problem, &vec![1.0; size]).unwrap();
    assert!(found.iter().all(|&lambda| lambda == 0.0));
    assert!(iterations <= longest + 2, "{iterations}");
}
