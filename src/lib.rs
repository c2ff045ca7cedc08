#![doc = include_str!("front.md")]
// The figure itself, so that it is seen without a network; editors, which show the front page as text, leave it out.
#![cfg_attr(doc, doc = include_str!("../docs/figures/force.svg"))]
#![doc = include_str!("lib.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![warn(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr)]

pub mod analysis;
#[cfg(any(test, doctest))]
mod book;
pub mod contact;
mod contact_failure;
mod contact_id;
pub mod contact_solver;
pub mod corrector;
mod dense;
mod error;
pub mod gradient;
#[cfg(all(shared_instances, not(test)))]
mod instances;
pub mod integrator;
mod kernels;
pub mod linear_solver;
pub mod mass;
pub mod matrix;
mod memory;
pub mod observer;
pub mod partitioned;
pub mod prelude;
mod preset;
pub mod ranks;
mod real;
pub mod reduction;
mod rounding;
mod scalar;
mod simulation;
mod sparse;
mod state;
mod system;
pub mod tableau;
mod threads;
pub mod verify;

pub use contact::{ContactConstraint, ContactLaw, LinearRows, NodesOnObstacle};
pub use contact_solver::{ActiveSet, ContactSolver};
pub use corrector::{Corrector, JumpProjection, PersistencyCorrection};
pub use error::{Error, Result};
pub use faer;
#[cfg(all(shared_instances, not(test)))]
#[doc(hidden)]
pub use instances::instances;
pub use integrator::*;
pub use linear_solver::{
    Automatic, ByBody, Cholesky, Condensation, ConjugateGradients, Diagonal, Factorization, LinearSolver, Lu,
    Tridiagonal,
};
pub use mass::Mass;
pub use observer::{Control, Observer, StepView};
pub use preset::Preset;
pub use real::Real;
pub use simulation::{
    ContactForce, Energy, InitialOverclosure, Iteration, Newton, Outcome, Simulation, SimulationBuilder,
    StartAdjustment, StartImpact, Statistics, StepControl, Works,
};
#[cfg(feature = "serde")]
pub use state::Checkpoint;
pub use state::{ContactState, ContactStatus, History, State};
pub use system::{DampingForce, LinearSystem, Linearity, Path, PathForce, System, TangentWeights};
pub use tableau::StartUp;
