//! One step of the present size: stages, corrections, acceptance; a failed step leaves everything unchanged.
//!
//! - `stages`: the stages of the step.
//! - `jumps`: contacts that close or open, and friction that changes.
//! - `finite`: the check before a state is accepted.
//! - `judge`: whether a step is fine enough; `control`: repeats refused steps.
//! - `resample`: changes of the step size, and restarts.

pub(super) mod control;
pub(super) mod finite;
pub(super) mod judge;
pub(super) mod jumps;
pub(super) mod resample;
pub(super) mod stages;

use crate::contact_solver::ContactSolver;
use crate::error::Result;
use crate::mass::Mass;
use crate::real::Real;
use crate::simulation::rows::slip::store_slips_of_state;
use crate::simulation::run::Simulation;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::step::finite::{Extent, check_contacts, check_motion};
use crate::simulation::step::judge::Verdict;
use crate::simulation::step::jumps::{friction_jumps, jumps, note_exerting};
use crate::simulation::watch::energy::StepBooks;
use crate::simulation::watch::stiffening::Taken;
use crate::state::History;

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
        constraints.add_kept(&mut work.contact.trial.gap);
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
            .take_stages()
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
            closed: &work.correction.buffers.closed,
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
        constraints.subtract_kept(&mut work.contact.trial.gap);
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
}

/// How far ahead a step looks, and its share of a whole step.
fn extent<T: Real>(ahead: f64, history: &History<T>) -> (f64, f64) {
    let (h, whole) = (history.clock.h, history.pace.nominal.max(history.made_with));
    (ahead * h, (h / whole).min(1.0))
}
