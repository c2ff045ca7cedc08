//! Properties that follow from the rows of a tableau: order, spectral radius, stability limit, period error, damping,
//! overshoot.
//!
//! All figures are computed only from the rows of a [`Tableau`], for the scalar equation `a + 2 ξ ω v + ω² u = 0`
//! with Ω = ω h, so they also hold for user-defined schemes.

mod local_error;
mod massless;
mod order;
mod overshoot;
mod period;
mod report;
mod series;
mod stability;

pub use local_error::{LocalError, local_error};
pub use massless::massless_factor;
pub(crate) use massless::{massless_follow, steps_by_means};
pub use order::{Order, order};
pub use overshoot::{Overshoot, overshoot, overshoot_growth};
pub use period::period_elongation;
pub use report::{Report, report};
pub(crate) use stability::critical_step;
pub use stability::{ZeroStability, critical_omega, radius_at_infinity, zero_stability};

use crate::rounding::ONLY_ROUNDING;
use crate::tableau::Tableau;
use faer::{Mat, c64};

/// The amplification matrix of one step: (U, V, A) of the newest state, of the one before, … to the same after the
/// step, with U = u, V = h v, A = h² a.
///
/// ```
/// use contact_dynamics::{Newmark, TimeIntegrator, analysis};
/// let a = analysis::amplification(&Newmark::trapezoidal().tableau(), 2.0, 0.0);
/// // Ω = 2: u' = (u + h v + h² a/4)/2
/// assert!((a[(0, 0)] - 0.5).abs() < 1e-15 && (a[(0, 2)] - 0.125).abs() < 1e-15);
/// ```
pub fn amplification(tableau: &Tableau, omega: f64, xi: f64) -> Mat<f64> {
    matrix(&tableau.step_map([omega * omega, 2.0 * xi * omega, 1.0]))
}

fn matrix(rows: &[Vec<f64>]) -> Mat<f64> {
    Mat::from_fn(rows.len(), rows.len(), |i, j| rows[i][j])
}

/// Eigenvalues of the amplification matrix.
///
/// For Ω > 1 the matrix is first scaled to (U, V/Ω, A/Ω²): eigenvalues are unchanged, and rounding does not grow with
/// Ω.
pub fn eigenvalues(tableau: &Tableau, omega: f64, xi: f64) -> Vec<c64> {
    roots(tableau, omega, 2.0 * xi * omega)
}

/// Eigenvalues at Ω and Δ = c h, which for a mode without stiffness differs from 2 ξ Ω.
fn roots(tableau: &Tableau, omega: f64, delta: f64) -> Vec<c64> {
    let a = matrix(&tableau.step_map([omega * omega, delta, 1.0]));
    let scale = |i: usize| match i % 3 {
        0 => 1.0,
        1 => omega.max(1.0),
        _ => omega.max(1.0).powi(2),
    };
    let balanced = Mat::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] * scale(j) / scale(i));
    // The iteration converges for every finite matrix of this size; a NaN spectrum is the answer otherwise.
    balanced.eigenvalues().unwrap_or_else(|_| vec![c64::new(f64::NAN, f64::NAN); a.nrows()])
}

/// Spectral radius at Ω and damping ratio ξ; NaN if the tableau is not finite there.
pub fn spectral_radius(tableau: &Tableau, omega: f64, xi: f64) -> f64 {
    largest_modulus(&eigenvalues(tableau, omega, xi))
}

fn largest_modulus(roots: &[c64]) -> f64 {
    moduli(roots).fold(0.0, |largest, x| if x.is_nan() || x > largest { x } else { largest })
}

fn moduli(roots: &[c64]) -> impl Iterator<Item = f64> + '_ {
    roots.iter().map(|x| x.re.hypot(x.im))
}

/// Relative elongation of the (damped) period and damping ratio of the principal root at `h_over_period` = h/T, for ξ
/// of the equation. `None` if the principal roots are real (no oscillation).
///
/// The damping ratio is −ln|root| over the angle of the root, as the literature tabulates it: numerical and physical
/// damping together, ξ/√(1 − ξ²) for an exact scheme.
pub fn period_and_damping(tableau: &Tableau, h_over_period: f64, xi: f64) -> Option<(f64, f64)> {
    let omega = 2.0 * std::f64::consts::PI * h_over_period;
    // The principal root is the complex one nearest to the exact exp(−ξΩ ± i Ω√(1 − ξ²)).
    let exact = ((-xi * omega).exp(), omega * (1.0 - xi * xi).max(0.0).sqrt());
    let distance = |root: &c64| (root.re - exact.0 * exact.1.cos()).hypot(root.im - exact.0 * exact.1.sin());
    let roots = eigenvalues(tableau, omega, xi).into_iter().filter(|root| root.im > ONLY_ROUNDING);
    let root = roots.min_by(|x, y| distance(x).total_cmp(&distance(y)))?;
    let (decay, angle) = (-root.re.hypot(root.im).ln(), root.im.atan2(root.re));
    Some((exact.1 / angle - 1.0, decay / angle))
}
