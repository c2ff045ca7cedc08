//! A run at one instant as one value, for saving and restoring.

use super::history::History;
use super::record::{Format, HistoryRecord, Record, ScalarName, StateRecord};
use super::{Motion, State};
use crate::error::{Error, Result};
use crate::real::Real;
use serde::{Deserialize, Serialize};

/// State and history of a run at one instant: all data that its later steps read, for saving in any format of serde.
/// Requires the feature `serde`.
///
/// Created by [`Simulation::checkpoint`](crate::Simulation::checkpoint) and used by
/// [`SimulationBuilder::resume_from`](crate::SimulationBuilder::resume_from). The resumed run is bitwise the same if
/// the format preserves the bits of numbers. Binary formats do; `serde_json` does with its feature `float_roundtrip`.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{Checkpoint, GeneralizedAlpha, LinearRows, LinearSystem, Simulation};
///
/// // A mass on a spring, which pulls it against a stop.
/// let scene = || {
///     let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 9.0)])?;
///     let stop = LinearRows::new().unilateral(&[(0, 1.0)], 0.5);
///     Ok::<_, Box<dyn std::error::Error>>(
///         Simulation::builder(LinearSystem::lumped(vec![1.0], k)?, GeneralizedAlpha::default(), 0.01)
///             .constraint(stop),
///     )
/// };
/// let mut run = scene()?.displacement(vec![1.0]).build()?;
/// run.run_until(0.5, &mut ())?;
/// let file = serde_json::to_string(&run.checkpoint())?;
///
/// // Later, in another process.
/// let checkpoint: Checkpoint<f64> = serde_json::from_str(&file)?;
/// let mut resumed = scene()?.resume_from(checkpoint).build()?;
/// run.run_until(2.0, &mut ())?;
/// resumed.run_until(2.0, &mut ())?;
/// assert_eq!(run.state(), resumed.state());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # What is in it, and what is not
///
/// A file contains its format number, the scalar (`f32` or `f64`), the name of the scheme and a fingerprint of its
/// rows. The format number changes whenever the stored data change, and files of another format are rejected.
/// Results, and so the bits of a run, may change between versions of the crate without a new format number. Stored
/// are the vectors of the state and of the past states that are read, the contacts, the clock, the position of a
/// controlled step size in the nominal grid, and the overlap depths at the start.
///
/// Not stored are system, constraints, correctors and settings: the host must build them again as before. The host
/// must save history variables of its own, such as plastic strains changed in
/// [`System::commit`](crate::System::commit). [`Statistics`](crate::Statistics) and the [`Works`](crate::Works) of
/// the energy balance count from the build of a simulation; both can be saved and added to the values of the resumed
/// run.
///
/// # Errors
///
/// Reading fails, with the format's own error, for other files, another format or scalar, and data that no run
/// produces: numbers that are not finite, lists of different lengths, counts out of range.
/// [`build`](crate::SimulationBuilder::build) checks what depends on the simulation: number of dofs, scheme, step
/// size, and that the state matches the end of its history. Wrong but possible numbers are not detected: use
/// checksums.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(bound = "T: Real", try_from = "Record<T>")]
pub struct Checkpoint<T> {
    pub(super) format: Format,
    pub(super) scalar: ScalarName<T>,
    /// Fingerprint of the rows of the scheme.
    pub(crate) rows: u32,
    #[serde(with = "StateRecord")]
    pub(crate) state: State<T>,
    /// Motions that nothing reads are empty.
    #[serde(with = "HistoryRecord")]
    pub(crate) history: History<T>,
}

impl<T: Real> Checkpoint<T> {
    pub(crate) fn new(state: State<T>, mut history: History<T>, rows: u32) -> Self {
        let spare = history.motions(state.is_shifted()).filter(|(is_read, _)| !is_read);
        spare.for_each(|(_, motion)| *motion = Motion::zero(0));
        Self { format: Format, scalar: ScalarName::default(), rows, state, history }
    }

    /// The state.
    pub fn state(&self) -> &State<T> {
        &self.state
    }

    /// The past states.
    pub fn history(&self) -> &History<T> {
        &self.history
    }

    /// Name of the scheme that created it.
    pub fn scheme(&self) -> &str {
        &self.history.scheme
    }
}

impl<T: Real> TryFrom<Record<T>> for Checkpoint<T> {
    type Error = Error;

    fn try_from(mut read: Record<T>) -> Result<Self> {
        read.check()?;
        let Record { format, scalar, rows, state, history } = read;
        Ok(Self { format, scalar, rows, state, history })
    }
}
