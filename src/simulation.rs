//! The simulation: one system, one integrator, contacts and correctors, advanced step by step.

mod builder;
mod constraints;
mod energy;
mod program;
mod start;

pub use builder::SimulationBuilder;
pub(crate) use constraints::Constraints;
pub use energy::{Energy, Works};

use crate::contact::{Candidates, ContactJacobian, ContactLaw, GapRates};
use crate::contact_solver::{Bound, ContactProblem, ContactSolver};
use crate::corrector::{
    Backup, Buffers, Correction, Corrector, Erased, ErasedGaps, Gaps, Scheme, contact_error, rounding,
};
use crate::error::{Error, Result};
use crate::integrator::TimeIntegrator;
use crate::observer::{Control, Observer, StepView};
use crate::real::Real;
use crate::state::{ContactState, History, Motion, State};
use crate::system::System;
use crate::tableau::Momentum;
use energy::{Ledger, StepBooks};
use program::{CompiledStage, Operator, Program};

/// Work counts since the start of a simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Statistics {
    /// Accepted steps.
    pub steps: u64,
    /// Solves with the effective matrix, responses of contact rows not counted.
    pub linear_solves: u64,
    /// Effective matrices factorized.
    pub factorizations: u64,
    /// Contact problems solved; a stage in which nothing comes near has none.
    pub contact_solves: u64,
    /// Active-set iterations of all contact problems together.
    pub contact_iterations: u64,
    /// Contacts that closed or opened, counted at the end of each step.
    pub contact_changes: u64,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The time was reached.
    Reached,
    /// An observer stopped the run.
    Stopped,
}

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
    integrator: Box<dyn TimeIntegrator + 'a>,
    momentum: Momentum,
    program: Program<T>,
    /// The one-step scheme of the first steps, dropped once the past is known.
    startup: Option<Program<T>>,
    depth: usize,
    state: State<T>,
    history: History<T>,
    work: Workspace<T>,
    ledger: Option<Ledger<T>>,
    statistics: Statistics,
}

/// Memory of a step. Nothing in it changes a result.
struct Workspace<T: Real> {
    /// Residual, then the increment d; one a dof.
    increment: Vec<T>,
    /// ū, v̄, ā where the balance does not hold at the recovered state.
    balance: Option<Motion<T>>,
    prescribed: Vec<usize>,
    /// Prescribed u, v, a at the time of the state and at that of the balance.
    supports: Vec<[T; 3]>,
    balance_supports: Vec<[T; 3]>,
    /// Whether M couples prescribed dofs with free ones.
    coupled_mass: bool,
    trial: ContactState<T>,
    was_closed: Vec<bool>,
    rows: ContactRowsWork<T>,
    buffers: Buffers<T>,
    projection: Option<crate::corrector::JumpProjection<T>>,
    backup: Backup<T>,
    /// Change of kinetic energy by corrections in this step.
    correction_energy: T,
}

/// Buffers of the contact problem, one entry a candidate unless said otherwise.
struct ContactRowsWork<T> {
    gaps: Vec<T>,
    rates: Vec<GapRates<T>>,
    tolerance: Vec<T>,
    in_problem: Vec<bool>,
    /// Rows of the problem, and its data, one entry a row of the problem.
    problem: Vec<usize>,
    delassus: Vec<T>,
    offset: Vec<T>,
    problem_tolerance: Vec<T>,
    bounds: Vec<Bound>,
    multipliers: Vec<T>,
}

impl<T: Real> std::fmt::Debug for Simulation<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Simulation")
            .field("integrator", &self.integrator.name())
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

    /// Takes whole steps and stops at the first grid time ≥ `t` − 1e-9 h, or when the observer says so.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if `t` is not finite, and those of [`step`](Self::step).
    pub fn run_until(&mut self, t: f64, observer: &mut dyn Observer<T>) -> Result<Outcome> {
        if !t.is_finite() {
            return Err(Error::Parameter { name: "the end time", value: t, range: "finite" });
        }
        while self.history.clock.at(0.0) < t - 1e-9 * self.history.clock.h {
            self.step()?;
            let view = StepView {
                state: &self.state,
                gaps: &self.work.rows.gaps[..self.constraints.len()],
                h: self.history.clock.h,
                statistics: &self.statistics,
            };
            if observer.observe(&view) == Control::Stop {
                return Ok(Outcome::Stopped);
            }
        }
        Ok(Outcome::Reached)
    }

    /// Takes one step.
    ///
    /// # Errors
    ///
    /// [`Error::StepNotFinite`], [`Error::ContactNotFinite`], [`Error::DependentContacts`], [`Error::Contact`], or what the host's own parts return. State and
    /// history are then as they were.
    pub fn step(&mut self) -> Result<()> {
        if let Some(ledger) = &mut self.ledger {
            ledger.begin(&self.state);
        }
        let Self { constraints, g, state, history, work, .. } = self;
        let found = constraints.search(state.motion.t, &state.motion.u, &state.motion.v, g)?;
        if found == Candidates::Changed {
            let programs = std::iter::once(&mut self.program).chain(&mut self.startup);
            programs.flat_map(|program| &mut program.operators).for_each(Operator::reset);
            if let Some(projection) = &mut work.projection {
                projection.reset();
            }
        }
        work.trial.carry_over(&state.contacts, &constraints.ids);
        work.backup.begin();
        work.correction_energy = T::zero();
        std::mem::swap(&mut state.motion, &mut history.slots[0]);
        let result = self.stages().and_then(|()| self.accept());
        if result.is_err() {
            let Self { state, history, work, .. } = self;
            work.backup.undo(&mut history.slots);
            std::mem::swap(&mut state.motion, &mut history.slots[0]);
        }
        result
    }

    /// Makes the motion in slot 0 of the history the state. An error leaves state and history to be undone.
    fn accept(&mut self) -> Result<()> {
        let Self { system, g, state, history, work, statistics, ledger, .. } = self;
        let books = StepBooks { g, corrections: work.correction_energy, h: history.clock.h };
        let new = &history.slots[0];
        if let Some(ledger) = ledger {
            ledger.prepare(&mut **system, new, &work.trial, &books)?;
        }
        system.commit(new.t, &new.u, &new.v)?;
        if let Some(ledger) = ledger {
            ledger.end(&mut **system, new, &work.trial, &books);
        }
        // The stages between drop out of the past.
        let stages = work.backup.rotations;
        history.slots[1..].rotate_left(stages - 1);
        std::mem::swap(&mut state.motion, &mut history.slots[0]);
        let old = &state.contacts.closed;
        let changed = |(i, &closed): (usize, &bool)| closed != old.get(i).copied().unwrap_or(false);
        statistics.contact_changes += work.trial.closed.iter().enumerate().filter(|&x| changed(x)).count() as u64;
        std::mem::swap(&mut state.contacts, &mut work.trial);
        history.known = (history.known + 1).min(self.depth);
        history.clock.steps += 1;
        statistics.steps += 1;
        if history.known == self.depth {
            self.startup = None;
        }
        Ok(())
    }

    /// All stages of a step. On entry slot 0 of the history holds the current motion.
    fn stages(&mut self) -> Result<()> {
        let Self { system, constraints, g, contact_solver, correctors, history, work, statistics, .. } = self;
        let program = match &mut self.startup {
            Some(startup) => startup,
            None => &mut self.program,
        };
        let clock = history.clock;
        for stage in &program.stages {
            history.slots.rotate_right(1);
            work.backup.rotations += 1;
            let Some((new, past)) = history.slots.split_first_mut() else {
                continue;
            };
            new.t = clock.at(stage.end);
            let operator = &mut program.operators[stage.operator];
            residual(stage, clock.at(stage.load), &mut **system, new, past, work)?;
            operator.solve(&mut work.increment);
            statistics.linear_solves += 1;
            if !T::all_finite(&work.increment) {
                let dof = work.increment.iter().position(|x| !x.is_finite()).unwrap_or(0);
                let value = work.increment[dof].value();
                return Err(Error::StepNotFinite { t: clock.at(0.0), h: clock.h, what: "the increment", dof, value });
            }
            let [w_u, w_v, w_a] = stage.recovery.weights;
            T::axpy(w_u, &work.increment, &mut new.u);
            if constraints.len() > 0 {
                solve_contact(operator, constraints, g, &mut **contact_solver, w_u, new, work, statistics)?;
            }
            T::axpy(w_v, &work.increment, &mut new.v);
            if stage.recovery.reads_past(2) {
                T::axpy(w_a, &work.increment, &mut new.a);
            } else {
                T::scale_into(w_a, &work.increment, &mut new.a);
            }
            for (&dof, support) in work.prescribed.iter().zip(&work.supports) {
                new.a[dof] = support[2];
            }
            if constraints.len() > 0 {
                close_contacts(clock.h, constraints, g, new, stage, work)?;
                if let Some(projection) = work.projection.as_mut().filter(|_| !work.buffers.closed.is_empty()) {
                    let mut correction = Correction {
                        h: clock.h,
                        t: new.t,
                        scheme: Scheme {
                            acceleration: stage.acceleration,
                            balance: stage.balance_acceleration,
                            covector: &stage.covector,
                            read: &stage.read,
                        },
                        g,
                        projection,
                        solver: &mut **contact_solver,
                        system: Erased(&mut **system),
                        constraints: ErasedGaps(constraints),
                        new,
                        past,
                        backup: &mut work.backup,
                        contacts: &mut work.trial,
                        was_closed: &work.was_closed,
                        buffers: &mut work.buffers,
                        energy: &mut work.correction_energy,
                    };
                    for corrector in correctors.iter() {
                        corrector.correct(&mut correction)?;
                    }
                }
            }
        }
        Ok(())
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
        &self.work.rows.gaps[..self.constraints.len()]
    }

    /// Work counts.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Number of scalars in the factors of the effective matrices.
    pub fn factor_size(&self) -> usize {
        self.program.operators.iter().map(Operator::stored_values).sum()
    }

    /// The system.
    pub fn system(&self) -> &dyn System<T> {
        &*self.system
    }

    /// Momentum along a direction (one entry a dof, for instance 1 on all x displacements) in the form that the scheme conserves.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] if the direction has the wrong length.
    #[allow(clippy::cast_precision_loss)]
    pub fn momentum(&self, direction: &[T]) -> Result<T> {
        let dofs = self.system.dofs();
        if direction.len() != dofs {
            return Err(Error::Dimension { what: "the direction", expected: dofs, found: direction.len() });
        }
        let h = self.history.clock.h;
        let mut sum = vec![T::zero(); dofs];
        let newest = &self.state.motion;
        for (k, psi) in self.momentum.after_step().iter().enumerate().take(self.history.known) {
            let motion = if k == 0 { newest } else { &self.history.slots[k] };
            // Displacements enter with weights that sum to zero: differences keep their digits.
            for ((sum, &u), &u0) in sum.iter_mut().zip(&motion.u).zip(&newest.u) {
                *sum += T::of(psi[0] / h) * (u - u0);
            }
            T::axpy(T::of(psi[1]), &motion.v, &mut sum);
            T::axpy(T::of(psi[2] * h), &motion.a, &mut sum);
        }
        let mut product = vec![T::zero(); dofs];
        self.system.mass().product(T::one(), &sum, &mut product);
        Ok(product.iter().zip(direction).map(|(&p, &d)| p * d).sum())
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
        energy::reactions(&mut *self.system, &self.state, &self.g)
    }
}

/// Predicts the new motion at d = 0 and leaves f(t̄, ū, v̄) − M ā there in `work.increment`.
fn residual<T: Real>(
    stage: &CompiledStage<T>,
    t_balance: f64,
    system: &mut dyn System<T>,
    new: &mut Motion<T>,
    past: &[Motion<T>],
    work: &mut Workspace<T>,
) -> Result<()> {
    let Workspace { increment, balance, prescribed, supports, balance_supports, coupled_mass, .. } = work;
    stage.recovery.predict(past, &mut [&mut new.u, &mut new.v, &mut new.a]);
    if !prescribed.is_empty() {
        system.prescribed_motion(new.t, supports);
        for (&dof, support) in prescribed.iter().zip(supports.iter()) {
            (new.u[dof], new.v[dof]) = (support[0], support[1]);
        }
    }
    let (rows, supports) = match (&stage.balance, balance.as_mut()) {
        (Some(rows), Some(balance)) => {
            rows.predict(past, &mut [&mut balance.u, &mut balance.v, &mut balance.a]);
            if !prescribed.is_empty() {
                system.prescribed_motion(t_balance, balance_supports);
                for (&dof, support) in prescribed.iter().zip(balance_supports.iter()) {
                    (balance.u[dof], balance.v[dof]) = (support[0], support[1]);
                }
            }
            system.force(t_balance, &balance.u, &balance.v, increment)?;
            (rows, balance_supports)
        }
        _ => {
            system.force(t_balance, &new.u, &new.v, increment)?;
            (&stage.recovery, supports)
        }
    };
    // ā at d = 0: the past's part on free dofs (none where the balance holds at the recovered state), and the motion of the supports.
    if rows.reads_past(2) || *coupled_mass {
        let acceleration = match (&stage.balance, balance.as_mut()) {
            (Some(_), Some(balance)) => &mut balance.a,
            _ => &mut new.a,
        };
        if !rows.reads_past(2) {
            acceleration.fill(T::zero());
        }
        for (&dof, support) in prescribed.iter().zip(supports.iter()) {
            acceleration[dof] = support[2];
        }
        system.mass().product(-T::one(), acceleration, increment);
    }
    for &dof in prescribed.iter() {
        increment[dof] = T::zero();
    }
    Ok(())
}

/// Finds the multipliers of the stage and adds their response to d and u.
fn solve_contact<T: Real>(
    operator: &mut Operator<T>,
    constraints: &mut Constraints<'_, T>,
    g: &ContactJacobian<T>,
    solver: &mut dyn ContactSolver<T>,
    w_u: T,
    new: &mut Motion<T>,
    work: &mut Workspace<T>,
    statistics: &mut Statistics,
) -> Result<()> {
    let Workspace { increment, prescribed, trial, rows, .. } = work;
    let ContactRowsWork { gaps, tolerance, in_problem, problem, delassus, offset, problem_tolerance, .. } = rows;
    let (bounds, multipliers) = (&mut rows.bounds, &mut rows.multipliers);
    let count = constraints.len();
    constraints.finite_gaps(new.t, &new.u, gaps)?;
    let mut needed = false;
    for row in 0..count {
        tolerance[row] = rounding(g.magnitude(row, &new.u) + gaps[row].abs());
        let violated = gaps[row] < -tolerance[row] || constraints.law(row) == ContactLaw::Equality;
        in_problem[row] = violated || trial.lambda_raw[row] > T::zero();
        needed |= violated;
    }
    if !needed {
        trial.lambda_raw.fill(T::zero());
        return Ok(());
    }
    // Solve on the rows that may be active; whoever is pushed in by that joins. The set only grows: this ends.
    loop {
        problem.clear();
        problem.extend((0..count).filter(|&row| in_problem[row]));
        for &row in problem.iter() {
            operator.prepare(g, row, prescribed);
        }
        for buffer in [&mut *delassus, &mut *offset, &mut *problem_tolerance, &mut *multipliers] {
            buffer.clear();
        }
        bounds.clear();
        for &j in problem.iter() {
            delassus.extend(problem.iter().map(|&i| w_u * g.product(i, operator.response(j))));
            offset.push(gaps[j]);
            problem_tolerance.push(tolerance[j]);
            multipliers.push(trial.lambda_raw[j]);
            bounds.push(match constraints.law(j) {
                ContactLaw::Equality => Bound::Free,
                ContactLaw::Rigid => Bound::NonNegative,
            });
        }
        let data = ContactProblem { delassus, offset, bounds, tolerance: problem_tolerance };
        let solved = solver.solve(&data, multipliers);
        statistics.contact_solves += 1;
        statistics.contact_iterations +=
            solved.map_err(|failure| contact_error(new.t, failure, |i| constraints.ids[problem[i]]))? as u64;
        let mut grown = false;
        for row in 0..count {
            if !in_problem[row] {
                let push = |(&j, &lambda): (&usize, &T)| w_u * lambda * g.product(row, operator.response(j));
                let gap = gaps[row] + problem.iter().zip(multipliers.iter()).map(push).sum::<T>();
                if gap < -tolerance[row] {
                    (in_problem[row], grown) = (true, true);
                }
            }
        }
        if !grown {
            break;
        }
    }
    trial.lambda_raw.fill(T::zero());
    for (&row, &lambda) in problem.iter().zip(multipliers.iter()) {
        if !lambda.is_finite() {
            let contact = constraints.ids[row];
            return Err(Error::ContactNotFinite { t: new.t, what: "the multiplier", contact, value: lambda.value() });
        }
        if lambda != T::zero() {
            trial.lambda_raw[row] = lambda;
            T::axpy(lambda, operator.response(row), increment);
            T::axpy(w_u * lambda, operator.response(row), &mut new.u);
        }
    }
    Ok(())
}

/// Decides which contacts are closed, and starts the books of the stage: reported force, impulse, corrections.
fn close_contacts<T: Real>(
    h: f64,
    constraints: &mut Constraints<'_, T>,
    g: &ContactJacobian<T>,
    new: &Motion<T>,
    stage: &CompiledStage<T>,
    work: &mut Workspace<T>,
) -> Result<()> {
    let first = work.backup.rotations == 1;
    let Workspace { trial, rows, buffers, was_closed, .. } = work;
    constraints.finite_gaps(new.t, &new.u, &mut rows.gaps)?;
    constraints.rates(new.t, &new.u, &new.v, &mut rows.rates);
    was_closed.clear();
    was_closed.extend_from_slice(&trial.closed);
    buffers.closed.clear();
    let impulse_weight = T::of(h * stage.impulse_weight);
    for row in 0..constraints.len() {
        let (gap, raw) = (rows.gaps[row], trial.lambda_raw[row]);
        let rate = g.product(row, &new.v) + rows.rates[row].rate;
        let tolerance = rounding(g.magnitude(row, &new.u) + gap.abs()) + T::of(1e-10 * h) * rate.abs();
        let closed = raw > T::zero() || gap <= tolerance || constraints.law(row) == ContactLaw::Equality;
        trial.closed[row] = closed;
        if closed {
            buffers.closed.push(row);
        }
        trial.lambda[row] = raw;
        (trial.lambda_v[row], trial.lambda_a[row]) = (T::zero(), T::zero());
        let before = if first { T::zero() } else { trial.impulse[row] };
        trial.impulse[row] = before + impulse_weight * raw;
    }
    Ok(())
}
