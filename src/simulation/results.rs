//! What a run hands to observers and to its caller: work counts, energies, and why it ended.

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
    /// Contact problems solved; a stage in which nothing comes near has none.
    pub contact_solves: u64,
    /// Active-set iterations of all contact problems together.
    pub contact_iterations: u64,
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
    /// Where energy came from and went since the start, if the builder asked for the balance.
    pub works: Option<Works<T>>,
}

impl<T: Real> Energy<T> {
    /// Kinetic plus potential energy.
    pub fn total(&self) -> T {
        self.kinetic + self.potential.unwrap_or(T::zero())
    }

    /// Refuses energies and works that are NaN or infinite.
    pub(super) fn check(&self, t: f64) -> Result<()> {
        finite(t, "the kinetic energy", self.kinetic)?;
        finite(t, "the potential energy", self.potential.unwrap_or(T::zero()))?;
        self.works.map_or(Ok(()), |works| works.check(t))
    }
}

/// Works done on the system since the start, by the trapezoidal rule over the steps. (That of contact takes the forces
/// in the middle of the step, which is the same rule for schemes whose forces live at its end.) All but `remainder` are
/// works of forces of the model; the remainder is the energy that the scheme itself adds (positive) or dissipates
/// (negative).
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
    /// Work of the reported contact forces along the normals, but for that of dashpots.
    pub contact: T,
    /// Work of the reported friction forces on the bodies: not positive where obstacles do not move along themselves.
    pub friction: T,
    /// Change of kinetic energy by corrections of velocity.
    pub corrections: T,
    /// Total energy minus energy at the start minus all of the above.
    pub remainder: T,
}

impl<T: Real> Works<T> {
    /// Refuses works that are NaN or infinite.
    pub(super) fn check(&self, t: f64) -> Result<()> {
        let Self { load, supports, damping, contact, friction, corrections, remainder } = *self;
        finite(t, "the work of the load", load)?;
        finite(t, "the work of the supports", supports)?;
        finite(t, "the work of damping", damping)?;
        finite(t, "the work of contact", contact)?;
        finite(t, "the work of friction", friction)?;
        finite(t, "the work of corrections", corrections)?;
        finite(t, "the remainder of the works", remainder)
    }
}

/// Refuses a term of the energy balance that is NaN or infinite.
pub(super) fn finite<T: Real>(t: f64, what: &'static str, value: T) -> Result<()> {
    match value.is_finite() {
        true => Ok(()),
        false => Err(Error::EnergyNotFinite { t, what, value: value.value() }),
    }
}
