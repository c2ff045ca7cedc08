//! The two-stage schemes of Bathe and of Noh and Bathe.

use super::{TimeIntegrator, within};
use crate::error::Result;
use crate::tableau::{A, Rows, Stage, Tableau, U, V, Z};

/// The two-stage implicit scheme of Bathe (Bathe, Baig, Comput. Struct. 83, 2005) in the form of Noh and Bathe (Comput.
/// Struct. 212, 2019), with ρ∞: the trapezoidal rule to t + γh, then a formula of three velocities and accelerations to
/// t + h.
///
/// ```text
/// stage 1:  v₁ = 2 (u₁ − u)/(γh) − v,     a₁ = 2 (v₁ − v)/(γh) − a
/// stage 2:  u' = u + h (q₀ v + q₁ v₁ + q₂ v'),     v' = v + h (q₀ a + q₁ a₁ + q₂ a')
/// q₁ = (ρ∞ + 1)/(2γ(ρ∞ − 1) + 4),  q₂ = ½ − γ q₁,  q₀ = 1 − q₁ − q₂
/// M a + C v + f_int(u) = f + Gᵀλ  at the end of either stage
/// ```
///
/// * Order 2, two solves per step. For γ = 2 − √2 and ρ∞ = 0 (the default; TR-BDF2 of Bank et al. 1985) both stages
///   share one effective matrix.
/// * Unconditionally stable with the given ρ∞; the first step already removes a stiff mode (ρ∞ = 0). At equal number
///   of solves the default is more accurate on smooth motion than the multistep schemes, less than Chung–Hulbert.
/// * Conserves linear momentum.
/// * Contact is imposed on the displacements at the end of either stage; the impulse is h Σ β_s λ_s. If a contact
///   closes in the second stage, that stage reads the first one, from before the impact: history projection helps.
/// * For ρ∞ = 0, where q₀ = q₁, stage 1 makes stage 2 equal to the formula of Bathe and Baig,
///   v' = (c₁ u + c₂ u₁ + c₃ u')/h and similarly for a', with c₁ = (1 − γ)/γ, c₂ = −1/(γ(1 − γ)), c₃ = (2 − γ)/(1 − γ):
///   v + v₁ = 2 (u₁ − u)/(γh) and a + a₁ = 2 (v₁ − v)/(γh). A correction of v₁ and a₁ breaks these relations, unless
///   the past is projected too. After an impact in the first stage the two forms therefore differ. In this form λ
///   contains the approach velocity left in v (1.3 to 7.4 F₀ for two bars), and λ_v removes it from the force. The
///   formula of three displacements does not contain it (λ stays below F₀), and releases an early impact. Reported
///   forces of this form equal those for a projected past.
///
/// ```
/// use contact_dynamics::{Bathe, TimeIntegrator, analysis};
/// let (period, damping) = analysis::period_and_damping(&Bathe::default().tableau(), 0.1, 0.0).unwrap();
/// assert!((period - 0.01571).abs() < 5e-6 && (damping - 0.00087).abs() < 5e-6);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bathe {
    gamma: f64,
    rho: f64,
}

impl Bathe {
    /// Bathe's scheme with its first stage ending at t + γh, ρ∞ = 0.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless γ is in [0.01, 0.99].
    pub fn new(gamma: f64) -> Result<Self> {
        Ok(Self { gamma: within("γ of Bathe's scheme", gamma, 0.01..=0.99, "in [0.01, 0.99]")?, rho: 0.0 })
    }

    /// The ρ∞ scheme with the γ that gives both stages the same effective matrix (½ at ρ∞ = 1).
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless ρ∞ is in [0, 1].
    pub fn with_radius(rho: f64) -> Result<Self> {
        within("ρ∞ of Bathe's scheme", rho, 0.0..=1.0, "in [0, 1]").map(Self::of_radius)
    }

    /// The ρ∞ scheme for a radius that is known to be in range.
    pub(crate) fn of_radius(rho: f64) -> Self {
        // (2 − √(2 + 2ρ))/(1 − ρ) without its removable singularity.
        Self { gamma: 2.0 / (2.0 + (2.0 + 2.0 * rho).sqrt()), rho }
    }
}

impl Default for Bathe {
    /// γ = 2 − √2, ρ∞ = 0.
    fn default() -> Self {
        Self { gamma: 2.0 - std::f64::consts::SQRT_2, rho: 0.0 }
    }
}

impl TimeIntegrator for Bathe {
    fn name(&self) -> String {
        if *self == Self::default() {
            "Bathe".into()
        } else if self.rho == 0.0 {
            format!("Bathe(γ = {})", self.gamma)
        } else {
            format!("ρ∞-Bathe({})", self.rho)
        }
    }

    fn tableau(&self) -> Tableau {
        let Self { gamma, rho } = *self;
        let q1 = (rho + 1.0) / (2.0 * gamma * (rho - 1.0) + 4.0);
        let q2 = 0.5 - gamma * q1;
        let q0 = 1.0 - q1 - q2;
        let v = (2.0 / gamma) * (Z - U[0]) - V[0];
        let a = (4.0 / (gamma * gamma)) * (Z - U[0] - gamma * V[0]) - A[0];
        let first = Stage::new(Rows { u: Z, v, a }).ending_at(gamma);
        let v = (Z - U[1] - q0 * V[1] - q1 * V[0]) / q2;
        let a = (v - V[1] - q0 * A[1] - q1 * A[0]) / q2;
        Tableau::staged(vec![first, Stage::new(Rows { u: Z, v, a })])
    }
}
