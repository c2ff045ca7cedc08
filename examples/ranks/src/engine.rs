//! The solvers that a body over ranks can have.

use crate::clock::Timed;
use crate::faults::Fault;
use crate::ffi::Input;
#[cfg(feature = "petsc")]
use crate::multigrid::Multigrid;
use crate::parts::Cut;
use crate::share::Share;
use crate::solver::{Direct, Way};
use contact_dynamics::{ConjugateGradients, LinearSolver};
use std::sync::Arc;

/// A solver that spans ranks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    /// Factorizes: MUMPS.
    Mumps(Way),
    /// Iterates: conjugate gradients with multigrid of PETSc, rows on all ranks.
    #[cfg(feature = "petsc")]
    Petsc,
    /// Iterates: conjugate gradients of the crate, rows on all ranks.
    Crate,
}

impl Engine {
    /// MUMPS with the rows of each rank on it, and the Schur complement of the contact dofs.
    pub const CONDENSING: Self = Self::Mumps(Way { input: Input::Distributed, condenses: true });

    /// All that there are.
    pub fn all() -> Vec<Self> {
        let mumps = |input, condenses| Self::Mumps(Way { input, condenses });
        vec![
            mumps(Input::Root, false),
            mumps(Input::Root, true),
            mumps(Input::Distributed, false),
            Self::CONDENSING,
            #[cfg(feature = "petsc")]
            Self::Petsc,
            Self::Crate,
        ]
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Mumps(Way { input: Input::Root, condenses: false }) => "MUMPS, matrix on rank 0",
            Self::Mumps(Way { input: Input::Root, condenses: true }) => "MUMPS, rank 0, Schur complement",
            Self::Mumps(Way { input: Input::Distributed, condenses: false }) => "MUMPS, rows on all ranks",
            Self::Mumps(Way { input: Input::Distributed, condenses: true }) => "MUMPS, all ranks, Schur complement",
            #[cfg(feature = "petsc")]
            Self::Petsc => "PETSc, multigrid, rows on all ranks",
            Self::Crate => "conjugate gradients of the crate",
        }
    }

    /// Whether each rank has its own rows of matrices and vectors.
    pub fn is_distributed(self) -> bool {
        !matches!(self, Self::Mumps(Way { input: Input::Root, .. }))
    }

    /// Whether it is direct.
    pub fn factorizes(self) -> bool {
        matches!(self, Self::Mumps(_))
    }

    /// By the word of the command line.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "mumps" => Some(Self::CONDENSING),
            #[cfg(feature = "petsc")]
            "petsc" => Some(Self::Petsc),
            "crate" => Some(Self::Crate),
            _ => None,
        }
    }

    /// The solver for a part of a body, with what fails on this rank.
    #[cfg_attr(not(feature = "petsc"), expect(unused_variables, reason = "MUMPS needs no coordinates"))]
    pub fn solver(self, cut: &Cut<3>, share: &Arc<Share>, fault: Option<Fault>) -> Box<dyn LinearSolver<f64>> {
        let (share, clock) = (share.clone(), share.clock.clone());
        match self {
            Self::Mumps(way) => Box::new(Timed { part: Direct { share, way, fault }, clock }),
            #[cfg(feature = "petsc")]
            Self::Petsc => Box::new(Timed { part: Multigrid::new(cut, share, fault), clock }),
            Self::Crate => {
                // As many digits as the other iteration.
                let settings = ConjugateGradients::default().tolerance(1e-13).expect("less than one");
                Box::new(Timed { part: settings.over_ranks(share), clock })
            }
        }
    }
}
