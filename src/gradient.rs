//! Derivatives of a recorded run: how an objective changes with initial values, gaps and the parameters of a model.
//!
//! - [`objective`](Objective): the number that is differentiated, a sum over the states of a run.
//! - [`parameters`](Parameters): what the host wants derivatives by.
//! - `support`: which runs are recorded; [`Simulation::record`] begins, [`Simulation::gradient`] goes back.
//! - `backward`: from the last step to the first; `stage`: the transpose of a stage, `changes`: of its corrections,
//!   `start`: of the state at the start; `conditions`: of contact conditions, `products`: products with K and C,
//!   `turning`: rows that turn, `replay`: steps taken again from checkpoints.

mod backward;
mod changes;
mod conditions;
mod objective;
mod parameters;
mod products;
mod replay;
mod stage;
mod start;
mod support;
mod turning;

pub use objective::{Objective, RecordedStep, Seed};
pub use parameters::{Balance, CompliantContact, Parameters, Scales};

use crate::contact::ContactId;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::Simulation;
use crate::state::{Checkpoints, Tape};

/// The derivatives of an objective J by initial values and gaps; see [`Simulation::gradient`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Gradient<T> {
    /// J.
    pub value: T,
    /// ∂J/∂u₀, one a dof; zero on prescribed dofs.
    pub displacement: Vec<T>,
    /// ∂J/∂v₀, one a dof; zero on prescribed dofs.
    pub velocity: Vec<T>,
    /// The derivative by a constant added to the gap of a contact during the whole run, for each contact that has
    /// carried a force; ascending.
    pub gaps: Vec<(ContactId, T)>,
    /// The derivative by the friction coefficient of each contact that has slid; ascending.
    pub friction: Vec<(ContactId, T)>,
}

impl<T: Real> Gradient<T> {
    /// The derivative by a constant added to the gap of a contact; zero for one that never carried a force.
    pub fn gap(&self, contact: ContactId) -> T {
        self.gaps.binary_search_by_key(&contact, |&(id, _)| id).map_or(T::zero(), |place| self.gaps[place].1)
    }
}

impl<T: Real> Simulation<'_, T> {
    /// Records the run from here on, so that [`gradient`](Self::gradient) can go back through it. Called before the
    /// first step. A recorded step keeps its state, and one more motion and the closed rows for each stage. A run that
    /// is recorded already begins a new tape only if no step was taken.
    ///
    /// # Errors
    ///
    /// [`Error::Incompatible`] names the part that has no derivative here: dofs without mass, ranks, correctors other
    /// than [`PersistencyCorrection`](crate::PersistencyCorrection), unsymmetric effective matrices, forces along a path,
    /// nonlinear damping with a correction, rows that turn (curved obstacles, meshes that slide on each other) with a
    /// scheme that imposes contact on velocities, at the start overlaps that gaps leave out, a force of a compliant law
    /// or friction that slides in space; and a run that has taken steps.
    ///
    /// [`gradient`](Self::gradient) refuses what occurred in the run: forces under other [laws](crate::ContactLaw) than
    /// `Rigid`, `Equality`, `Penalty`, `PowerLaw`, `KelvinVoigt` and `HuntCrossley`, changes of the step size if the
    /// scheme reads more than u, v and a of the last state, restarts, damping that a step does not resolve, penetration
    /// recovered over several steps, and along rows that turn friction, damped laws, projections of the past, and places
    /// where rows jump.
    pub fn record(&mut self) -> Result<()> {
        self.check_sound()?;
        let past = support::check(self)?;
        let presses = |&row: &usize| self.state.contacts.lambda[row] != T::zero();
        let held =
            (0..self.constraints.len()).filter(|row| presses(row) || self.constraints.laws()[*row].is_equality());
        self.work.tape = Some(Box::new(Tape::new(self.state.clone(), held.collect(), past)));
        self.work.correction.buffers.changes = Some(Box::default());
        Ok(())
    }

    /// [`record`](Self::record) with less memory: of N steps some √N states are kept, and [`gradient`](Self::gradient)
    /// takes the steps between them again, some √N at a time. It takes the time of another run.
    ///
    /// The steps taken again call [`System::commit`](crate::System::commit) again.
    ///
    /// # Errors
    ///
    /// As [`record`](Self::record). [`gradient`](Self::gradient) refuses runs in which bonds have broken.
    pub fn record_checkpoints(&mut self) -> Result<()> {
        self.record()?;
        if let Some(tape) = &mut self.work.tape {
            tape.checkpoints = Some(Checkpoints::new(self.state.clone(), self.history.clone()));
        }
        Ok(())
    }

    /// The derivatives of an objective of the recorded run, by the discrete adjoint: the transpose of every step, from
    /// the last to the first. They are the derivatives of what the program computes, and belong to the contacts that
    /// closed and opened: a step in which a contact closes under other parameters is a kink.
    ///
    /// A linear step back costs about one solve, as a step does; a nonlinear one a factorization and a solve. The tape
    /// stays, and the run may go on.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::SparseColMat;
    /// use contact_dynamics::gradient::{RecordedStep, Seed};
    /// use contact_dynamics::{ContactLaw, GeneralizedAlpha, LinearRows, LinearSystem, Simulation};
    ///
    /// // A ball of mass 2 falls on a bed of stiffness 800. How does the largest force depend on the speed?
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[])?;
    /// let bed = LinearRows::new().row(ContactLaw::Penalty { stiffness: 800.0 }, &[(0, 1.0)], 0.1);
    /// let mut run = Simulation::builder(LinearSystem::lumped(vec![2.0], free)?, GeneralizedAlpha::default(), 1e-4)
    ///     .velocity(vec![-3.0])
    ///     .constraint(bed)
    ///     .build()?;
    /// run.record()?;
    /// run.run_until(0.1 / 3.0 + std::f64::consts::PI / 40.0, &mut ())?; // a quarter of a period after it touches
    /// let mut last_force = |step: &RecordedStep<'_, f64>, seed: &mut Seed<'_, f64>| {
    ///     if step.step < step.steps {
    ///         return 0.0;
    ///     }
    ///     seed.force[0] += 1.0;
    ///     step.state.contacts().forces()[0]
    /// };
    /// let gradient = run.gradient(&mut last_force, &mut ())?;
    /// // F = v √(k m), so that dF/dv = −√(k m) with v downward.
    /// assert!((gradient.value - 120.0).abs() < 1e-2 && (gradient.velocity[0] + 40.0).abs() < 1e-2);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Incompatible`] if nothing was recorded, or names what happened in the run that has no derivative;
    /// errors of the linear solver, of the system, and of the parameters.
    pub fn gradient(
        &mut self,
        objective: &mut dyn Objective<T>,
        parameters: &mut dyn Parameters<T>,
    ) -> Result<Gradient<T>> {
        self.guarded(|run| {
            let Some(tape) = run.work.tape.take() else {
                let reason = "the run is not recorded: call `record` before the first step";
                return Err(Error::Incompatible { part: "the gradient".into(), reason });
            };
            if tape.checkpoints.is_some() && !run.state.broken.is_empty() {
                run.work.tape = Some(tape);
                let reason = "steps are not taken again before a bond has broken: call `record`";
                return Err(Error::Incompatible { part: "the gradient by checkpoints".into(), reason });
            }
            let h = run.history.clock.h;
            let result = backward::run_backward(run, &tape, objective, parameters);
            run.work.tape = Some(tape);
            let restored = run.compile_for(h);
            run.search_again();
            let gradient = result?;
            restored?;
            Ok(gradient)
        })
    }
}
