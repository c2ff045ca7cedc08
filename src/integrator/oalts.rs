//! A one-parameter family of A-stable linear two-step schemes.

use super::{TimeIntegrator, within};
use crate::error::Result;
use crate::tableau::{A, MAX_PAST, Row, Rows, Stage, Tableau, U, V, Z};

/// Optimal A-stable linear two-step schemes (OALTS), from BDF2 (ρ = 0) to the trapezoidal rule (ρ = 1).
///
/// ```text
/// h (y' + 2ρ y + ρ² y₋) = ½ (1 + ρ)(3 − ρ) x' − 2 (1 − ρ²) x + ½ (1 + ρ)(1 − 3ρ) x₋
/// with (x, y) = (u, v) and (v, a)                  M a' + C v' + f_int(u') = f(t') + Gᵀλ
/// ```
///
/// * Order 2; reads u, v and a of two states.
/// * Unconditionally stable with ρ∞ = ρ. For ρ = 1 the second state has an undamped root −1: prefer
///   [`Newmark::trapezoidal`](crate::Newmark::trapezoidal), its one-step form.
/// * Conserves linear momentum.
/// * Contact is imposed on the displacements at the end of the step; the past needs the history projection at impact.
///
/// ```
/// use contact_dynamics::{Oalts, TimeIntegrator, analysis};
/// let scheme = Oalts::new(0.6)?;
/// assert!((analysis::spectral_radius(&scheme.tableau(), 1e8, 0.0) - 0.6).abs() < 1e-3);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oalts {
    rho: f64,
}

impl Oalts {
    /// The member with spectral radius ρ∞ in [0, 1].
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) if ρ∞ is outside its range.
    pub fn new(rho: f64) -> Result<Self> {
        Ok(Self { rho: within("ρ∞ of the two-step family", rho, 0.0..=1.0, "in [0, 1]")? })
    }
}

impl TimeIntegrator for Oalts {
    fn name(&self) -> String {
        format!("OALTS({})", self.rho)
    }

    fn tableau(&self) -> Tableau {
        let rho = self.rho;
        let c =
            [0.5 * (1.0 + rho) * (3.0 - rho), -2.0 * (1.0 - rho) * (1.0 + rho), 0.5 * (1.0 + rho) * (1.0 - 3.0 * rho)];
        let d = |x: Row, past: [Row; MAX_PAST], rate: [Row; MAX_PAST]| {
            c[0] * x + c[1] * past[0] + c[2] * past[1] - (2.0 * rho) * rate[0] - (rho * rho) * rate[1]
        };
        let v = d(Z, U, V);
        Tableau::single(Stage::new(Rows { u: Z, v, a: d(v, V, A) }))
    }
}
