//! The explicit family of Chung and Lee.

use super::{TimeIntegrator, within};
use crate::error::Result;
use crate::tableau::{A, Rows, Stage, Tableau, U, V, Z};

/// The explicit dissipative family of Chung and Lee (Int. J. Numer. Meth. Eng. 37, 1994).
///
/// ```text
/// M a' + C v + f_int(u) = f(t) + Gᵀλ
/// u' = u + h v + h² [ (½ − β) a + β a' ],     v' = v − ½ h a + 3/2 h a'
/// ```
///
/// Forces are evaluated at the start of the step; with a lumped mass no matrix is factorized, with or without
/// damping.
///
/// * Order 2. The stored a lags by one step; the acceleration of a [`State`](crate::State) is extrapolated to its time.
/// * β = 1 has no damping, β = 28/27 the most (ρ_b = ½; the spectrum of Hulbert–Chung with ρ_b = ½). Stable for
///   Ω < 2/√(4β − 3), 1.8665 at β = 28/27; damping forces that lag lower this bound.
/// * Conserves linear momentum in the form v − ½ h a.
/// * Contact is imposed on the displacements at the end of the step by the multiplier at its start.
///
/// ```
/// use contact_dynamics::{ChungLee, TimeIntegrator, analysis};
/// let tableau = ChungLee::new(28.0 / 27.0)?.tableau();
/// assert!(analysis::spectral_radius(&tableau, 1.86, 0.0) < 1.0 + 1e-12);
/// assert!(analysis::spectral_radius(&tableau, 1.88, 0.0) > 1.0);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChungLee {
    beta: f64,
}

impl ChungLee {
    /// The scheme with parameter β.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless β is in [1, 28/27].
    pub fn new(beta: f64) -> Result<Self> {
        Ok(Self { beta: within("β of the Chung–Lee scheme", beta, 1.0..=28.0 / 27.0, "in [1, 28/27]")? })
    }
}

impl TimeIntegrator for ChungLee {
    fn name(&self) -> String {
        format!("Chung–Lee({:.4})", self.beta)
    }

    fn tableau(&self) -> Tableau {
        let u = U[0] + V[0] + (0.5 - self.beta) * A[0] + self.beta * Z;
        let v = V[0] - 0.5 * A[0] + 1.5 * Z;
        Tableau::single(Stage::new(Rows { u, v, a: Z }).balanced(Rows { u: U[0], v: V[0], a: Z }, 0.0))
    }
}
