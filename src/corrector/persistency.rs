//! The λ_v/λ_a correction: velocity and acceleration satisfy the persistency of contact.

use super::{Correction, Corrector, Edits, Effects, Requirements};
use crate::error::Result;
use crate::real::Real;
use crate::tableau::Tableau;

/// Which jumps are removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Parts {
    /// Velocity, then acceleration.
    #[default]
    Both,
    /// Velocity only (λ_a).
    Velocity,
    /// Acceleration only (λ_v).
    Acceleration,
}

/// Whether the past of a contact that has just closed is made consistent with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum HistoryProjection {
    /// States before the step keep their approach. The states between the stages of a step are corrected like any
    /// other.
    #[default]
    Off,
    /// Gap, gap rate and gap acceleration of the past states that later steps read are projected to zero.
    On,
}

/// The λ_v/λ_a correction of Zhang, Li, Zhang, Luo and Gao (Eng. Mech. 40 (Suppl.), 2023), for any tableau, any rows of
/// G, lumped or consistent mass, with damping.
///
/// After the contact problem of a stage, on closed rows, with S = G M⁻¹ Gᵀ and γ the motion of the obstacle:
///
/// ```text
/// λ_a = h S⁻¹ (G v − γ_v)             v ← v − M⁻¹ Gᵀ λ_a / h          a ← a − M⁻¹ C δv, or as in `apply_impulses`
/// λ_v = −(h/w_a) S⁻¹ (G a − γ_a)      a ← a − M⁻¹ Gᵀ S⁻¹ (G a − γ_a)
/// p' = p − (w_ā/w_a) S⁻¹ (G a − γ_a)
/// ```
///
/// [`apply_impulses`](Correction::apply_impulses) explains the effect of damping on a, and
/// [`push_acceleration`](Correction::push_acceleration) the reduction of λ_v if a step does not resolve the damping.
/// p' is the reported force; the raw p still decides release. Rows that touch without pressure are corrected only if
/// they approach, and contacts with friction keep the law of Coulomb: they do not pull. Linear momentum is conserved,
/// and the correction never raises the kinetic energy: an impact costs ½ jumpᵀ S⁻¹ jump, which is 1/(2n) of the energy
/// of two equal bars of n elements. With [`HistoryProjection::On`] the past states of a newly closed contact are
/// projected too; multistep schemes need it, one-step schemes that read no past ignore it.
///
/// It works with schemes that impose contact on the displacements of the state; with others ([`ContactLevel`]) the
/// build fails.
///
/// [`ContactLevel`]: crate::tableau::ContactLevel
///
/// Known failures: it cannot restore the kinetic energy of the contact nodes, and at release the velocity keeps the
/// overshoot that every scheme shows there. In the step in which a contact opens, the trapezoidal rule applies the
/// force of the previous state for half a step over the opening gap. If a step is long compared with the waves that
/// end contact (Courant numbers far above 1), this may raise the energy of a run; use a scheme with numerical damping
/// there.
///
/// ```
/// use contact_dynamics::corrector::Parts;
/// use contact_dynamics::{Corrector, PersistencyCorrection};
/// let plain = PersistencyCorrection::new();
/// let full = PersistencyCorrection::with_history_projection();
/// let velocity = PersistencyCorrection::new().parts(Parts::Velocity);
/// assert_ne!(plain, full);
/// assert_eq!(Corrector::<f64>::name(&velocity), "λ_a (velocity)");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PersistencyCorrection {
    parts: Parts,
    history: HistoryProjection,
}

impl PersistencyCorrection {
    /// Velocity and acceleration, as in the paper. In a scheme with several stages the state of each stage is
    /// corrected, including states between two steps that later stages of the same step read as their past. States
    /// before the step stay as they are.
    pub const fn new() -> Self {
        Self { parts: Parts::Both, history: HistoryProjection::Off }
    }

    /// The same with the projection of past states at activation.
    pub const fn with_history_projection() -> Self {
        Self { parts: Parts::Both, history: HistoryProjection::On }
    }

    /// Chooses which jumps are removed.
    #[must_use]
    pub const fn parts(self, parts: Parts) -> Self {
        Self { parts, ..self }
    }

    /// Chooses whether past states are projected.
    #[must_use]
    pub const fn history(self, history: HistoryProjection) -> Self {
        Self { history, ..self }
    }
}

impl<T: Real> Corrector<T> for PersistencyCorrection {
    fn name(&self) -> String {
        let parts = match self.parts {
            Parts::Both => "λ_v/λ_a",
            Parts::Velocity => "λ_a (velocity)",
            Parts::Acceleration => "λ_v (acceleration)",
        };
        match self.history {
            HistoryProjection::Off => parts.into(),
            HistoryProjection::On => format!("{parts} + history"),
        }
    }

    fn requirements(&self, tableau: &Tableau) -> Requirements {
        let reads_past = |stage: usize| {
            let read = tableau.read_after(stage);
            read.is_ok_and(|read| read.iter().skip(1).flatten().any(|&read| read))
        };
        let restitution = match (self.parts, self.history) {
            (Parts::Both, HistoryProjection::On) => Ok(()),
            (Parts::Both, HistoryProjection::Off) if !(0..tableau.stages.len()).any(reads_past) => Ok(()),
            (Parts::Both, HistoryProjection::Off) => {
                Err("the past that the scheme reads would go on to approach: choose `with_history_projection`")
            }
            (Parts::Velocity | Parts::Acceleration, _) => {
                Err("what leaves has neither its old velocity nor the force of the impact: choose both parts")
            }
        };
        Requirements { friction: Ok(()), restitution, gradient: Ok(()), ..Requirements::default() }
    }

    fn effects(&self) -> Effects {
        let edits = match self.history {
            HistoryProjection::Off => Edits::NewState,
            HistoryProjection::On => Edits::Past,
        };
        Effects { edits, ..Effects::default() }
    }

    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        step.solve_velocity_jumps()?;
        if self.parts != Parts::Acceleration {
            step.push_velocity()?;
        }
        if self.parts != Parts::Velocity {
            step.solve_acceleration_jumps()?;
            step.push_acceleration()?;
        }
        match self.history {
            HistoryProjection::Off => Ok(()),
            HistoryProjection::On => step.project_past(),
        }
    }
}
