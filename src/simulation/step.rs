//! One step: stages, corrections, acceptance; a failed step leaves everything as it was.

use super::contact_step::{ContactStep, Part};
use super::control::Verdict;
use super::curved_rows::FOLLOWED;
use super::energy::StepBooks;
use super::finite::{Extent, check_contacts, check_motion};
use super::operator::Operator;
use super::program::CompiledStage;
use super::supports::put_supports;
use super::{Constraints, Simulation, Statistics, Workspace};
use crate::contact::ContactJacobian;
use crate::contact_solver::{ContactFailure, ContactSolver};
use crate::corrector::{Correction, Erased, ErasedGaps, JumpProjection, Prediction, Scheme, contact_error};
use crate::error::{Error, Result};
use crate::mass::Mass;
use crate::real::Real;
use crate::real::kernels::Accumulate;
use crate::state::{Clock, Motion};
use crate::system::System;
use crate::tableau::impulse_weight;

impl<T: Real> Simulation<'_, T> {
    /// Takes one step: with [`step_control`](super::SimulationBuilder::step_control) of whatever size succeeds.
    ///
    /// # Errors
    ///
    /// [`Error::StepNotFinite`], [`Error::ContactNotFinite`], [`Error::ContradictoryContacts`], [`Error::Contact`],
    /// [`Error::NewtonNotConverged`], [`Error::IndefiniteTangent`], [`Error::ContactLost`], [`Error::PassedThrough`],
    /// [`Error::LinearNotConverged`], [`Error::TimeNotAdvancing`], or what the host's own parts return;
    /// [`Error::StepRefused`] in place of those if smaller steps were tried. State and history are then as they
    /// were. [`Error::Poisoned`] after a panic of the host that was caught.
    pub fn step(&mut self) -> Result<()> {
        self.guarded(|run| match run.judge {
            Some(_) => run.controlled_step(),
            None => run.attempt().map(drop),
        })
    }

    /// Tries a step of the present size.
    pub(super) fn attempt(&mut self) -> Result<Verdict> {
        let Self { constraints, g, state, history, work, ledger, scheme, .. } = self;
        history.clock.check()?;
        constraints.search(&state.motion, scheme.ahead() * history.clock.h, g)?;
        work.trial.carry_over(&state.contacts, &constraints.ids);
        if let Some(ledger) = ledger {
            ledger.begin(state);
        }
        work.closed_at_start.clone_from(&work.trial.closed);
        work.backup.begin();
        work.correction_energy = T::zero();
        std::mem::swap(&mut state.motion, &mut history.slots[0]);
        work.backup.underway = true;
        let result = self.stages().and_then(|()| self.inspect()).and_then(|()| self.accept());
        let clock = self.history.clock;
        let result = result.map_err(|error| error.in_step(clock.at(0.0), clock.h));
        if matches!(result, Ok(Verdict::Accepted)) {
            self.work.backup.underway = false;
        } else {
            self.undo();
        }
        result
    }

    /// Undoes what an attempt has done to state, history and rows.
    fn undo(&mut self) {
        self.put_back();
        let Self { constraints, g, state, history, scheme, .. } = self;
        // Rows may have followed the trial: back to the state. Should this search fail, the next step fails with its
        // error.
        constraints.search(&state.motion, scheme.ahead() * history.clock.h, g).ok();
    }

    /// Lets the constraints look at the motion in slot 0 of the history. Where a contact has closed, and now and then,
    /// rates of gaps are compared with their motion.
    fn inspect(&mut self) -> Result<()> {
        const NOW_AND_THEN: u64 = 64;
        let Self { constraints, g, history, work, .. } = self;
        let [new, past @ ..] = &history.slots[..] else { return Ok(()) };
        // (States of the past that were edited have their displacements.)
        let (start, closed) = (&past[work.backup.rotations - 1], [&work.closed_at_start[..], &work.trial.closed]);
        if history.clock.steps % NOW_AND_THEN == 0 || closed[0].iter().zip(closed[1]).any(|(was, is)| *is && !was) {
            constraints.check_rates(start, history.clock.h, g)?;
        }
        constraints.inspect([start, new], closed)
    }

    /// Puts state and history back to where an attempt began.
    pub(super) fn put_back(&mut self) {
        let Self { state, history, work, .. } = self;
        work.backup.undo(&mut history.slots);
        std::mem::swap(&mut state.motion, &mut history.slots[0]);
        work.backup.underway = false;
    }

    /// Makes the motion in slot 0 of the history the state. An error or another verdict leaves state and history to be
    /// undone.
    fn accept(&mut self) -> Result<Verdict> {
        let Self { system, constraints, g, state, history, work, statistics, ledger, scheme, judge, .. } = self;
        let stages = work.backup.rotations;
        let flags = work.trial.closed.iter().zip(&work.closed_at_start);
        let changes = flags.filter(|(now, before)| now != before).count();
        let [new, past @ ..] = &history.slots[..] else { return Ok(Verdict::Accepted) };
        let finite = scheme.show(new, (changes == 0).then(|| &past[stages - 1]), &work.prescribed, &mut work.shown);
        let step = (history.clock.at(0.0), history.clock.h);
        // Recovery has looked at what it wrote. Left are dofs whose velocity is differenced, and what corrections have
        // edited.
        let touched = work.buffers.has_touched() && work.projection.is_some();
        let spreads = work.buffers.spreads() || matches!(system.mass(), Mass::Consistent(_));
        let extent = match work.newton.is_some() || touched && spreads {
            true => Extent::All,
            false => Extent::At([&work.massless, if constraints.len() > 0 { constraints.interface() } else { &[] }]),
        };
        check_motion(step.0, step.1, [&new.u, &new.v, &new.a], extent)?;
        if touched {
            for motion in work.backup.edited(past) {
                check_motion(step.0, step.1, [&motion.u, &motion.v, &motion.a], extent)?;
            }
        }
        if !finite {
            check_motion(step.0, step.1, [&new.u, new.shown(&work.shown, 1), new.shown(&work.shown, 2)], Extent::All)?;
        }
        check_contacts(new.t, &work.trial)?;
        let motion = [&new.u, new.shown(&work.shown, 1), new.shown(&work.shown, 2)];
        if let Some(judge) = judge {
            let verdict = judge.judge([motion[0], motion[1]], &work.prescribed, history.clock.h, changes);
            if verdict == Verdict::Coarse {
                return Ok(verdict);
            }
        }
        let corrections = work.correction_energy;
        let stage = &scheme.tableau.stages[scheme.tableau.stages.len() - 1];
        let (forces, load) = (work.rows.curved.forces(g), if self.startup.is_some() { 1.0 } else { stage.load });
        let (contacts, h) = (&work.trial, history.clock.h);
        let books = StepBooks { t: new.t, motion, contacts, g, forces, load, corrections, h };
        if let Some(ledger) = ledger {
            ledger.prepare(&mut **system, &books)?;
        }
        system.commit(new.t, motion[0], motion[1])?;
        if let Some(ledger) = ledger {
            ledger.end();
        }
        // The stages between drop out of the past.
        history.slots[1..].rotate_left(stages - 1);
        std::mem::swap(&mut state.motion, &mut history.slots[0]);
        std::mem::swap(&mut state.shown, &mut work.shown);
        std::mem::swap(&mut state.contacts, &mut work.trial);
        let depth = scheme.depth;
        history.known = (history.known + 1).min(depth);
        history.smooth = if changes > 0 { 1 } else { history.smooth + 1 };
        if !history.trail.is_empty() {
            history.trail.push(&history.slots[1], history.made_with);
            for (field, unmoved) in (1..).zip(&mut history.unmoved) {
                if let Some(front) = history.trail.front().filter(|_| !unmoved.is_empty()) {
                    std::mem::swap(front.rate_mut(field), unmoved);
                    unmoved.clear();
                }
            }
        }
        let (now, before) = (&state.motion.u, &history.slots[1].u);
        for (slope, &dof) in history.slopes.iter_mut().zip(&work.massless) {
            *slope = (now[dof] - before[dof]) / T::of(history.clock.h);
        }
        history.made_with = history.clock.h;
        history.clock.steps += 1;
        statistics.contact_changes += changes as u64;
        statistics.steps += 1;
        if history.known == depth {
            self.startup = None;
        }
        Ok(Verdict::Accepted)
    }

    /// All stages of a step. On entry slot 0 of the history holds the current motion.
    fn stages(&mut self) -> Result<()> {
        let Self { system, constraints, g, contact_solver, correctors, history, work, statistics, .. } = self;
        let (program, start_covector) = match &mut self.startup {
            // The covector of one state more than is known now.
            Some(startup) => (startup, Some(&self.scheme.covectors[history.known])),
            None => (&mut self.program, None),
        };
        let clock = history.clock;
        for (stages_before, stage) in program.stages.iter().enumerate() {
            let covector = start_covector.unwrap_or(&stage.covector);
            history.slots.rotate_right(1);
            work.backup.rotations += 1;
            let Some((new, past)) = history.slots.split_first_mut() else { continue };
            new.t = clock.at(stage.end);
            let operator = &mut program.operators[stage.operator];
            operator.follow(constraints.version());
            predict(stage, clock, &mut **system, new, past, work)?;
            if let Some(projection) = &mut work.projection {
                refresh(projection, &mut work.projected_rows, constraints.version());
                work.buffers.report(&work.trial, stages_before == 0);
                if !work.shifted.is_empty() {
                    let mut prediction = Prediction {
                        h: clock.h * stage.end,
                        t: new.t,
                        weights: [stage.recovery.weights()[0], stage.balanced().weights()[0]],
                        g,
                        projection,
                        solver: &mut **contact_solver,
                        constraints: ErasedGaps(constraints),
                        start: &past[0],
                        new,
                        balance: work.balance.as_mut().filter(|_| stage.balance.is_some()),
                        was_closed: &work.trial.closed,
                        massless: &work.massless,
                        prescribed: &work.prescribed,
                        ids: &work.trial.ids,
                        buffers: &mut work.buffers,
                        shifted: &mut work.shifted,
                    };
                    for corrector in correctors.iter() {
                        corrector.predict(&mut prediction)?;
                    }
                }
            }
            work.rows.read_start(constraints, g, past, clock.h)?;
            let (parts, solver) = (&mut **system, &mut **contact_solver);
            let mut solve = StageSolve { stage, clock, system: parts, operator, constraints, g, solver, statistics };
            match work.newton {
                Some(_) if work.block.is_none() => solve.by_iteration(new, past, work)?,
                _ => solve.directly(new, past, work)?,
            }
            for (&dof, support) in work.prescribed.iter().zip(&work.supports) {
                new.a[dof] = support[2];
            }
            if let (Some(start), false) = (past.get(stages_before), work.massless.is_empty()) {
                let intervals = [clock.h * stage.end, history.made_with];
                difference(&work.massless, &history.slopes, &start.u, intervals, new);
            }
            if constraints.len() > 0 {
                let solver = &mut **contact_solver;
                let part = if work.block.is_some() { Part::Massive } else { Part::All };
                let mut contact = ContactStep { stage, clock, constraints, g, solver, statistics, iterate: None, part };
                let is_last = stages_before + 1 == program.stages.len();
                contact.close(new, impulse_weight(stage.response, covector), is_last, work)?;
                if let Some(projection) = work.projection.as_mut().filter(|_| work.buffers.has_touched()) {
                    refresh(projection, &mut work.projected_rows, constraints.version());
                    let mut correction = Correction {
                        h: clock.h,
                        t: new.t,
                        scheme: Scheme {
                            response: stage.response,
                            acceleration: stage.acceleration,
                            balance: stage.balance_acceleration,
                            covector,
                            read: &stage.read,
                            stage: stages_before,
                            stages: program.stages.len(),
                        },
                        g,
                        projection,
                        operator,
                        solver: &mut **contact_solver,
                        system: Erased(&mut **system),
                        constraints: ErasedGaps(constraints),
                        new,
                        past,
                        backup: &mut work.backup,
                        contacts: &mut work.trial,
                        was_closed: &work.was_closed,
                        massless: &work.massless,
                        prescribed: &work.prescribed,
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
}

/// Makes a projection forget rows of another version.
fn refresh<T: Real>(projection: &mut JumpProjection<T>, known: &mut u64, version: u64) {
    if *known != version {
        *known = version;
        projection.reset();
    }
}

/// Gives dofs without mass a velocity: that of the parabola through their last three displacements. The rows of a
/// scheme find v from a, which such dofs do not have; it stays zero.
///
/// `slopes` are those of the interval before the `start` of the step, the second of the `intervals`.
fn difference<T: Real>(massless: &[usize], slopes: &[T], start: &[T], [now, before]: [f64; 2], new: &mut Motion<T>) {
    let curve = T::of(now / (now + before));
    for (&dof, &slope) in massless.iter().zip(slopes) {
        let newest = (new.u[dof] - start[dof]) / T::of(now);
        (new.v[dof], new.a[dof]) = (newest + curve * (newest - slope), T::zero());
    }
}

/// What a stage is solved with.
pub(super) struct StageSolve<'s, 'a, T: Real> {
    pub(super) stage: &'s CompiledStage<T>,
    pub(super) clock: Clock,
    pub(super) system: &'s mut dyn System<T>,
    pub(super) operator: &'s mut Operator<T>,
    pub(super) constraints: &'s mut Constraints<'a, T>,
    pub(super) g: &'s mut ContactJacobian<T>,
    pub(super) solver: &'s mut dyn ContactSolver<T>,
    pub(super) statistics: &'s mut Statistics,
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Moves the predicted motion of a linear system to where the balance and the contact conditions hold.
    fn directly(&mut self, new: &mut Motion<T>, past: &[Motion<T>], work: &mut Workspace<T>) -> Result<()> {
        residual(self.stage, self.clock.at(self.stage.load), self.system, new, work)?;
        if let Some(mut block) = work.block.take() {
            let settled = self.settle(&mut block, new, past, work);
            work.block = Some(block);
            settled?;
        }
        self.operator.begin(&mut work.increment, &mut work.interface.increment)?;
        work.interface.forces.fill(T::zero());
        self.statistics.linear_solves += 1;
        if self.constraints.len() > 0 && T::all_finite(&work.interface.increment) {
            let settled = self.contact(None, new, past, work)?;
            self.refuse_unsettled(settled, new.t, work)?;
        }
        self.operator.finish(&mut work.increment, &work.interface.increment, &work.interface.forces)?;
        let recovery = &self.stage.recovery;
        let accumulate = if recovery.reads_past(2) { Accumulate::Add } else { Accumulate::Replace };
        if T::recover(recovery.weights(), &work.increment, [&mut new.u, &mut new.v, &mut new.a], accumulate) {
            return Ok(());
        }
        // (What has been written is undone with the step.)
        self.refuse_nan(&work.increment, "the increment")?;
        check_motion(self.clock.at(0.0), self.clock.h, [&new.u, &new.v, &new.a], Extent::All)
    }

    /// Adds contact to the increment on the interface; `iterate` is what motions contain of the unknown already. Says
    /// whether curved rows fit where it ends.
    pub(super) fn contact(
        &mut self,
        iterate: Option<&[T]>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        work: &mut Workspace<T>,
    ) -> Result<bool> {
        let Self { stage, clock, system, operator, constraints, g, solver, statistics } = self;
        let part = if work.block.is_some() { Part::Massive } else { Part::All };
        let mut contact =
            ContactStep { stage, clock: *clock, constraints, g, solver: &mut **solver, statistics, iterate, part };
        contact.solve(&mut **system, operator, new, past, work)
    }

    /// Refuses contact whose curved rows do not fit where it ends.
    pub(super) fn refuse_unsettled(&self, settled: bool, t: f64, work: &Workspace<T>) -> Result<()> {
        if settled {
            return Ok(());
        }
        let (row, residual) = work.rows.curved.worst;
        let failure = ContactFailure::NotConverged { iterations: FOLLOWED, row, residual };
        Err(contact_error(t, failure, |row| self.constraints.ids[row]))
    }

    pub(super) fn refuse_nan(&self, values: &[T], what: &'static str) -> Result<()> {
        if T::all_finite(values) {
            return Ok(());
        }
        let dof = values.iter().position(|x| !x.is_finite()).unwrap_or(0);
        let value = values[dof].value();
        Err(Error::StepNotFinite { t: self.clock.at(0.0), h: self.clock.h, what, dof, value })
    }
}

/// Predicts the new motion at d = 0, and that of the balance where it holds elsewhere: displacements and velocities
/// with the supports in place, and what accelerations have of the past.
fn predict<T: Real>(
    stage: &CompiledStage<T>,
    clock: Clock,
    system: &mut dyn System<T>,
    new: &mut Motion<T>,
    past: &[Motion<T>],
    work: &mut Workspace<T>,
) -> Result<()> {
    let Workspace { balance, prescribed, supports, balance_supports, .. } = work;
    stage.recovery.predict(past, &mut [&mut new.u, &mut new.v, &mut new.a]);
    put_supports(system, new.t, prescribed, supports, new)?;
    if let (Some(rows), Some(balance)) = (&stage.balance, balance.as_mut()) {
        rows.predict(past, &mut [&mut balance.u, &mut balance.v, &mut balance.a]);
        put_supports(system, clock.at(stage.load), prescribed, balance_supports, balance)?;
        if let (true, Some(start)) = (stage.along_path, past.first()) {
            // The mean of the ends is that of the supports too: work is force times the way between them.
            let per_step = T::of((clock.h * (stage.end - stage.start)).recip());
            for &dof in prescribed.iter() {
                let (from, to) = (start.u[dof], new.u[dof]);
                (balance.u[dof], balance.v[dof]) = (T::of(0.5) * (from + to), per_step * (to - from));
            }
        }
    }
    Ok(())
}

/// Leaves f(t̄, ū, v̄) − M ā of a predicted motion in `work.increment`.
fn residual<T: Real>(
    stage: &CompiledStage<T>,
    t_balance: f64,
    system: &mut dyn System<T>,
    new: &mut Motion<T>,
    work: &mut Workspace<T>,
) -> Result<()> {
    let Workspace { increment, balance, prescribed, supports, balance_supports, coupled_mass, .. } = work;
    let (rows, supports, motion) = match (&stage.balance, balance.as_mut()) {
        (Some(rows), Some(balance)) => (rows, balance_supports, balance),
        _ => (&stage.recovery, supports, new),
    };
    system.force(t_balance, &motion.u, &motion.v, increment)?;
    // ā at d = 0: the past's part on free dofs (none where the balance holds at the recovered state), and the motion of
    // the supports.
    if rows.reads_past(2) || *coupled_mass {
        if !rows.reads_past(2) {
            motion.a.fill(T::zero());
        }
        for (&dof, support) in prescribed.iter().zip(supports.iter()) {
            motion.a[dof] = support[2];
        }
        system.mass().add_product(-T::one(), &motion.a, increment);
    }
    for &dof in prescribed.iter() {
        increment[dof] = T::zero();
    }
    Ok(())
}
