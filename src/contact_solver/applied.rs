//! Contact problems with a matrix-free W: if the factor of a body changes with every iteration, computing the
//! response to each of hundreds of rows would cost more than the factorization.

use super::acceptance::Settings;
use super::{AdmissibleSet, ContactFailure};
use crate::dense::dot;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding as sum_rounding;

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
    /// use contact_dynamics::contact_solver::{AdmissibleSet, AppliedProblem};
    /// use contact_dynamics::{ActiveSet, ContactSolver};
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

/// Products allowed for the equations of one active set.
const PRODUCTS: usize = 200;

/// Restarts of the equation solver to reduce rounding errors.
const REFINEMENTS: usize = 3;

/// Memory of the primal–dual active set with a matrix-free W.
#[derive(Clone, Debug, Default)]
pub(super) struct AppliedSet<T> {
    active: Vec<bool>,
    y: Vec<T>,
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
        let Self { y, rounding, residual, direction, product, .. } = self;
        for vector in [y, rounding, residual, direction, product] {
            vector.clear();
            vector.resize(size, T::zero());
        }
        let guess = multipliers.iter().zip(problem.sets);
        self.active.clear();
        self.active.extend(guess.map(|(&lambda, &set)| set == AdmissibleSet::Free || lambda > T::zero()));
        // The magnitude of an old guess must not persist.
        multipliers.fill(T::zero());
        let accepted = Settings::<T>::default().tolerance() * T::largest(problem.offset);
        for exchange in 1..=EXCHANGES {
            if !self.solve_active(problem, accepted, multipliers) {
                return Err(ContactFailure::NotConverged { iterations: exchange, row: 0, residual: T::nan() });
            }
            let Self { active, y, rounding, .. } = self;
            let mut is_solved = true;
            for (i, active) in active.iter_mut().enumerate() {
                let noise = problem.tolerance[i] + rounding[i] + accepted;
                let miss = if *active { -problem.scale[i] * multipliers[i] } else { -y[i] };
                if problem.sets[i] != AdmissibleSet::Free && miss > noise {
                    *active = !*active;
                    is_solved = false;
                }
            }
            if is_solved {
                for (lambda, &set) in multipliers.iter_mut().zip(problem.sets) {
                    *lambda = set.nearest(*lambda);
                }
                return Ok(exchange);
            }
        }
        Err(ContactFailure::NotConverged { iterations: EXCHANGES, row: 0, residual: T::nan() })
    }

    /// Solves the equations of the active rows by conjugate gradients, starting from the present multipliers, and
    /// leaves y and its rounding. Returns whether every equation is met to rounding, or to the `accepted` residual.
    fn solve_active(&mut self, problem: &mut AppliedProblem<'_, T>, accepted: T, multipliers: &mut [T]) -> bool {
        for (lambda, &active) in multipliers.iter_mut().zip(&self.active) {
            if !active {
                *lambda = T::zero();
            }
        }
        for _ in 0..REFINEMENTS {
            self.evaluate(problem, multipliers);
            if self.is_met(T::zero()) {
                return true;
            }
            if !self.iterate(problem, multipliers) {
                return false;
            }
        }
        self.evaluate(problem, multipliers);
        self.is_met(accepted)
    }

    /// Whether every active equation is met to rounding, or to this residual.
    fn is_met(&self, accepted: T) -> bool {
        let rows = self.active.iter().zip(&self.y).zip(&self.rounding);
        rows.into_iter().all(|((active, y), &rounding)| y.is_finite() && (!active || y.abs() <= rounding + accepted))
    }

    /// Evaluates y and the rounding of its terms.
    fn evaluate(&mut self, problem: &mut AppliedProblem<'_, T>, multipliers: &[T]) {
        let Self { y, rounding, direction, product, .. } = self;
        problem.apply(multipliers, y);
        for (size, lambda) in direction.iter_mut().zip(multipliers) {
            *size = lambda.abs();
        }
        problem.apply(direction, product);
        for (i, y) in y.iter_mut().enumerate() {
            // Entries of W may cancel in the product with magnitudes: the row's own terms are a lower bound.
            let terms = product[i].abs().max(y.abs()).max(problem.scale[i] * multipliers[i].abs());
            *y += problem.offset[i];
            // Convergence must not depend on tolerances, because these depend on where the rows were evaluated.
            rounding[i] = sum_rounding(problem.offset[i].abs() + terms);
        }
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
        let goal = weighted(rounding, problem.scale) / T::of(residual.len() as f64);
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
