//! Correctors: changes of velocity and acceleration after a contact solve that make them agree with the contact.

mod buffers;
mod contact_implicit;
mod correction;
mod group_problem;
mod jump_projection;
mod laursen_love;
mod nonsmooth_splitting;
mod persistency;
mod prediction;
mod release;
mod rubbing_problem;
mod switching;
mod work_balance;
mod zero_acceleration;

pub(crate) use crate::contact::{ErasedGaps, Gaps, rounding, share_of_rounding};
pub(crate) use crate::contact_solver::{contact_error, no_response};
pub(crate) use crate::state::Backup;
pub(crate) use buffers::Buffers;
pub use contact_implicit::{ContactImplicit, ContactStabilized};
pub use correction::Correction;
pub(crate) use correction::{Erased, Scheme};
pub use jump_projection::JumpProjection;
pub use laursen_love::LaursenLove;
pub use nonsmooth_splitting::NonsmoothSplitting;
pub use persistency::{HistoryProjection, Parts, PersistencyCorrection};
pub use prediction::{Extent, Prediction};
pub use release::{Release, TaylorPapadopoulos};
pub(crate) use rubbing_problem::{Block, Rubbing, slides};
pub(crate) use switching::Switching;
pub use work_balance::WorkBalance;
pub use zero_acceleration::ZeroAcceleration;

use crate::error::Result;
use crate::real::Real;
use crate::tableau::Tableau;

/// Changes the result of a stage after its contact problem was solved; several act in the order given.
///
/// ```
/// use contact_dynamics::corrector::{Correction, Corrector};
/// use contact_dynamics::{PersistencyCorrection, Result};
///
/// /// Velocity projection alone, written with the tools of a [`Correction`].
/// #[derive(Debug)]
/// struct Plastic;
///
/// impl Corrector<f64> for Plastic {
///     fn name(&self) -> String {
///         "plastic".into()
///     }
///     fn correct(&self, step: &mut Correction<'_, f64>) -> Result<()> {
///         step.solve_velocity_jumps()?;
///         step.push_velocity()
///     }
/// }
/// let correctors: Vec<Box<dyn Corrector<f64>>> = vec![Box::new(Plastic), Box::new(PersistencyCorrection::new())];
/// # let _ = correctors;
/// ```
pub trait Corrector<T: Real>: std::fmt::Debug + Send {
    /// Name with options, as printed in tables.
    fn name(&self) -> String;

    /// Whether [`correct`](Self::correct) edits past states; only then is a copy kept to undo a failed step.
    fn edits(&self) -> Edits {
        Edits::NewState
    }

    /// Checks once, at build, whether the corrector works with a scheme. Default: it does.
    ///
    /// # Errors
    ///
    /// The reason, for the [`Error::Incompatible`](crate::Error::Incompatible) that a builder returns.
    fn check(&self, tableau: &Tableau) -> std::result::Result<(), &'static str> {
        let _ = tableau;
        Ok(())
    }

    /// Checks once, at build, whether the corrector works with a scheme if bodies have damping. Default: it does.
    ///
    /// # Errors
    ///
    /// The reason, as from [`check`](Self::check).
    fn check_damping(&self, tableau: &Tableau) -> std::result::Result<(), &'static str> {
        let _ = tableau;
        Ok(())
    }

    /// Checks once, at build, whether the corrector works if contacts have friction. Default: it does not. Correctors
    /// built from [`Correction::solve_velocity_jumps`] and the three matching methods can return `Ok`.
    ///
    /// # Errors
    ///
    /// The reason, as from [`check`](Self::check).
    fn check_friction(&self) -> std::result::Result<(), &'static str> {
        Err("the correction knows nothing of friction: choose `PersistencyCorrection`, or none")
    }

    /// Checks once, at build, whether the corrector works with
    /// [`ContactLaw::PersistencySwitch`](crate::contact::ContactLaw), which constrains the gap rate once the gap is
    /// closed. Default: it does.
    ///
    /// # Errors
    ///
    /// The reason, as from [`check`](Self::check).
    fn check_switch(&self) -> std::result::Result<(), &'static str> {
        Ok(())
    }

    /// Checks once, at build, whether contacts under [`ContactLaw::Restitution`] rebound with the required share of
    /// their approach rate, in a scheme that imposes contact on the displacements of the state. Default: they do not.
    ///
    /// [`ContactLaw::Restitution`]: crate::contact::ContactLaw::Restitution
    ///
    /// # Errors
    ///
    /// The reason, as from [`check`](Self::check).
    fn check_restitution(&self, tableau: &Tableau) -> std::result::Result<(), &'static str> {
        let _ = tableau;
        Err("the correction knows nothing of restitution: choose `PersistencyCorrection::with_history_projection`")
    }

    /// Whether the corrector removes the forces of closed contacts from the accelerations, so that only the smooth
    /// motion remains. The accelerations at the start then contain no contact forces, and friction constrains the
    /// slip of a stage, not its velocity, because the correction changes that. Default: the forces stay.
    fn leaves_smooth_motion(&self) -> bool {
        false
    }

    /// Whether the corrector acts on contacts on dofs without mass, and only on these; such contacts leave no jumps.
    /// It is then called for every step in which one of them closes or opens, even if the scheme imposes other
    /// contacts on velocities. Default: it does not.
    fn corrects_massless(&self) -> bool {
        false
    }

    /// Whether [`predict`](Self::predict) does anything; its memory is reserved only then.
    fn predicts(&self) -> bool {
        false
    }

    /// Acts on the prediction of the scheme before a stage is solved. Called for every stage of a run with contacts
    /// if [`predicts`](Self::predicts) is true. Default: does nothing.
    ///
    /// # Errors
    ///
    /// As [`correct`](Self::correct).
    fn predict(&self, step: &mut Prediction<'_, T>) -> Result<()> {
        let _ = step;
        Ok(())
    }

    /// Corrects the stage. Called for every stage with at least one closed contact, or one that has opened in it.
    ///
    /// # Errors
    ///
    /// [`Error::ContactNotFinite`](crate::Error::ContactNotFinite), [`Error::Contact`](crate::Error::Contact); the
    /// step is then undone.
    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()>;
}

/// Which states a corrector changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Edits {
    /// Only the state of the stage.
    NewState,
    /// Past states too.
    Past,
}

impl<T: Real, C: Corrector<T> + ?Sized> Corrector<T> for Box<C> {
    fn name(&self) -> String {
        (**self).name()
    }
    fn edits(&self) -> Edits {
        (**self).edits()
    }
    fn check(&self, tableau: &Tableau) -> std::result::Result<(), &'static str> {
        (**self).check(tableau)
    }
    fn check_damping(&self, tableau: &Tableau) -> std::result::Result<(), &'static str> {
        (**self).check_damping(tableau)
    }
    fn check_friction(&self) -> std::result::Result<(), &'static str> {
        (**self).check_friction()
    }
    fn check_switch(&self) -> std::result::Result<(), &'static str> {
        (**self).check_switch()
    }
    fn check_restitution(&self, tableau: &Tableau) -> std::result::Result<(), &'static str> {
        (**self).check_restitution(tableau)
    }
    fn leaves_smooth_motion(&self) -> bool {
        (**self).leaves_smooth_motion()
    }
    fn corrects_massless(&self) -> bool {
        (**self).corrects_massless()
    }
    fn predicts(&self) -> bool {
        (**self).predicts()
    }
    fn predict(&self, step: &mut Prediction<'_, T>) -> Result<()> {
        (**self).predict(step)
    }
    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        (**self).correct(step)
    }
}
