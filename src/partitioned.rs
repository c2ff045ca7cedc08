//! Contact between bodies in separate codes: the interface problem of localized Lagrange multipliers.
//!
//! A body provides the motion of its contact dofs without contact, and its flexibility: their response to unit
//! forces. [`Frame`] joins two bodies with matching contact nodes, [`Assembly`] any number of bodies by rows with any
//! weights, such as points where many bodies meet, or faces whose nodes do not match. Both return forces; a body
//! needs no knowledge of the others or their codes.

mod assembly;
mod coupling;
mod frame;
mod problem;

pub use assembly::{Assembled, Assembly};
pub use coupling::Coupling;
pub use frame::{Frame, Interface, Side};
