//! Results of a run: work counts, energies, and why it ended.

use crate::error::{Error, Result};
use crate::real::Real;

/// Work counts since the start of a simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default))]
pub struct Statistics {
    /// Accepted steps.
    pub steps: u64,
    /// Solves with the effective matrix, responses of contact rows not counted.
    pub linear_solves: u64,
    /// Iterations of Newton's method, in all stages together; none for linear systems.
    pub newton_iterations: u64,
    /// Effective matrices factorized.
    pub factorizations: u64,
    /// Contact problems solved; a stage without near contacts has none.
    pub contact_solves: u64,
    /// Active-set iterations of all contact problems with W together.
    pub contact_iterations: u64,
    /// Products with the effective matrix for contact problems without W
    /// ([`Assembly`](crate::contact_solver::Assembly)).
    pub contact_products: u64,
    /// Contacts that closed or opened, counted at the end of each step.
    pub contact_changes: u64,
    /// Steps that failed or were judged too coarse, and were taken again with half the size.
    pub refused_steps: u64,
    /// Steps of the smallest size that were taken though they were judged too coarse.
    pub coarse_steps: u64,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Outcome {
    /// The time was reached.
    Reached,
    /// An observer stopped the run.
    Stopped,
}

/// Energy of a state.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Energy<T> {
    /// ½ vᵀ M v.
    pub kinetic: T,
    /// Elastic energy (½ uᵀ K u of a linear system), if the system has a potential.
    pub potential: Option<T>,
    /// Sources and sinks of energy since the start, if the builder requested the balance.
    pub works: Option<Works<T>>,
}

impl<T: Real> Energy<T> {
    /// Kinetic plus potential energy.
    pub fn total(&self) -> T {
        self.kinetic + self.potential.unwrap_or(T::zero())
    }

    /// Refuses energies and works that are NaN or infinite.
    pub(crate) fn check(&self, t: f64) -> Result<()> {
        finite(t, "the kinetic energy", self.kinetic)?;
        finite(t, "the potential energy", self.potential.unwrap_or(T::zero()))?;
        self.works.map_or(Ok(()), |works| works.check(t))
    }
}

/// Sources and sinks of the energy of the system since the start: the change of the total energy is the sum of all
/// lines.
///
/// Works of forces are computed by the trapezoidal rule over the steps. The work of contact uses the forces in the
/// middle of the step, which is the same rule for schemes whose forces act at its end. `load` to `impacts` belong to
/// the model, and tend to the works of the exact motion as the step goes to zero; `corrections` and `remainder`
/// belong to the time integration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Works<T> {
    /// Work of the external load.
    pub load: T,
    /// Work of the supports.
    pub supports: T,
    /// Work of damping (not positive), and of the dashpots of contact laws.
    pub damping: T,
    /// Work of the reported contact forces along the normals: by moving obstacles, by the springs of compliant laws
    /// without their dashpots, and by contacts on dofs without mass. Impacts against moving obstacles are included.
    /// The closing of rigid gaps is not work of a force, but an impact.
    pub contact: T,
    /// Work of the friction forces on the bodies, impulses of impacts included: not positive if obstacles do not move
    /// along their own surface.
    pub friction: T,
    /// Kinetic energy lost in impacts (negative), in the frame of the obstacle: ½ (r' − r)ᵀ S⁻¹ (r' + r) for contacts
    /// with mass that close with the gap rates r and continue with r', S = G M⁻¹ Gᵀ. Two rigid masses that stay
    /// together lose ½ m r² with m = m₁ m₂/(m₁ + m₂), whatever the scheme, the step and the instant of the impact
    /// within it; masses that rebound with −e r lose (1 − e²) of that. For an elastic body it is the energy of the
    /// contact nodes alone, which goes to zero with the size of the elements.
    pub impacts: T,
    /// Change of kinetic energy by velocity corrections of contacts that were closed at the start of the step, or
    /// that open. Corrections in the step in which a contact closes are part of its impact.
    pub corrections: T,
    /// Total energy minus energy at the start minus all of the above: energy that the scheme itself adds (positive)
    /// or dissipates (negative).
    pub remainder: T,
}

impl<T: Real> Works<T> {
    /// Refuses works that are NaN or infinite.
    pub(crate) fn check(&self, t: f64) -> Result<()> {
        let Self { load, supports, damping, contact, friction, impacts, corrections, remainder } = *self;
        finite(t, "the work of the load", load)?;
        finite(t, "the work of the supports", supports)?;
        finite(t, "the work of damping", damping)?;
        finite(t, "the work of contact", contact)?;
        finite(t, "the work of friction", friction)?;
        finite(t, "the work of impacts", impacts)?;
        finite(t, "the work of corrections", corrections)?;
        finite(t, "the remainder of the works", remainder)
    }
}

/// Refuses a term of the energy balance that is NaN or infinite.
pub(crate) fn finite<T: Real>(t: f64, what: &'static str, value: T) -> Result<()> {
    match value.is_finite() {
        true => Ok(()),
        false => Err(Error::EnergyNotFinite { t, what, value: value.value() }),
    }
}
