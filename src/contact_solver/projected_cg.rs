//! Contact problems without W: conjugate gradients for the displacements, projected onto the closed rows.
//!
//! Forming W = G A⁻¹ Gᵀ takes a response for every row, and solving with it a dense matrix. This method takes products
//! with A instead, as many as a system without contact would take: all its directions keep the closed rows closed,
//! because residuals are projected with the diagonal D of A in the place of A (a constraint preconditioner: Gould,
//! Hribar and Nocedal, SIAM J. Sci. Comput. 23, 2001). The only matrix of contacts is N = G D⁻¹ Gᵀ, which is sparse.
//!
//! In the order of execution:
//!
//! - `rows`: the rows of the problem, with tangents turned along the slip.
//! - `metric`: N and its factor, projections.
//! - `statuses`: which rows are closed, stick or slide.

mod metric;
mod rows;
mod statuses;

use super::AdmissibleSet;
use crate::contact::ContactJacobian;
use crate::dense::dot;
use crate::error::Result;
use crate::memory;
use crate::real::Real;
use crate::threads;
use metric::Metric;
use rows::Rows;
use statuses::Statuses;

/// What memory is asked for.
const WHAT: &str = "a contact problem without W";

/// Writes A x to its last argument. x is zero farther from the dofs of the rows than its first argument, the number of
/// products with which it can get there.
type Product<'a, T> = &'a mut dyn FnMut(usize, &[T], &mut [T]);

/// A contact problem given by A and G: y = G x + c λ + q with A x = Gᵀ λ.
pub(crate) struct SparseProblem<'a, T> {
    /// A is symmetric and positive definite.
    pub(crate) product: Product<'a, T>,
    /// D⁻¹ by dof: one over the diagonal of A, zero for dofs that do not move.
    pub(crate) inverse: &'a [T],
    pub(crate) data: RowData<'a, T>,
    pub(crate) patience: Patience,
}

/// When an iteration gives up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patience {
    /// Products with A.
    pub(crate) products: usize,
    /// How often statuses may be decided.
    pub(crate) looks: usize,
    /// The residual at which the iteration ends, relative to the contact forces.
    pub(crate) residual: f64,
}

/// The rows: c, q and the rounding of y of each row, and the set of each block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowData<'a, T> {
    /// G, of which the problem has these rows, block after block.
    pub(crate) g: &'a ContactJacobian<T>,
    pub(crate) rows: &'a [usize],
    pub(crate) compliance: &'a [T],
    pub(crate) offset: &'a [T],
    pub(crate) tolerance: &'a [T],
    pub(crate) sets: &'a [AdmissibleSet],
    /// For each block its friction per unit normal force, if that is given. Empty if none is.
    pub(crate) along: &'a [Option<[T; 2]>],
}

/// The cost and the result of an iteration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    /// Products with A.
    pub(crate) products: usize,
    /// The residual of the balance, relative to the contact forces, both in the norm of D⁻¹.
    pub(crate) residual: f64,
    pub(crate) is_solved: bool,
}

/// The method, with its memory. Between two problems of one stage it keeps x and N: the second problem differs little.
#[derive(Debug, Default)]
pub(crate) struct ProjectedCg<T> {
    rows: Rows<T>,
    metric: Metric<T>,
    statuses: Statuses<T>,
    /// D⁻¹ by dof, then for each row its compliance: a compliant row has a displacement of its own, σ = c λ.
    inverse: Vec<T>,
    x: Vec<T>,
    /// Gᵀ λ − A x.
    residual: Vec<T>,
    direction: Vec<T>,
    product: Vec<T>,
    /// How far x reaches from the dofs of the rows.
    reach: usize,
    is_begun: bool,
}

/// The decrease of the residual after which the statuses of the rows are looked at again.
const LOOK: f64 = 0.1;

impl<T: Real> ProjectedCg<T> {
    /// Forgets the last problem: the next one is of another stage or has another A.
    pub(crate) fn begin(&mut self) {
        self.is_begun = false;
    }

    /// x of the last problem, by dof.
    pub(crate) fn solution(&self) -> &[T] {
        &self.x[..self.x.len() - self.rows.len()]
    }

    /// Solves for the multipliers, which contain a guess of the closed rows without friction.
    pub(crate) fn solve(&mut self, problem: &mut SparseProblem<'_, T>, multipliers: &mut [T]) -> Result<Outcome> {
        let mut outcome = Outcome { products: 0, residual: 1.0, is_solved: false };
        self.take(problem, multipliers)?;
        let mut scale = T::zero();
        while outcome.products < problem.patience.products && self.statuses.looks < problem.patience.looks {
            self.set_compliances();
            if !self.metric.follow(&self.rows, &self.statuses, &self.inverse)? {
                break;
            }
            let miss = self.metric.close(&self.rows, &self.statuses, &self.inverse, &mut self.x);
            if !miss.is_met() && self.metric.is_near {
                self.metric.forget();
                continue;
            }
            if !miss.is_met() {
                outcome.residual = miss.share();
                break;
            }
            match self.iterate(problem, &mut scale, &mut outcome) {
                End::OtherEquations => {}
                End::GivenUp => break,
                End::Solved => {
                    self.rows.read(&self.statuses.multipliers, multipliers);
                    (outcome.is_solved, self.is_begun) = (true, true);
                    break;
                }
            }
        }
        Ok(outcome)
    }

    /// Takes the rows of a problem. Those of the last one, linearized elsewhere, go on from its solution.
    fn take(&mut self, problem: &SparseProblem<'_, T>, guess: &[T]) -> Result<()> {
        let keeps = self.is_begun && self.rows.are_of(problem);
        self.is_begun = false;
        let (dofs, size) = (problem.inverse.len(), problem.inverse.len() + problem.data.rows.len());
        let same = self.rows.take(problem, keeps)?;
        if keeps {
            self.statuses.keep(&self.rows);
            self.metric.keep();
            return Ok(());
        }
        self.statuses.begin(&self.rows, guess)?;
        // A factor of exactly this N may stay: it changes no bit of the result.
        match same && self.inverse.get(..dofs) == Some(problem.inverse) {
            true => self.metric.begin(&self.statuses),
            false => self.metric.forget(),
        }
        memory::copy(&mut self.inverse, problem.inverse, WHAT)?;
        memory::make_room(&mut self.inverse, problem.data.rows.len(), WHAT)?;
        self.reach = 0;
        self.x.clear();
        for values in [&mut self.x, &mut self.residual, &mut self.direction, &mut self.product] {
            memory::grow(values, size, 1, WHAT)?;
        }
        Ok(())
    }

    /// D⁻¹ of the displacements of compliant rows is their compliance.
    fn set_compliances(&mut self) {
        let dofs = self.x.len() - self.rows.len();
        self.inverse.truncate(dofs);
        self.inverse.extend_from_slice(&self.statuses.compliance);
    }

    /// Conjugate gradients with the present statuses, from a solution that closes the closed rows. `scale` is the size
    /// of the forces.
    fn iterate(&mut self, problem: &mut SparseProblem<'_, T>, scale: &mut T, outcome: &mut Outcome) -> End {
        self.balance(problem);
        outcome.products += 1;
        let (mut last, mut looked) = (None, None);
        *scale = scale.max(self.metric.norm(&self.statuses.multipliers));
        loop {
            let square = weighted(&self.residual, &self.inverse);
            if !square.is_finite() {
                return End::GivenUp;
            }
            let left = square.sqrt();
            let goal = T::of(problem.patience.residual) * *scale;
            outcome.residual = ratio(left, *scale);
            if left <= goal.max(T::of(LOOK) * *looked.get_or_insert(left)) {
                looked = Some(left);
                *scale = scale.max(self.metric.norm(&self.statuses.multipliers));
                let changes = self.statuses.update(&mut self.rows, &mut self.x, &mut self.metric);
                // Projections that are not exact leave closed rows a little open.
                let mut is_closed = || self.metric.miss(&self.rows, &self.statuses, &self.x).is_met();
                if changes || (left <= goal && !is_closed()) {
                    return End::OtherEquations;
                }
                if left <= goal {
                    return End::Solved;
                }
            }
            if outcome.products == problem.patience.products || !self.descend(problem, square, &mut last) {
                return End::GivenUp;
            }
            outcome.products += 1;
        }
    }

    /// Evaluates the residual Gᵀλ − A x, and projects it.
    fn balance(&mut self, problem: &mut SparseProblem<'_, T>) {
        let Self { rows, metric, statuses, inverse, x, residual, reach, .. } = self;
        multiply(problem, *reach, inverse, (x, residual));
        for r in residual.iter_mut() {
            *r = -*r;
        }
        let dofs = problem.inverse.len();
        for row in 0..rows.len() {
            let lambda = statuses.multipliers[row];
            if lambda != T::zero() {
                rows.scatter(row, lambda, residual);
                if inverse[dofs + row] > T::zero() {
                    residual[dofs + row] += lambda;
                }
            }
        }
        let size = weighted(residual, inverse).sqrt();
        metric.project(rows, statuses, inverse, (residual, size));
    }

    /// One step of conjugate gradients; `last` is the square of the residual in the last step. Returns whether the
    /// curvature is positive.
    fn descend(&mut self, problem: &mut SparseProblem<'_, T>, square: T, last: &mut Option<T>) -> bool {
        let share = last.map_or(T::zero(), |last| square / last);
        *last = Some(square);
        let Self { rows, metric, statuses, inverse, x, residual, direction, product, reach, .. } = self;
        threads::sum_pieces([direction], [residual, inverse], &|[p], [r, inverse]| {
            for ((p, &r), &inverse) in p.iter_mut().zip(r).zip(inverse) {
                *p = inverse * r + if share > T::zero() { share * *p } else { T::zero() };
            }
            T::zero()
        });
        *reach += 1;
        multiply(problem, *reach, inverse, (direction, product));
        let curvature = threads::sum_pieces([], [direction, product], &|[], [p, product]| dot(p, product));
        let sound = curvature > T::zero();
        if sound {
            let length = square / curvature;
            threads::sum_pieces([x, residual], [direction, product], &|[x, residual], [p, product]| {
                T::axpy(length, p, x);
                T::axpy(-length, product, residual);
                T::zero()
            });
            metric.project(rows, statuses, inverse, (residual, square.sqrt()));
        }
        sound
    }
}

/// How an iteration ends.
enum End {
    Solved,
    /// Rows have another status, or are not closed any more.
    OtherEquations,
    GivenUp,
}

/// `y = A x`. A compliant row has the stiffness 1/c.
fn multiply<T: Real>(problem: &mut SparseProblem<'_, T>, reach: usize, inverse: &[T], (x, y): (&[T], &mut [T])) {
    let dofs = problem.inverse.len();
    (problem.product)(reach, &x[..dofs], &mut y[..dofs]);
    for ((y, &x), &c) in y[dofs..].iter_mut().zip(&x[dofs..]).zip(&inverse[dofs..]) {
        *y = if c > T::zero() { x / c } else { T::zero() };
    }
}

/// rᵀ D⁻¹ r.
fn weighted<T: Real>(r: &[T], inverse: &[T]) -> T {
    threads::sum_pieces([], [r, inverse], &|[], [r, inverse]| {
        r.iter().zip(inverse).map(|(&r, &inverse)| inverse * r * r).sum()
    })
}

/// A ratio of sizes; zero if there is nothing to compare with.
fn ratio<T: Real>(x: T, y: T) -> f64 {
    if y > T::zero() { (x / y).value() } else { x.value() }
}
