//! Acceptance of a solved step: it is checked, judged, accounted in the energy balance, and made the state.

use crate::error::Result;
use crate::mass::Mass;
use crate::real::Real;
use crate::simulation::run::{Parts, Simulation};
use crate::simulation::step::finite::{Extent, check_contacts, check_motion};
use crate::simulation::step::judge::Verdict;
use crate::simulation::step::jumps::{friction_jumps, jumps};
use crate::simulation::watch::StepData;

/// Contacts that have closed or opened in a step, and friction that has changed.
#[derive(Clone, Copy)]
struct ContactChanges {
    /// Number of contacts that have closed or opened.
    count: usize,
    /// Whether the motion jumps because of them.
    jumps: bool,
    /// Whether friction jumps in a contact that stays closed.
    friction_jumps: bool,
}

impl<T: Real> Simulation<'_, T> {
    /// Makes the motion in slot 0 of the history the state. After an error, or if the step is too coarse, the caller
    /// undoes the step.
    pub(super) fn accept(&mut self) -> Result<Verdict> {
        let changes = self.contact_changes();
        self.check_result(changes.jumps)?;
        if self.judge(changes)? == Verdict::Coarse {
            return Ok(Verdict::Coarse);
        }
        self.account()?;
        self.commit(changes);
        Ok(Verdict::Accepted)
    }

    fn contact_changes(&self) -> ContactChanges {
        let Self { constraints, g, state, history, work, .. } = self;
        let (new, past) = history.new_and_past();
        let flags = work.contact.trial.closed.iter().zip(&work.contact.closed_at_start);
        // A bond that broke at the end of the last step is open in this one.
        let broken = state.broken_at(past[work.backup.rotations - 1].t).len();
        let ends = [work.backup.start(past), new];
        ContactChanges {
            count: flags.filter(|(now, before)| now != before).count().max(broken),
            jumps: broken > 0 || jumps(constraints, g, ends, history.clock.h, &work.contact),
            friction_jumps: friction_jumps(constraints, g, &work.massless, &work.contact).next().is_some(),
        }
    }

    /// Extrapolates v and a to the time of the state, unless the motion jumps, and refuses results that are not finite.
    fn check_result(&mut self, jumps: bool) -> Result<()> {
        let Self { parts: Parts { system, .. }, constraints, history, work, scheme, .. } = self;
        let (new, past) = history.new_and_past();
        let (t, h) = (history.clock.at(0.0), history.clock.h);
        let from = (!jumps).then(|| &past[work.backup.rotations - 1]);
        let finite = scheme.extrapolate_rates(new, from, &work.vectors.supports.dofs, &mut work.rates);
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
        check_motion(t, h, [&new.u, &new.v, &new.a], extent)?;
        if touched {
            for motion in work.backup.edited(past) {
                check_motion(t, h, [&motion.u, &motion.v, &motion.a], extent)?;
            }
        }
        if !finite {
            check_motion(t, h, new.at_state(&work.rates), Extent::All)?;
        }
        check_contacts(new.t, &work.contact.trial)
    }

    /// Whether the step is fine enough, for runs that control their step size.
    fn judge(&mut self, changes: ContactChanges) -> Result<Verdict> {
        let Self { parts, monitors, constraints, g, history, work, .. } = self;
        let Some(judge) = &mut monitors.judge else { return Ok(Verdict::Accepted) };
        let (new, h) = (&history.slots[0], history.clock.h);
        let [u, v, a] = new.at_state(&work.rates);
        let rows = friction_jumps(constraints, g, &work.massless, &work.contact)
            .flat_map(|contact| constraints.tangents().of(contact));
        let friction = judge.velocity_error((g, rows), a, h);
        judge.judge(&parts.together, [u, v], &work.vectors.supports.dofs, h, (changes.jumps, changes.count, friction))
    }

    /// Commits the step in the system of the host, and in the energy balance if there is one.
    fn account(&mut self) -> Result<()> {
        let Self { parts, monitors, constraints, g, history, work, scheme, .. } = self;
        let new = &history.slots[0];
        let motion = new.at_state(&work.rates);
        if let Some(ledger) = &mut monitors.ledger {
            let load = if self.compiled.startup.is_some() {
                1.0
            } else {
                scheme.tableau.stages.last().map_or(1.0, |s| s.load)
            };
            let data = StepData {
                t: new.t,
                motion,
                contacts: &work.contact.trial,
                g,
                forces: work.contact.rows.curved.forces(g),
                load,
                closed: &work.correction.buffers.rows.closed,
                closed_at_start: &work.contact.closed_at_start,
                is_corrected: parts.correctors.iter().any(|corrector| !corrector.effects().corrects_massless),
                corrections: work.correction.energy,
                h: history.clock.h,
            };
            ledger.prepare(&mut *parts.system, constraints, &data)?;
        }
        parts.system.commit(new.t, motion[0], motion[1])?;
        if let Some(ledger) = &mut monitors.ledger {
            ledger.end();
        }
        Ok(())
    }

    /// Moves the results of the step to state, history and statistics. Nothing fails here.
    fn commit(&mut self, changes: ContactChanges) {
        let Self { constraints, state, history, work, statistics, scheme, .. } = self;
        // The states of the stages before the last are dropped from the past.
        history.slots[1..].rotate_left(work.backup.rotations - 1);
        std::mem::swap(&mut state.motion, &mut history.slots[0]);
        std::mem::swap(&mut state.rates, &mut work.rates);
        constraints.offsets.subtract_kept(&mut work.contact.trial.gap);
        std::mem::swap(&mut state.contacts, &mut work.contact.trial);
        work.contact.impulses.accept();
        constraints.break_bonds(state.contacts.forces(), state.motion.t, &mut state.broken);
        history.extend(&state.motion.u, &work.massless, scheme.depth, changes.jumps || changes.friction_jumps);
        statistics.contact_changes += changes.count as u64;
        statistics.steps += 1;
        if let Some(tape) = &mut work.tape {
            tape.end_step((self.compiled.startup.is_some(), !changes.jumps), state, history);
        }
        if history.known == scheme.depth {
            self.compiled.startup = None;
        }
    }
}
