//! One step of the present size: stages, corrections, acceptance; a failed step leaves everything unchanged.
//!
//! - `accept`: checks a solved step and makes it the state; `finite`: its check for NaN and infinity; `jumps`: contacts
//!   that close or open in it, and friction that changes.
//! - `judge`: whether a step is fine enough; `control`: repeats refused steps.
//! - `resample`: changes of the step size; `restart`: restarts after a discontinuity.

mod accept;
pub(super) mod control;
pub(super) mod finite;
pub(super) mod judge;
pub(super) mod jumps;
pub(super) mod resample;
mod restart;

use crate::contact::ContactJacobian;
use crate::contact_solver::ContactSolver;
use crate::corrector::{Correction, Corrector, Erased, ErasedGaps, JumpProjection, Prediction, Scheme};
use crate::error::Result;
use crate::real::Real;
use crate::simulation::build::program::{Compiled, CompiledStage};
use crate::simulation::build::workspace::{CorrectionWork, Workspace};
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::rows::contact_rows::Part;
use crate::simulation::rows::slip::note_slips_of_state;
use crate::simulation::run::{Parts, Simulation};
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::closing::Booking;
use crate::simulation::stage::contact::{ContactStep, ContactWork};
use crate::simulation::stage::massless_step::difference;
use crate::simulation::stage::vectors::predict;
use crate::simulation::step::judge::Verdict;
use crate::simulation::step::jumps::store_exerting;
use crate::simulation::watch::stiffening::SolvedStep;
use crate::state::{Clock, History, Motion};
use crate::tableau::impulse_weight;

impl<T: Real> Simulation<'_, T> {
    /// Tries a step of the present size.
    pub(crate) fn attempt(&mut self) -> Result<Verdict> {
        match self.attempt_together() {
            // All ranks have agreed on it before the host's history moved.
            Ok(verdict) => Ok(verdict),
            failed => self.parts.together.finish(failed),
        }
    }

    fn attempt_together(&mut self) -> Result<Verdict> {
        self.begin_step()?;
        let result = self
            .stages()
            .and_then(|()| self.check_stability())
            .and_then(|()| self.check_constraints())
            .and_then(|()| self.accept());
        let clock = self.history.clock;
        match result {
            Ok(Verdict::Accepted) => self.work.backup.underway = false,
            Ok(Verdict::Coarse) | Err(_) => self.undo(),
        }
        result.map_err(|error| error.in_step(clock.at(0.0), clock.h))
    }

    /// Searches the contacts of the step and stores their state at its start. From here on the step must be accepted
    /// or undone.
    fn begin_step(&mut self) -> Result<()> {
        let Self { parts, monitors, constraints, g, state, history, work, scheme, .. } = self;
        history.clock.check()?;
        work.rate_check.version = constraints.version();
        constraints.search_for_step(&state.motion, extent(scheme.ahead(), history), g)?;
        if constraints.room() > work.rows {
            work.make_room(constraints.room(), g.entries());
            state.contacts.make_room(constraints.room());
            parts.contact_solver.reserve(constraints.room());
        }
        work.contact.trial.carry_over(&state.contacts, constraints.named(), constraints.tangents());
        constraints.measure_from_kept(&mut work.contact.trial.gap);
        if let Some(ledger) = &mut monitors.ledger {
            ledger.begin((constraints, g), state, &work.contact.trial.lambda)?;
        }
        work.contact.closed_at_start.clone_from(&work.contact.trial.closed);
        let ContactWork { trial, exerting_at_start, forces_at_start, sliding_at_start, .. } = &mut work.contact;
        store_exerting((constraints, g), trial, &state.motion.u, exerting_at_start);
        if !constraints.tangents().is_empty() {
            forces_at_start.clone_from(&trial.lambda);
            sliding_at_start.clone_from(&trial.sliding);
        }
        work.backup.begin();
        work.contact.impulses.begin();
        work.correction.energy = T::zero();
        std::mem::swap(&mut state.motion, &mut history.slots[0]);
        work.backup.underway = true;
        Ok(())
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
        let Self { parts, monitors, constraints, g, history, work, scheme, .. } = self;
        let Some(stiffening) = &mut work.stiffening else { return Ok(()) };
        let (new, past) = history.new_and_past();
        stiffening.check(SolvedStep {
            system: &mut *parts.system,
            scheme,
            limit: monitors.limit,
            clock: history.clock,
            constraints,
            g,
            contact: &work.contact,
            start: &past[work.backup.rotations - 1],
            new,
        })
    }

    /// Checks the motion in slot 0 of the history by each constraint. When a contact has closed, and at regular
    /// intervals of steps, gap rates are compared with the gaps.
    fn check_constraints(&mut self) -> Result<()> {
        const EVERY: u64 = 64;
        let Self { compiled: Compiled { program, startup, .. }, constraints, g, history, work, .. } = self;
        let (new, past) = history.new_and_past();
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

    /// All stages of a step. On entry slot 0 of the history holds the current motion.
    fn stages(&mut self) -> Result<()> {
        let Self {
            parts: Parts { system, contact_solver, correctors, together, .. },
            constraints,
            g,
            history,
            work,
            statistics,
            ..
        } = self;
        let (program, start_covector) = match &mut self.compiled.startup {
            // After the step one more state is known than now.
            Some(startup) => (startup, Some(&self.scheme.derived.covectors[history.known])),
            None => (&mut self.compiled.program, None),
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
            if let Some(excess) = &mut work.excess {
                excess.begin(is_first);
                excess.shift(stage, clock.h, new);
            }
            work.contact.rows.read_start(constraints, g, past, clock.h)?;
            let (parts, solver) = (&mut **system, &mut **contact_solver);
            let mut solve =
                StageSolve { stage, clock, system: parts, together, operator, constraints, g, solver, statistics };
            let (vectors, contact) = (&mut work.vectors, &mut work.contact);
            match (&mut work.newton, &mut work.block) {
                (Some(newton), None) => solve.by_iteration(newton, new, past, vectors, contact)?,
                (_, block) => solve.directly(block.as_mut(), new, past, vectors, contact)?,
            }
            if let (Some(excess), Some(projection)) = (&mut work.excess, &mut work.correction.projection) {
                let switching = &mut *work.correction.buffers.switching;
                work.correction.energy +=
                    excess.solve_again(&mut solve, (new, past), (vectors, contact), (switching, projection))?;
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
                if let Some(excess) = &work.excess {
                    excess.book(stage, clock.h, &work.correction.buffers.switching, &mut work.contact.trial);
                }
                if let Some(projection) =
                    work.correction.projection.as_mut().filter(|_| work.correction.buffers.has_touched())
                {
                    refresh(projection, &mut work.correction.projected_rows, constraints.version());
                    let mut correction = Correction {
                        h: clock.h,
                        t: new.t,
                        scheme: numbers(stage, covector, [stages_before, program.stages.len()]),
                        g,
                        projection,
                        operator,
                        block: work.block.as_mut(),
                        solver: &mut **contact_solver,
                        system: Erased(&mut **system),
                        constraints: ErasedGaps(constraints),
                        new,
                        past,
                        backup: &mut work.backup,
                        contacts: &mut work.contact.trial,
                        was_closed: &work.contact.was_closed,
                        closed_at_start: &work.contact.closed_at_start,
                        was_sticking: &work.contact.was_sticking,
                        massless: &work.massless,
                        prescribed: &work.vectors.supports.dofs,
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
    let CorrectionWork { buffers, projection, projected_rows, shifted, .. } = &mut work.correction;
    let (Some(projection), Some(start)) = (projection, past.first()) else { return Ok(()) };
    refresh(projection, projected_rows, constraints.version());
    buffers.begin(&work.contact.trial, is_first);
    if shifted.is_empty() {
        return Ok(());
    }
    let mut prediction = Prediction {
        h: clock.h * stage.end,
        t: new.t,
        balance_share: balance_share(stage),
        g,
        projection,
        solver,
        constraints: ErasedGaps(constraints),
        start,
        new,
        balance: work.vectors.balance.as_mut().filter(|_| stage.balance.is_some()),
        was_closed: &work.contact.trial.closed,
        massless: &work.massless,
        prescribed: &work.vectors.supports.dofs,
        ids: &work.contact.trial.ids,
        buffers,
        shifted,
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
    covector: &'s [[f64; 3]],
    [place, stages]: [usize; 2],
) -> Scheme<'s> {
    Scheme {
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
