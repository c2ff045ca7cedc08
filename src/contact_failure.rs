//! Why a contact problem was not solved: plain data, which contact solvers return and errors carry.

use crate::error::few;
use crate::real::Real;

/// Why a contact problem was not solved; rows count within the problem.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ContactFailure<T> {
    /// No multipliers meet all conditions: rows demand opposite things of the same dofs.
    Contradictory {
        /// The row that is violated most.
        row: usize,
        /// The row that presses hardest against it.
        other: usize,
        /// The violation, in the unit of y.
        residual: T,
    },
    /// The iteration limit was reached.
    NotConverged {
        /// Iterations spent.
        iterations: usize,
        /// The worst row.
        row: usize,
        /// Its residual, in the unit of y.
        residual: T,
    },
    /// A contact for which friction leaves no way out (Painlevé): sliding on, every force that presses closes the gap
    /// by more than it opens it, μ |W_nt| ≥ W_nn. It is proven that no multipliers solve the problem.
    Jammed {
        /// The first row of the contact.
        row: usize,
        /// μ.
        friction: f64,
        /// W_nn: what a unit of the normal multiplier adds to the gap.
        normal: T,
        /// W_nt: what a unit of friction adds to it, in the direction in which that is most.
        coupling: T,
    },
    /// The problem has a contact with friction, and the solver takes none; nothing was done.
    Friction {
        /// The first row of the contact.
        row: usize,
    },
    /// W is not symmetric, and the solver is for symmetric ones; nothing was done.
    Unsymmetric {
        /// The pair of rows whose entries across the diagonal differ most.
        row: usize,
        /// The other row.
        other: usize,
    },
}

impl<T: Real> std::fmt::Display for ContactFailure<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Contradictory { row, other, residual } => {
                let residual = few(residual.value());
                write!(f, "rows {row} and {other} contradict each other: {row} stays violated by {residual:e}")
            }
            Self::NotConverged { iterations, row, residual } => {
                let residual = few(residual.value());
                write!(f, "not solved after {iterations} iterations: row {row} misses complementarity by {residual:e}")
            }
            Self::Jammed { row, friction, normal, coupling } => {
                let (friction, normal, coupling) = (few(*friction), few(normal.value()), few(coupling.value()));
                write!(
                    f,
                    "the contact of row {row} jams: with μ = {friction} friction moves its gap by {friction} × \
                     {coupling:e} where the normal force moves it by {normal:e}"
                )
            }
            Self::Friction { row } => {
                write!(f, "row {row} is that of a contact with friction; use ActiveSet or GaussSeidel")
            }
            Self::Unsymmetric { row, other } => {
                write!(
                    f,
                    "rows {row} and {other} answer to each other differently: W is not symmetric; use ActiveSet or \
                     GaussSeidel"
                )
            }
        }
    }
}

impl<T: Real> std::error::Error for ContactFailure<T> {}
