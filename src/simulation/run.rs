//! A run: its parts, its results, and its restoration after a failed step.
//!
//! - `advance`: steps of a run, up to a time.
//! - `results`: work counts, energies, and why a run ended.
//! - `contact_output`, `impulses`: forces and impulses of contact for the caller.

pub(super) mod advance;
pub(super) mod contact_output;
pub(super) mod impulses;
pub(super) mod results;

use crate::contact::{ContactConstraint, ContactJacobian};
use crate::contact_solver::ContactSolver;
use crate::corrector::Corrector;
use crate::error::{Error, Result};
use crate::linear_solver::LinearSolver;
use crate::ranks::Together;
use crate::real::Real;
use crate::simulation::build::program::Compiled;
use crate::simulation::build::scheme::Scheme;
use crate::simulation::build::workspace::Workspace;
use crate::simulation::operator::Operator;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::run::results::{Energy, Statistics};
use crate::simulation::stage::newton::Iteration;
use crate::simulation::start::balance::StartAdjustment;
use crate::simulation::step::judge::Judge;
use crate::simulation::watch::energy::{self, Ledger};
use crate::simulation::watch::stability::StepLimit;
use crate::state::{History, State};
use crate::system::System;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Advances a system in time; made by [`Simulation::builder`].
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{GeneralizedAlpha, LinearRows, LinearSystem, Simulation};
///
/// // A ball of unit mass flies with speed 2 toward a wall 1 away.
/// let free = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 0.0)])?;
/// let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], free)?, GeneralizedAlpha::default(), 0.01)
///     .velocity(vec![-2.0])
///     .constraint(LinearRows::new().unilateral(&[(0, 1.0)], 1.0))
///     .build()?;
/// run.run_until(1.0, &mut ())?;
/// // A rigid ball loses its velocity: contact without a rebound law is plastic.
/// assert!((run.state().displacement()[0] + 1.0).abs() < 1e-12);
/// assert!(run.state().velocity()[0].abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Simulation<'a, T: Real> {
    pub(crate) parts: Parts<'a, T>,
    pub(crate) constraints: Constraints<'a, T>,
    /// The rows of G of all constraints.
    pub(crate) g: ContactJacobian<T>,
    pub(crate) scheme: Scheme<'a>,
    pub(crate) compiled: Compiled<T>,
    pub(crate) state: State<T>,
    pub(crate) history: History<T>,
    pub(crate) work: Workspace<T>,
    pub(crate) monitors: Monitors<T>,
    pub(crate) adjustment: Option<StartAdjustment<T>>,
    pub(crate) statistics: Statistics,
    /// Whether a callback of the host has panicked.
    pub(crate) poisoned: bool,
}

/// The parts of a run that the caller chooses.
pub(crate) struct Parts<'a, T: Real> {
    pub(crate) system: Box<dyn System<T> + 'a>,
    pub(crate) contact_solver: Box<dyn ContactSolver<T> + 'a>,
    pub(crate) correctors: Vec<Box<dyn Corrector<T> + 'a>>,
    pub(crate) linear_solver: Box<dyn LinearSolver<T> + 'a>,
    /// The ranks of the system.
    pub(crate) together: Together<T>,
}

/// Monitors of the steps.
pub(crate) struct Monitors<T: Real> {
    /// The largest step size known to be stable.
    pub(crate) limit: StepLimit,
    /// The energy balance, if the caller has requested it.
    pub(crate) ledger: Option<Box<Ledger<T>>>,
    /// For runs that control their step size.
    pub(crate) judge: Option<Judge<T>>,
}

impl<T: Real> std::fmt::Debug for Simulation<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Simulation")
            .field("integrator", &self.scheme.integrator.name())
            .field("dofs", &self.parts.system.dofs())
            .field("constraints", &self.constraints)
            .field("correctors", &self.parts.correctors)
            .field("time", &self.state.motion.t)
            .field("statistics", &self.statistics)
            .finish_non_exhaustive()
    }
}

impl<T: Real> Simulation<'_, T> {
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

    /// How dofs without mass were moved when the simulation was built, because they were not in static balance with
    /// the others, the load and contact. Otherwise they would have jumped in the first step, at a cost that the
    /// energy balance does not contain. If the run [starts at rest](crate::SimulationBuilder::start_at_rest) all dofs
    /// count.
    ///
    /// It also stores the [impact](crate::StartImpact) that stopped the slip of a contact which friction jammed at
    /// the start. None if nothing was moved, and no velocity changed.
    pub fn start_adjustment(&self) -> Option<StartAdjustment<T>> {
        self.adjustment
    }

    /// Number of scalars in the factors of the effective matrices, as the linear solver counts them.
    pub fn factor_size(&self) -> usize {
        self.compiled.program.operators.iter().map(Operator::stored_values).sum()
    }

    /// The system.
    pub fn system(&self) -> &dyn System<T> {
        &*self.parts.system
    }

    /// A contact constraint, by its index in the order in which they were given: the first number of a
    /// [`ContactId`](crate::contact::ContactId). A host that needs the type of its own constraint keeps it, and
    /// passes a wrapper that shares it.
    pub fn constraint(&self, constraint: usize) -> Option<&dyn ContactConstraint<T>> {
        self.constraints.part(constraint)
    }

    /// The iterations of Newton's method in the stage that was solved last, also if it failed; empty for linear systems
    /// and for stages that are linear in their unknown.
    ///
    /// ```
    /// # use contact_dynamics::{GeneralizedAlpha, LinearSystem, Simulation};
    /// # use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// # let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 1.0)])?;
    /// # let system = LinearSystem::lumped(vec![1.0], k)?;
    /// # let mut run = Simulation::builder(system, GeneralizedAlpha::default(), 0.1).build()?;
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
    /// conserves: its change over a step is the sum of the impulses, to rounding.
    ///
    /// This is the momentum of the velocities v + p h a, up to O(h²), with a p of the scheme: 0 for the trapezoidal
    /// rule, ½ for central differences, whose conserved velocities are half a step ahead. Under a force F, contact
    /// included, the value therefore depends on h: [`set_step_size`](Self::set_step_size) from h to h' changes it by
    /// p (h' − h) F, but does not change the state.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the direction has the wrong length.
    pub fn momentum(&self, direction: &[T]) -> Result<T> {
        self.check_sound()?;
        let dofs = self.parts.system.dofs();
        if direction.len() != dofs {
            return Err(Error::Dimension { what: "the direction", expected: dofs, found: direction.len() });
        }
        let history = &self.history;
        let sum = self.scheme.momentum(&self.state.motion, &history.slots[1..history.known], history.clock.h);
        let mut product = vec![T::zero(); dofs];
        self.parts.system.mass().add_product(T::one(), &sum, &mut product);
        self.parts.together.dot(&product, direction)
    }

    /// The impulses of all contacts on each dof (force × time), friction and corrections included, in the last step
    /// that this simulation has made; empty without constraints.
    ///
    /// Their sum over the dofs of a body along a direction is the impulse of contact on that body: under no other
    /// force along that direction it is the change of the body's [`momentum`](Self::momentum), to rounding. Over two
    /// bodies that touch only each other the sum is zero.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{GeneralizedAlpha, LinearRows, LinearSystem, Simulation};
    ///
    /// // Two free masses, of which the first runs into the second with speed 2.
    /// let none = [Triplet::new(0, 0, 0.0), Triplet::new(1, 1, 0.0)];
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &none)?;
    /// let system = LinearSystem::lumped(vec![1.0; 2], free)?;
    /// let gap = LinearRows::new().unilateral(&[(0, -1.0), (1, 1.0)], 0.05);
    /// let mut run = Simulation::builder(system, GeneralizedAlpha::default(), 0.1)
    ///     .velocity(vec![2.0, 0.0])
    ///     .constraint(gap)
    ///     .build()?;
    /// run.step()?;
    /// let [first, second] = run.impulses_on_dofs() else { panic!("two dofs") };
    /// assert!((first + 1.0).abs() < 1e-12 && (second - 1.0).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn impulses_on_dofs(&self) -> &[T] {
        self.work.contact.impulses.last()
    }

    /// Refuses calls after a panic of the host.
    pub(crate) fn check_sound(&self) -> Result<()> {
        if self.poisoned { Err(Error::Poisoned) } else { Ok(()) }
    }

    /// Runs a call that changes the run and calls the host. If the host panics, state and history are restored before
    /// the panic continues, and later calls are refused.
    pub(crate) fn guarded<R>(&mut self, call: impl FnOnce(&mut Self) -> Result<R>) -> Result<R> {
        self.check_sound()?;
        // Unwind safe: state and history are restored below, and later calls are refused.
        match catch_unwind(AssertUnwindSafe(|| call(self))) {
            Ok(result) => result,
            Err(panic) => {
                self.poisoned = true;
                if self.work.backup.underway {
                    self.put_back();
                }
                // The others do not wait for a rank that has panicked.
                self.parts.together.finish::<()>(Err(Error::Poisoned)).ok();
                resume_unwind(panic)
            }
        }
    }

    /// Restores state and history as they were when the attempt of a step began.
    pub(crate) fn put_back(&mut self) {
        let Self { state, history, work, .. } = self;
        work.backup.undo(&mut history.slots);
        std::mem::swap(&mut state.motion, &mut history.slots[0]);
        work.backup.underway = false;
    }

    /// Kinetic and elastic energy of the state, and the balance if the builder requested it.
    ///
    /// Takes `&mut self`, as [`reactions`](Self::reactions) does, because the host evaluates its energy and its
    /// forces with memory of its own ([`System::potential_energy`], [`System::force`]). The run does not change.
    pub fn energy(&mut self) -> Energy<T> {
        energy::energy(&mut *self.parts.system, &self.parts.together, &self.state, self.monitors.ledger.as_deref())
    }

    /// Forces of the supports on the system, one a prescribed dof: R = M a − f(t, u, v) − Gᵀ λ.
    ///
    /// # Errors
    ///
    /// Errors of the host.
    pub fn reactions(&mut self) -> Result<Vec<T>> {
        self.check_sound()?;
        let reactions = energy::reactions(&mut *self.parts.system, &self.state, (&self.constraints, &self.g));
        self.parts.together.finish(reactions)
    }
}
