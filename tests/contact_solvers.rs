//! The contact solvers on their own: against each other, against closed forms, and where they must refuse.

use contact_dynamics::Real;
use contact_dynamics::contact_solver::{
    ActiveSet, Bound, ContactFailure, ContactProblem, ContactSolver, GaussSeidel, Pivoting, ProjectedGradient,
};

/// Reproducible numbers (Knuth's linear congruential generator).
struct Random(u64);

impl Random {
    /// In [0, 1).
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
}

#[derive(Clone, Debug)]
struct Problem<T = f64> {
    delassus: Vec<T>,
    offset: Vec<T>,
    bounds: Vec<Bound>,
    tolerance: Vec<T>,
}

impl<T: Real> Problem<T> {
    fn unilateral(delassus: &[f64], offset: &[f64]) -> Self {
        Self {
            delassus: delassus.iter().map(|&x| T::of(x)).collect(),
            offset: offset.iter().map(|&x| T::of(x)).collect(),
            bounds: vec![Bound::NonNegative; offset.len()],
            tolerance: vec![T::zero(); offset.len()],
        }
    }

    fn view(&self) -> ContactProblem<'_, T> {
        let Self { delassus, offset, bounds, tolerance } = self;
        ContactProblem { delassus, offset, bounds, tolerance }
    }

    fn gaps(&self, multipliers: &[T]) -> Vec<T> {
        (0..self.offset.len()).map(|i| self.view().gap(i, multipliers)).collect()
    }

    fn scale(&self) -> T {
        self.offset.iter().fold(T::zero(), |scale, q| scale.max(q.abs()))
    }

    /// The residual as a fraction of the largest |q_i|.
    fn residual(&self, multipliers: &[T]) -> f64 {
        assert!(multipliers.iter().zip(&self.bounds).all(|(&l, &b)| b == Bound::Free || l >= T::zero()));
        assert!(multipliers.iter().all(|l| l.is_finite()));
        (self.view().residual(multipliers).1 / self.scale().max(T::min_positive_value())).value()
    }
}

/// W = B Bᵀ with B of size × columns in units that differ by decades, and a q that makes λ*, y* a solution.
///
/// Below `size` columns W has that rank only; twice the size keeps its condition moderate, as Gauss–Seidel needs.
fn random(random: &mut Random, size: usize, columns: usize, free: f64) -> (Problem, Vec<f64>) {
    let rows: Vec<Vec<f64>> = (0..size)
        .map(|_| {
            let unit = 10_f64.powf(random.within(-1.0, 1.0));
            (0..columns).map(|_| unit * random.within(-1.0, 1.0)).collect()
        })
        .collect();
    let mut delassus = vec![0.0; size * size];
    for i in 0..size {
        for j in 0..=i {
            let entry = rows[i].iter().zip(&rows[j]).map(|(x, y)| x * y).sum();
            delassus[i + j * size] = entry;
            delassus[j + i * size] = entry;
        }
    }
    let (mut bounds, mut multipliers, mut gaps) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..size {
        let diagonal: f64 = delassus[i * (size + 1)];
        let (kind, value) = (random.unit(), random.within(0.2, 1.0));
        let (bound, lambda, gap) = if kind < free {
            (Bound::Free, if random.unit() < 0.5 { value } else { -value }, 0.0)
        } else if random.unit() < 0.5 {
            (Bound::NonNegative, value, 0.0)
        } else {
            (Bound::NonNegative, 0.0, value)
        };
        bounds.push(bound);
        multipliers.push(lambda / diagonal.sqrt());
        gaps.push(gap * diagonal.sqrt());
    }
    let product = |i: usize| (0..size).map(|j| delassus[i + j * size] * multipliers[j]).sum::<f64>();
    let offset = (0..size).map(|i| gaps[i] - product(i)).collect();
    (Problem { delassus, offset, bounds, tolerance: vec![0.0; size] }, gaps)
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

/// The solvers that take redundant rows.
fn general<T: Real>() -> Vec<Listed<T>> {
    vec![
        ("Gauss-Seidel", Box::new(GaussSeidel::default()), 1e-9),
        ("relaxed Gauss-Seidel", Box::new(GaussSeidel::new(1.3).unwrap()), 1e-9),
        ("projected gradient", Box::new(ProjectedGradient::default()), 1e-9),
        ("pivoting", Box::new(Pivoting::default()), 1e-12),
    ]
}

fn all<T: Real>() -> Vec<Listed<T>> {
    let mut solvers = general();
    solvers.push(("active set", Box::new(ActiveSet::default()), 1e-12));
    solvers
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
    let (mut numbers, mut solvers) = (Random(1), all());
    for size in 1..=40 {
        for free in [0.0, 0.3] {
            let (problem, gaps) = random(&mut numbers, size, 2 * size + 2, free);
            for listed in &mut solvers {
                assert_solves(listed, &problem, &gaps, &vec![0.0; size]);
            }
        }
    }
}

#[test]
fn solvers_agree_on_redundant_rows() {
    let (mut numbers, mut solvers) = (Random(2), general());
    for size in 2..=40_usize {
        for (rank, free) in [(size.div_ceil(2), 0.0), (size - 1, 0.0), (size.div_ceil(3), 0.2), (1, 0.1)] {
            let (problem, gaps) = random(&mut numbers, size, rank, free);
            for listed in &mut solvers {
                assert_solves(listed, &problem, &gaps, &vec![0.0; size]);
            }
        }
    }
}
