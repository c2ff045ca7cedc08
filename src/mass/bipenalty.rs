//! The mass that goes with a penalty spring in explicit schemes.

use crate::error::{Result, positive};

/// The mass m = k (h/2)² for a contact stiffness k, as in [`ContactLaw::Bipenalty`](crate::ContactLaw::Bipenalty):
/// central differences keep their critical step for any k, if h does not exceed it (Askes, Caramés-Saddler,
/// Rodríguez-Ferran, Proc. R. Soc. A 466, 2010).
///
/// k in force/length, h in time. A contact row G adds k to the stiffness and m to the mass of the same motion Gᵀ, and
/// a quotient of sums is at most the larger quotient: ω² ≤ max(ω²_max, k/m), with k/m = (2/h)². A larger mass does
/// not reduce the critical step. But contact adds the mass to moving dofs, which changes the energy at impact;
/// [`ContactLaw::StabilizedBipenalty`](crate::ContactLaw::StabilizedBipenalty), which includes this mass, avoids
/// that. Schemes with another limit than ωh = 2 need m = k (h/limit)².
///
/// # Errors
///
/// [`Error::Parameter`](crate::Error::Parameter) unless k, h and m are positive and finite.
///
/// ```
/// use contact_dynamics::{ContactLaw, mass};
/// let stiffness = 4e6;
/// let law = ContactLaw::Bipenalty { stiffness, mass: mass::bipenalty(stiffness, 1e-3)? };
/// assert_eq!(law, ContactLaw::Bipenalty { stiffness, mass: 1.0 });
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn bipenalty(stiffness: f64, h: f64) -> Result<f64> {
    let half = 0.5 * positive("the step size", h)?;
    positive("the contact mass", positive("the contact stiffness", stiffness)? * half * half)
}
