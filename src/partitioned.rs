//! Contact between bodies in separate codes: the interface problem of localized Lagrange multipliers.
//!
//! A body provides the motion of its contact dofs without contact, and its flexibility: their response to unit
//! forces. An [`Assembly`] joins any number of bodies by rows with any weights: matching nodes of two bodies, points
//! where many bodies meet, faces whose nodes do not match. It returns forces; a body needs no knowledge of the others
//! or their codes.

mod assembly;
mod coupling;
mod problem;

pub use assembly::{Assembled, Assembly};
pub use coupling::Coupling;
