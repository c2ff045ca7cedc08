//! Newmark's family of one-step schemes.

use super::{TimeIntegrator, within};
use crate::error::Result;
use crate::tableau::{A, Rows, Stage, Tableau, U, V, Z};

/// Newmark's scheme (J. Eng. Mech. Div. ASCE 85, 1959) with parameters β and γ.
///
/// ```text
/// u' = u + h v + h² [ (½ − β) a + β a' ]
/// v' = v + h [ (1 − γ) a + γ a' ]                 M a' + C v' + f_int(u') = f(t') + Gᵀλ
/// ```
///
/// Effective matrix `K + γ/(βh) C + 1/(βh²) M`.
///
/// * Order 2 in u, v and a if and only if γ = ½.
/// * Unconditionally stable if and only if 2β ≥ γ ≥ ½.
/// * The trapezoidal rule (¼, ½) conserves the energy of linear free motion; it has no numerical damping.
/// * Conserves linear momentum in the form v + (1 − γ) h a.
/// * Contact is imposed on the displacements at the end of the step.
/// * The rows read a of the past: after an impact they need the acceleration correction as much as the velocity
///   correction.
///
/// ```
/// use contact_dynamics::{Newmark, TimeIntegrator, analysis};
/// let rule = Newmark::trapezoidal();
/// assert!((analysis::spectral_radius(&rule.tableau(), 100.0, 0.0) - 1.0).abs() < 1e-10);
/// assert!(Newmark::new(0.0, 0.5).is_err()); // the explicit member has no implicit unknown
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Newmark {
    beta: f64,
    gamma: f64,
}

impl Newmark {
    /// The scheme with parameters β and γ.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless 0 < β ≤ 1 and ½ ≤ γ ≤ 1 (below γ = ½ the scheme has
    /// negative damping).
    pub fn new(beta: f64, gamma: f64) -> Result<Self> {
        Ok(Self {
            beta: within("Newmark's β", beta, f64::MIN_POSITIVE..=1.0, "in (0, 1]")?,
            gamma: within("Newmark's γ", gamma, 0.5..=1.0, "in [1/2, 1]")?,
        })
    }

    /// The trapezoidal rule, β = ¼, γ = ½ (average acceleration).
    pub const fn trapezoidal() -> Self {
        Self { beta: 0.25, gamma: 0.5 }
    }

    /// β.
    pub fn beta(&self) -> f64 {
        self.beta
    }

    /// γ.
    pub fn gamma(&self) -> f64 {
        self.gamma
    }
}

impl Default for Newmark {
    /// The trapezoidal rule.
    fn default() -> Self {
        Self::trapezoidal()
    }
}

impl TimeIntegrator for Newmark {
    fn name(&self) -> String {
        format!("Newmark({}, {})", self.beta, self.gamma)
    }

    fn tableau(&self) -> Tableau {
        Tableau::single(Stage::new(kinematics(self.beta, self.gamma)))
    }
}

/// Newmark's rows for the unknown z = u'.
pub(super) fn kinematics(beta: f64, gamma: f64) -> Rows {
    let a = (Z - U[0] - V[0]) / beta - ((0.5 - beta) / beta) * A[0];
    let v = V[0] + (1.0 - gamma) * A[0] + gamma * a;
    Rows { u: Z, v, a }
}
