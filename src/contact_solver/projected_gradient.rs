//! Accelerated projected gradient: updates all rows at once, for many coupled rows.

use super::acceptance::Settings;
use super::{ContactFailure, ContactProblem, ContactSolver};
use crate::error::Result;
use crate::real::Real;

/// Nesterov's accelerated projected gradient with adaptive restart, in variables scaled with √W_ii.
///
/// It minimizes ½ λᵀ W λ + qᵀ λ over the admissible λ. Mazhar, Heyn, Negrut and Tasora (ACM Trans. Graph. 34, 2015)
/// applied it to contact; momentum is dropped whenever it points uphill (gradient restart of O'Donoghue and Candès,
/// Found. Comput. Math. 15, 2015). In the scaled variables D^{-½} W D^{-½} has a unit diagonal, so its eigenvalue
/// bound L is between 1 and n in any units. The scaled matrix is never formed: scaling changes the gradient to y_i /
/// W_ii and the inner products to Σ W_ii a_i b_i. L starts at 1 and is doubled when a step is too long, up to a bound
/// that always holds (the largest row sum).
///
/// An iteration costs one product with W, O(n²); unlike in [`GaussSeidel`](super::GaussSeidel) the order of the rows
/// does not matter. Redundant rows are allowed: the acceleration converges for every positive semi-definite W if the
/// problem has a solution. Restarts save iterations; with them convergence is observed, not proven. y is then unique,
/// the multipliers are not: with free rows only it finds the solution nearest to the guess in the norm √(Σ W_ii
/// λ_i²), from zero the smallest one; with unilateral rows one near it, which depends on the guess.
///
/// The acceptance rule and the treatment of the guess are the same as in `GaussSeidel`. An unsymmetric W is rejected
/// ([`ContactFailure::Unsymmetric`]): there is no function to minimize.
///
/// Known weakness: iterations grow with the root of the condition of W (Gauss–Seidel: with the condition), and the
/// last digits converge slowly if contacts are about to open. One tolerance applies to all rows, so small gaps next
/// to large ones are less accurate. A problem without a solution uses all allowed iterations before it fails.
///
/// ```
/// use contact_dynamics::contact_solver::{AdmissibleSet, ContactProblem, ProjectedGradient};
/// use contact_dynamics::ContactSolver;
///
/// let sets = [AdmissibleSet::NonNegative; 2];
/// let problem = ContactProblem::new(&[2.0, 1.0, 1.0, 2.0], &[-4.0, -5.0], &sets, &[1e-15; 2]).unwrap();
/// let mut lambda = [0.0_f64; 2];
/// ProjectedGradient::default().solve(&problem, &mut lambda).unwrap();
/// assert!((lambda[0] - 1.0).abs() < 1e-11 && (lambda[1] - 2.0).abs() < 1e-11);
/// ```
#[derive(Clone, Debug)]
pub struct ProjectedGradient<T = f64> {
    settings: Settings<T>,
    memory: Memory<T>,
}

impl<T: Real> Default for ProjectedGradient<T> {
    fn default() -> Self {
        Self { settings: Settings::default(), memory: Memory::default() }
    }
}

/// Points λ and their y = W λ + q.
#[derive(Clone, Debug, Default)]
struct Memory<T> {
    /// 1/W_ii; zero in rows without W_ii, which stay at λ = 0.
    inverse: Vec<T>,
    /// y of the iterate.
    gaps: Vec<T>,
    /// The previous iterate.
    old: Vec<T>,
    old_gaps: Vec<T>,
    /// The extrapolated iterate, at which the gradient is evaluated.
    ahead: Vec<T>,
    ahead_gaps: Vec<T>,
}

impl<T: Real> Memory<T> {
    fn all(&mut self) -> [&mut Vec<T>; 6] {
        let Self { inverse, gaps, old, old_gaps, ahead, ahead_gaps } = self;
        [inverse, gaps, old, old_gaps, ahead, ahead_gaps]
    }

    /// Starts at `multipliers`; returns a bound of L that always holds.
    fn begin(&mut self, problem: &ContactProblem<'_, T>, multipliers: &[T]) -> T {
        let size = problem.size();
        for vector in self.all() {
            vector.clear();
            vector.resize(size, T::zero());
        }
        let Self { inverse, gaps, old, old_gaps, ahead, ahead_gaps } = self;
        for (i, inverse) in inverse.iter_mut().enumerate() {
            let diagonal = problem.delassus(i, i);
            *inverse = if diagonal > T::zero() { diagonal.recip() } else { T::zero() };
        }
        // Row sums of |D^{-½} W D^{-½}|; the trace is a bound too. Roots of products are used, because roots of units
        // that are odd powers of two are rounded.
        let scaled = |own: T, w: T, inverse: T| w.value().abs() * (own.value() * inverse.value()).sqrt();
        let sum = |i: usize| {
            let own = inverse[i];
            problem.row(i).iter().zip(inverse.iter()).map(|(&w, &inverse)| scaled(own, w, inverse)).sum::<f64>()
        };
        let bound = (0..size).map(sum).fold(1.0, f64::max).min(size as f64).max(1.0);
        evaluate(problem, multipliers, gaps);
        old.copy_from_slice(multipliers);
        old_gaps.copy_from_slice(gaps);
        ahead.copy_from_slice(multipliers);
        ahead_gaps.copy_from_slice(gaps);
        T::of(bound)
    }

    /// The gradient step of length 1/L from the extrapolated point.
    fn step(&mut self, problem: &ContactProblem<'_, T>, lipschitz: T, multipliers: &mut [T]) {
        for (i, lambda) in multipliers.iter_mut().enumerate() {
            let gradient = self.ahead_gaps[i] * self.inverse[i];
            *lambda = problem.sets[i].nearest(self.ahead[i] - gradient / lipschitz);
        }
        evaluate(problem, multipliers, &mut self.gaps);
    }

    /// Whether the curvature of W along the step is at most L, so that the step cannot overshoot.
    fn is_bounded(&self, problem: &ContactProblem<'_, T>, lipschitz: T, multipliers: &[T]) -> bool {
        let (mut change, mut length) = (0.0, 0.0);
        for (i, (&new, &ahead)) in multipliers.iter().zip(&self.ahead).enumerate() {
            let difference = (new - ahead).value();
            change += difference * (self.gaps[i] - self.ahead_gaps[i]).value();
            length += difference * difference * problem.delassus(i, i).value();
        }
        change <= lipschitz.value() * length
    }

    /// Whether the momentum points uphill.
    fn is_uphill(&self, problem: &ContactProblem<'_, T>, multipliers: &[T]) -> bool {
        let product = |(i, &new): (usize, &T)| {
            problem.delassus(i, i).value() * (self.ahead[i] - new).value() * (new - self.old[i]).value()
        };
        multipliers.iter().enumerate().map(product).sum::<f64>() > 0.0
    }

    /// Extrapolates from the iterate, with this share of the last step as momentum.
    fn advance(&mut self, momentum: T, multipliers: &[T]) {
        let points = self.ahead.iter_mut().zip(&mut self.old).zip(multipliers);
        let gaps = self.ahead_gaps.iter_mut().zip(&mut self.old_gaps).zip(&self.gaps);
        for ((ahead, old), &new) in points.chain(gaps) {
            *ahead = new + momentum * (new - *old);
            *old = new;
        }
    }
}

/// y = W λ + q.
fn evaluate<T: Real>(problem: &ContactProblem<'_, T>, multipliers: &[T], gaps: &mut [T]) {
    for (i, y) in gaps.iter_mut().enumerate() {
        *y = problem.gap(i, multipliers);
    }
}

impl<T: Real> ProjectedGradient<T> {
    /// Accepts a residual of this fraction of the largest |q_i|; by default 1e-12, or 8 eps of a coarser scalar.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless it is in [0, 1).
    pub fn tolerance(self, tolerance: f64) -> Result<Self> {
        Ok(Self { settings: self.settings.with_tolerance(tolerance)?, ..self })
    }

    /// Gives up after this many iterations; by default 10 000.
    #[must_use]
    pub fn iterations(mut self, iterations: usize) -> Self {
        self.settings.iterations = iterations;
        self
    }
}

impl<T: Real> ContactSolver<T> for ProjectedGradient<T> {
    fn reserve(&mut self, size: usize) {
        for vector in self.memory.all() {
            *vector = Vec::with_capacity(size);
        }
    }

    fn solve(
        &mut self,
        problem: &ContactProblem<'_, T>,
        multipliers: &mut [T],
    ) -> std::result::Result<usize, ContactFailure<T>> {
        let Self { settings, memory } = self;
        problem.check_symmetric()?;
        let acceptance = settings.begin(problem, false, multipliers)?;
        let bound = memory.begin(problem, multipliers);
        let (mut lipschitz, mut age) = (T::one(), T::one());
        for iteration in 0..settings.iterations {
            if acceptance.accepts(multipliers) {
                return Ok(iteration);
            }
            memory.step(problem, lipschitz, multipliers);
            while lipschitz < bound && !memory.is_bounded(problem, lipschitz, multipliers) {
                lipschitz = (lipschitz + lipschitz).min(bound);
                memory.step(problem, lipschitz, multipliers);
            }
            let momentum = if memory.is_uphill(problem, multipliers) {
                age = T::one();
                T::zero()
            } else {
                let before = age;
                age = T::of(0.5) * (T::one() + (T::one() + T::of(4.0) * age * age).sqrt());
                (before - T::one()) / age
            };
            memory.advance(momentum, multipliers);
        }
        let iterations = settings.iterations;
        if acceptance.accepts(multipliers) { Ok(iterations) } else { Err(acceptance.failure(iterations, multipliers)) }
    }
}
