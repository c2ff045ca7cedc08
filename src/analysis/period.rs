//! The leading term of the period error.

use super::order::response;
use super::series::Series;
use crate::tableau::Tableau;

/// p of the relative elongation of periods T′/T = 1 + p Ω² + O(Ω⁴), without damping: 1/12 for the trapezoidal rule,
/// −1/24 for central differences.
///
/// `None` if free oscillations have a first-order error in phase or amplitude.
///
/// Exact to rounding: the motion eᵗ is inserted into the rows for u″ = u, and the remainder gives the equation that it
/// solves instead; no oscillation is sampled at small Ω.
///
/// ```
/// use contact_dynamics::{CentralDifference, Composite, Newmark, TimeIntegrator, analysis};
/// let p = |tableau| analysis::period_elongation(&tableau);
/// assert!((p(CentralDifference.tableau()).unwrap() + 1.0 / 24.0).abs() < 1e-14);
/// assert!((p(Newmark::trapezoidal().tableau()).unwrap() - 1.0 / 12.0).abs() < 1e-14);
/// // γ ≠ ½ brings damping of first order.
/// assert_eq!(p(Newmark::new(0.3025, 0.6)?.tableau()), None);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn period_elongation(tableau: &Tableau) -> Option<f64> {
    // The response η of u″ + k u to the force eᵗ at k = −1, where the exact response is unbounded: 1/η is the missing
    // part of k, e h² + …, so eᵗ is the scheme's motion for u″ = (1 + e h²) u.
    let [displacement, ..] = response(tableau, [0.0, -1.0], 1.0)?;
    let missing = Series::monomial(1.0, 0).over(&displacement);
    // In terms of the rate σ = √(1 + e h²) that the scheme was given: σ h (1 − ½ e (σ h)²) is the exponent of a step.
    // The series has real coefficients in σ h; at σ h = iΩ the angle is Ω (1 + ½ e Ω²): a positive e shortens the
    // period.
    missing.valuation().filter(|&power| power >= 2).map(|_| -0.5 * missing.coefficient(2))
}
