//! PETSc as the linear solver of a run: conjugate gradients with algebraic multigrid, for solids whose factor is too
//! large. The matrix must be definite: an effective one of an implicit step, or a mass.

use crate::faults::Fault;
use crate::ffi::{Failed, Multigrid as Grids, Reason};
use crate::parts::Cut;
use crate::share::{Share, host};
use contact_dynamics::faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use contact_dynamics::{Error, Factorization, LinearSolver, Result};
use std::sync::Arc;

/// Where iterations end: the residual over the right-hand side. As tight as f64 lets it be, for solves take the place
/// of a factorization, and what they leave is lost or won energy.
const TOLERANCE: f64 = 1e-13;

/// Iterations at most. (Twenty or so are usual.)
const MOST: usize = 500;

/// The solver of a body over ranks.
#[derive(Clone, Debug)]
pub struct Multigrid {
    share: Arc<Share>,
    /// Of the nodes that this rank owns.
    coordinates: Vec<f64>,
    fault: Option<Fault>,
}

#[derive(Debug)]
struct Factor {
    share: Arc<Share>,
    grids: Grids,
    /// What this rank owns of the matrix, and of a vector.
    values: Vec<f64>,
    own: Vec<f64>,
    iterations: usize,
    solves: usize,
    fault: Option<Fault>,
}

fn failed(failed: Failed) -> Error {
    host("PETSc", failed)
}

impl Multigrid {
    /// For a part of a solid, with what fails on this rank.
    pub fn new(cut: &Cut<3>, share: Arc<Share>, fault: Option<Fault>) -> Self {
        let all: Vec<f64> = cut.solid.nodes.iter().flatten().copied().collect();
        let coordinates = share.own_dofs().map(|dof| all[dof]).collect();
        Self { share, coordinates, fault }
    }
}

impl LinearSolver<f64> for Multigrid {
    fn analyze(&self, pattern: SymbolicSparseColMatRef<'_, usize>, _: &[usize]) -> Result<Box<dyn Factorization<f64>>> {
        let place = self.share.consecutive();
        // The matrix is symmetric: columns are rows.
        let row = |j: usize| pattern.row_idx_of_col_raw(j).iter().map(move |&i| (j, i));
        let entries = self.share.own_dofs().flat_map(row).map(|(row, column)| (place[row], place[column]));
        let most = if self.fault == Some(Fault::Iterations) { 2 } else { MOST };
        let grids = Grids::new(&self.coordinates, entries, TOLERANCE, most).map_err(failed)?;
        Ok(Box::new(Factor {
            share: self.share.clone(),
            grids,
            values: Vec::new(),
            own: Vec::new(),
            iterations: 0,
            solves: 0,
            fault: self.fault,
        }))
    }

    fn spans_ranks(&self) -> bool {
        true
    }
}

impl Factorization<f64> for Factor {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, f64>) -> Result<()> {
        let Self { share, grids, values, .. } = self;
        values.clear();
        values.extend(share.own_dofs().flat_map(|j| a.val_of_col(j)));
        let reason = grids.factorize(values).map_err(failed)?;
        // (Some ranks may know before the others.)
        let mut unbuilt = [f64::from(u8::from(reason.is_some()))];
        share.world.max(&mut unbuilt).map_err(failed)?;
        if unbuilt[0] > 0.0 {
            return Err(Error::Singular { matrix: "effective matrix", dof: 0 });
        }
        Ok(())
    }

    fn solve(&mut self, rhs: &mut [f64]) -> Result<()> {
        let Self { share, grids, own, iterations, .. } = self;
        *iterations = 0;
        for column in rhs.chunks_exact_mut(share.known.len()) {
            own.clear();
            own.extend(share.own_dofs().map(|dof| column[dof]));
            let ended = grids.solve(own).map_err(failed)?;
            *iterations = ended.iterations.max(*iterations);
            // The same on all ranks.
            match ended.reason {
                None => {}
                Some(Reason::NotFinite) => own.fill(f64::NAN),
                Some(Reason::Iterations) => {
                    return Err(Error::LinearNotConverged {
                        method: "conjugate gradients of PETSc",
                        iterations: ended.iterations,
                        residual: ended.residual,
                        tolerance: TOLERANCE,
                    });
                }
                Some(Reason::Indefinite) => return Err(Error::Singular { matrix: "effective matrix", dof: 0 }),
                Some(other) => {
                    let source = format!("conjugate gradients have ended: {other:?}").into();
                    return Err(Error::Host { callback: "PETSc", source });
                }
            }
            share.own_dofs().zip(own.iter()).for_each(|(dof, &value)| column[dof] = value);
        }
        self.solves += 1;
        if self.fault == Some(Fault::Solve) && self.solves == 20 {
            return Err(Error::Host { callback: "solve", source: "a bit has flipped on this rank".into() });
        }
        Ok(())
    }

    fn stored_values(&self) -> usize {
        self.grids.stored()
    }

    fn is_symmetric(&self) -> bool {
        true
    }

    fn iterations(&self) -> usize {
        self.iterations
    }
}
