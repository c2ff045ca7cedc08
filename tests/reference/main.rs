//! Whole scenes against what is known of them: exact impacts, published figures, laws of conservation.

#[allow(clippy::pedantic, reason = "numerics, with the lints of tests/scenes")]
mod elements;
mod hard_cases;
mod large_motion;
mod presets;
mod solids;
mod stabilization;
mod two_bars;
