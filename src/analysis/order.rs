//! Order of consistency, by Taylor matching of the rows.

use super::series::{Series, solve};
use crate::tableau::{Row, Tableau};

/// Order of a scheme in displacement, velocity and acceleration, and the times of its stored values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Order {
    /// Order of the displacements.
    pub displacement: u32,
    /// Order of the velocities, at the time of the state.
    pub velocity: u32,
    /// Order of the accelerations, at the time of the state.
    pub acceleration: u32,
    /// Time at which the stored velocity is of higher order, in steps from the time of the state: −½ for a half-step
    /// velocity, 0 for most schemes. A [`State`](crate::State) extrapolates it to its own time.
    pub velocity_shift: f64,
    /// The same for the stored acceleration: α_m − α_f for generalized-α.
    pub acceleration_shift: f64,
}

impl Order {
    /// The orders of a tableau that has no solution for smooth motion.
    const NONE: Self =
        Self { displacement: 0, velocity: 0, acceleration: 0, velocity_shift: 0.0, acceleration_shift: 0.0 };
}

/// Higher orders are reported as this one.
const HIGHEST: i32 = 6;

/// Damping and stiffness of the test equation: unrelated numbers, so that no terms cancel accidentally.
const TEST: [f64; 2] = [0.731, 1.273];

/// Order of consistency of a tableau.
///
/// The rows are applied to the equation u″ + c u′ + k u = F with the motion eᵗ. Its response in the scheme is
/// computed exactly as a power series in h; the first power in which it differs from eᵗ is the order. No run is
/// simulated, and no step size is chosen.
///
/// ```
/// use contact_dynamics::{GeneralizedAlpha, TimeIntegrator, analysis};
/// let scheme = GeneralizedAlpha::chung_hulbert(0.8)?;
/// let order = analysis::order(&scheme.tableau());
/// assert_eq!([order.displacement, order.velocity, order.acceleration], [2, 2, 2]);
/// // The stored acceleration lives at t + (α_m − α_f) h.
/// assert!((order.acceleration_shift - (scheme.alpha_m() - scheme.alpha_f())).abs() < 1e-12);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn order(tableau: &Tableau) -> Order {
    let Some([displacement, velocity, acceleration]) = response(tableau, TEST, 1.0 + TEST[0] + TEST[1]) else {
        return Order::NONE;
    };
    let one = Series::monomial(1.0, 0);
    // The exact values of U, V, A: 1, h, h².
    let relative = |stored: &Series, power: i32| stored.over(&Series::monomial(1.0, power));
    let error = |value: &Series| value.minus(&one).valuation().map_or(HIGHEST, |power| power.clamp(0, HIGHEST));
    let in_u = error(&displacement);
    let read = |stored: &Series, power: i32| {
        let value = relative(stored, power);
        let own = error(&value);
        if own != 1 || in_u < 2 {
            return (own, 0.0);
        }
        // Extrapolated from two states: x − δ (x − x₋).
        let shift = value.coefficient(1);
        let step_back = one.minus(&Series::exponential(-1.0));
        let factor = one.minus(&Series::monomial(shift, 0).times(&step_back));
        (error(&value.times(&factor)), shift)
    };
    let (in_v, velocity_shift) = read(&velocity, 1);
    let (in_a, acceleration_shift) = read(&acceleration, 2);
    Order {
        displacement: in_u.unsigned_abs(),
        velocity: in_v.unsigned_abs(),
        acceleration: in_a.unsigned_abs(),
        velocity_shift,
        acceleration_shift,
    }
}

/// The series η, φ, ψ for which (U, V, A)_k = (η, φ, ψ) e^{−kh} is reproduced by the steps of u″ + c u′ + k u = F eᵗ,
/// with [c, k] and F given.
pub(super) fn response(tableau: &Tableau, [damping, stiffness]: [f64; 2], force: f64) -> Option<[Series; 3]> {
    let stages = tableau.stages.len();
    let unknowns = stages + 3;
    let unit = |index: usize, value: Series| -> Vec<Series> {
        (0..unknowns).map(|i| if i == index { value.clone() } else { Series::zero() }).collect()
    };
    // Past states as linear functions of the unknowns z₁ … z_m, η, φ, ψ, newest first.
    let mut past: Vec<[Vec<Series>; 3]> = (0..tableau.depth())
        .map(|k| [0, 1, 2].map(|field| unit(stages + field, Series::exponential(-(k as f64)))))
        .collect();
    let (mut matrix, mut right) = (Vec::new(), Vec::new());
    for (s, stage) in tableau.stages.iter().enumerate() {
        let combine = |row: Row| {
            let mut sum = unit(s, Series::monomial(row.z, 0));
            for (k, state) in past.iter().enumerate().take(row.depth()) {
                for (field, c) in row.past(k).into_iter().enumerate().filter(|(_, c)| *c != 0.0) {
                    add(&mut sum, c, &state[field], 0);
                }
            }
            sum
        };
        let [u, v, a] = stage.balance.each().map(combine);
        let mut balance = a;
        add(&mut balance, damping, &v, 1);
        add(&mut balance, stiffness, &u, 2);
        matrix.push(balance);
        right.push(Series::monomial(force, 2).times(&Series::exponential(stage.load)));
        let new = stage.recovery.each().map(combine);
        past.insert(0, new);
    }
    for (field, new) in past.swap_remove(0).into_iter().enumerate() {
        let mut closure = new;
        let end = unit(stages + field, Series::exponential(1.0));
        add(&mut closure, -1.0, &end, 0);
        matrix.push(closure);
        right.push(Series::zero());
    }
    let solution = solve(matrix, right)?;
    <[Series; 3]>::try_from(solution[stages..].to_vec()).ok()
}

/// `sum += c h^power term`.
fn add(sum: &mut [Series], c: f64, term: &[Series], power: i32) {
    for (sum, term) in sum.iter_mut().zip(term).filter(|(_, term)| !term.is_zero()) {
        *sum = sum.plus(&term.scaled(c, power));
    }
}
