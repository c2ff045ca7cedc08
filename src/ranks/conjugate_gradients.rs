//! Conjugate gradients over ranks, scaled by the diagonal.

use super::Ranks;
use crate::error::{Error, Result};
use crate::linear_solver::{ConjugateGradients, Factorization, LinearSolver};
use crate::memory;
use crate::real::Real;
use crate::sparse::{self, Product};
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};
use std::sync::Arc;

/// [`ConjugateGradients`] for a matrix that is spread over ranks, made by [`ConjugateGradients::over_ranks`]: a solver
/// that needs no other package.
///
/// Its preconditioner is the diagonal of the matrix (Jacobi), which does not depend on the partition: any number of
/// ranks gives the same result up to rounding. It takes about twice as many iterations as `ConjugateGradients` without
/// ranks. An iteration costs a product with the rows of the rank, one exchange of a vector and two sums. The residual
/// is measured in the norm of the inverse diagonal.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::ranks::Ranks;
/// use contact_dynamics::{ConjugateGradients, LinearRows, LinearSystem, Newmark, Simulation};
/// use std::{ops::Range, sync::Arc};
///
/// #[derive(Debug)]
/// struct Alone([Range<usize>; 1]); // of a host: its message passing
///
/// impl Ranks<f64> for Alone {
///     fn rank(&self) -> usize {
///         0
///     }
///     fn owned(&self) -> &[Range<usize>] {
///         &self.0
///     }
///     fn sum(&self, _: &mut [f64]) -> contact_dynamics::Result<()> {
///         Ok(())
///     }
///     fn max(&self, _: &mut [f64]) -> contact_dynamics::Result<()> {
///         Ok(())
///     }
///     fn share(&self, _: &mut [f64]) -> contact_dynamics::Result<()> {
///         Ok(())
///     }
/// }
///
/// let springs = [(0, 0, 1.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)].map(|(i, j, k)| Triplet::new(i, j, k));
/// let stiffness = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &springs)?;
/// let ranks = Arc::new(Alone([0..2]));
/// let system = LinearSystem::lumped(vec![1.0; 2], stiffness)?.over_ranks(ranks.clone());
/// let mut run = Simulation::builder(system, Newmark::trapezoidal(), 0.1)
///     .velocity(vec![1.0; 2])
///     .constraint(LinearRows::new().unilateral(&[(1, -1.0)], 0.25))
///     .linear_solver(ConjugateGradients::default().over_ranks(ranks))
///     .build()?;
/// run.run_until(2.0, &mut ())?;
/// assert!(run.state().displacement()[1] <= 0.25 + 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ConjugateGradientsOverRanks<T: Real> {
    settings: ConjugateGradients,
    ranks: Arc<dyn Ranks<T>>,
}

impl ConjugateGradients {
    /// The same tolerance and limit for a matrix that is spread over ranks.
    #[must_use]
    pub fn over_ranks<T: Real>(self, ranks: Arc<dyn Ranks<T>>) -> ConjugateGradientsOverRanks<T> {
        ConjugateGradientsOverRanks { settings: self, ranks }
    }
}

/// The rows of a rank.
#[derive(Debug)]
struct Rows<T: Real> {
    settings: ConjugateGradients,
    ranks: Arc<dyn Ranks<T>>,
    matrix: SparseColMat<usize, T>,
    product: Product<T>,
    /// One over the diagonal, of all dofs of the rank.
    inverse: Vec<T>,
    /// Residual, direction, and its product.
    vectors: [Vec<T>; 3],
    cursor: Vec<usize>,
    iterations: usize,
}

impl<T: Real> LinearSolver<T> for ConjugateGradientsOverRanks<T> {
    fn analyze(&self, pattern: SymbolicSparseColMatRef<'_, usize>, _: &[usize]) -> Result<Box<dyn Factorization<T>>> {
        let what = "a matrix over ranks";
        let dofs = sparse::check_effective_pattern(pattern)?;
        let entries = pattern.row_idx().len();
        let (mut pointers, mut rows) = (memory::reserve(dofs + 1, 1, what)?, memory::reserve(entries, 1, what)?);
        pointers.extend_from_slice(pattern.col_ptr());
        rows.extend_from_slice(pattern.row_idx());
        let own = SymbolicSparseColMat::new_checked(dofs, dofs, pointers, None, rows);
        let vector = || memory::zeros(dofs, 1, what);
        Ok(Box::new(Rows {
            settings: self.settings,
            ranks: self.ranks.clone(),
            matrix: SparseColMat::new(own, memory::zeros(entries, 1, what)?),
            product: Product::of_symmetric(pattern)?,
            inverse: vector()?,
            vectors: [vector()?, vector()?, vector()?],
            cursor: Vec::with_capacity(dofs),
            iterations: 0,
        }))
    }

    fn spans_ranks(&self) -> bool {
        true
    }
}

impl<T: Real> Rows<T> {
    /// The sum over the dofs of all ranks.
    fn sum(&self, term: impl Fn(usize) -> T) -> Result<T> {
        let mut sum = [self.ranks.owned().iter().cloned().flatten().map(term).sum::<T>().value()];
        self.ranks.sum(&mut sum)?;
        Ok(T::of(sum[0]))
    }

    /// Solves A x = b, with b in x at first.
    fn solve_column(&mut self, x: &mut [T]) -> Result<usize> {
        let [mut r, mut p, mut q] = std::mem::take(&mut self.vectors);
        let solved = self.iterate(x, [&mut r, &mut p, &mut q]);
        self.vectors = [r, p, q];
        solved
    }

    fn iterate(&mut self, x: &mut [T], [r, p, q]: [&mut [T]; 3]) -> Result<usize> {
        let (tolerance, limit) = self.settings.limits();
        self.ranks.share(x)?;
        r.copy_from_slice(x);
        x.fill(T::zero());
        let mut square = self.sum(|dof| self.inverse[dof] * r[dof] * r[dof])?;
        let first = square;
        let (mut iteration, mut last) = (0, None);
        loop {
            if square <= T::of(tolerance * tolerance) * first || !square.is_finite() {
                return Ok(iteration);
            }
            if iteration == limit.max(1) {
                return Err(Error::LinearNotConverged {
                    method: "conjugate gradients over ranks",
                    iterations: iteration,
                    residual: (square / first).sqrt().value(),
                    tolerance,
                });
            }
            let share = last.map_or(T::zero(), |last| square / last);
            for ((p, &r), &inverse) in p.iter_mut().zip(&*r).zip(&self.inverse) {
                *p = inverse * r + if share > T::zero() { share * *p } else { T::zero() };
            }
            self.product.write(T::one(), self.matrix.as_ref(), p, q);
            self.ranks.share(q)?;
            let curvature = self.sum(|dof| p[dof] * q[dof])?;
            if curvature <= T::zero() {
                let scale = self.sum(|dof| p[dof] * p[dof] / self.inverse[dof])?;
                let dof = (0..p.len()).max_by(|&i, &j| p[i].abs().value().total_cmp(&p[j].abs().value()));
                let curvature = (curvature / scale).value();
                return Err(Error::Indefinite { curvature, dof: dof.unwrap_or(0) });
            }
            let length = square / curvature;
            T::axpy(length, p, x);
            T::axpy(-length, q, r);
            last = Some(square);
            square = self.sum(|dof| self.inverse[dof] * r[dof] * r[dof])?;
            iteration += 1;
        }
    }
}

impl<T: Real> Factorization<T> for Rows<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let refused = self.read(a);
        // Before any rank waits for the others, all know whether one has no matrix.
        let mut failed = [f64::from(u8::from(refused.is_err()))];
        self.ranks.max(&mut failed)?;
        refused?;
        if failed[0] > 0.0 {
            let part = "the matrix of another rank".into();
            return Err(Error::Incompatible { part, reason: "conjugate gradients over ranks cannot use it" });
        }
        self.ranks.share(&mut self.inverse)
    }

    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        let dofs = self.inverse.len();
        if !rhs.len().is_multiple_of(dofs.max(1)) {
            return Err(Error::Dimension { what: "right-hand side", expected: dofs, found: rhs.len() });
        }
        // At least one, by which contact knows that solves iterate.
        self.iterations = 1;
        for column in rhs.chunks_exact_mut(dofs.max(1)) {
            self.iterations = self.iterations.max(self.solve_column(column)?);
        }
        Ok(())
    }

    fn is_symmetric(&self) -> bool {
        true
    }

    fn stored_values(&self) -> usize {
        self.matrix.val().len() + 4 * self.inverse.len()
    }

    fn iterations(&self) -> usize {
        self.iterations
    }
}

impl<T: Real> Rows<T> {
    /// Copies a matrix.
    fn read(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let own = self.matrix.symbolic();
        if a.col_ptr() != own.col_ptr() || a.row_idx() != own.row_idx() {
            let part = "conjugate gradients over ranks".into();
            return Err(Error::Incompatible { part, reason: "the matrix has another pattern than was analyzed" });
        }
        sparse::check_symmetric_in("effective", a, &mut self.cursor)?;
        self.matrix.val_mut().copy_from_slice(a.val());
        self.inverse.fill(T::one());
        for dof in self.ranks.owned().iter().cloned().flatten() {
            let at = a.row_idx_of_col_raw(dof).binary_search(&dof);
            let own = at.map_or(T::zero(), |at| a.val_of_col(dof)[at]);
            if own <= T::zero() || !own.is_finite() {
                return Err(Error::Singular { matrix: "effective matrix", dof });
            }
            self.inverse[dof] = own.recip();
        }
        Ok(())
    }
}
