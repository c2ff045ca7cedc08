//! Observers see every accepted step; they may stop the run, never change it.

use crate::real::Real;
use crate::simulation::results::{Energy, Statistics};
use crate::state::State;

/// Whether a run goes on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Control {
    /// Go on.
    #[default]
    Continue,
    /// Stop after this step.
    Stop,
}

/// What an observer sees of an accepted step.
#[derive(Clone, Copy, Debug)]
pub struct StepView<'a, T> {
    /// The state at the end of the step.
    pub state: &'a State<T>,
    /// Energy at the end of the step, if an observer [wants](Observer::wants) it.
    pub energy: Option<Energy<T>>,
    /// Size of the step.
    pub h: f64,
    /// Work counts since the start.
    pub statistics: &'a Statistics,
}

/// Sees every accepted step. Implemented for closures, for `()` (sees nothing) and for pairs.
///
/// ```
/// use contact_dynamics::observer::{Control, Observer, StepView};
/// let mut steps = 0;
/// let count = |_: &StepView<'_, f64>| {
///     steps += 1;
///     Control::Continue
/// };
/// let stop_late = |step: &StepView<'_, f64>| match step.state.time() > 2.0 {
///     true => Control::Stop,
///     false => Control::Continue,
/// };
/// let mut both: Box<dyn Observer<f64>> = Box::new((count, stop_late));
/// # let _ = &mut both;
/// ```
pub trait Observer<T: Real> {
    /// Called once after each accepted step.
    fn observe(&mut self, step: &StepView<'_, T>) -> Control;

    /// What has to be computed for this observer besides the step itself.
    fn wants(&self) -> Wants {
        Wants::State
    }
}

/// What an observer needs to see.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wants {
    /// State, gaps and counts: nothing is computed for it.
    State,
    /// Energy as well: about one product with M and one with K a step.
    Energy,
}

impl<T: Real, F: FnMut(&StepView<'_, T>) -> Control> Observer<T> for F {
    fn observe(&mut self, step: &StepView<'_, T>) -> Control {
        self(step)
    }
}

impl<T: Real> Observer<T> for () {
    fn observe(&mut self, _: &StepView<'_, T>) -> Control {
        Control::Continue
    }
}

impl<T: Real, A: Observer<T>, B: Observer<T>> Observer<T> for (A, B) {
    fn observe(&mut self, step: &StepView<'_, T>) -> Control {
        // Both see every step, also the one that stops the run.
        match (self.0.observe(step), self.1.observe(step)) {
            (Control::Continue, Control::Continue) => Control::Continue,
            _ => Control::Stop,
        }
    }

    fn wants(&self) -> Wants {
        self.0.wants().max(self.1.wants())
    }
}

/// Records displacement, velocity and acceleration of one dof over time.
///
/// ```
/// use contact_dynamics::observer::DofRecorder;
/// let recorder = DofRecorder::<f64>::new(3);
/// assert!(recorder.times().is_empty());
/// ```
#[derive(Clone, Debug)]
pub struct DofRecorder<T> {
    dof: usize,
    times: Vec<f64>,
    motion: Vec<[T; 3]>,
}

impl<T: Real> DofRecorder<T> {
    /// A recorder of `dof`. A dof that the system does not have records nothing.
    pub fn new(dof: usize) -> Self {
        Self { dof, times: Vec::new(), motion: Vec::new() }
    }

    /// Times of the recorded steps.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// (u, v, a) of the recorded steps.
    pub fn motion(&self) -> &[[T; 3]] {
        &self.motion
    }
}

impl<T: Real> Observer<T> for DofRecorder<T> {
    fn observe(&mut self, step: &StepView<'_, T>) -> Control {
        let state = step.state;
        let fields = [state.displacement(), state.velocity(), state.acceleration()];
        if let Some(&u) = fields[0].get(self.dof) {
            self.times.push(state.time());
            self.motion.push([u, fields[1][self.dof], fields[2][self.dof]]);
        }
        Control::Continue
    }
}

/// Records the total contact force (sum of the reported multipliers), the raw one, and the impulse over time.
#[derive(Clone, Debug, Default)]
pub struct ContactRecorder<T> {
    times: Vec<f64>,
    forces: Vec<T>,
    raw_forces: Vec<T>,
    impulses: Vec<T>,
}

impl<T: Real> ContactRecorder<T> {
    /// An empty recorder.
    pub fn new() -> Self {
        Self { times: Vec::new(), forces: Vec::new(), raw_forces: Vec::new(), impulses: Vec::new() }
    }

    /// Times of the recorded steps.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Contact force after correction.
    pub fn forces(&self) -> &[T] {
        &self.forces
    }

    /// Raw contact force.
    pub fn raw_forces(&self) -> &[T] {
        &self.raw_forces
    }

    /// Impulse of each step, corrections included.
    pub fn impulses(&self) -> &[T] {
        &self.impulses
    }
}

impl<T: Real> Observer<T> for ContactRecorder<T> {
    fn observe(&mut self, step: &StepView<'_, T>) -> Control {
        let contacts = step.state.contacts();
        self.times.push(step.state.time());
        self.forces.push(contacts.forces().iter().copied().sum());
        self.raw_forces.push(contacts.raw_forces().iter().copied().sum());
        self.impulses.push(contacts.impulses().iter().copied().sum());
        Control::Continue
    }
}

/// Records the energy over time.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::observer::EnergyRecorder;
/// use contact_dynamics::{LinearSystem, Newmark, Simulation};
///
/// let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 4.0)])?;
/// let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], k)?, Newmark::trapezoidal(), 0.1)
///     .displacement(vec![1.0])
///     .build()?;
/// let mut recorder = EnergyRecorder::new();
/// run.run_until(5.0, &mut recorder)?;
/// // The trapezoidal rule conserves ½ k u².
/// assert!(recorder.energies().iter().all(|energy| (energy.total() - 2.0).abs() < 1e-13));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct EnergyRecorder<T> {
    times: Vec<f64>,
    energies: Vec<Energy<T>>,
}

impl<T: Real> EnergyRecorder<T> {
    /// An empty recorder.
    pub fn new() -> Self {
        Self { times: Vec::new(), energies: Vec::new() }
    }

    /// Times of the recorded steps.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Energies of the recorded steps.
    pub fn energies(&self) -> &[Energy<T>] {
        &self.energies
    }
}

impl<T: Real> Observer<T> for EnergyRecorder<T> {
    fn observe(&mut self, step: &StepView<'_, T>) -> Control {
        if let Some(energy) = step.energy {
            self.times.push(step.state.time());
            self.energies.push(energy);
        }
        Control::Continue
    }

    fn wants(&self) -> Wants {
        Wants::Energy
    }
}
