//! Correctors: what must be mended so that velocity and acceleration agree with the contact.

mod correction;
mod jump_projection;
mod persistency;

pub use correction::Correction;
pub(crate) use correction::{Backup, Buffers, Erased, ErasedGaps, Gaps, Scheme, contact_error, no_response, rounding};
pub use jump_projection::JumpProjection;
pub use persistency::{HistoryProjection, Parts, PersistencyCorrection};

use crate::error::Result;
use crate::real::Real;

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
///         step.push_velocity();
///         Ok(())
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

    /// Corrects the stage. Called for every stage with at least one closed contact.
    ///
    /// # Errors
    ///
    /// [`Error::ContactNotFinite`](crate::Error::ContactNotFinite), [`Error::Contact`](crate::Error::Contact); the
    /// step is then undone.
    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()>;
}

/// What a corrector changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
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
    fn correct(&self, step: &mut Correction<'_, T>) -> Result<()> {
        (**self).correct(step)
    }
}
