//! One step of the present size: stages, corrections, acceptance; a failed step leaves everything unchanged.
//!
//! - `jumps`: contacts that close or open, and friction that changes.
//! - `finite`: the check before a state is accepted.
//! - `judge`: whether a step is fine enough; `control`: repeats refused steps.
//! - `resample`: changes of the step size, and restarts.

pub(super) mod control;
pub(super) mod finite;
pub(super) mod judge;
pub(super) mod jumps;
pub(super) mod resample;

use crate::contact::ContactJacobian;
use crate::contact_solver::ContactSolver;
use crate::corrector::{
    Before, Bodies, Correction, Corrector, Erased, ErasedGaps, JumpProjection, Past, Prediction, Scheme,
};
use crate::error::Result;
use crate::mass::Mass;
use crate::real::Real;
use crate::simulation::build::program::CompiledStage;
use crate::simulation::build::workspace::{CorrectionWork, Workspace};
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::rows::contact_rows::Part;
use crate::simulation::rows::slip::note_slips_of_state;
use crate::simulation::run::Simulation;
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::closing::Booking;
use crate::simulation::stage::contact::{ContactStep, ContactWork};
use crate::simulation::stage::massless_step::difference;
use crate::simulation::stage::vectors::predict;
use crate::simulation::step::finite::{Extent, check_contacts, check_motion};
use crate::simulation::step::judge::Verdict;
use crate::simulation::step::jumps::{friction_jumps, jumps, note_exerting};
use crate::simulation::watch::energy::StepBooks;
use crate::simulation::watch::stiffening::Taken;
use crate::state::{Clock, History, Motion};
use crate::tableau::impulse_weight;

impl<T: Real> Simulation<'_, T> {
    /// Tries a step of the present size.
    pub(crate) fn attempt(&mut self) -> Result<Verdict> {
        match self.attempt_together() {
            // All ranks have agreed on it before the host's history moved.
            Ok(verdict) => Ok(verdict),
            failed => self.together.finish(failed),
        }
    }

    fn attempt_together(&mut self) -> Result<Verdict> {
        let Self { constraints, g, state, history, work, ledger, scheme, contact_solver, .. } = self;
        history.clock.check()?;
        work.rate_check.version = constraints.version();
        constraints.search_for_step(&state.motion, extent(scheme.ahead(), history), g)?;
        if constraints.room() > work.rows {
            work.make_room(constraints.room(), g.entries());
            state.contacts.make_room(constraints.room());
            contact_solver.reserve(constraints.room());
        }
        work.contact.trial.carry_over(&state.contacts, constraints.named(), constraints.tangents());
        constraints.measure_from_kept(&mut work.contact.trial.gap);
        if let Some(ledger) = ledger {
            ledger.begin((constraints, g), state, &work.contact.trial.lambda)?;
        }
        work.contact.closed_at_start.clone_from(&work.contact.trial.closed);
        let ContactWork { trial, exerting_at_start, forces_at_start, sliding_at_start, .. } = &mut work.contact;
        note_exerting((constraints, g), trial, &state.motion.u, exerting_at_start);
        if !constraints.tangents().is_empty() {
            forces_at_start.clone_from(&trial.lambda);
            sliding_at_start.clone_from(&trial.sliding);
        }
        work.backup.begin();
        work.contact.impulses.begin();
        work.correction.energy = T::zero();
        std::mem::swap(&mut state.motion, &mut history.slots[0]);
        work.backup.underway = true;
        let result = self
            .stages()
            .and_then(|()| self.check_stability())
            .and_then(|()| self.inspect())
            .and_then(|()| self.accept());
        let clock = self.history.clock;
        let result = result.map_err(|error| error.in_step(clock.at(0.0), clock.h));
        if matches!(result, Ok(Verdict::Accepted)) {
            self.work.backup.underway = false;
        } else {
            self.undo();
        }
        result
    }

    /// Undoes the changes of an attempt to state, history and rows.
    fn undo(&mut self) {
        self.put_back();
        let Self { constraints, g, state, history, scheme, .. } = self;
        // Rows may have followed the failed step: this moves them back to the state. A past that is resampled for
        // half of the step is projected onto gaps as the step has measured them. An error of this search is not lost,
        // for the next step begins with the same search.
        constraints.search_for_step(&state.motion, extent(scheme.ahead(), history), g).ok();
    }

    /// Refuses a step that has become too long for active contacts, or for a system that has stiffened.
    fn check_stability(&mut self) -> Result<()> {
        let Self { system, constraints, g, history, work, scheme, limit, .. } = self;
        let (Some(stiffening), [new, past @ ..]) = (&mut work.stiffening, &history.slots[..]) else { return Ok(()) };
        stiffening.check(Taken {
            system: &mut **system,
            scheme,
            limit: *limit,
            clock: history.clock,
            constraints,
            g,
            contact: &work.contact,
            start: &past[work.backup.rotations - 1],
            new,
        })
    }

    /// Lets the constraints inspect the motion in slot 0 of the history. When a contact has closed, and at regular
    /// intervals of steps, gap rates are compared with the gaps.
    fn inspect(&mut self) -> Result<()> {
        const EVERY: u64 = 64;
        let Self { constraints, g, history, work, program, startup, .. } = self;
        let [new, past @ ..] = &history.slots[..] else { return Ok(()) };
        let ahead = startup.as_ref().unwrap_or(program).stages.last().and_then(|stage| stage.contact.as_ref());
        note_slips_of_state((constraints, g), new, ahead, &mut work.contact)?;
        // If correctors have edited the start of the step, it is the edited one.
        let (start, closed) =
            (&past[work.backup.rotations - 1], [&work.contact.closed_at_start[..], &work.contact.trial.closed]);
        if history.clock.steps % EVERY == 0 || closed[0].iter().zip(closed[1]).any(|(was, is)| *is && !was) {
            work.rate_check.check(constraints, start, history.clock.h, g)?;
            work.rate_check.check_rows(constraints, [start, new], g)?;
        }
        constraints.inspect([start, new], closed)
    }

    /// Makes the motion in slot 0 of the history the state. After an error, or if the step is too coarse, the caller
    /// undoes the step.
    fn accept(&mut self) -> Result<Verdict> {
        let Self { system, constraints, g, correctors, state, history, work, statistics, .. } = self;
        let Self { ledger, scheme, judge, together, .. } = self;
        let stages = work.backup.rotations;
        let flags = work.contact.trial.closed.iter().zip(&work.contact.closed_at_start);
        let changes = flags.filter(|(now, before)| now != before).count();
        let [new, past @ ..] = &history.slots[..] else { return Ok(Verdict::Accepted) };
        // A bond that broke at the end of the last step is open in this one.
        let broken = state.broken_at(past[stages - 1].t).len();
        let ends = [work.backup.start(past), new];
        let jumps = broken > 0 || jumps(constraints, g, ends, history.clock.h, &work.contact);
        let changes = changes.max(broken);
        let friction_jumps = || friction_jumps(constraints, g, &work.massless, &work.contact);
        let rubs = friction_jumps().next().is_some();
        let from = (!jumps).then(|| &past[stages - 1]);
        let finite = scheme.show(new, from, &work.vectors.supports.dofs, &mut work.shown);
        let step = (history.clock.at(0.0), history.clock.h);
        // Recovery has checked its results. Dofs whose velocity is differenced, and edits of corrections, are still
        // to be checked.
        let touched = work.correction.buffers.has_touched() && work.correction.projection.is_some();
        let spreads = work.correction.buffers.spreads() || matches!(system.mass(), Mass::Consistent(_));
        // For a large interface, checking all dofs is faster than checking its dofs: a cache line holds eight.
        let interface = if constraints.len() > 0 { constraints.interface() } else { &[] };
        let extent = match work.newton.is_some() || touched && spreads || 8 * interface.len() > new.u.len() {
            true => Extent::All,
            false => Extent::At([&work.massless, interface]),
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
        check_contacts(new.t, &work.contact.trial)?;
        let motion = [&new.u, new.shown(&work.shown, 1), new.shown(&work.shown, 2)];
        if let Some(judge) = judge {
            let (prescribed, h) = (&work.vectors.supports.dofs[..], history.clock.h);
            let rows = friction_jumps().flat_map(|contact| constraints.tangents().of(contact));
            let friction = judge.velocity_error((g, rows), motion[2], h);
            let verdict = judge.judge(together, [motion[0], motion[1]], prescribed, h, (jumps, changes, friction))?;
            if verdict == Verdict::Coarse {
                return Ok(verdict);
            }
        }
        let corrections = work.correction.energy;
        let stage = &scheme.tableau.stages[scheme.tableau.stages.len() - 1];
        let (forces, load) =
            (work.contact.rows.curved.forces(g), if self.startup.is_some() { 1.0 } else { stage.load });
        let ContactWork { trial: contacts, closed_at_start, .. } = &work.contact;
        let books = StepBooks {
            t: new.t,
            motion,
            contacts,
            g,
            forces,
            load,
            closed: &work.correction.buffers.rows.closed,
            closed_at_start,
            is_corrected: correctors.iter().any(|corrector| !corrector.effects().corrects_massless),
            corrections,
            h: history.clock.h,
        };
        if let Some(ledger) = ledger {
            ledger.prepare(&mut **system, constraints, &books)?;
        }
        system.commit(new.t, motion[0], motion[1])?;
        if let Some(ledger) = ledger {
            ledger.end();
        }
        // The states of the stages before the last are dropped from the past.
        history.slots[1..].rotate_left(stages - 1);
        std::mem::swap(&mut state.motion, &mut history.slots[0]);
        std::mem::swap(&mut state.shown, &mut work.shown);
        constraints.measure_from_surfaces(&mut work.contact.trial.gap);
        std::mem::swap(&mut state.contacts, &mut work.contact.trial);
        work.contact.impulses.accept();
        constraints.break_bonds(state.contacts.forces(), state.motion.t, &mut state.broken);
        let depth = scheme.depth;
        history.known = (history.known + 1).min(depth);
        history.smooth = if jumps || rubs { 1 } else { history.smooth + 1 };
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
        let Self { system, constraints, g, contact_solver, correctors, history, work, statistics, together, .. } = self;
        let (program, start_covector) = match &mut self.startup {
            // After the step one more state is known than now.
            Some(startup) => (startup, Some(&self.scheme.derived.covectors[history.known])),
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
            predict(stage, clock, &mut **system, new, past, &mut work.vectors)?;
            let is_first = stages_before == 0;
            let (rows, motions, at) = ((&mut *constraints, &*g), (&mut *new, &*past), (stage, clock, is_first));
            begin_corrections(work, correctors, &mut **contact_solver, rows, at, motions)?;
            work.contact.rows.read_start(constraints, g, past, clock.h)?;
            let (parts, solver) = (&mut **system, &mut **contact_solver);
            let mut solve =
                StageSolve { stage, clock, system: parts, together, operator, constraints, g, solver, statistics };
            let (vectors, contact) = (&mut work.vectors, &mut work.contact);
            match (&mut work.newton, &mut work.block) {
                (Some(newton), None) => solve.by_iteration(newton, new, past, vectors, contact)?,
                (_, block) => solve.directly(block.as_mut(), new, past, vectors, contact)?,
            }
            for (&dof, support) in work.vectors.supports.dofs.iter().zip(&work.vectors.supports.state) {
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
                let booking = Booking {
                    impulse_weight: impulse_weight(stage.response, covector),
                    is_first,
                    is_last: stages_before + 1 == program.stages.len(),
                };
                contact.close(
                    (new, past),
                    &booking,
                    &work.massless,
                    &mut work.correction.buffers,
                    &mut work.contact,
                )?;
                if let Some(projection) =
                    work.correction.projection.as_mut().filter(|_| work.correction.buffers.has_touched())
                {
                    refresh(projection, &mut work.correction.projected_rows, constraints.version());
                    let mut correction = Correction {
                        scheme: numbers(stage, clock.h, covector, [stages_before, program.stages.len()]),
                        g,
                        projection,
                        bodies: Bodies {
                            system: Erased(&mut **system),
                            operator,
                            block: work.block.as_mut(),
                            massless: &work.massless,
                            prescribed: &work.vectors.supports.dofs,
                        },
                        solver: &mut **contact_solver,
                        constraints: ErasedGaps(constraints),
                        new,
                        past: Past { states: past, backup: &mut work.backup },
                        contacts: &mut work.contact.trial,
                        before: Before {
                            closed: &work.contact.was_closed,
                            closed_at_start: &work.contact.closed_at_start,
                            sticking: &work.contact.was_sticking,
                        },
                        buffers: &mut work.correction.buffers,
                        energy: &mut work.correction.energy,
                    };
                    correction.correct(correctors)?;
                }
                work.contact.impulses.push_corrections(g, &work.contact.trial);
            }
        }
        Ok(())
    }
}

/// How far ahead a step looks, and its share of a whole step.
fn extent<T: Real>(ahead: f64, history: &History<T>) -> (f64, f64) {
    let (h, whole) = (history.clock.h, history.pace.nominal.max(history.made_with));
    (ahead * h, (h / whole).min(1.0))
}

/// Begins the corrections of a stage; correctors with a prediction act on its predicted motion.
fn begin_corrections<T: Real>(
    work: &mut Workspace<T>,
    correctors: &[Box<dyn Corrector<T> + '_>],
    solver: &mut dyn ContactSolver<T>,
    (constraints, g): (&mut Constraints<'_, T>, &ContactJacobian<T>),
    (stage, clock, is_first): (&CompiledStage<T>, Clock, bool),
    (new, past): (&mut Motion<T>, &[Motion<T>]),
) -> Result<()> {
    let CorrectionWork { buffers, projection, projected_rows, .. } = &mut work.correction;
    let (Some(projection), Some(start)) = (projection, past.first()) else { return Ok(()) };
    refresh(projection, projected_rows, constraints.version());
    buffers.begin(&work.contact.trial, is_first);
    if buffers.shifted.is_empty() {
        return Ok(());
    }
    let mut prediction = Prediction {
        h: clock.h * stage.end,
        g,
        projection,
        solver,
        constraints: ErasedGaps(constraints),
        start,
        new,
        balance: work.vectors.balance.as_mut().filter(|_| stage.balance.is_some()).map(|at| (balance_share(stage), at)),
        contacts: &work.contact.trial,
        massless: &work.massless,
        prescribed: &work.vectors.supports.dofs,
        buffers,
    };
    correctors.iter().try_for_each(|corrector| corrector.predict(&mut prediction))
}

/// Resets a projection made for rows of another version.
fn refresh<T: Real>(projection: &mut JumpProjection<T>, known: &mut u64, version: u64) {
    if *known != version {
        *known = version;
        projection.reset();
    }
}

/// The displacement of the balance per displacement of the state, as functions of the unknown.
fn balance_share<T: Real>(stage: &CompiledStage<T>) -> T {
    let [state, balance] = [stage.recovery.weights()[0], stage.balanced().weights()[0]];
    if state == T::zero() { T::zero() } else { balance / state }
}

/// The numbers of a stage that a correction needs; the stage is number `place` of `stages`.
fn numbers<'s, T: Real>(
    stage: &'s CompiledStage<T>,
    h: f64,
    covector: &'s [[f64; 3]],
    [place, stages]: [usize; 2],
) -> Scheme<'s> {
    Scheme {
        h,
        response: stage.response,
        acceleration: stage.acceleration,
        balance: stage.balance_acceleration,
        covector,
        read: &stage.read,
        reads_acceleration: stage.reads_acceleration,
        keeps_balance: stage.keeps_balance,
        stage: place,
        stages,
        length: stage.end - stage.start,
    }
}
