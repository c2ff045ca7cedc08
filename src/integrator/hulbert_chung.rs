//! The explicit generalized-α scheme of Hulbert and Chung.

use super::{TimeIntegrator, within};
use crate::error::Result;
use crate::tableau::{A, Rows, Stage, Tableau, U, V, Z};

/// The explicit generalized-α scheme of Hulbert and Chung (Comput. Methods Appl. Mech. Eng. 137, 1996).
///
/// ```text
/// M ((1 − α_m) a' + α_m a) + C v + f_int(u) = f(t) + Gᵀλ
/// u' = u + h v + h² [ (½ − β) a + β a' ],     v' = v + h [ (1 − γ) a + γ a' ]
/// α_m = (2ρ − 1)/(1 + ρ),  β = (5 − 3ρ)/((1 + ρ)²(2 − ρ)),  γ = 3/2 − α_m,  ρ the modulus ρ_b where the roots meet
/// ```
///
/// Forces are evaluated at the start of the step; with a lumped mass no matrix is factorized, with or without
/// damping.
///
/// * Order 2. The stored a belongs to t + (α_m − 1) h; the acceleration of a [`State`](crate::State) is extrapolated
///   to its time.
/// * Stable for Ω² < 2 (1 − 2α_m)/(2β − γ): Ω below 1.5492, 1.8665, 1.9758, 2 at ρ_b = 0, ½, 0.8, 1; the roots meet
///   at Ω_b = (1 + ρ_b) √(2 − ρ_b). Damping forces lag: with any damping the member ρ_b = 1 is unstable for every h,
///   and building a simulation with both fails.
/// * Conserves linear momentum in the form v + (1 − γ − α_m) h a.
/// * Contact is imposed on the displacements at the end of the step by the multiplier at its start.
///
/// ```
/// use contact_dynamics::{HulbertChung, TimeIntegrator, analysis};
/// let tableau = HulbertChung::new(0.8)?.tableau();
/// assert!(analysis::spectral_radius(&tableau, 1.97, 0.0) < 1.0 + 1e-12);
/// assert!(analysis::spectral_radius(&tableau, 1.98, 0.0) > 1.0);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HulbertChung {
    rho: f64,
}

impl HulbertChung {
    /// The scheme with modulus ρ_b in [0, 1] where its roots meet.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) if ρ_b is outside its range.
    pub fn new(rho: f64) -> Result<Self> {
        Ok(Self { rho: within("ρ_b of the Hulbert–Chung scheme", rho, 0.0..=1.0, "in [0, 1]")? })
    }
}

impl TimeIntegrator for HulbertChung {
    fn name(&self) -> String {
        format!("Hulbert–Chung({})", self.rho)
    }

    fn tableau(&self) -> Tableau {
        let rho = self.rho;
        let am = (2.0 * rho - 1.0) / (1.0 + rho);
        let beta = (5.0 - 3.0 * rho) / ((1.0 + rho) * (1.0 + rho) * (2.0 - rho));
        let gamma = 1.5 - am;
        let u = U[0] + V[0] + (0.5 - beta) * A[0] + beta * Z;
        let v = V[0] + (1.0 - gamma) * A[0] + gamma * Z;
        let balance = Rows { u: U[0], v: V[0], a: (1.0 - am) * Z + am * A[0] };
        Tableau::single(Stage::new(Rows { u, v, a: Z }).balanced(balance, 0.0))
    }
}
