//! Why a contact problem was not solved: plain data, returned by contact solvers and carried by errors.

use crate::error::text::few;

/// Why a contact problem was not solved; row numbers refer to the problem.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ContactFailure<T> {
    /// No multipliers satisfy all conditions: rows contradict each other.
    Contradictory {
        /// The most violated row.
        row: usize,
        /// The row that acts most against it.
        other: usize,
        /// The violation, in the unit of y.
        residual: T,
    },
    /// The iteration limit was reached.
    NotConverged {
        /// Iterations performed.
        iterations: usize,
        /// The worst row.
        row: usize,
        /// Its residual, in the unit of y.
        residual: T,
    },
    /// Friction jams a contact (Painlevé): while it slides, every pressing force closes the gap by at least as much
    /// as it opens it, μ |W_nt| ≥ W_nn. It is proven that no multipliers solve the problem.
    Jammed {
        /// The first row of the contact.
        row: usize,
        /// μ.
        friction: f64,
        /// W_nn: change of the gap per unit of normal multiplier.
        normal: T,
        /// W_nt: change of the gap per unit of friction, in the direction in which it is largest.
        coupling: T,
    },
    /// The problem has a contact with friction, which the solver does not support; nothing was done.
    Friction {
        /// The first row of the contact.
        row: usize,
    },
    /// W is not symmetric, which the solver requires; nothing was done.
    Unsymmetric {
        /// The row of the pair with the largest asymmetry.
        row: usize,
        /// The other row.
        other: usize,
    },
}

impl<T: Copy + Into<f64>> std::fmt::Display for ContactFailure<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Contradictory { row, other, residual } => {
                let residual = few((*residual).into());
                write!(f, "rows {row} and {other} contradict each other: {row} stays violated by {residual:e}")
            }
            Self::NotConverged { iterations, row, residual } => {
                let residual = few((*residual).into());
                write!(f, "not solved after {iterations} iterations: row {row} misses complementarity by {residual:e}")
            }
            Self::Jammed { row, friction, normal, coupling } => {
                let (friction, normal, coupling) = (few(*friction), few((*normal).into()), few((*coupling).into()));
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

impl<T: Copy + Into<f64> + std::fmt::Debug> std::error::Error for ContactFailure<T> {}
