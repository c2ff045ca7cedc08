//! The explicit two-stage scheme of Noh and Bathe.

use super::{TimeIntegrator, within};
use crate::error::Result;
use crate::tableau::{A, ContactLevel, Row, Rows, Stage, Tableau, U, V, Z};

/// The explicit two-stage scheme of Noh and Bathe for wave propagation (Comput. Struct. 129, 2013).
///
/// ```text
/// stage 1:  u₁ = u + p h v + ½ (p h)² a,      v₁ = v + ½ p h (a + a₁)                       damping at v + p h a
/// stage 2:  u' = u₁ + s h v₁ + ½ (s h)² a₁,   v' = v₁ + s h [ q₀ a + (½ + q₁) a₁ + q₂ a' ]  damping at v₁ + s h a₁
/// s = 1 − p,  q₁ = (1 − 2p)/(2p(1 − p)),  q₂ = ½ − p q₁,  q₀ = ½ − q₁ − q₂
/// M a + C v̂ + f_int(u) = f + Gᵀλ  at the end of either stage;   0 ≤ g ⊥ λ ≥ 0  at the end of the next one
/// ```
///
/// Two force evaluations per step; with a lumped mass no matrix is factorized, with or without damping.
///
/// * Order 2. For p = 0.54: period error −0.25 % at h/T = 0.1, stable for Ω < 3.745; high frequencies are damped.
/// * Conserves linear momentum.
/// * Displacements are known before the forces of a stage, so contact is imposed on those at the end of the next
///   stage, which the multiplier determines (forward increments, as in
///   [`CentralDifference`](crate::CentralDifference)): no state penetrates, and no correction applies. If contact
///   were imposed on the velocities of either stage, the multipliers of the two stages would counteract each other:
///   the force of two bars had ten times the error. A rigid mass leaves with up to 6 % of its approach speed.
///
/// ```
/// use contact_dynamics::{NohBathe, TimeIntegrator, analysis};
/// let tableau = NohBathe::new(0.54)?.tableau();
/// assert!(analysis::spectral_radius(&tableau, 3.74, 0.0) < 1.0 + 1e-12);
/// assert!(analysis::spectral_radius(&tableau, 3.76, 0.0) > 1.0);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NohBathe {
    p: f64,
}

impl NohBathe {
    /// The scheme whose first stage ends at t + p h; the authors use p = 0.54.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless p is in [½, 2 − √2].
    pub fn new(p: f64) -> Result<Self> {
        let largest = 2.0 - std::f64::consts::SQRT_2;
        Ok(Self { p: within("p of the Noh–Bathe scheme", p, 0.5..=largest, "in [1/2, 2 − √2]")? })
    }

    /// The scheme with modulus ρ_b in [0, 1] where its roots meet: p = 2/(2 + √(2 + 2ρ_b)).
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) if ρ_b is outside its range.
    pub fn with_radius(rho: f64) -> Result<Self> {
        let rho = within("ρ_b of the Noh–Bathe scheme", rho, 0.0..=1.0, "in [0, 1]")?;
        Ok(Self { p: 2.0 / (2.0 + (2.0 + 2.0 * rho).sqrt()) })
    }
}

impl TimeIntegrator for NohBathe {
    fn name(&self) -> String {
        format!("Noh–Bathe({:.4})", self.p)
    }

    fn tableau(&self) -> Tableau {
        let p = self.p;
        let s = 1.0 - p;
        let q1 = (1.0 - 2.0 * p) / (2.0 * p * s);
        let q2 = 0.5 - p * q1;
        let q0 = 0.5 - q1 - q2;
        let stage = |fraction: f64, end: f64, lead: f64, v: Row| {
            let u = U[0] + fraction * V[0] + (0.5 * fraction * fraction) * A[0];
            let balance = Rows { u, v: V[0] + fraction * A[0], a: Z };
            let contact = ContactLevel::Position { lead };
            Stage::new(Rows { u, v, a: Z }).ending_at(end).balanced(balance, end).with_contact(contact)
        };
        // Either stage imposes contact at the end of the next one.
        let first = stage(p, p, s, V[0] + (0.5 * p) * (A[0] + Z));
        let second = stage(s, 1.0, p, V[0] + s * (q0 * A[1] + (0.5 + q1) * A[0] + q2 * Z));
        Tableau::staged(vec![first, second])
    }
}
