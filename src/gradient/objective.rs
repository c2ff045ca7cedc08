//! The objective: a sum over the states of a run.

use crate::real::Real;
use crate::state::State;

/// A state of a recorded run.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct RecordedStep<'a, T> {
    /// The state at the end of the step.
    pub state: &'a State<T>,
    /// The size of the step; of the first step for the state at the start.
    pub h: f64,
    /// Its number: 0 is the state at the start.
    pub step: usize,
    /// The number of the last step.
    pub steps: usize,
}

/// The derivatives of a term of the objective; zero on entry, to be added to.
#[derive(Debug)]
#[non_exhaustive]
pub struct Seed<'a, T> {
    /// By [`State::displacement`], one a dof.
    pub displacement: &'a mut [T],
    /// By [`State::velocity`], one a dof.
    pub velocity: &'a mut [T],
    /// By [`State::acceleration`], one a dof.
    pub acceleration: &'a mut [T],
    /// By the contact forces after correction, [`ContactState::forces`](crate::ContactState::forces), one a candidate.
    pub force: &'a mut [T],
    /// By the impulses of the step, [`ContactState::impulses`](crate::ContactState::impulses), one a candidate.
    pub impulse: &'a mut [T],
}

/// The objective J = Σ j(state), summed over the state at the start and the states at the ends of all steps.
/// Implemented for closures.
///
/// ```
/// use contact_dynamics::gradient::{Objective, RecordedStep, Seed};
///
/// /// ∫ ½ (u − d)² dt of a dof with a wanted displacement.
/// struct Track {
///     dof: usize,
///     wanted: f64,
/// }
///
/// impl Objective<f64> for Track {
///     fn term(&mut self, step: &RecordedStep<'_, f64>, seed: &mut Seed<'_, f64>) -> f64 {
///         let miss = step.state.displacement()[self.dof] - self.wanted;
///         seed.displacement[self.dof] += step.h * miss;
///         0.5 * step.h * miss * miss
///     }
/// }
/// ```
pub trait Objective<T: Real> {
    /// The term of a state. Its derivatives are added to `seed`. Called once for each state, from the last to the
    /// first.
    fn term(&mut self, step: &RecordedStep<'_, T>, seed: &mut Seed<'_, T>) -> T;
}

impl<T: Real, F: FnMut(&RecordedStep<'_, T>, &mut Seed<'_, T>) -> T> Objective<T> for F {
    fn term(&mut self, step: &RecordedStep<'_, T>, seed: &mut Seed<'_, T>) -> T {
        self(step, seed)
    }
}
