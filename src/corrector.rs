//! Correctors: what must be mended so that velocity and acceleration agree with the contact.

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
    /// Name with options, as a table shows it.
    fn name(&self) -> String;

    /// Whether [`correct`](Self::correct) edits past states; only then is a copy kept to undo a failed step.
    fn edits(&self) -> Edits {
        Edits::NewState
    }

    /// Whether it can act with a scheme, or why not; asked once, at build. Default: it can.
    ///
    /// # Errors
    ///
    /// The reason, for the [`Error::Incompatible`](crate::Error::Incompatible) that a builder returns.
    fn check(&self, tableau: &Tableau) -> std::result::Result<(), &'static str> {
        let _ = tableau;
        Ok(())
    }

    /// Whether it can act with a scheme where bodies have damping, or why not; asked once, at build, of such systems.
    /// Default: it can.
    ///
    /// # Errors
    ///
    /// The reason, as from [`check`](Self::check).
    fn check_damping(&self, tableau: &Tableau) -> std::result::Result<(), &'static str> {
        let _ = tableau;
        Ok(())
    }

    /// Whether it can act where contacts have friction, or why not; asked once, at build. Default: it cannot. (What is
    /// made of [`Correction::solve_velocity_jumps`] and the other three of these methods can.)
    ///
    /// # Errors
    ///
    /// The reason, as from [`check`](Self::check).
    fn check_friction(&self) -> std::result::Result<(), &'static str> {
        Err("the correction knows nothing of friction: choose `PersistencyCorrection`, or none")
    }

    /// Whether it can act on contacts under [`ContactLaw::PersistencySwitch`](crate::contact::ContactLaw), which hold
    /// the rate of a gap once that is closed, or why not; asked once, at build. Default: it can.
    ///
    /// # Errors
    ///
    /// The reason, as from [`check`](Self::check).
    fn check_switch(&self) -> std::result::Result<(), &'static str> {
        Ok(())
    }

    /// Whether contacts leave with the share of their approach that [`ContactLaw::Restitution`] asks for, by a scheme
    /// that imposes contact on the displacements of the state, or why not; asked once, at build. Default: they do not.
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

    /// Whether it takes the forces of closed contacts out of the accelerations, and leaves those of the smooth motion.
    /// Those of the start are without them then, and friction holds the way made in a stage, not its velocity, which
    /// the correction changes. Default: the forces stay.
    fn leaves_smooth_motion(&self) -> bool {
        false
    }

    /// Whether it corrects contacts on dofs without mass, and these alone; they leave no jumps. It is then called for
    /// every step in which one of them closes or opens, also where a scheme imposes other contacts on velocities.
    /// Default: it does not.
    fn corrects_massless(&self) -> bool {
        false
    }

    /// Whether [`predict`](Self::predict) does anything; memory for it is reserved only then.
    fn predicts(&self) -> bool {
        false
    }

    /// Acts before a stage is solved, on what the scheme predicts. Called for every stage of a run with contacts, if
    /// [`predicts`](Self::predicts) says so. Default: nothing.
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

/// What a corrector changes.
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
