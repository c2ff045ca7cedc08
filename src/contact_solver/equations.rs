//! The equations of the active rows, W_AA λ_A = −q_A: by a factor, or of many rows by iteration. What is computed from
//! W serves again while W and the rows stay.

use super::extents::Extents;
use super::many_rows::ManyRows;
use super::{ContactProblem, FORESEEN, MANY};
use crate::dense::DenseCholesky;
use crate::real::Real;

/// A factor of W on some rows, or what takes its place.
#[derive(Clone, Debug, Default)]
pub(super) struct Equations<T> {
    factor: DenseCholesky<T>,
    many: ManyRows<T>,
    method: Method,
    /// The version of W, and the rows, to which these belong; version 0 if to none.
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

/// What became of the equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Solved {
    /// They have one solution.
    Once,
    /// Rows depend on one another: of all solutions the one of least norm was taken.
    LeastNorm,
    /// Rows depend on one another, and W is not symmetric: none was found.
    Not,
}

impl<T: Real> Equations<T> {
    /// Memory for up to so many rows. Of many the factor is a last resort, and gets its memory when it is needed.
    pub(super) fn with_capacity(rows: usize) -> Self {
        let dense = if rows < MANY { rows } else { FORESEEN };
        let factor = DenseCholesky::with_capacity(dense);
        Self { factor, many: ManyRows::default(), method: Method::Factor, version: 0, rows: Vec::with_capacity(rows) }
    }

    /// Solves for `x`, which holds −q on entry. With a `shift` of the diagonal W is positive definite, and what is
    /// computed serves once. `Err(row)` names a row of the problem whose W is not finite, or not semidefinite.
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
