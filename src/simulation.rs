//! The simulation: one system, one integrator, contacts and correctors, advanced step by step.

mod admitted;
mod builder;
mod constraints;
mod contact_step;
mod control;
mod curved_rows;
mod energy;
mod finite;
mod massless;
mod newton;
mod newton_step;
mod operator;
mod overclosures;
mod pairing;
mod path;
mod program;
mod resample;
pub(crate) mod results;
mod scheme;
mod stability;
mod start;
mod step;
mod supports;

pub use builder::SimulationBuilder;
use constraints::Constraints;
pub use control::StepControl;
pub use massless::StartAdjustment;
pub use newton::{Iteration, Newton};
pub(crate) use overclosures::Overclosures;
pub use results::{Energy, Outcome, Statistics, Works};
pub use start::InitialOverclosure;

use crate::contact::ContactJacobian;
use crate::contact_solver::ContactSolver;
use crate::corrector::{Backup, Buffers, Corrector, JumpProjection};
use crate::error::{Error, Result};
use crate::integrator::TimeIntegrator;
use crate::linear_solver::LinearSolver;
use crate::observer::{Control, Observer, StepView, Wants};
use crate::real::Real;
use crate::state::{ContactState, History, Motion, State};
use crate::system::System;
use contact_step::{ContactRowsWork, InterfaceWork};
use control::Judge;
use energy::Ledger;
use massless::MasslessBlock;
use newton_step::NewtonWork;
pub(crate) use operator::Operator;
use program::Program;
use scheme::Scheme;
use stability::StepLimit;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Advances a system in time; made by [`Simulation::builder`].
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{Composite, LinearRows, LinearSystem, PersistencyCorrection, Simulation};
///
/// // A ball of unit mass flies with speed 2 toward a wall 1 away.
/// let free = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 0.0)])?;
/// let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], free)?, Composite, 0.01)
///     .velocity(vec![-2.0])
///     .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 1.0))
///     .corrector(PersistencyCorrection::with_history_projection())
///     .build()?;
/// run.run_until(1.0, &mut ())?;
/// // A rigid ball loses its velocity: contact without a rebound law is plastic.
/// assert!((run.state().displacement()[0] + 1.0).abs() < 1e-12);
/// assert!(run.state().velocity()[0].abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Simulation<'a, T: Real> {
    system: Box<dyn System<T> + 'a>,
    constraints: Constraints<'a, T>,
    /// The rows of G of all constraints.
    g: ContactJacobian<T>,
    contact_solver: Box<dyn ContactSolver<T> + 'a>,
    correctors: Vec<Box<dyn Corrector<T> + 'a>>,
    linear_solver: Box<dyn LinearSolver<T> + 'a>,
    scheme: Scheme<'a>,
    program: Program<T>,
    limit: StepLimit,
    /// The one-step scheme of the first steps, dropped once the past is known.
    startup: Option<Program<T>>,
    state: State<T>,
    history: History<T>,
    work: Workspace<T>,
    ledger: Option<Ledger<T>>,
    /// For runs that control their step size.
    judge: Option<Judge<T>>,
    adjustment: Option<StartAdjustment<T>>,
    statistics: Statistics,
    /// Whether a callback of the host has panicked.
    poisoned: bool,
}

/// Memory of a step. Nothing in it changes a result.
struct Workspace<T: Real> {
    /// Residual, then the increment d; one a dof.
    increment: Vec<T>,
    /// ū, v̄, ā where the balance does not hold at the recovered state.
    balance: Option<Motion<T>>,
    prescribed: Vec<usize>,
    /// Free dofs without mass.
    massless: Vec<usize>,
    /// For explicit schemes, if there are any.
    block: Option<MasslessBlock<T>>,
    /// Prescribed u, v, a at the time of the state and at that of the balance.
    supports: Vec<[T; 3]>,
    balance_supports: Vec<[T; 3]>,
    /// Whether M couples prescribed dofs with free ones.
    coupled_mass: bool,
    /// For nonlinear systems.
    newton: Option<NewtonWork<T>>,
    trial: ContactState<T>,
    /// v and a at the time of the new state, where the scheme stores those of another time.
    shown: [Vec<T>; 2],
    /// Closed flags at the start of the step, and before the present stage.
    closed_at_start: Vec<bool>,
    was_closed: Vec<bool>,
    interface: InterfaceWork<T>,
    rows: ContactRowsWork<T>,
    buffers: Buffers<T>,
    projection: Option<JumpProjection<T>>,
    /// For correctors that act on the prediction, one entry a dof.
    shifted: Vec<T>,
    /// Version of the rows that the projection knows.
    projected_rows: u64,
    backup: Backup<T>,
    /// Change of kinetic energy by corrections in this step.
    correction_energy: T,
}

impl<T: Real> std::fmt::Debug for Simulation<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Simulation")
            .field("integrator", &self.scheme.integrator.name())
            .field("dofs", &self.system.dofs())
            .field("constraints", &self.constraints)
            .field("correctors", &self.correctors)
            .field("time", &self.state.motion.t)
            .field("statistics", &self.statistics)
            .finish_non_exhaustive()
    }
}

impl<'a, T: Real> Simulation<'a, T> {
    /// Begins a simulation of `system` by `integrator` with step size `h`; everything else is optional.
    pub fn builder(
        system: impl System<T> + 'a,
        integrator: impl TimeIntegrator + 'a,
        h: f64,
    ) -> SimulationBuilder<'a, T> {
        SimulationBuilder::new(Box::new(system), Box::new(integrator), h)
    }

    /// Takes whole steps and stops at the first grid time ≥ `t` − 1e-9 h, or when the observer says so. A grid time
    /// that rounds to the number before `t` is `t`.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if `t` is not finite, those of [`step`](Self::step), and [`Error::EnergyNotFinite`] if an
    /// observer that asks for the energy would be shown one that is no number; the step before it is taken.
    pub fn run_until(&mut self, t: f64, observer: &mut dyn Observer<T>) -> Result<Outcome> {
        if !t.is_finite() {
            return Err(Error::Parameter { name: "the end time", value: t, range: "finite" });
        }
        while !self.history.clock.has_reached(t) {
            if self.observed_step(observer)? == Control::Stop {
                return Ok(Outcome::Stopped);
            }
        }
        Ok(Outcome::Reached)
    }

    /// Takes a step and shows it to the observer.
    fn observed_step(&mut self, observer: &mut dyn Observer<T>) -> Result<Control> {
        self.step()?;
        let energy = match observer.wants() {
            Wants::State => None,
            Wants::Energy => {
                let energy = self.energy();
                energy.check(self.time())?;
                Some(energy)
            }
        };
        let view = StepView { state: &self.state, energy, h: self.history.made_with, statistics: &self.statistics };
        Ok(observer.observe(&view))
    }

    /// The state at the end of the last step.
    pub fn state(&self) -> &State<T> {
        &self.state
    }

    /// The past states that later steps read.
    pub fn history(&self) -> &History<T> {
        &self.history
    }

    /// Time at the end of the last step.
    pub fn time(&self) -> f64 {
        self.history.clock.at(0.0)
    }

    /// Gaps at the end of the last step, one a candidate.
    pub fn gaps(&self) -> &[T] {
        &self.state.contacts.gap
    }

    /// Work counts.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// What was moved when the simulation was built: dofs without mass that were not in static balance with the others,
    /// the load and contact. Left there they would jump in the first step, and take their energy with them unseen. None
    /// if nothing was.
    pub fn start_adjustment(&self) -> Option<StartAdjustment<T>> {
        self.adjustment
    }

    /// Number of scalars in the factors of the effective matrices.
    pub fn factor_size(&self) -> usize {
        self.program.operators.iter().map(Operator::stored_values).sum()
    }

    /// The system.
    pub fn system(&self) -> &dyn System<T> {
        &*self.system
    }

    /// The iterations of Newton's method in the stage that was solved last, also if it failed; empty for linear systems
    /// and for stages that are linear in their unknown.
    ///
    /// ```
    /// # use contact_dynamics::{LinearSystem, Newmark, Simulation};
    /// # use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// # let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 1.0)])?;
    /// # let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], k)?, Newmark::trapezoidal(), 0.1).build()?;
    /// run.step()?;
    /// for iteration in run.convergence() {
    ///     println!("{:.1e} {:.1e}", iteration.residual, iteration.increment);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn convergence(&self) -> &[Iteration] {
        self.work.newton.as_ref().map_or(&[], |newton| &newton.report)
    }

    /// Momentum along a direction (one entry a dof, for instance 1 on all x displacements) in the form that the scheme
    /// conserves.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the direction has the wrong length.
    pub fn momentum(&self, direction: &[T]) -> Result<T> {
        self.check_sound()?;
        let dofs = self.system.dofs();
        if direction.len() != dofs {
            return Err(Error::Dimension { what: "the direction", expected: dofs, found: direction.len() });
        }
        let history = &self.history;
        let sum = self.scheme.momentum(&self.state.motion, &history.slots[1..history.known], history.clock.h);
        let mut product = vec![T::zero(); dofs];
        self.system.mass().add_product(T::one(), &sum, &mut product);
        Ok(product.iter().zip(direction).map(|(&p, &d)| p * d).sum())
    }

    /// Refuses to go on after a panic of the host.
    fn check_sound(&self) -> Result<()> {
        if self.poisoned { Err(Error::Poisoned) } else { Ok(()) }
    }

    /// Calls what calls the host and changes the run. Should the host panic, state and history are put back before the
    /// panic goes on; if somebody catches it, later calls are refused.
    fn guarded<R>(&mut self, call: impl FnOnce(&mut Self) -> Result<R>) -> Result<R> {
        self.check_sound()?;
        // Nothing half done is seen: what is undone below is all that was swapped, and the rest is refused.
        match catch_unwind(AssertUnwindSafe(|| call(self))) {
            Ok(result) => result,
            Err(panic) => {
                self.poisoned = true;
                if self.work.backup.underway {
                    self.put_back();
                }
                resume_unwind(panic)
            }
        }
    }

    /// Kinetic and elastic energy of the state, and the balance if the builder asked for it.
    pub fn energy(&mut self) -> Energy<T> {
        energy::energy(&mut *self.system, &self.state, self.ledger.as_ref())
    }

    /// Forces of the supports on the system, one a prescribed dof: R = M a − f(t, u, v) − Gᵀ λ.
    ///
    /// # Errors
    ///
    /// The host's own.
    pub fn reactions(&mut self) -> Result<Vec<T>> {
        self.check_sound()?;
        energy::reactions(&mut *self.system, &self.state, (&self.constraints, &self.g))
    }
}
