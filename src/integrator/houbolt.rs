//! Houbolt's scheme.

use super::TimeIntegrator;
use crate::tableau::{Rows, Stage, Tableau, U, Z};

/// The scheme of Houbolt (J. Aeronaut. Sci. 17, 1950): third-order backward polynomial through four displacements.
///
/// ```text
/// v' = (11 u' − 18 u + 9 u₋ − 2 u₋₋)/(6h)
/// a' = (2 u' − 5 u + 4 u₋ − u₋₋)/h²               M a' + C v' + f_int(u') = f(t') + Gᵀλ
/// ```
///
/// * Order 2; reads only three displacements.
/// * Unconditionally stable; ρ∞ = 0 with strong damping also of the low modes (period elongation 11/24 Ω², damping
///   proportional to Ω³: the spectrum of Chung–Hulbert with ρ∞ = 0).
/// * Conserves linear momentum in the form (2 u − 3 u₋ + u₋₋)/h.
/// * Contact is imposed on the displacements at the end of the step; the past needs the history projection at impact.
///
/// ```
/// use contact_dynamics::{Houbolt, TimeIntegrator, analysis};
/// let (period, damping) = analysis::period_and_damping(&Houbolt.tableau(), 0.1, 0.0).unwrap();
/// assert!((period - 0.12321).abs() < 5e-6 && (damping - 0.05499).abs() < 5e-6);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Houbolt;

impl TimeIntegrator for Houbolt {
    fn name(&self) -> String {
        "Houbolt".into()
    }

    fn tableau(&self) -> Tableau {
        let v = (11.0 * Z - 18.0 * U[0] + 9.0 * U[1] - 2.0 * U[2]) / 6.0;
        let a = 2.0 * Z - 5.0 * U[0] + 4.0 * U[1] - U[2];
        Tableau::single(Stage::new(Rows { u: Z, v, a }))
    }
}
