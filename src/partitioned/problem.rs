//! The contact problem of the selected rows, its solver and memory, and checks of host data.

use crate::contact_solver::{AdmissibleSet, ContactFailure, ContactProblem, ContactSolver};
use crate::error::{Error, Result};
use crate::memory;
use crate::real::Real;
use crate::rounding::half_digits;
use crate::sparse::check_vector;

/// The contact problem of selected rows.
#[derive(Debug)]
pub(super) struct Problem<T: Real> {
    solver: Box<dyn ContactSolver<T>>,
    /// The rows in the problem, and their multipliers.
    pub(super) rows: Vec<usize>,
    pub(super) multipliers: Vec<T>,
    /// W of these rows, and its version.
    pub(super) delassus: Vec<T>,
    pub(super) version: u64,
    pub(super) offset: Vec<T>,
    pub(super) tolerance: Vec<T>,
    pub(super) sets: Vec<AdmissibleSet>,
}

impl<T: Real> Problem<T> {
    /// For this many rows. `what` names the memory if there is not enough for W and for the solver, which cannot report
    /// that later.
    pub(super) fn new(rows: usize, solver: Box<dyn ContactSolver<T>>, what: &'static str) -> Result<Self> {
        memory::probe::<T>(rows, rows.saturating_mul(8), what)?;
        Ok(Self {
            solver,
            rows: Vec::new(),
            multipliers: Vec::new(),
            delassus: memory::reserve(rows, rows, what)?,
            version: 0,
            offset: Vec::new(),
            tolerance: Vec::new(),
            sets: Vec::new(),
        })
    }

    /// Finds the multipliers, starting from the present ones.
    pub(super) fn solve(&mut self) -> Result<usize> {
        let Self { solver, rows, multipliers, delassus, version, offset, tolerance, sets } = self;
        let problem = ContactProblem::of(delassus, offset, sets, tolerance, *version);
        solver.solve(&problem, multipliers).map_err(|failure| Error::Frame { failure: of_frame(failure, rows) })
    }
}

/// The failure in the numbering of all rows.
fn of_frame<T: Real>(failure: ContactFailure<T>, rows: &[usize]) -> ContactFailure<f64> {
    match failure {
        ContactFailure::Contradictory { row, other, residual } => {
            ContactFailure::Contradictory { row: rows[row], other: rows[other], residual: residual.value() }
        }
        ContactFailure::NotConverged { iterations, row, residual } => {
            ContactFailure::NotConverged { iterations, row: rows[row], residual: residual.value() }
        }
        ContactFailure::Jammed { row, friction, normal, coupling } => {
            let [normal, coupling] = [normal, coupling].map(Real::value);
            ContactFailure::Jammed { row: rows[row], friction, normal, coupling }
        }
        ContactFailure::Friction { row } => ContactFailure::Friction { row: rows[row] },
        ContactFailure::Unsymmetric { row, other } => {
            ContactFailure::Unsymmetric { row: rows[row], other: rows[other] }
        }
    }
}

pub(super) const FLEXIBILITY: &str = "flexibility of a body";

pub(super) fn check_length(what: &'static str, found: usize, expected: usize) -> Result<()> {
    if found == expected { Ok(()) } else { Err(Error::Dimension { what, expected, found }) }
}

/// Rejects flexibilities whose number of dofs is not n, with a negative diagonal entry, or that are not symmetric
/// (columns may have been stored as rows, or solved for with other normals).
pub(super) fn check_flexibility<T: Real>(flexibility: &[T], n: usize) -> Result<()> {
    check_vector(FLEXIBILITY, flexibility, n * n)?;
    let entry = |i: usize, j: usize| flexibility[i + j * n];
    for column in 0..n {
        if entry(column, column) < T::zero() {
            return Err(Error::Singular { matrix: FLEXIBILITY, dof: column });
        }
        for row in 0..column {
            // Columns are results of solves, whose error depends on the condition of the body's matrix.
            let scale = entry(row, row).max(entry(column, column));
            let (value, mirrored) = (entry(row, column), entry(column, row));
            if (value - mirrored).abs() > half_digits::<T>() * scale {
                let (value, mirrored) = (value.value(), mirrored.value());
                return Err(Error::Asymmetric { matrix: "flexibility", row, column, value, mirrored });
            }
        }
    }
    Ok(())
}
