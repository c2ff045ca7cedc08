//! The equations of the active rows, W_AA λ_A = −q_A: by a factor, or for many rows by iteration. The factorization
//! or preconditioner is reused while W and the rows stay the same.

use super::extents::Extents;
use super::many_rows::ManyRows;
use super::{ContactProblem, FORESEEN, MANY};
use crate::dense::DenseCholesky;
use crate::real::Real;

/// A factor of W on some rows, or the iterative solver that replaces it.
#[derive(Clone, Debug, Default)]
pub(super) struct Equations<T> {
    factor: DenseCholesky<T>,
    many: ManyRows<T>,
    method: Method,
    /// The version of W, and the rows, of the stored factorization; version 0 if there is none.
    version: u64,
    rows: Vec<usize>,
}

/// How the equations are solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Method {
    #[default]
    Factor,
    Iteration,
}

/// Whether W is symmetric to rounding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Symmetry {
    #[default]
    Symmetric,
    General,
}

/// Result of solving the equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Solved {
    /// The solution is unique.
    Once,
    /// The rows are dependent: the least-norm solution was taken.
    LeastNorm,
    /// The rows are dependent and W is not symmetric: no solution was computed.
    Not,
}

impl<T: Real> Equations<T> {
    /// Memory for up to `rows` rows. For many rows the factor is a fallback and is allocated only when needed.
    pub(super) fn with_capacity(rows: usize) -> Self {
        let dense = if rows < MANY { rows } else { FORESEEN };
        let factor = DenseCholesky::with_capacity(dense);
        Self { factor, many: ManyRows::default(), method: Method::Factor, version: 0, rows: Vec::with_capacity(rows) }
    }

    /// Solves for `x`, which holds −q on entry. With a `shift` of the diagonal W is positive definite, and its
    /// factorization is not reused. `Err(row)` gives a row of the problem whose W is not finite or not semidefinite.
    pub(super) fn solve(
        &mut self,
        (problem, extents): (&ContactProblem<'_, T>, &Extents),
        (rows, symmetry): (&[usize], Symmetry),
        shift: Option<&[T]>,
        x: &mut [T],
    ) -> Result<Solved, usize> {
        let known = self.version > 0 && self.version == problem.version && self.rows == rows && shift.is_none();
        if !known {
            self.version = 0;
            let iterates = rows.len() >= MANY && symmetry == Symmetry::Symmetric && shift.is_none();
            match iterates && self.many.prepare(problem, extents, rows) {
                true => self.method = Method::Iteration,
                false => self.factorize(problem, (rows, symmetry), shift)?,
            }
        }
        let mut solved = Solved::Once;
        if !(self.method == Method::Iteration && self.many.solve(problem, extents, rows, x).is_some()) {
            if self.method == Method::Iteration {
                self.factorize(problem, (rows, symmetry), shift)?;
            }
            if self.factor.is_singular() {
                solved = if symmetry == Symmetry::General { Solved::Not } else { Solved::LeastNorm };
            }
            if solved != Solved::Not {
                self.factor.solve(x);
            }
        }
        if shift.is_none() {
            self.version = problem.version;
            self.rows.clear();
            self.rows.extend_from_slice(rows);
        }
        Ok(solved)
    }

    fn factorize(
        &mut self,
        problem: &ContactProblem<'_, T>,
        (rows, symmetry): (&[usize], Symmetry),
        shift: Option<&[T]>,
    ) -> Result<(), usize> {
        self.method = Method::Factor;
        self.version = 0;
        let entry = |i: usize, j: usize| {
            let w = problem.row(rows[i])[rows[j]];
            let own = shift.filter(|_| i == j).map_or(T::zero(), |shift| shift[rows[i]]);
            w + own
        };
        let done = match symmetry {
            Symmetry::Symmetric => self.factor.factorize(rows.len(), entry),
            Symmetry::General => self.factor.factorize_general(rows.len(), entry),
        };
        done.map_err(|i| rows[i])
    }
}
