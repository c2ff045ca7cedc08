//! Contact problems with a matrix-free W: if the factor of a body changes with every iteration, computing the
//! response to each of hundreds of rows would cost more than the factorization.

use super::{AdmissibleSet, ContactFailure};
use crate::dense::dot;
use crate::error::{Error, Result};
use crate::real::Real;

/// Writes W x to its second argument, with x its first.
pub(crate) type Product<'a, T> = &'a mut dyn FnMut(&[T], &mut [T]);

/// A [`ContactProblem`](super::ContactProblem) whose W is applied, not stored. All blocks have one row, and W is
/// symmetric.
pub struct AppliedProblem<'a, T> {
    pub(crate) product: Product<'a, T>,
    pub(crate) scale: &'a [T],
    pub(crate) offset: &'a [T],
    pub(crate) sets: &'a [AdmissibleSet],
    pub(crate) tolerance: &'a [T],
}

impl<T: Real> std::fmt::Debug for AppliedProblem<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("AppliedProblem").field("rows", &self.offset.len()).finish_non_exhaustive()
    }
}

impl<'a, T: Real> AppliedProblem<'a, T> {
    /// From a function that writes W x to its second argument, the magnitude of the diagonal of W (positive), and the
    /// data of the rows.
    ///
    /// ```
    /// use contact_dynamics::contact_solver::{ActiveSet, AdmissibleSet, AppliedProblem, ContactSolver};
    ///
    /// let mut product = |x: &[f64], y: &mut [f64]| {
    ///     (y[0], y[1]) = (2.0 * x[0] + x[1], x[0] + 2.0 * x[1]);
    /// };
    /// let sets = [AdmissibleSet::NonNegative; 2];
    /// let mut problem = AppliedProblem::new(&mut product, &[2.0; 2], &[-2.0, 1.0], &sets, &[1e-14; 2])?;
    /// let mut lambda = [0.0; 2];
    /// ActiveSet::default().solve_applied(&mut problem, &mut lambda).ok_or("it needs no entries")??;
    /// assert!((lambda[0] - 1.0).abs() < 1e-14 && lambda[1] == 0.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the lengths disagree, [`Error::Incompatible`] for sets of several rows.
    pub fn new(
        product: &'a mut dyn FnMut(&[T], &mut [T]),
        scale: &'a [T],
        offset: &'a [T],
        sets: &'a [AdmissibleSet],
        tolerance: &'a [T],
    ) -> Result<Self> {
        let expected = offset.len();
        for (what, found) in [
            ("the diagonal of an applied Delassus operator", scale.len()),
            ("the sets of a contact problem", sets.len()),
            ("the tolerances of a contact problem", tolerance.len()),
        ] {
            if expected != found {
                return Err(Error::Dimension { what, expected, found });
            }
        }
        if sets.iter().any(|set| set.rows() > 1) {
            let reason = "it takes no contacts with friction";
            return Err(Error::Incompatible { part: "a contact problem whose W is applied".into(), reason });
        }
        Ok(Self { product, scale, offset, sets, tolerance })
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.offset.len()
    }

    /// q: y at λ = 0, one per row.
    pub fn offset(&self) -> &[T] {
        self.offset
    }

    /// The set of each block, one per row.
    pub fn sets(&self) -> &[AdmissibleSet] {
        self.sets
    }

    /// The rounding of y in each row.
    pub fn tolerance(&self) -> &[T] {
        self.tolerance
    }

    /// Magnitude of the diagonal of W: positive, and at most the diagonal itself if the dofs of a row are not
    /// coupled.
    pub fn scale(&self) -> &[T] {
        self.scale
    }

    /// `y = W x`, both with one entry per row; costs about one solve with the effective matrix.
    pub fn apply(&mut self, x: &[T], y: &mut [T]) {
        (self.product)(x, y);
    }
}

/// Limit of row exchanges.
const EXCHANGES: usize = 40;

/// Exchanges allowed without progress.
const TRIES: usize = 4;

/// Products allowed for the equations of one active set.
const PRODUCTS: usize = 200;

/// Restarts of the equation solver to reduce rounding errors.
const REFINEMENTS: usize = 3;

/// How well equations are met; the best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Met {
    /// To the rounding of their own terms.
    Exactly,
    /// To a small fraction of the largest q.
    Nearly,
    Not,
}

/// Memory of the primal–dual active set with a matrix-free W.
#[derive(Clone, Debug, Default)]
pub(super) struct AppliedSet<T> {
    active: Vec<bool>,
    y: Vec<T>,
    noise: Vec<T>,
    rounding: Vec<T>,
    residual: Vec<T>,
    direction: Vec<T>,
    product: Vec<T>,
}

impl<T: Real> AppliedSet<T> {
    /// Solves from the guess in `multipliers`. An error means that the problem needs a solver with an assembled W.
    pub(super) fn solve(
        &mut self,
        problem: &mut AppliedProblem<'_, T>,
        multipliers: &mut [T],
    ) -> std::result::Result<usize, ContactFailure<T>> {
        let size = problem.size();
        let Self { y, noise, rounding, residual, direction, product, .. } = self;
        for vector in [y, noise, rounding, residual, direction, product] {
            vector.clear();
            vector.resize(size, T::zero());
        }
        let guess = multipliers.iter().zip(problem.sets);
        self.active.clear();
        self.active.extend(guess.map(|(&lambda, &set)| set == AdmissibleSet::Free || lambda > T::zero()));
        // The magnitude of an old guess must not persist.
        multipliers.fill(T::zero());
        let (mut fewest, mut tries) = (usize::MAX, TRIES);
        for exchange in 1..=EXCHANGES {
            let failure = |row| ContactFailure::NotConverged { iterations: exchange, row, residual: T::nan() };
            if !self.solve_active(problem, multipliers) {
                return Err(failure(0));
            }
            let Self { active, y, noise, .. } = self;
            let mut violations = 0;
            for (i, active) in active.iter_mut().enumerate() {
                let violated = match (problem.sets[i], *active) {
                    (AdmissibleSet::Free, _) => false,
                    (_, true) => problem.scale[i] * multipliers[i] < -noise[i],
                    (_, false) => y[i] < -noise[i],
                };
                violations += usize::from(violated);
                *active ^= violated;
            }
            if violations == 0 {
                for (lambda, &set) in multipliers.iter_mut().zip(problem.sets) {
                    *lambda = set.nearest(*lambda);
                }
                return Ok(exchange);
            }
            if violations < fewest {
                (fewest, tries) = (violations, TRIES);
            } else {
                tries -= 1;
            }
            if tries == 0 {
                return Err(failure(0));
            }
        }
        Err(ContactFailure::NotConverged { iterations: EXCHANGES, row: 0, residual: T::nan() })
    }

    /// Solves the equations of the active rows by conjugate gradients, starting from the present multipliers, and
    /// leaves y and its noise. Returns whether every equation is met within that noise.
    fn solve_active(&mut self, problem: &mut AppliedProblem<'_, T>, multipliers: &mut [T]) -> bool {
        for (lambda, &active) in multipliers.iter_mut().zip(&self.active) {
            if !active {
                *lambda = T::zero();
            }
        }
        for _ in 0..REFINEMENTS {
            if self.observe(problem, multipliers) == Met::Exactly {
                return true;
            }
            if !self.iterate(problem, multipliers) {
                return false;
            }
        }
        self.observe(problem, multipliers) != Met::Not
    }

    /// Evaluates y, the rounding of its terms, and the noise below which it counts as zero; returns how well the
    /// equations are met.
    fn observe(&mut self, problem: &mut AppliedProblem<'_, T>, multipliers: &[T]) -> Met {
        let Self { active, y, noise, rounding, direction, product, .. } = self;
        problem.apply(multipliers, y);
        for (size, lambda) in direction.iter_mut().zip(multipliers) {
            *size = lambda.abs();
        }
        problem.apply(direction, product);
        let largest = problem.offset.iter().fold(T::zero(), |largest, q| largest.max(q.abs()));
        let share = T::of(1e-12).max(T::of(8.0) * T::epsilon()) * largest;
        let mut met = Met::Exactly;
        for (i, y) in y.iter_mut().enumerate() {
            // Entries of W may cancel in the product with magnitudes: the row's own terms are a lower bound.
            let terms = product[i].abs().max(y.abs()).max(problem.scale[i] * multipliers[i].abs());
            *y += problem.offset[i];
            // Convergence must not depend on tolerances, because these depend on where the rows were evaluated.
            rounding[i] = T::of(32.0) * T::epsilon() * (problem.offset[i].abs() + terms);
            noise[i] = problem.tolerance[i] + rounding[i] + share;
            let row = match y.abs() {
                _ if !y.is_finite() => Met::Not,
                _ if !active[i] => Met::Exactly,
                size if size <= rounding[i] => Met::Exactly,
                size if size <= rounding[i] + share => Met::Nearly,
                _ => Met::Not,
            };
            met = met.max(row);
        }
        met
    }

    /// Conjugate gradients on the active rows, scaled by the diagonal, starting from the y of the multipliers.
    fn iterate(&mut self, problem: &mut AppliedProblem<'_, T>, multipliers: &mut [T]) -> bool {
        let Self { active, y, residual, direction, product, rounding, .. } = self;
        for ((r, &y), &active) in residual.iter_mut().zip(y.iter()).zip(active.iter()) {
            *r = if active { -y } else { T::zero() };
        }
        direction.fill(T::zero());
        let weighted = |x: &[T], scale: &[T]| x.iter().zip(scale).map(|(&x, &s)| x * x / s).sum::<T>();
        // Goal: each equation within a fraction of its own rounding.
        let goal = weighted(rounding, problem.scale) * T::of(1e-2) / T::of(residual.len() as f64);
        let mut before = T::zero();
        for step in 0..PRODUCTS {
            let now = weighted(residual, problem.scale);
            if now <= goal {
                return true;
            }
            let share = if step == 0 { T::zero() } else { now / before };
            before = now;
            for ((p, &r), &s) in direction.iter_mut().zip(residual.iter()).zip(problem.scale) {
                *p = r / s + share * *p;
            }
            problem.apply(direction, product);
            let curvature = dot(direction, product);
            let sound = curvature > T::zero() && now.is_finite();
            if !sound {
                return false;
            }
            let length = now / curvature;
            for (i, &active) in active.iter().enumerate() {
                if active {
                    multipliers[i] += length * direction[i];
                    residual[i] -= length * product[i];
                }
            }
        }
        // Rounding may have stalled the iteration; the caller evaluates the residual again.
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed row whose force is zero to rounding does not pull.
    #[test]
    fn multipliers_of_rounding_do_not_pull() {
        let mut kept = 0;
        for ulps in -6..=6 {
            let mut product = |x: &[f64], y: &mut [f64]| (y[0], y[1]) = (2.0 * x[0] + x[1], x[0] + 2.0 * x[1]);
            let (offset, sets) = ([-2.0, f64::from(ulps) * f64::EPSILON - 1.0], [AdmissibleSet::NonNegative; 2]);
            let mut problem = AppliedProblem::new(&mut product, &[2.0; 2], &offset, &sets, &[1e-14; 2]).unwrap();
            let mut multipliers = [1.0; 2];
            AppliedSet::default().solve(&mut problem, &mut multipliers).unwrap();
            assert!(multipliers[1] >= 0.0 && (multipliers[0] - 1.0).abs() < 1e-14, "{ulps}: {multipliers:?}");
            kept += usize::from(multipliers[1] > 0.0);
        }
        assert!((1..13).contains(&kept), "{kept}");
    }
}
