//! A run at an instant as one value, to be written to a file and read again.

use super::State;
use super::history::History;
use super::record::Record;
use crate::real::Real;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// State and history of a run at one instant: all that its later steps read, to be saved by any format of serde. With
/// the feature `serde`.
///
/// Made by [`Simulation::checkpoint`](crate::Simulation::checkpoint), taken by
/// [`SimulationBuilder::resume_from`](crate::SimulationBuilder::resume_from): the run goes on bit for bit, if the
/// format keeps the bits of numbers. Binary ones do; `serde_json` does with its feature `float_roundtrip`.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{Checkpoint, Composite, LinearRows, LinearSystem, Simulation};
///
/// // A mass on a spring, which pulls it against a stop.
/// let scene = || {
///     let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 9.0)])?;
///     let stop = LinearRows::new().unilateral(&[(0, 1.0)], 0.5);
///     Ok::<_, Box<dyn std::error::Error>>(
///         Simulation::builder(LinearSystem::lumped(vec![1.0], k)?, Composite, 0.01).constraint(stop),
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
/// A file names its format (a number), the scalar (`f32` or `f64`) and the scheme, with a number that tells the rows of
/// schemes apart. The format changes when what is stored changes, and files of another one are refused; results, and
/// with them the bits of a run, may change between versions of the crate without that. Stored are the vectors of the
/// state and of the past that is read, the contacts, the clock, the place of a controlled step size in the nominal
/// grid, and the depths of overlaps at the start.
///
/// Not in it are system, constraints, correctors and settings: the host builds these again as they were. A history of
/// the host's own (plastic strains, as [`System::commit`](crate::System::commit) moves them) is the host's to save.
/// [`Statistics`](crate::Statistics) and the [`Works`](crate::Works) of the energy balance count from the build of a
/// simulation; both can be saved, and added to those of the run that goes on.
///
/// # Errors
///
/// Reading refuses, in the format's own error, files of something else, of another format or scalar, and what no run
/// leaves: numbers that are not finite, lists of different lengths, counts out of range. What depends on the
/// simulation is checked by [`build`](crate::SimulationBuilder::build): number of dofs, scheme, step size, and that the
/// state is that of the end of its history. A file with wrong but possible numbers is taken as it is: checksums are the
/// host's.
#[derive(Clone, Debug)]
pub struct Checkpoint<T> {
    pub(crate) state: State<T>,
    /// Without spare slots: past states only.
    pub(crate) history: History<T>,
    /// Fingerprint of the rows of the scheme.
    pub(crate) rows: u32,
}

impl<T: Real> Checkpoint<T> {
    /// The state.
    pub fn state(&self) -> &State<T> {
        &self.state
    }

    /// The past states.
    pub fn history(&self) -> &History<T> {
        &self.history
    }

    /// Name of the scheme that made it.
    pub fn scheme(&self) -> &str {
        &self.history.scheme
    }
}

impl<T: Real> Serialize for Checkpoint<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Record::of(&self.state, &self.history, self.rows).serialize(serializer)
    }
}

impl<'de, T: Real> Deserialize<'de> for Checkpoint<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (state, history, rows) = Record::deserialize(deserializer)?.checked().map_err(D::Error::custom)?;
        Ok(Self { state, history, rows })
    }
}
