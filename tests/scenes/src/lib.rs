//! Meshes, assembly and measured quantities shared by tests, benches and examples. Not published.

pub mod bars;
pub mod bed;
pub mod boxes;
pub mod combinations;
pub mod curved;
pub mod damped_contact;
pub mod disc;
pub mod drops;
pub mod frames;
pub mod ground;
pub mod hosts;
pub mod hyperelastic;
pub mod large;
pub mod masses;
pub mod measure;
pub mod mindlin;
pub mod on_system;
pub mod output;
pub mod particles;
pub mod plot;
pub mod random;
pub mod schemes;
pub mod slabs;
pub mod solids;
pub mod sparse;
pub mod springs;
pub mod squeeze;
pub mod tables;
pub mod timing;
pub mod truss;
pub mod two_slabs;
pub mod wall_bar;

pub use bars::{Bars, MassKind};
pub use measure::{Figures, Record, record};
pub use on_system::OnSystem;
