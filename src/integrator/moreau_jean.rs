//! The Moreau–Jean time-stepping scheme.

use super::{TimeIntegrator, within};
use crate::error::Result;
use crate::tableau::{ContactLevel, Rows, Stage, Tableau, U, V, Z};

/// The θ scheme of Moreau and Jean for nonsmooth dynamics (Jean, Comput. Methods Appl. Mech. Eng. 177, 1999): impacts
/// are impulses of the step, contact is a condition on velocities.
///
/// ```text
/// u' = u + h v̄,     M (v' − v)/h + C v̄ + f_int(ū) = f(t + θh) + Gᵀλ,     x̄ = θ x' + (1 − θ) x
/// 0 ≤ ġ' ⊥ λ ≥ 0  for contacts with g(t) + ½ h ġ(t) ≤ 0
/// ```
///
/// * Order 2 for θ = ½, order 1 otherwise. The stored a is the mean over the step and belongs to its middle; the
///   acceleration of a [`State`](crate::State) is extrapolated to its time.
/// * Unconditionally stable for θ ≥ ½; ρ∞ = (1 − θ)/θ. θ = ½ conserves the energy of linear free motion and has the
///   spectrum of the trapezoidal rule.
/// * Conserves linear momentum in the form v. Impacts are plastic (restitution 0).
/// * Contact is imposed on the velocities at the end of the step, and gaps are not controlled. A node that would meet
///   an obstacle a fraction φ of a step after its beginning, at the relative speed v, keeps a penetration of (1 − θ −
///   φ) h v for φ ≤ ½ and of (2 − θ − φ) h v beyond as long as they touch (negative: a gap); with θ = ½ it is ((½ −
///   φ) mod 1) h v. It is of first order in h and the error of a single step: impacts do not accumulate it (theory,
///   5.1; `docs/reliability.md` has long runs). At the impact the force is the impulse over h, and no correction
///   applies.
///
/// ```
/// use contact_dynamics::{MoreauJean, TimeIntegrator, analysis};
/// let scheme = MoreauJean::new(0.5)?;
/// assert!((analysis::spectral_radius(&scheme.tableau(), 3.0, 0.0) - 1.0).abs() < 1e-12);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoreauJean {
    theta: f64,
}

impl MoreauJean {
    /// The scheme with weight θ of the new state.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless θ is in [½, 1].
    pub fn new(theta: f64) -> Result<Self> {
        Ok(Self { theta: within("θ of the Moreau–Jean scheme", theta, 0.5..=1.0, "in [1/2, 1]")? })
    }
}

impl TimeIntegrator for MoreauJean {
    fn name(&self) -> String {
        format!("Moreau–Jean({})", self.theta)
    }

    fn tableau(&self) -> Tableau {
        let theta = self.theta;
        let v = (Z - U[0] - (1.0 - theta) * V[0]) / theta;
        let a = v - V[0];
        let balance = Rows { u: theta * Z + (1.0 - theta) * U[0], v: theta * v + (1.0 - theta) * V[0], a };
        let contact = ContactLevel::Velocity { lead: 0.0, forecast: U[0] + 0.5 * V[0], forecast_at: 0.5 };
        Tableau::single(Stage::new(Rows { u: Z, v, a }).balanced(balance, theta).with_contact(contact))
    }
}
