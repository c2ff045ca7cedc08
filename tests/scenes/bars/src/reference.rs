//! Exact solutions to measure the schemes against.
//!
//! [`CollidingBars`] solves the central impact of two linear elastic bars, or of a bar and a rigid wall, by the
//! method of characteristics; [`single_oscillator`] and [`forced_oscillator`] are the textbook responses of one
//! degree of freedom; [`PowerLawImpact`] is Hertz' impact, [`BouncingBar`] an elastic bar that falls on a wall
//! repeatedly. Units are the caller's and need only be consistent.
//!
//! # Method of characteristics
//!
//! With the compressive force `p = -sigma A` and the impedance `Z = rho c A`, `c = sqrt(E / rho)`, the wave equation
//! of a bar states that `R = v + p/Z` travels unchanged to the right and `L = v - p/Z` to the left, at the speed `c`.
//! At the contact end, one of them arrives and the other leaves; the free far end (`p = 0`) reflects the outgoing one
//! as the incoming one, so that
//!
//! ```math
//! \text{incoming}(t) = \text{outgoing} \left( t - \frac{2l}{c} \right).
//! ```
//!
//! While apart, the contact ends are independent. While in contact they share one velocity and one force:
//!
//! ```math
//! p = \frac{R_1 - L_2}{1/Z_1 + 1/Z_2}, \qquad v = R_1 - \frac{p}{Z_1} = L_2 + \frac{p}{Z_2}, \qquad p \ge 0,
//! ```
//!
//! and they separate as soon as this `p` would be negative; while apart, the gap grows at the rate `L2 - R1`. A rigid
//! wall is the limit `1/Z2 = 0`. Bars that start undeformed keep both invariants piecewise constant in time, so the
//! solution is a finite list of jumps, and displacements, impulses and energies are exact sums over it.
//!
//! # References
//!
//! - W. Goldsmith, *Impact: The Theory and Physical Behaviour of Colliding Solids*, 1960 (longitudinal impact of rods,
//!   after Saint-Venant).
//! - K. F. Graff, *Wave Motion in Elastic Solids*, 1975 (characteristics, impedance).

mod bar;
mod bouncing_bar;
mod colliding_bars;
mod error;
mod oscillator;
mod power_law;

pub use bar::Bar;
pub use bouncing_bar::BouncingBar;
pub use colliding_bars::{CollidingBars, Side};
pub use error::ReferenceError;
pub use oscillator::{HarmonicForce, forced_oscillator, single_oscillator};
pub use power_law::PowerLawImpact;
