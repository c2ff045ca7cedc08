//! The equations of the active rows, (W + d I)_AA λ_A = b, with a shift d from zero: by a factor, or for many
//! independent rows by iteration. The factor or preconditioner is kept while W, the rows and the shift stay the same.

use super::many_rows::ManyRows;
use super::structure::{Structure, Symmetry};
use super::{ContactProblem, MANY};
use crate::dense::DenseCholesky;
use crate::real::Real;

/// A factor of W + d I on some rows, or the iterative solver that replaces it.
#[derive(Clone, Debug, Default)]
pub(super) struct Equations<T> {
    factor: DenseCholesky<T>,
    many: ManyRows<T>,
    /// Whether the iterative solver is used.
    iterates: bool,
    /// The rows of the stored factor, and its shift of the diagonal.
    factored: Block,
    shift: T,
    /// The rows last found to depend on one another.
    dependent: Block,
}

/// A block of W: some rows of one version of W, if any.
#[derive(Clone, Debug, Default)]
struct Block {
    version: Option<u64>,
    rows: Vec<usize>,
}

impl Block {
    fn is(&self, version: u64, rows: &[usize]) -> bool {
        self.version == Some(version) && self.rows == rows
    }

    fn set(&mut self, version: u64, rows: &[usize]) {
        self.version = Some(version);
        self.rows.clear();
        self.rows.extend_from_slice(rows);
    }
}

impl<T: Real> Equations<T> {
    /// Discards what is kept of earlier problems.
    pub(super) fn forget(&mut self) {
        self.factored.version = None;
        self.dependent.version = None;
    }

    /// Solves for `x`, which holds b on entry. Returns false, without a solution, if the rows depend on one another.
    /// `Err(row)` gives a row of the problem whose W is not finite or not semidefinite.
    pub(super) fn solve(
        &mut self,
        problem: &ContactProblem<'_, T>,
        structure: &Structure,
        (rows, shift): (&[usize], T),
        x: &mut [T],
    ) -> Result<bool, usize> {
        let plain = shift == T::zero();
        if plain && self.dependent.is(problem.version, rows) {
            return Ok(false);
        }
        if !(self.shift == shift && self.factored.is(problem.version, rows)) {
            self.factored.version = None;
            self.iterates = plain
                && rows.len() >= MANY
                && structure.symmetry() == Symmetry::Symmetric
                && self.many.prepare(problem, structure, rows);
            if !self.iterates {
                self.factorize(problem, structure, (rows, shift))?;
            }
            self.factored.set(problem.version, rows);
            self.shift = shift;
        }
        if self.iterates {
            if self.many.solve(problem, structure, rows, x).is_some() {
                return Ok(true);
            }
            self.iterates = false;
            self.factored.version = None;
            self.factorize(problem, structure, (rows, shift))?;
            self.factored.set(problem.version, rows);
        }
        if self.factor.is_singular() {
            self.dependent.set(problem.version, rows);
            return Ok(false);
        }
        self.factor.solve(x);
        Ok(true)
    }

    fn factorize(
        &mut self,
        problem: &ContactProblem<'_, T>,
        structure: &Structure,
        (rows, shift): (&[usize], T),
    ) -> Result<(), usize> {
        let entry = |i: usize, j: usize| {
            let w = problem.delassus(rows[i], rows[j]);
            if i == j { w + shift } else { w }
        };
        let done = match structure.symmetry() {
            Symmetry::Symmetric => self.factor.factorize(rows.len(), entry),
            Symmetry::General => self.factor.factorize_general(rows.len(), entry),
        };
        done.map_err(|i| rows[i])
    }
}
