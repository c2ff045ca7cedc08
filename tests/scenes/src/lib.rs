//! Meshes, assembly and measured quantities shared by tests, benches and examples. Not published.

pub mod bed;
pub mod boxes;
pub mod combinations;
pub mod curved;
pub mod curved_patch;
pub mod damped_contact;
pub mod disc;
pub mod drops;
pub mod falls;
pub mod folding;
pub mod frames;
pub mod front;
pub mod gradients;
pub mod ground;
pub mod hertz;
pub mod hosts;
pub mod hyperelastic;
pub mod impact_scenes;
pub mod impacts;
#[cfg(shared_instances)]
mod instances;
pub mod ironing;
pub mod large;
pub mod mindlin;
pub mod obstacles;
pub mod on_system;
pub mod particles;
pub mod pounding;
pub mod propagated;
pub mod random;
pub mod reduced;
pub mod schemes;
pub mod second_order;
pub mod slabs;
pub mod solids;
pub mod springs;
pub mod squeeze;
pub mod stacks;
pub mod truss;
pub mod two_slabs;
pub mod vectors;
pub mod wall_bar;
pub mod well;

pub use contact_dynamics_bars::{Bars, Figures, MassKind, Record, bars, masses, measure, record, reference, sparse};
#[cfg(shared_instances)]
#[doc(hidden)]
pub use instances::instances;
pub use on_system::OnSystem;
