//! What examples and benches share beside the scenes of the tests: plots, timing, output folders. Not published.

pub mod collisions;
pub mod output;
pub mod plot;
pub mod timing;
pub mod yardsticks;
