//! The simulation: one system, one integrator, contacts and correctors, advanced step by step.
//!
//! In the order of a run: `build` assembles the simulation from its parts, `start` computes the first state, `step`
//! advances it by one step. A step consists of stages (`stage`), each solved with its effective matrix (`operator`)
//! and the contact rows (`rows`). `watch` monitors energy and stability, `run` is the interface for the caller.

mod build;
mod operator;
mod rows;
mod run;
mod stage;
mod start;
mod step;
mod watch;

pub use build::builder::SimulationBuilder;
pub(crate) use build::program::{CompiledStage, Program};
pub(crate) use operator::Operator;
pub(crate) use operator::tangent::At;
pub(crate) use rows::constraints::Constraints;
pub(crate) use rows::slip::{Source as SlipSource, source as slip_source};
pub(crate) use run::Parts;
pub use run::Simulation;
pub use run::contact_output::ContactForce;
pub(crate) use run::impulses::Impulses;
pub use run::results::{Energy, Outcome, Statistics, Works};
pub(crate) use stage::massless::MasslessBlock;
pub use stage::newton::{Iteration, Newton};
pub use start::InitialOverclosure;
pub use start::balance::StartAdjustment;
pub use start::problem::StartImpact;
pub(crate) use start::projection;
pub use step::judge::StepControl;
