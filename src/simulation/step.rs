//! One step: stages, corrections, acceptance; a failed step leaves everything as it was.

use super::contact_step::ContactStep;
use super::energy::StepBooks;
use super::program::CompiledStage;
use super::{Simulation, Workspace};
use crate::corrector::{Correction, Erased, ErasedGaps, Scheme};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::state::Motion;
use crate::system::System;

impl<T: Real> Simulation<'_, T> {
    /// Takes one step.
    ///
    /// # Errors
    ///
    /// [`Error::StepNotFinite`], [`Error::ContactNotFinite`], [`Error::ContradictoryContacts`], [`Error::Contact`], or what
    /// the host's own parts return. State and history are then as they were.
    pub fn step(&mut self) -> Result<()> {
        if let Some(ledger) = &mut self.ledger {
            ledger.begin(&self.state);
        }
        let Self { constraints, g, state, history, work, .. } = self;
        constraints.search(state.motion.t, &state.motion.u, &state.motion.v, g)?;
        work.trial.carry_over(&state.contacts, &constraints.ids);
        work.closed_at_start.clone_from(&work.trial.closed);
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
        let Self { system, g, state, history, work, statistics, ledger, scheme, .. } = self;
        let stages = work.backup.rotations;
        let flags = work.trial.closed.iter().zip(&work.closed_at_start);
        let changes = flags.filter(|(now, before)| now != before).count();
        let [new, past @ ..] = &history.slots[..] else { return Ok(()) };
        scheme.show(new, (changes == 0).then(|| &past[stages - 1]), &work.prescribed, &mut work.shown);
        let motion = [&new.u, new.shown(&work.shown, 1), new.shown(&work.shown, 2)];
        let corrections = work.correction_energy;
        let books = StepBooks { t: new.t, motion, contacts: &work.trial, g, corrections, h: history.clock.h };
        if let Some(ledger) = ledger {
            ledger.prepare(&mut **system, &books)?;
        }
        system.commit(new.t, motion[0], motion[1])?;
        if let Some(ledger) = ledger {
            ledger.end(&mut **system, &books);
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
        history.made_with = history.clock.h;
        history.clock.steps += 1;
        statistics.contact_changes += changes as u64;
        statistics.steps += 1;
        if history.known == depth {
            self.startup = None;
        }
        Ok(())
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
        for stage in &program.stages {
            let covector = start_covector.unwrap_or(&stage.covector);
            history.slots.rotate_right(1);
            work.backup.rotations += 1;
            let Some((new, past)) = history.slots.split_first_mut() else {
                continue;
            };
            new.t = clock.at(stage.end);
            let operator = &mut program.operators[stage.operator];
            operator.follow(constraints.version());
            residual(stage, clock.at(stage.load), &mut **system, new, past, work)?;
            operator.begin(&mut work.increment, &mut work.interface.increment);
            work.interface.forces.fill(T::zero());
            statistics.linear_solves += 1;
            if constraints.len() > 0 && T::all_finite(&work.interface.increment) {
                ContactStep { stage, clock, constraints, g, solver: &mut **contact_solver, statistics }.solve(
                    &mut **system,
                    operator,
                    new,
                    past,
                    work,
                )?;
            }
            operator.finish(&mut work.increment, &work.interface.increment, &work.interface.forces);
            if !T::all_finite(&work.increment) {
                let dof = work.increment.iter().position(|x| !x.is_finite()).unwrap_or(0);
                let value = work.increment[dof].value();
                return Err(Error::StepNotFinite { t: clock.at(0.0), h: clock.h, what: "the increment", dof, value });
            }
            let [w_u, w_v, w_a] = stage.recovery.weights();
            T::axpy(w_u, &work.increment, &mut new.u);
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
                ContactStep { stage, clock, constraints, g, solver: &mut **contact_solver, statistics }.close(
                    new,
                    stage.impulse_weight(covector),
                    work,
                )?;
                if let Some(projection) = work.projection.as_mut().filter(|_| !work.buffers.closed.is_empty()) {
                    if work.projected_rows != constraints.version() {
                        work.projected_rows = constraints.version();
                        projection.reset();
                    }
                    let mut correction = Correction {
                        h: clock.h,
                        t: new.t,
                        scheme: Scheme {
                            acceleration: stage.acceleration,
                            balance: stage.balance_acceleration,
                            covector,
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
}

/// Refuses prescribed motions that are NaN or infinite.
pub(super) fn finite_supports<T: Real>(t: f64, prescribed: &[usize], supports: &[[T; 3]]) -> Result<()> {
    for (&dof, support) in prescribed.iter().zip(supports) {
        if let Some(value) = support.iter().find(|x| !x.is_finite()) {
            return Err(Error::SupportNotFinite { t, dof, value: value.value() });
        }
    }
    Ok(())
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
        finite_supports(new.t, prescribed, supports)?;
        for (&dof, support) in prescribed.iter().zip(supports.iter()) {
            (new.u[dof], new.v[dof]) = (support[0], support[1]);
        }
    }
    let (rows, supports) = if let (Some(rows), Some(balance)) = (&stage.balance, balance.as_mut()) {
        rows.predict(past, &mut [&mut balance.u, &mut balance.v, &mut balance.a]);
        if !prescribed.is_empty() {
            system.prescribed_motion(t_balance, balance_supports);
            finite_supports(t_balance, prescribed, balance_supports)?;
            for (&dof, support) in prescribed.iter().zip(balance_supports.iter()) {
                (balance.u[dof], balance.v[dof]) = (support[0], support[1]);
            }
        }
        system.force(t_balance, &balance.u, &balance.v, increment)?;
        (rows, balance_supports)
    } else {
        system.force(t_balance, &new.u, &new.v, increment)?;
        (&stage.recovery, supports)
    };
    // ā at d = 0: the past's part on free dofs (none where the balance holds at the recovered state), and the motion of
    // the supports.
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
