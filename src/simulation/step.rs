//! One step of the present size: stages, corrections, acceptance; a failed step leaves everything unchanged.
//!
//! - `stages`: the stages of the step: predicted, solved, completed and corrected; `record`: a stage on a tape.
//! - `accept`: checks a solved step and makes it the state; `finite`: its check for NaN and infinity; `jumps`: contacts
//!   that close or open in it, and friction that changes.
//! - `judge`: whether a step is fine enough; `control`: repeats refused steps.
//! - `resample`: changes of the step size; `restart`: restarts after a discontinuity.

mod accept;
pub(super) mod control;
pub(super) mod finite;
pub(super) mod judge;
pub(super) mod jumps;
mod record;
pub(super) mod resample;
mod restart;
mod stages;

use crate::error::Result;
use crate::real::Real;
use crate::simulation::build::program::Compiled;
use crate::simulation::rows::slip::store_slips_of_state;
use crate::simulation::run::Simulation;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::step::judge::Verdict;
use crate::simulation::step::jumps::store_exerting;
use crate::simulation::watch::stiffening::SolvedStep;
use crate::state::{Changes, History};

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
            .take_stages()
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
        let Self { monitors, constraints, g, state, history, work, scheme, .. } = self;
        history.clock.check()?;
        work.rate_check.version = constraints.version();
        constraints.search_for_step(&state.motion, extent(scheme.ahead(), history), g)?;
        if g.rows() > work.rows {
            work.resize(g.rows());
        }
        work.contact.trial.carry_over(&state.contacts, constraints.named(), constraints.tangents());
        constraints.offsets.add_kept(&mut work.contact.trial.gap);
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
        if let Some(tape) = &mut work.tape {
            tape.begin_step();
        }
        // An attempt that failed within its corrections has left them.
        if let Some(changes) = &mut work.correction.buffers.changes {
            **changes = Changes::default();
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
        self.search_again();
    }

    /// Finds the rows of the present state again.
    pub(crate) fn search_again(&mut self) {
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
        store_slips_of_state((constraints, g), new, ahead, &mut work.contact)?;
        // If correctors have edited the start of the step, it is the edited one.
        let (start, closed) =
            (&past[work.backup.rotations - 1], [&work.contact.closed_at_start[..], &work.contact.trial.closed]);
        if history.clock.steps % EVERY == 0 || closed[0].iter().zip(closed[1]).any(|(was, is)| *is && !was) {
            work.rate_check.check(constraints, start, history.clock.h, g)?;
            work.rate_check.check_rows(constraints, [start, new], g)?;
        }
        constraints.inspect([start, new], closed)
    }
}

/// How far ahead a step looks, and its share of a whole step.
fn extent<T: Real>(ahead: f64, history: &History<T>) -> (f64, f64) {
    let (h, whole) = (history.clock.h, history.pace.nominal.max(history.made_with));
    (ahead * h, (h / whole).min(1.0))
}
