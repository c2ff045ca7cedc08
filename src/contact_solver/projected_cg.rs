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
use std::ops::Range;

/// What memory is asked for.
const WHAT: &str = "a contact problem without W";

/// The body of a contact problem: its matrix A, symmetric and positive definite. Over ranks vectors are correct at
/// every dof of a rank, and results are the same on all to the bit.
pub(crate) trait Body<T> {
    /// Writes A x to y. x is zero farther from the dofs of the rows than `reach`, the number of products with which it
    /// can get there.
    fn multiply(&mut self, reach: usize, x: &[T], y: &mut [T]) -> Result<()>;

    /// The number of a dof of the system in these vectors; none if it does not move.
    fn number(&self, dof: usize) -> Option<usize> {
        Some(dof)
    }

    /// The sum over all dofs, of which there are `dofs` on this rank, from the sums over ranges of them.
    fn sum(&self, dofs: usize, part: &dyn Fn(Range<usize>) -> T) -> Result<T> {
        Ok(part(0..dofs))
    }

    /// Solves in a coarse space that leaves the closed rows closed, if there is one: x += Z μ and r −= A Z μ, so that
    /// Zᵀ r = 0.
    fn start(&mut self, _r: &mut [T], _x: &mut [T]) -> Result<()> {
        Ok(())
    }

    /// Keeps a direction A-orthogonal to that space: p −= Z μ, so that Zᵀ A p = 0.
    fn turn(&mut self, _p: &mut [T]) -> Result<()> {
        Ok(())
    }

    /// Fails on all ranks if one has failed.
    fn agree(&self, result: Result<bool>) -> Result<bool> {
        result
    }
}

/// A contact problem given by A and G: y = G x + c λ + q with A x = Gᵀ λ.
pub(crate) struct SparseProblem<'a, T> {
    pub(crate) body: &'a mut dyn Body<T>,
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
    /// Whether blocks whose friction is given stay closed, by a normal force of either sign.
    pub(crate) holds: bool,
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
        let taken = self.take(problem, multipliers).map(|()| true);
        problem.body.agree(taken)?;
        let mut scale = T::zero();
        while outcome.products < problem.patience.products && self.statuses.looks < problem.patience.looks {
            self.set_compliances();
            let is_factorized = self.metric.follow(&self.rows, &self.statuses, &self.inverse);
            if !problem.body.agree(is_factorized)? {
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
            match self.iterate(problem, &mut scale, &mut outcome)? {
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
    fn iterate(&mut self, problem: &mut SparseProblem<'_, T>, scale: &mut T, outcome: &mut Outcome) -> Result<End> {
        self.balance(problem)?;
        outcome.products += 1;
        let (mut last, mut looked) = (None, None);
        *scale = scale.max(self.metric.norm(&self.statuses.multipliers));
        loop {
            let square = weighted(problem, &self.residual, &self.inverse)?;
            if !square.is_finite() {
                return Ok(End::GivenUp);
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
                    return Ok(End::OtherEquations);
                }
                if left <= goal {
                    return Ok(End::Solved);
                }
            }
            if outcome.products == problem.patience.products || !self.descend(problem, square, &mut last)? {
                return Ok(End::GivenUp);
            }
            outcome.products += 1;
        }
    }

    /// Evaluates the residual Gᵀλ − A x, and projects it.
    fn balance(&mut self, problem: &mut SparseProblem<'_, T>) -> Result<()> {
        let Self { rows, metric, statuses, inverse, x, residual, reach, .. } = self;
        multiply(problem, *reach, inverse, (x, residual))?;
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
        problem.body.start(&mut residual[..dofs], &mut x[..dofs])?;
        let size = weighted(problem, residual, inverse)?.sqrt();
        metric.project(rows, statuses, inverse, (residual, size));
        Ok(())
    }

    /// One step of conjugate gradients; `last` is the square of the residual in the last step. Returns whether the
    /// curvature is positive.
    fn descend(&mut self, problem: &mut SparseProblem<'_, T>, square: T, last: &mut Option<T>) -> Result<bool> {
        let share = last.map_or(T::zero(), |last| square / last);
        *last = Some(square);
        let Self { rows, metric, statuses, inverse, x, residual, direction, product, reach, .. } = self;
        threads::sum_pieces([direction], [residual, inverse], &|[p], [r, inverse]| {
            for ((p, &r), &inverse) in p.iter_mut().zip(r).zip(inverse) {
                *p = inverse * r + if share > T::zero() { share * *p } else { T::zero() };
            }
            T::zero()
        });
        let dofs = problem.inverse.len();
        problem.body.turn(&mut direction[..dofs])?;
        *reach += 1;
        multiply(problem, *reach, inverse, (direction, product))?;
        let curvature = total(problem, [direction, product], &|[p, product]| dot(p, product))?;
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
        Ok(sound)
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
fn multiply<T: Real>(
    problem: &mut SparseProblem<'_, T>,
    reach: usize,
    inverse: &[T],
    (x, y): (&[T], &mut [T]),
) -> Result<()> {
    let dofs = problem.inverse.len();
    problem.body.multiply(reach, &x[..dofs], &mut y[..dofs])?;
    for ((y, &x), &c) in y[dofs..].iter_mut().zip(&x[dofs..]).zip(&inverse[dofs..]) {
        *y = if c > T::zero() { x / c } else { T::zero() };
    }
    Ok(())
}

/// rᵀ D⁻¹ r.
fn weighted<T: Real>(problem: &SparseProblem<'_, T>, r: &[T], inverse: &[T]) -> Result<T> {
    let square = |[r, inverse]: [&[T]; 2]| r.iter().zip(inverse).map(|(&r, &inverse)| inverse * r * r).sum();
    total(problem, [r, inverse], &square)
}

/// A sum over the dofs of all ranks and over the compliant rows, which all ranks have.
fn total<T: Real>(
    problem: &SparseProblem<'_, T>,
    vectors: [&[T]; 2],
    sum: &(impl Fn([&[T]; 2]) -> T + Sync),
) -> Result<T> {
    let part = |range: Range<usize>| {
        let pieces = vectors.map(|vector| &vector[range.clone()]);
        threads::sum_pieces([], pieces, &|[], pieces| sum(pieces))
    };
    let dofs = problem.inverse.len();
    Ok(problem.body.sum(dofs, &part)? + part(dofs..vectors[0].len()))
}

/// A ratio of sizes; zero if there is nothing to compare with.
fn ratio<T: Real>(x: T, y: T) -> f64 {
    if y > T::zero() { (x / y).value() } else { x.value() }
}
