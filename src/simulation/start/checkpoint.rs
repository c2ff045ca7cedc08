//! Checkpoints: the saved form of a run, and how another run continues from it.

use crate::real::Real;
use crate::simulation::build::builder::SimulationBuilder;
use crate::simulation::run::Simulation;
use crate::simulation::start::resumed::Resumed;
use crate::state::Checkpoint;

impl<T: Real> Simulation<'_, T> {
    /// A copy of state and history as they are now, to be saved. With the feature `serde`.
    #[must_use]
    pub fn checkpoint(&self) -> Checkpoint<T> {
        Checkpoint::new(self.state.clone(), self.history.clone(), self.scheme.tableau.fingerprint())
    }
}

impl<T: Real> SimulationBuilder<'_, T> {
    /// Continues from a checkpoint of a run of the same system, scheme and
    /// [step size](crate::History::step_size), bit for bit, as [`resume`](Self::resume) does. Initial values and start
    /// time given elsewhere are ignored. With the feature `serde`.
    ///
    /// A checkpoint that does not fit is refused by [`build`](Self::build): [`Error::Dimension`] for another number
    /// of dofs, [`Error::Incompatible`] for another scheme, or for other rows under the same name,
    /// [`Error::Parameter`] for another step size. Changes of system, constraints, correctors or settings are not
    /// detected.
    ///
    /// [`Error::Dimension`]: crate::Error::Dimension
    /// [`Error::Incompatible`]: crate::Error::Incompatible
    /// [`Error::Parameter`]: crate::Error::Parameter
    #[must_use]
    pub fn resume_from(mut self, checkpoint: Checkpoint<T>) -> Self {
        self.resumed = Some(Resumed::from_checkpoint(checkpoint));
        self
    }
}
