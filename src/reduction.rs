//! Reduced bodies: a few normal modes and the contact dofs in place of a mesh.
//!
//! A body that is struck at a few places needs a few modes and its contact dofs. [`Reduction`] makes a [`ReducedBody`]
//! of mass and stiffness matrices: a [`LinearSystem`](crate::LinearSystem) of as many dofs, whose contact dofs have no
//! mass, and the way from fields of the parent and back. [`Modes`] are found by a sparse eigensolver, or taken from
//! another code. [`Blocks`] puts several bodies side by side. [`ModalPropagation`] moves them without a scheme: modes
//! are solved exactly, under contact forces that are linear in each step.
//!
//! What is new here is the taper: of the usual reductions the contact force rings, by a third and more, because the
//! modes end abruptly. `docs/reduction.md` derives it and measures when to take it and when not.

mod blocks;
mod body;
mod builder;
mod exact_step;
mod lanczos;
mod modes;
mod pencil;
mod propagation;
mod residual;

pub use blocks::Blocks;
pub use body::ReducedBody;
pub use builder::{Accuracy, Boundary, Reduction};
pub use modes::{GivenModes, Modes};
pub use propagation::{ModalPropagation, ModalPropagationBuilder};
