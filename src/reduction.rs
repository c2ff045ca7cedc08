//! Reduced bodies: a few normal modes and the contact dofs replace a mesh.
//!
//! A body that is struck at a few places needs a few modes and its contact dofs. [`Reduction`] builds a
//! [`ReducedBody`] from mass and stiffness matrices: a small [`LinearSystem`](crate::LinearSystem) whose contact dofs
//! have no mass, with maps from fields of the parent and back. [`Modes`] are computed by a sparse eigensolver or
//! imported from another code. [`Blocks`] combines several bodies in one system. [`ModalPropagation`] integrates them
//! without a time scheme: modes are solved exactly, under contact forces that are linear in each step.
//!
//! The taper is new: with the usual reductions the contact force rings, by a third and more, because the set of modes
//! ends abruptly. `docs/reduction.md` derives the taper and measures when to use it.

mod blocks;
mod body;
mod builder;
mod exact_step;
mod lanczos;
mod matrices;
mod modes;
mod pencil;
mod propagation;
mod residual;

pub use blocks::Blocks;
pub use body::{Accuracy, Boundary, ReducedBody};
pub use builder::Reduction;
pub use modes::{GivenModes, Modes};
pub use propagation::{ModalPropagation, ModalPropagationBuilder};
