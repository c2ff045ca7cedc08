//! The overshoot of modes that the step does not resolve, in the first steps.

use super::order::order;
use crate::integrator::{Newmark, TimeIntegrator};
use crate::tableau::{StartUp, Tableau};

/// Overshoot of the first steps.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Overshoot {
    /// Largest |u|/|u₀| of the first ten steps.
    pub displacement: f64,
    /// Largest |v|/(ω|u₀|) of the first ten steps.
    pub velocity: f64,
}

/// Number of steps in which overshoot is measured.
const STEPS: usize = 10;

/// Overshoot of an undamped oscillator released from u₀ at rest, with Ω = ω h (Hilber, Hughes, Earthq. Eng. Struct.
/// Dyn. 6, 1978). An exact scheme has 1 and 1.
///
/// ```
/// use contact_dynamics::{Composite, StartUp, TimeIntegrator, analysis};
/// // The Taylor past of a stiff mode starts with the velocity −Ω/4 ω u₀ …
/// let ghost = analysis::overshoot(&Composite.tableau(), 1e3, StartUp::Taylor);
/// assert!((ghost.velocity / 250.0 - 1.0).abs() < 0.01);
/// // … a trapezoidal first step does not.
/// let rule = analysis::overshoot(&Composite.tableau(), 1e3, StartUp::Trapezoidal);
/// assert!(rule.velocity < 1.0);
/// ```
pub fn overshoot(tableau: &Tableau, omega: f64, start: StartUp) -> Overshoot {
    let states = release(tableau, omega, start, STEPS);
    let largest = |field: usize| states.iter().map(|state| state[field].abs()).fold(0.0, f64::max);
    Overshoot { displacement: largest(0), velocity: largest(1) / omega }
}

/// Exponents of the growth of displacement and velocity overshoot for Ω → ∞ (0: bounded).
///
/// ```
/// use contact_dynamics::{Newmark, StartUp, TimeIntegrator, analysis};
/// let growth = analysis::overshoot_growth(&Newmark::new(0.3025, 0.6)?.tableau(), StartUp::Trapezoidal);
/// assert_eq!(growth.map(f64::round), [0.0, 1.0]); // velocity proportional to Ω
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn overshoot_growth(tableau: &Tableau, start: StartUp) -> [f64; 2] {
    let [low, high] = [1e3, 1e4].map(|omega| overshoot(tableau, omega, start));
    // A decreasing overshoot is bounded.
    let exponent = |high: f64, low: f64| (high / low).log10().max(0.0);
    [exponent(high.displacement, low.displacement), exponent(high.velocity, low.velocity)]
}

/// (U, V, A) in units of the step after each of `steps` steps from (1, 0, −Ω²).
fn release(tableau: &Tableau, omega: f64, start: StartUp, steps: usize) -> Vec<[f64; 3]> {
    let weights = [omega * omega, 0.0, 1.0];
    let (depth, stages) = (tableau.depth(), tableau.stages.len().max(1));
    let order = order(tableau);
    let [u, a] = [1.0, -omega * omega];
    // The stored values of schemes that store v and a at another time.
    let mut past = vec![[u, order.velocity_shift * a, a]];
    if start == StartUp::Taylor {
        past.extend((1..depth).map(|k| {
            let back = k as f64;
            [u + 0.5 * back * back * a, -back * a, a]
        }));
    }
    let rule = Newmark::trapezoidal().tableau();
    let mut states = Vec::with_capacity(steps);
    for _ in 0..steps {
        let scheme = if past.len() < depth { &rule } else { tableau };
        for stage in &scheme.stages {
            let map = Tableau::stage_map(stage, weights, past.len());
            let flat = past.concat();
            let new = map.map(|row| row.iter().zip(&flat).map(|(c, x)| c * x).sum());
            past.insert(0, new);
        }
        past.drain(1..scheme.stages.len().max(1));
        past.truncate(depth + stages - 1);
        states.push(past[0]);
    }
    states
}
