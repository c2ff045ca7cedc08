//! Park's stiffly stable scheme.

use super::TimeIntegrator;
use crate::tableau::{MAX_PAST, Row, Rows, Stage, Tableau, U, V, Z};

/// The stiffly stable scheme of Park (J. Appl. Mech. 42, 1975): one three-step difference, applied to u and then to v.
///
/// ```text
/// D(x) = (10 x' − 15 x + 6 x₋ − x₋₋)/(6h)
/// v' = D(u),     a' = D(v)                        M a' + C v' + f_int(u') = f(t') + Gᵀλ
/// ```
///
/// * Order 2; reads u and v of three states.
/// * Unconditionally stable; ρ∞ = 0. Period elongation Ω²/6 and damping proportional to Ω⁵: of the multistep schemes
///   with one solve per step it changes low modes least.
/// * Conserves linear momentum in the form (10 v − 5 v₋ + v₋₋)/6.
/// * Contact is imposed on the displacements at the end of the step; the past needs the history projection at impact.
///
/// ```
/// use contact_dynamics::{Park, TimeIntegrator, analysis};
/// let (period, damping) = analysis::period_and_damping(&Park.tableau(), 0.1, 0.0).unwrap();
/// assert!((period - 0.06707).abs() < 5e-6 && (damping - 0.00445).abs() < 5e-6);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Park;

impl TimeIntegrator for Park {
    fn name(&self) -> String {
        "Park".into()
    }

    fn tableau(&self) -> Tableau {
        let d = |x: Row, y: [Row; MAX_PAST]| (10.0 * x - 15.0 * y[0] + 6.0 * y[1] - y[2]) / 6.0;
        let v = d(Z, U);
        Tableau::single(Stage::new(Rows { u: Z, v, a: d(v, V) }))
    }
}
