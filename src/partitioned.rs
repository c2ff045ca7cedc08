//! Contact between bodies that live in codes of their own: the interface problem of localized Lagrange multipliers.
//!
//! A body hands over what its contact dofs would do without contact, and its flexibility: what unit forces on them do.
//! [`Frame`] joins two bodies whose contact nodes match, [`Assembly`] any number of bodies by rows with any weights:
//! points where many bodies meet, faces whose nodes do not match. Both return forces; a body needs to know neither the
//! others nor their codes.

mod assembly;
mod coupling;
mod frame;
mod problem;

pub use assembly::{Assembled, Assembly};
pub use coupling::Coupling;
pub use frame::{Frame, Interface, Side};
