//! The simulation: one system, one integrator, contacts and correctors, advanced step by step.

mod admitted;
mod advance;
mod builder;
#[cfg(feature = "serde")]
mod checkpoint;
mod closing;
mod constraints;
mod contact_multipliers;
mod contact_rows;
mod contact_solve;
mod contact_step;
mod control;
mod curved_rows;
mod curved_step;
mod energy;
mod finite;
mod interface;
mod judge;
mod linear_step;
mod massless;
mod massless_start;
mod massless_step;
mod newton;
mod newton_step;
mod operator;
mod overclosures;
mod pairing;
mod past;
mod path;
mod program;
mod rate_check;
mod resample;
pub(crate) mod results;
mod resumed;
mod run;
mod scheme;
#[cfg(feature = "serde")]
mod settings;
mod stability;
mod stage;
mod stage_vectors;
mod start;
mod start_problem;
mod step;
mod supports;
mod tangent;
mod workspace;

pub use builder::SimulationBuilder;
pub use judge::StepControl;
pub use massless_start::StartAdjustment;
pub use newton::{Iteration, Newton};
pub(crate) use operator::Operator;
pub(crate) use overclosures::Overclosures;
pub use results::{Energy, Outcome, Statistics, Works};
pub use run::Simulation;
pub use start::InitialOverclosure;
