//! The composite scheme: three-point backward difference for v, generalized central difference for a.

use super::TimeIntegrator;
use crate::tableau::{Rows, Stage, Tableau, U, V, Z};

/// The composite scheme of Zhang, Liu and Li (Math. Probl. Eng. 2015:907023).
///
/// ```text
/// v' = (3 u' − 4 u + u₋)/(2h)
/// a' = (u' − 2u + u₋)/h² + (v' − 2v + v₋)/h        M a' + C v' + f_int(u') = f(t') + Gᵀλ
/// ```
///
/// Effective matrix `K + 3/(2h) C + 5/(2h²) M`: one symmetric solve per step.
///
/// * Order 2 in u, v and a; reads u and v of two states, never a.
/// * Unconditionally stable for every damping ratio; ρ∞ = 0, reached over about four steps.
/// * Period elongation 5/24 Ω², numerical damping ≈ ¼ Ω⁵ for small Ω.
/// * Conserves linear momentum; no energy or angular-momentum theorem.
/// * Contact is imposed on the displacements at the end of the step.
/// * After an impact the rows still read values from before it: without the history projection of
///   [`PersistencyCorrection`](crate::PersistencyCorrection) contact may be lost for several steps.
///
/// At equal number of solves the two-stage scheme of Bathe is more accurate on smooth motion.
///
/// ```
/// use contact_dynamics::{Composite, TimeIntegrator, analysis};
/// let tableau = Composite.tableau();
/// assert!(analysis::spectral_radius(&tableau, 1e4, 0.0) < 0.01);
/// let (period, damping) = analysis::period_and_damping(&tableau, 0.1, 0.0).unwrap();
/// assert!((period - 0.08448).abs() < 5e-6 && (damping - 0.01032).abs() < 5e-6);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Composite;

impl TimeIntegrator for Composite {
    fn name(&self) -> String {
        "composite".into()
    }

    fn tableau(&self) -> Tableau {
        let v = 1.5 * Z - 2.0 * U[0] + 0.5 * U[1];
        let a = (Z - 2.0 * U[0] + U[1]) + (v - 2.0 * V[0] + V[1]);
        Tableau::single(Stage::new(Rows { u: Z, v, a }))
    }
}
