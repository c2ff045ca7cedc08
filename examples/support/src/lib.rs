//! What examples and benches share beside the scenes of the tests: plots, timing, output folders. Not published.

pub mod collisions;
pub mod output;
pub use example_plot as plot;
pub mod timing;
pub mod yardsticks;
