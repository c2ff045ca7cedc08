//! The explicit scheme of Tchamwa and Wielgosz.

use super::{TimeIntegrator, within};
use crate::error::Result;
use crate::tableau::{A, Rows, Stage, Tableau, U, V, Z};

/// The explicit dissipative scheme of Tchamwa and Wielgosz (Tchamwa, Conway, Wielgosz, ASME PVP 398, 1999).
///
/// ```text
/// u' = u + h v + φ h² a,     v' = v + h a                  M a' + C v' + f_int(u') = f(t')
/// ```
///
/// With a lumped mass no matrix is factorized.
///
/// * Order 1. Stable for Ω < 2/√(2φ − 1); the roots meet at Ω_b = 2/φ with modulus ρ_b = (2 − φ)/φ.
/// * Conserves linear momentum in the form v + h a.
/// * The unknown enters neither u' nor v': a multiplier of the step could not close a gap or stop an approach, so
///   building a simulation with multiplier contact fails.
///
/// ```
/// use contact_dynamics::{TchamwaWielgosz, TimeIntegrator, analysis};
/// let tableau = TchamwaWielgosz::new(1.033)?.tableau();
/// assert!(analysis::spectral_radius(&tableau, 1.9, 0.0) < 1.0);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TchamwaWielgosz {
    phi: f64,
}

impl TchamwaWielgosz {
    /// The scheme with parameter φ; 1.033 is the authors' choice, 1 is undamped.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless φ is in [1, 2].
    pub fn new(phi: f64) -> Result<Self> {
        Ok(Self { phi: within("φ of the Tchamwa–Wielgosz scheme", phi, 1.0..=2.0, "in [1, 2]")? })
    }

    /// The scheme with modulus ρ_b in [0, 1] where its roots meet: φ = 2/(1 + ρ_b).
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) if ρ_b is outside its range.
    pub fn with_radius(rho: f64) -> Result<Self> {
        let rho = within("ρ_b of the Tchamwa–Wielgosz scheme", rho, 0.0..=1.0, "in [0, 1]")?;
        Ok(Self { phi: 2.0 / (1.0 + rho) })
    }
}

impl TimeIntegrator for TchamwaWielgosz {
    fn name(&self) -> String {
        format!("Tchamwa–Wielgosz({})", self.phi)
    }

    fn tableau(&self) -> Tableau {
        Tableau::single(Stage::new(Rows { u: U[0] + V[0] + self.phi * A[0], v: V[0] + A[0], a: Z }))
    }
}
