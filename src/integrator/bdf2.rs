//! The two-step backward difference formula.

use super::TimeIntegrator;
use crate::tableau::{MAX_PAST, Row, Rows, Stage, Tableau, U, V, Z};

/// The two-step backward difference formula (Gear, Numerical Initial Value Problems, 1971), applied to u and then to v.
///
/// ```text
/// D(x) = (3 x' − 4 x + x₋)/(2h)
/// v' = D(u),     a' = D(v)                        M a' + C v' + f_int(u') = f(t') + Gᵀλ
/// ```
///
/// * Order 2; reads u and v of two states.
/// * Unconditionally stable; ρ∞ = 0. Period elongation Ω²/3 and damping ¼ Ω³: the composite scheme, at the same cost,
///   is more accurate in both.
/// * Conserves linear momentum in the form (3 v − v₋)/2.
/// * Contact is imposed on the displacements at the end of the step; the past needs the history projection at impact.
///
/// ```
/// use contact_dynamics::{Bdf2, TimeIntegrator, analysis};
/// let (period, damping) = analysis::period_and_damping(&Bdf2.tableau(), 0.1, 0.0).unwrap();
/// assert!((period - 0.10206).abs() < 5e-6 && (damping - 0.03443).abs() < 5e-6);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bdf2;

impl TimeIntegrator for Bdf2 {
    fn name(&self) -> String {
        "BDF2".into()
    }

    fn tableau(&self) -> Tableau {
        let d = |x: Row, y: [Row; MAX_PAST]| 1.5 * x - 2.0 * y[0] + 0.5 * y[1];
        let v = d(Z, U);
        Tableau::single(Stage::new(Rows { u: Z, v, a: d(v, V) }))
    }
}
