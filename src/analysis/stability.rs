//! Stability: the limit of high frequencies, the critical frequency, and zero-stability.

use super::{largest_modulus, matrix, moduli, roots};
use crate::rounding::{DISTINCT, ONLY_ROUNDING, split_of_root};
use crate::tableau::Tableau;
use faer::{Mat, c64};

/// Spectral radius at infinite frequency (ρ∞), without damping; `None` for explicit schemes.
///
/// Computed from the limit of the amplification matrix, in which stiffness alone determines the unknown; no large
/// numbers are involved.
///
/// ```
/// use contact_dynamics::{Composite, Newmark, TimeIntegrator, analysis};
/// assert_eq!(analysis::radius_at_infinity(&Composite.tableau()), Some(0.0));
/// let rule = analysis::radius_at_infinity(&Newmark::trapezoidal().tableau()).unwrap();
/// assert!((rule - 1.0).abs() < 1e-12);
/// ```
pub fn radius_at_infinity(tableau: &Tableau) -> Option<f64> {
    if tableau.stages.iter().any(|stage| stage.balance.u.z == 0.0) {
        return None;
    }
    let limit = matrix(&tableau.step_map([1.0, 0.0, 0.0]));
    if is_nilpotent(&limit) {
        return Some(0.0);
    }
    let mut roots = limit.eigenvalues().ok()?;
    let largest = roots.iter().copied().max_by(|x, y| modulus(*x).total_cmp(&modulus(*y)))?;
    roots.sort_by(|x, y| modulus(*x - largest).total_cmp(&modulus(*y - largest)));
    // A root of multiplicity m splits by the m-th root of the rounding error, while the mean of the split roots is
    // unchanged.
    let mean = |m: usize| {
        let sum = roots[..m].iter().fold(c64::new(0.0, 0.0), |sum, root| sum + *root);
        c64::new(sum.re / m as f64, sum.im / m as f64)
    };
    let is_split = |m: &usize| {
        let spread = roots[..*m].iter().map(|root| modulus(*root - mean(*m))).fold(0.0, f64::max);
        spread <= 4.0 * limit.norm_max() * split_of_root(*m)
    };
    let multiplicity = (2..=roots.len()).rev().find(is_split).unwrap_or(1);
    Some(modulus(mean(multiplicity)))
}

fn modulus(x: c64) -> f64 {
    x.re.hypot(x.im)
}

/// Whether powers of a matrix vanish to rounding, so that all eigenvalues are zero.
fn is_nilpotent(a: &Mat<f64>) -> bool {
    let n = a.nrows();
    let power = (1..n).fold(a.clone(), |power, _| &power * a);
    let scale = a.norm_max().max(1.0) * n as f64;
    power.norm_max() <= ONLY_ROUNDING * scale.powi(i32::try_from(n).unwrap_or(i32::MAX))
}

/// Ω up to which the scheme is stable at damping ratio ξ: below it the spectral radius is at most 1. `None` if this
/// holds for all Ω between 0.01 and 10⁴, `Some(0.0)` if it already fails at 0.01.
///
/// ```
/// use contact_dynamics::{CentralDifference, Composite, TimeIntegrator, analysis};
/// let critical = analysis::critical_omega(&CentralDifference.tableau(), 0.0).unwrap();
/// assert!((critical - 2.0).abs() < 1e-6);
/// assert_eq!(analysis::critical_omega(&Composite.tableau(), 0.0), None);
/// ```
pub fn critical_omega(tableau: &Tableau, xi: f64) -> Option<f64> {
    critical_along(tableau, 1.0, 2.0 * xi)
}

/// The longest stable step of the mode a + c v + ω² u = 0, which may have no stiffness; `None` if all steps in the
/// range of [`critical_omega`] are stable.
pub(crate) fn critical_step(tableau: &Tableau, omega: f64, damping: f64) -> Option<f64> {
    let rate = omega.max(damping);
    (rate > 0.0).then(|| critical_along(tableau, omega / rate, damping / rate)).flatten().map(|x| x / rate)
}

/// x up to which a step with Ω = x `omega` and Δ = x `damping` is stable; at least one of both is 1.
fn critical_along(tableau: &Tableau, omega: f64, damping: f64) -> Option<f64> {
    // Roots that are nearly double at 1 have an accuracy of eps/x, matrices of size x one of eps x. NaN counts as
    // unstable.
    let radius = |x: f64| largest_modulus(&roots(tableau, x * omega, x * damping));
    let is_stable = |x: f64| radius(x) <= 1.0 + ONLY_ROUNDING * (10.0 + x);
    let at = |i: i32| 10_f64.powf(f64::from(i) / 80.0);
    let first = (-160..=320).find(|&i| !is_stable(at(i)))?;
    if first == -160 {
        return Some(0.0);
    }
    let (mut below, mut above) = (at(first - 1), at(first));
    for _ in 0..50 {
        let middle = 0.5 * (below + above);
        if is_stable(middle) {
            below = middle;
        } else {
            above = middle;
        }
    }
    Some(below)
}

/// Whether errors of single steps stay bounded as h → 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ZeroStability {
    /// Only the double root 1 of rigid-body motion has modulus 1.
    Strong,
    /// Other simple roots have modulus 1: their errors are not damped when h → 0.
    Weak,
    /// Some root grows.
    Unstable,
}

/// Zero-stability: the roots of the step at K = C = 0.
///
/// ```
/// use contact_dynamics::analysis::{ZeroStability, zero_stability};
/// use contact_dynamics::{Park, TimeIntegrator};
/// assert_eq!(zero_stability(&Park.tableau()), ZeroStability::Strong);
/// ```
pub fn zero_stability(tableau: &Tableau) -> ZeroStability {
    let roots = matrix(&tableau.step_map([0.0, 0.0, 1.0])).eigenvalues().unwrap_or_default();
    let one = c64::new(1.0, 0.0);
    let rigid = roots.iter().filter(|root| modulus(**root - one) < DISTINCT).count();
    let largest = moduli(&roots).fold(0.0, |largest: f64, x| if x.is_nan() { x } else { largest.max(x) });
    if rigid != 2 || largest.is_nan() || largest > 1.0 + DISTINCT {
        return ZeroStability::Unstable;
    }
    let marginal: Vec<c64> = roots
        .iter()
        .copied()
        .filter(|root| modulus(*root) > 1.0 - DISTINCT && modulus(*root - one) >= DISTINCT)
        .collect();
    let simple = |i: usize| (0..i).all(|j| modulus(marginal[i] - marginal[j]) > DISTINCT);
    match (marginal.is_empty(), (0..marginal.len()).all(simple)) {
        (true, _) => ZeroStability::Strong,
        (false, true) => ZeroStability::Weak,
        (false, false) => ZeroStability::Unstable,
    }
}
