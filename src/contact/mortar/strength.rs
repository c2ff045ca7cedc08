//! The strength of bonds between surfaces.

use crate::error::{Error, Result};

/// The strength of a bond between two surfaces: stresses (force/area; force/length in two dimensions) in tension,
/// along the normal, and in shear, across it.
///
/// A bond breaks when its tension σ and its shear τ reach
///
/// √((⟨σ⟩/σ_max)² + (τ/τ_max)²) = 1, ⟨σ⟩ = max(σ, 0),
///
/// the quadratic stress criterion that is usual for cohesive interfaces (Camanho and Dávila, NASA/TM-2002-211737, eq.
/// 8). Compression does not break it. A bond breaks as a whole and at once: it stores no energy, and a broken bond
/// opens without energy (`docs/contact/ties.md`).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BondStrength {
    tension: f64,
    shear: f64,
}

impl BondStrength {
    /// σ_max and τ_max. An infinite value means that tension, or shear, never breaks the bond.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless both are positive, and one of them finite.
    ///
    /// ```
    /// use contact_dynamics::contact::BondStrength;
    /// let mortar_joint = BondStrength::new(2e5, 4e5)?;
    /// assert!((mortar_joint.load([1.2e5, 3.2e5]) - 1.0).abs() < 1e-15);
    /// assert!(BondStrength::new(0.0, 1.0).is_err());
    /// # Ok::<(), contact_dynamics::Error>(())
    /// ```
    pub fn new(tension: f64, shear: f64) -> Result<Self> {
        for value in [tension, shear] {
            if !(value > 0.0 && value.recip().is_finite()) {
                let range = "positive, and infinite for one of them at most";
                return Err(Error::Parameter { name: "the strength of a bond", value, range });
            }
        }
        match tension.min(shear) {
            least if least.is_finite() => Ok(Self { tension, shear }),
            value => {
                let range = "finite for one of them: tie what never breaks";
                Err(Error::Parameter { name: "the strength of a bond", value, range })
            }
        }
    }

    /// The ratio of the stresses to the strength, for tension (negative in compression) and shear: the bond breaks at
    /// 1.
    pub fn load(&self, [tension, shear]: [f64; 2]) -> f64 {
        (tension.max(0.0) / self.tension).hypot(shear / self.shear)
    }
}
