//! The GSSSS family of one-step schemes.

use super::{TimeIntegrator, within};
use crate::error::Result;
use crate::tableau::{A, Rows, Stage, Tableau, U, V, Z};

/// The generalized single-step single-solve family U0(ρ₁, ρ₂, ρ₃) of Zhou and Tamma (Int. J. Numer. Meth. Eng. 59,
/// 2004): second-order schemes without displacement overshoot, parametrized by the moduli of their roots at infinite
/// frequency.
///
/// With δa = a' − a and
/// λ₃ = 1/((1+ρ₁)(1+ρ₂)), λ₅ = ½ (3 + ρ₁ + ρ₂ − ρ₁ρ₂) λ₃, w = 1/(1+ρ₃), w₆ = (2 + ρ₁ + ρ₂ + ρ₃ − ρ₁ρ₂ρ₃) λ₃ w:
///
/// ```text
/// u' = u + h v + h² (½ a + λ₃ δa),     v' = v + h (a + λ₅ δa)
/// M (a + w₆ δa) + C (v + w (v' − v)) + f_int(u + w (u' − u)) = f(t + w h) + Gᵀλ
/// ```
///
/// * Order 2; the stored a belongs to t + (w − w₆) h; the a of a [`State`](crate::State) is extrapolated to its time.
/// * Unconditionally stable for ρ₃ ≤ ρ₁ ≤ ρ₂ ≤ 1; ρ∞ = ρ₂. U0(1, 1, 0) has the trapezoidal rule's spectrum, U0(ρ, ρ, ρ)
///   is Chung–Hulbert's scheme.
/// * Conserves linear momentum; U0(1, 1, ρ₃) keeps the energy of a linear oscillator bounded without damping it.
/// * Contact is imposed on the displacements at the end of the step; the multiplier belongs to t + w h. The rows read
///   a of the past.
///
/// ```
/// use contact_dynamics::{Gssss, TimeIntegrator, analysis};
/// let scheme = Gssss::new(0.5, 0.9, 0.5)?;
/// assert!((analysis::spectral_radius(&scheme.tableau(), 1e6, 0.0) - 0.9).abs() < 1e-4);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gssss {
    rho: [f64; 3],
}

impl Gssss {
    /// The member with principal moduli ρ₁, ρ₂ and spurious modulus ρ₃ at infinite frequency.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless 0 ≤ ρ₃ ≤ ρ₁ ≤ ρ₂ ≤ 1.
    pub fn new(rho_1: f64, rho_2: f64, rho_3: f64) -> Result<Self> {
        within("ρ₂ of the GSSSS family", rho_2, 0.0..=1.0, "in [0, 1]")?;
        within("ρ₁ of the GSSSS family", rho_1, 0.0..=rho_2, "in [0, ρ₂]")?;
        within("ρ₃ of the GSSSS family", rho_3, 0.0..=rho_1, "in [0, ρ₁]")?;
        Ok(Self { rho: [rho_1, rho_2, rho_3] })
    }
}

impl TimeIntegrator for Gssss {
    fn name(&self) -> String {
        let [rho_1, rho_2, rho_3] = self.rho;
        format!("GSSSS-U0({rho_1}, {rho_2}, {rho_3})")
    }

    fn tableau(&self) -> Tableau {
        let [r1, r2, r3] = self.rho;
        let l3 = 1.0 / ((1.0 + r1) * (1.0 + r2));
        let l5 = 0.5 * (3.0 + r1 + r2 - r1 * r2) * l3;
        let w = 1.0 / (1.0 + r3);
        let w6 = (2.0 + r1 + r2 + r3 - r1 * r2 * r3) * l3 * w;
        let increment = (Z - U[0] - V[0] - 0.5 * A[0]) / l3;
        let (a, v) = (A[0] + increment, V[0] + A[0] + l5 * increment);
        let balance = Rows { u: U[0] + w * (Z - U[0]), v: V[0] + w * (v - V[0]), a: A[0] + w6 * increment };
        Tableau::single(Stage::new(Rows { u: Z, v, a }).balanced(balance, w))
    }
}
