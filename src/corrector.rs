//! Correctors: changes of velocity and acceleration after a contact solve that make them agree with the contact.

mod buffers;
mod contact_implicit;
mod correction;
mod jump_problem;
mod jump_projection;
mod laursen_love;
mod many_jumps;
mod nonsmooth_splitting;
mod persistency;
mod prediction;
mod rebounds;
mod release;
mod switching;
mod work_balance;
mod zero_acceleration;

pub(crate) use crate::contact::{ErasedGaps, Gaps};
pub(crate) use crate::contact_solver::{contact_error, no_response};
pub(crate) use crate::state::{Backup, slides};
pub(crate) use buffers::Buffers;
pub use contact_implicit::{ContactImplicit, ContactStabilized};
pub use correction::Correction;
pub(crate) use correction::{Before, Bodies, Erased, Past, Scheme};
pub(crate) use jump_problem::{Block, FrictionOf, JumpProblem};
pub use jump_projection::JumpProjection;
pub use laursen_love::LaursenLove;
pub use nonsmooth_splitting::NonsmoothSplitting;
pub use persistency::{HistoryProjection, Parts, PersistencyCorrection};
pub use prediction::{Extent, Prediction};
pub use release::{Release, TaylorPapadopoulos};
pub(crate) use switching::Switching;
pub use work_balance::WorkBalance;
pub use zero_acceleration::ZeroAcceleration;

use crate::error::Result;
use crate::real::Real;
use crate::tableau::Tableau;

/// Changes the result of a stage after its contact problem was solved; several act in the order given.
///
/// ```
/// use contact_dynamics::corrector::Correction;
/// use contact_dynamics::{Corrector, PersistencyCorrection, Result};
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

    /// The schemes, systems and contacts that the corrector supports; read at build.
    fn requirements(&self, tableau: &Tableau) -> Requirements {
        let _ = tableau;
        Requirements::default()
    }

    /// The states and contacts that the corrector changes.
    fn effects(&self) -> Effects {
        Effects::default()
    }

    /// Acts on the prediction of the scheme before a stage is solved. Called for every stage of a run with contacts
    /// if [`Effects::predicts`] is true. Default: does nothing.
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

/// The schemes, systems and contacts that a [`Corrector`] supports. The default fits a corrector without friction and
/// restitution. `Err` is the reason in the [`Error::Incompatible`](crate::Error::Incompatible) that `build` returns.
///
/// ```
/// use contact_dynamics::corrector::Requirements;
///
/// let with_friction = Requirements { friction: Ok(()), ..Requirements::default() };
/// assert!(with_friction.restitution.is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Requirements {
    /// The scheme. Default: any.
    pub scheme: Verdict,
    /// Damping of the bodies. Default: possible.
    pub damping: Verdict,
    /// Friction. Default: refused. Correctors built from [`Correction::solve_velocity_jumps`] and the three matching
    /// methods can act with friction.
    pub friction: Verdict,
    /// Contacts under [`ContactLaw::PersistencySwitch`](crate::contact::ContactLaw), which constrains the gap rate once
    /// the gap is closed. Default: possible.
    pub persistency_switch: Verdict,
    /// Contacts under [`ContactLaw::Restitution`](crate::contact::ContactLaw) rebound with the required share of their
    /// approach rate, in a scheme that imposes contact on the displacements of the state. Default: they do not.
    pub restitution: Verdict,
    /// The [gradient](crate::gradient) of a run passes through the corrector: it changes the motion only by
    /// [`push_velocity`](Correction::push_velocity), [`push_acceleration`](Correction::push_acceleration) and
    /// [`project_past`](Correction::project_past). Default: it does not.
    pub gradient: Verdict,
}

/// `Ok` if a corrector supports a case, or the reason for the refusal.
pub type Verdict = std::result::Result<(), &'static str>;

impl Default for Requirements {
    fn default() -> Self {
        Self {
            scheme: Ok(()),
            damping: Ok(()),
            friction: Err("the corrector does not support friction: choose `PersistencyCorrection`, or none"),
            persistency_switch: Ok(()),
            restitution: Err(
                "the corrector does not support restitution: choose `PersistencyCorrection::with_history_projection`",
            ),
            gradient: Err("its derivative is not known: choose `PersistencyCorrection`, or none"),
        }
    }
}

/// The states and contacts that a [`Corrector`] changes. By default it changes the state of the stage, for contacts
/// with mass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effects {
    /// The states that [`correct`](Corrector::correct) edits. A copy of past states, to undo a failed step, is kept
    /// only if it edits them.
    pub edits: Edits,
    /// The corrector removes the forces of closed contacts from the accelerations, so that only the smooth motion
    /// remains. The accelerations at the start then contain no contact forces, and friction constrains the slip of a
    /// stage, not its velocity, because the correction changes that.
    pub leaves_smooth_motion: bool,
    /// The corrector acts on contacts on dofs without mass, and only on these; such contacts leave no jumps. It is then
    /// called for every step in which one of them closes or opens, even if the scheme imposes other contacts on
    /// velocities.
    pub corrects_massless: bool,
    /// [`predict`](Corrector::predict) does something; its memory is reserved only then.
    pub predicts: bool,
}

impl Effects {
    /// The effects of several correctors together.
    pub(crate) fn of_all<T: Real>(correctors: &[Box<dyn Corrector<T> + '_>]) -> Self {
        correctors.iter().map(Corrector::effects).fold(Self::default(), |all, own| Self {
            edits: all.edits.max(own.edits),
            leaves_smooth_motion: all.leaves_smooth_motion || own.leaves_smooth_motion,
            corrects_massless: all.corrects_massless || own.corrects_massless,
            predicts: all.predicts || own.predicts,
        })
    }
}

/// Which states a corrector changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Edits {
    /// Only the state of the stage.
    #[default]
    NewState,
    /// Past states too.
    Past,
}

impl<T: Real, C: Corrector<T> + ?Sized> Corrector<T> for Box<C> {
    fn name(&self) -> String {
        (**self).name()
    }
    fn requirements(&self, tableau: &Tableau) -> Requirements {
        (**self).requirements(tableau)
    }
    fn effects(&self) -> Effects {
        (**self).effects()
    }
    fn predict(&self, step: &mut Prediction<'_, T>) -> Result<()> {
        (**self).predict(step)
    }
    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        (**self).correct(step)
    }
}
