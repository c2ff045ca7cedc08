//! State and history that a run continues from, refused if they do not fit the run.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::SAME_TIME;
use crate::simulation::build::scheme::Scheme;
#[cfg(feature = "serde")]
use crate::simulation::step::resample::computed_capacity;
#[cfg(feature = "serde")]
use crate::state::{Checkpoint, Motion};
use crate::state::{Clock, History, Names, State};
use crate::system::{check_step_size, check_vector};

/// State and history that a run continues from.
pub(crate) struct Resumed<T> {
    state: State<T>,
    history: History<T>,
    /// Fingerprint of the rows that made a checkpoint; motions that nothing reads are empty in its history.
    #[cfg(feature = "serde")]
    rows: Option<u32>,
}

impl<T: Real> Resumed<T> {
    pub(crate) fn new(mut state: State<T>, history: History<T>) -> Self {
        // Versions of names count within a run: versions of another run mean nothing here.
        state.contacts.names = Names::default();
        Self {
            state,
            history,
            #[cfg(feature = "serde")]
            rows: None,
        }
    }

    #[cfg(feature = "serde")]
    pub(crate) fn from_checkpoint(checkpoint: Checkpoint<T>) -> Self {
        Self { state: checkpoint.state, history: checkpoint.history, rows: Some(checkpoint.rows) }
    }

    pub(crate) fn clock(&self) -> Clock {
        self.history.clock
    }

    /// State and history, if a run of this size, scheme and nominal step size may have left them.
    pub(crate) fn checked(
        self,
        scheme: &Scheme<'_>,
        h: f64,
        [dofs, massless]: [usize; 2],
    ) -> Result<(State<T>, History<T>)> {
        let (state, history) = (self.state, self.history);
        check_scheme(&history, scheme)?;
        #[cfg(feature = "serde")]
        let history = match self.rows {
            Some(rows) => fitted(&state, history, scheme, rows)?,
            None => history,
        };
        history.check(dofs, scheme.slots(), massless)?;
        check_vector("the resumed displacement", &state.motion.u, dofs)?;
        check_vector("the resumed velocity", &state.motion.v, dofs)?;
        check_vector("the resumed acceleration", &state.motion.a, dofs)?;
        let (t, end) = (state.motion.t, history.clock.at(0.0));
        if (t - end).abs() > SAME_TIME * history.clock.h {
            let part = format!("a state of t = {t:e} with a history that ends at t = {end:e}");
            return Err(Error::Incompatible { part, reason: "both belong to one instant: clone them together" });
        }
        let own = history.step_size();
        if own.to_bits() != h.to_bits() {
            return Err(Error::Parameter { name: "the step size of the history", value: own, range: "h of the run" });
        }
        check_step_size::<T>(history.clock.h)?;
        Ok((state, history))
    }
}

fn check_scheme<T: Real>(history: &History<T>, scheme: &Scheme<'_>) -> Result<()> {
    let name = scheme.integrator.name();
    if history.scheme != name {
        let part = format!("a history of {} in a run by {name}", history.scheme);
        return Err(Error::Incompatible { part, reason: "a past belongs to the scheme that made it" });
    }
    Ok(())
}

/// The history of a checkpoint with memory for the motions that are spare.
#[cfg(feature = "serde")]
fn fitted<T: Real>(state: &State<T>, mut history: History<T>, scheme: &Scheme<'_>, rows: u32) -> Result<History<T>> {
    let refuse = |reason| Err(Error::Incompatible { part: format!("a checkpoint of {}", history.scheme), reason });
    if scheme.tableau.fingerprint() != rows {
        return refuse("the rows of its scheme were others, though their name was that of the scheme of this run");
    }
    let slots = scheme.slots();
    let computed = history.computed.room();
    let shifted = scheme.shifts.map(|shift| shift != 0.0);
    // Values at the time of the state are there if, and only if, the stored values belong to another time.
    let shown = state.rates.each_ref().map(|rate| !rate.is_empty());
    let moved = history.unshifted.iter().zip(shifted).any(|(unshifted, shifted)| !unshifted.is_empty() && !shifted);
    let length = computed == 0 || computed == computed_capacity(scheme);
    if history.known > scheme.depth || history.slots.len() != slots || !length || moved || shown != shifted {
        return refuse("it does not hold what this scheme reads");
    }
    let spare = history.slots.iter_mut().chain(history.computed.all()).filter(|motion| motion.u.is_empty());
    spare.for_each(|motion| *motion = Motion::zero(state.motion.u.len()));
    Ok(history)
}
