//! The wrapper of a linear solver for steps over ranks: shares solutions, and starts a solve only when all ranks
//! agree.

use super::Together;
use crate::error::{Error, Result};
use crate::linear_solver::{Condensation, Factorization, LinearSolver};
use crate::real::Real;
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};

/// The solver of the host, or one of this crate for diagonal matrices, and the ranks of the run.
#[derive(Debug)]
pub(crate) struct AgreedSolver<'a, T: Real> {
    inner: Box<dyn LinearSolver<T> + 'a>,
    together: Together<T>,
}

impl<'a, T: Real> AgreedSolver<'a, T> {
    /// The solver of a run over ranks.
    pub(crate) fn new(inner: Box<dyn LinearSolver<T> + 'a>, together: Together<T>) -> Self {
        Self { inner, together }
    }
}

#[derive(Debug)]
struct AgreedFactorization<T: Real> {
    inner: Box<dyn Factorization<T>>,
    together: Together<T>,
    dofs: usize,
    /// The largest value over all ranks, so that all decide alike.
    stored_values: usize,
}

impl<T: Real> LinearSolver<T> for AgreedSolver<'_, T> {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<T>>> {
        let off_diagonal = (pattern.row_idx().len() - pattern.ncols().min(pattern.row_idx().len())) as f64;
        let [most] = self.together.max(Ok([off_diagonal]))?;
        if most > 0.0 && !self.inner.spans_ranks() {
            return Err(Error::Incompatible {
                part: format!("the linear solver {:?}", self.inner),
                reason: "it solves for the rows of one rank, and the matrix is spread over several: give one that \
                         `spans_ranks`",
            });
        }
        let inner = self.inner.analyze(pattern, last);
        let stored = inner.as_ref().map_or(0, |inner| inner.stored_values()) as f64;
        let inner = self.together.agree(inner)?;
        let [stored] = self.together.max(Ok([stored]))?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of values")]
        let stored_values = stored as usize;
        Ok(Box::new(AgreedFactorization {
            inner,
            together: self.together.clone(),
            dofs: pattern.ncols(),
            stored_values,
        }))
    }

    fn spans_ranks(&self) -> bool {
        true
    }
}

impl<T: Real> AgreedFactorization<T> {
    /// Shares the columns of a solution. A rank that has failed takes part too, because the others do not know yet.
    fn shared(&self, result: Result<()>, solution: &mut [T]) -> Result<()> {
        for column in solution.chunks_exact_mut(self.dofs.max(1)) {
            self.together.share(column)?;
        }
        result
    }

    fn condensed(&mut self) -> Result<&mut dyn Condensation<T>> {
        self.inner.condensation().ok_or(Error::Incompatible {
            part: "the linear solver".into(),
            reason: "it has offered a condensation, and has none now",
        })
    }
}

impl<T: Real> Factorization<T> for AgreedFactorization<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        self.together.agree(Ok(()))?;
        self.inner.factorize(a)
    }

    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        self.together.agree(Ok(()))?;
        let result = self.inner.solve(rhs);
        self.shared(result, rhs)
    }

    fn release(&mut self) {
        self.inner.release();
    }

    fn stored_values(&self) -> usize {
        self.stored_values
    }

    fn is_symmetric(&self) -> bool {
        self.inner.is_symmetric()
    }

    fn iterations(&self) -> usize {
        self.inner.iterations()
    }

    fn condensation(&mut self) -> Option<&mut dyn Condensation<T>> {
        self.inner.condensation().is_some().then_some(self)
    }
}

impl<T: Real> Condensation<T> for AgreedFactorization<T> {
    fn condense(&mut self, rhs: &[T], interface: &mut [T]) -> Result<()> {
        self.together.agree(Ok(()))?;
        self.condensed()?.condense(rhs, interface)
    }

    fn expand(&mut self, interface: &[T], solution: &mut [T]) -> Result<()> {
        self.together.agree(Ok(()))?;
        let result = self.condensed().and_then(|condensed| condensed.expand(interface, solution));
        self.shared(result, solution)
    }

    fn solve(&mut self, forces: &mut [T]) -> Result<()> {
        self.together.agree(Ok(()))?;
        self.condensed()?.solve(forces)
    }
}
