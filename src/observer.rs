//! Observers receive every accepted step; they may stop the run but not change it.

use crate::error::Result;
use crate::real::Real;
use crate::simulation::{Energy, Statistics};
use crate::state::{ContactStatus, State};

/// Whether a run continues.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Control {
    /// Continue the run.
    #[default]
    Continue,
    /// Stop after this step.
    Stop,
}

/// The data of an accepted step for an observer.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct StepView<'a, T> {
    /// The state at the end of the step.
    pub state: &'a State<T>,
    /// Energy at the end of the step, if an observer [wants](Observer::wants) it.
    pub energy: Option<Energy<T>>,
    /// Size of the step.
    pub h: f64,
    /// Statistics since the start.
    pub statistics: &'a Statistics,
}

impl<'a, T> StepView<'a, T> {
    /// A view of a step without energy: for hosts with their own loop that call an observer.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::observer::EnergyRecorder;
    /// use contact_dynamics::{GeneralizedAlpha, LinearSystem, Observer, Simulation, StepView};
    ///
    /// let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 4.0)])?;
    /// let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], k)?, GeneralizedAlpha::default(), 0.1)
    ///     .displacement(vec![1.0])
    ///     .build()?;
    /// let mut recorder = EnergyRecorder::new();
    /// for _ in 0..10 {
    ///     run.step()?;
    ///     let energy = run.energy();
    ///     recorder.observe(&StepView::new(run.state(), run.step_size(), run.statistics()).with_energy(energy))?;
    /// }
    /// assert_eq!(recorder.energies().len(), 10);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub const fn new(state: &'a State<T>, h: f64, statistics: &'a Statistics) -> Self {
        Self { state, energy: None, h, statistics }
    }

    /// The same view with the energy at the end of the step.
    #[must_use]
    pub fn with_energy(self, energy: Energy<T>) -> Self {
        Self { energy: Some(energy), ..self }
    }
}

/// Receives every accepted step. Implemented for `()` (does nothing), for pairs, for closures that return a
/// [`Control`] or, if they may fail, a `Result<Control>`, for `&mut` references to the recorders of this crate, and
/// for `Box<dyn Observer<T>>` and `&mut dyn Observer<T>`. A host lends its own recorder with
/// [`by_ref`](Self::by_ref), because Rust does not allow an implementation for every `&mut O` besides the one for
/// closures.
///
/// A combination of observers computes everything that any of them [wants](Self::wants).
///
/// ```
/// use contact_dynamics::observer::{DofRecorder, Wants};
/// use contact_dynamics::{Control, Error, Observer, Result, StepView};
///
/// /// Writes the energy to a file.
/// struct Journal(std::io::BufWriter<Vec<u8>>);
///
/// impl Observer<f64> for Journal {
///     fn observe(&mut self, step: &StepView<'_, f64>) -> Result<Control> {
///         use std::io::Write;
///         let energy = step.energy.map_or(f64::NAN, |energy| energy.total());
///         let written = writeln!(self.0, "{} {energy}", step.state.time());
///         written.map_err(|error| Error::Host { callback: "observer", source: error.into() })?;
///         Ok(Control::Continue)
///     }
///     fn wants(&self) -> Wants {
///         Wants::Energy
///     }
/// }
///
/// let (mut journal, mut recorder) = (Journal(std::io::BufWriter::new(Vec::new())), DofRecorder::<f64>::new(0));
/// let mut steps = 0;
/// let count = |_: &StepView<'_, f64>| {
///     steps += 1;
///     Control::Continue
/// };
/// let refuse_late = |step: &StepView<'_, f64>| -> Result<Control> {
///     match step.state.time() > 2.0 {
///         true => Err(Error::Host { callback: "observer", source: "too late".into() }),
///         false => Ok(Control::Continue),
///     }
/// };
/// let mut all: Box<dyn Observer<f64>> = Box::new(((count, refuse_late), (journal.by_ref(), &mut recorder)));
/// assert_eq!(all.wants(), Wants::Energy);
/// # let _ = &mut all;
/// ```
pub trait Observer<T: Real> {
    /// Called once after each accepted step.
    ///
    /// # Errors
    ///
    /// The host's own, usually [`Error::Host`](crate::Error::Host). It ends the run with this error; the observed
    /// step remains taken.
    fn observe(&mut self, step: &StepView<'_, T>) -> Result<Control>;

    /// Data to be computed for this observer besides the step itself.
    fn wants(&self) -> Wants {
        Wants::State
    }

    /// Lends the observer, for instance to a pair of observers.
    fn by_ref(&mut self) -> &mut dyn Observer<T>
    where
        Self: Sized,
    {
        self
    }
}

/// Data that an observer needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Wants {
    /// State, gaps and statistics: no extra computation.
    State,
    /// Energy as well: about one product with M and one with K per step.
    Energy,
}

/// Allows a closure to return either type.
impl From<Control> for Result<Control> {
    fn from(control: Control) -> Self {
        Ok(control)
    }
}

impl<T: Real, R: Into<Result<Control>>, F: FnMut(&StepView<'_, T>) -> R> Observer<T> for F {
    fn observe(&mut self, step: &StepView<'_, T>) -> Result<Control> {
        self(step).into()
    }
}

impl<T: Real> Observer<T> for () {
    fn observe(&mut self, _: &StepView<'_, T>) -> Result<Control> {
        Ok(Control::Continue)
    }
}

impl<T: Real, A: Observer<T>, B: Observer<T>> Observer<T> for (A, B) {
    fn observe(&mut self, step: &StepView<'_, T>) -> Result<Control> {
        // Both observe every step, even if the first one stops the run or fails.
        let (first, second) = (self.0.observe(step), self.1.observe(step));
        match (first?, second?) {
            (Control::Continue, Control::Continue) => Ok(Control::Continue),
            _ => Ok(Control::Stop),
        }
    }

    fn wants(&self) -> Wants {
        self.0.wants().max(self.1.wants())
    }
}

/// Pointers to observers are observers.
macro_rules! forward {
    ($($pointer:ty),*) => {$(
        impl<T: Real> Observer<T> for $pointer {
            fn observe(&mut self, step: &StepView<'_, T>) -> Result<Control> {
                (**self).observe(step)
            }
            fn wants(&self) -> Wants {
                (**self).wants()
            }
        }
    )*};
}

forward!(
    &mut (dyn Observer<T> + '_),
    Box<dyn Observer<T> + '_>,
    &mut DofRecorder<T>,
    &mut ContactRecorder<T>,
    &mut EnergyRecorder<T>
);

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
    fn observe(&mut self, step: &StepView<'_, T>) -> Result<Control> {
        let state = step.state;
        let fields = [state.displacement(), state.velocity(), state.acceleration()];
        if let Some(&u) = fields[0].get(self.dof) {
            self.times.push(state.time());
            self.motion.push([u, fields[1][self.dof], fields[2][self.dof]]);
        }
        Ok(Control::Continue)
    }
}

/// Records the total contact force (sum of the reported multipliers), the raw one, and the impulse over time; with
/// friction also the sum of the friction magnitudes and the numbers of sticking and sliding contacts.
///
/// ```
/// use contact_dynamics::observer::ContactRecorder;
/// use contact_dynamics::faer::sparse::SparseColMat;
/// use contact_dynamics::{LinearRows, LinearSystem, Newmark, Simulation};
///
/// // A block of 2 kg slides over a floor until friction has stopped it, at t = 0.1.
/// let free = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &[])?;
/// let mut run = Simulation::builder(
///     LinearSystem::lumped(vec![2.0; 2], free)?.load(|_, f| f[1] = -20.0),
///     Newmark::trapezoidal(),
///     0.01,
/// )
/// .velocity(vec![0.25, 0.0])
/// .constraint(LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(0.25, &[&[(0, 1.0)]]))
/// .build()?;
/// let mut recorder = ContactRecorder::new();
/// run.run_until(0.2, &mut recorder)?;
/// assert!((recorder.friction()[3] - 5.0).abs() < 1e-12 && recorder.friction()[15].abs() < 1e-12);
/// assert!(recorder.sliding()[3] == 1 && recorder.sticking()[15] == 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct ContactRecorder<T> {
    times: Vec<f64>,
    forces: Vec<T>,
    raw_forces: Vec<T>,
    impulses: Vec<T>,
    friction: Vec<T>,
    sticking: Vec<usize>,
    sliding: Vec<usize>,
}

impl<T: Real> ContactRecorder<T> {
    /// An empty recorder.
    pub fn new() -> Self {
        Self {
            times: Vec::new(),
            forces: Vec::new(),
            raw_forces: Vec::new(),
            impulses: Vec::new(),
            friction: Vec::new(),
            sticking: Vec::new(),
            sliding: Vec::new(),
        }
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

    /// Impulse of each step, including corrections.
    pub fn impulses(&self) -> &[T] {
        &self.impulses
    }

    /// Σ |f| over the contacts (force), f the friction after correction. Directions are in
    /// [`ContactState::friction_forces`](crate::ContactState::friction_forces).
    pub fn friction(&self) -> &[T] {
        &self.friction
    }

    /// Number of contacts with friction that stick.
    pub fn sticking(&self) -> &[usize] {
        &self.sticking
    }

    /// Number of contacts with friction that slide.
    pub fn sliding(&self) -> &[usize] {
        &self.sliding
    }
}

impl<T: Real> Observer<T> for ContactRecorder<T> {
    fn observe(&mut self, step: &StepView<'_, T>) -> Result<Control> {
        let contacts = step.state.contacts();
        self.times.push(step.state.time());
        self.forces.push(contacts.forces().iter().copied().sum());
        self.raw_forces.push(contacts.raw_forces().iter().copied().sum());
        self.impulses.push(contacts.impulses().iter().copied().sum());
        let size = |contact| contacts.tangential(contact, &contacts.lambda);
        let all = 0..contacts.ids().len();
        let count = |status| all.clone().filter(|&contact| contacts.status(contact) == status).count();
        self.friction.push(all.clone().map(size).sum());
        self.sticking.push(count(ContactStatus::Sticking));
        self.sliding.push(count(ContactStatus::Sliding));
        Ok(Control::Continue)
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
    fn observe(&mut self, step: &StepView<'_, T>) -> Result<Control> {
        if let Some(energy) = step.energy {
            self.times.push(step.state.time());
            self.energies.push(energy);
        }
        Ok(Control::Continue)
    }

    fn wants(&self) -> Wants {
        Wants::Energy
    }
}
