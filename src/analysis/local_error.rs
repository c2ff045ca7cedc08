//! The local error of a scheme, from the values before and after a step.

use super::amplification;
use super::order::{Order, order};
use crate::tableau::Tableau;
use faer::c64;

/// Ω at which the error is evaluated: terms of higher order are smaller by Ω².
const OMEGA: f64 = 0.02;

/// Relation between the error that a step adds and its distance from the Taylor expansion,
///
/// ```text
/// e = factor · max( |u' − u − h v − ½ h² a| , h |v' − v − h a| ),
/// ```
///
/// for smooth motion; both are of size hᵖ⁺¹.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LocalError {
    /// p + 1: e falls with this power of h.
    pub power: u32,
    /// Error of a step divided by the distance, for small h.
    pub factor: f64,
}

/// The local error of a scheme, from a free oscillation at small Ω: the error added per step is the error of the
/// principal root, and the distance belongs to its principal vector, so the effect of earlier steps on v and a is
/// included.
///
/// `None` if the error is not proportional to the distance: first-order schemes like Newmark's with γ ≠ ½ have an
/// error of h² in v, of which h v contains only h³.
///
/// ```
/// use contact_dynamics::{Newmark, TimeIntegrator, analysis};
/// // u' errs by h³/12 of the third derivative; h (v' − v − h a) is ½ h³ of it.
/// let error = analysis::local_error(&Newmark::trapezoidal().tableau()).unwrap();
/// assert!(error.power == 3 && (error.factor - 1.0 / 6.0).abs() < 1e-3);
/// ```
pub fn local_error(tableau: &Tableau) -> Option<LocalError> {
    let order = order(tableau);
    let [factor, finer] = [factor(tableau, &order, OMEGA)?, factor(tableau, &order, 0.5 * OMEGA)?];
    let error = LocalError { power: order.displacement + 1, factor };
    (factor > 0.0 && (finer / factor - 1.0).abs() < 0.05).then_some(error)
}

/// Error divided by distance at Ω.
fn factor(tableau: &Tableau, order: &Order, omega: f64) -> Option<f64> {
    let eigen = amplification(tableau, omega, 0.0).eigen().ok()?;
    let (roots, vectors) = (eigen.S(), eigen.U());
    let exact = c64::new(omega.cos(), omega.sin());
    let size = |x: c64| x.re.hypot(x.im);
    let principal = (0..vectors.ncols()).min_by(|&i, &j| size(roots[i] - exact).total_cmp(&size(roots[j] - exact)))?;
    let root = roots[principal];
    let [u, stored_v, stored_a] = [0, 1, 2].map(|i| vectors[(i, principal)]);
    // v and a extrapolated to the time of the state.
    let back = c64::new(1.0, 0.0) - c64::new(1.0, 0.0) / root;
    let shown = |x: c64, shift: f64| x - x * back * shift;
    let (v, a) = (shown(stored_v, order.velocity_shift), shown(stored_a, order.acceleration_shift));
    let distance = size(root * u - u - v - a * 0.5).max(size(root * v - v - a));
    Some(size(root - exact) * size(u) / distance)
}
