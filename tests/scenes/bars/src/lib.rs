//! Colliding bars, assembly, measured quantities and exact solutions. A package of its own, so that the program
//! of two bars builds in less than two minutes; all other scenes and tests take it from `contact_dynamics_scenes`.

pub mod bars;
pub mod masses;
pub mod measure;
pub mod reference;
pub mod sparse;

pub use bars::{Bars, MassKind};
pub use measure::{Figures, Record, record};
