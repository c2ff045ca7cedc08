//! Edits of past states: projection onto newly closed contacts, and velocity changes applied together with the
//! state's.

use super::{Correction, Past};
use crate::contact_solver::AdmissibleSet;
use crate::corrector::Buffers;
use crate::corrector::buffers::Readings;
use crate::corrector::jump_problem::{Block, FrictionOf};
use crate::error::Result;
use crate::real::Real;
use crate::rounding::rounding;

/// Largest accepted ratio of the distance that a projection moves the past, in the mass norm, to the distance with
/// the current rows.
const FARTHEST: f64 = 2.0;

/// Which rows measure the gaps of a past state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MeasuredBy {
    /// Its own rows.
    PastRows,
    CurrentRows,
}

impl<T: Real> Correction<'_, T> {
    /// If an engaged row has just closed: projects gap, gap rate and gap acceleration of the engaged rows to zero in
    /// all past values that later rows read (`docs/theory.md`, history projection). If the law reads the gap at the
    /// start of a stage, the gap is projected to its current value.
    ///
    /// # Errors
    ///
    /// [`Error::ContactNotFinite`](crate::Error::ContactNotFinite);
    /// [`Error::Incompatible`](crate::Error::Incompatible) if the corrector's
    /// [`edits`](crate::corrector::Effects::edits) is not [`Edits::Past`](crate::corrector::Edits::Past).
    pub fn project_past(&mut self) -> Result<()> {
        let leave = self.record_outgoing()?;
        let begins = |&row: &usize| !self.before.closed[row] || self.sticks(row) && !self.before.sticking[row];
        if !leave && !self.buffers.rows.engaged.iter().any(begins) {
            return Ok(());
        }
        self.past.backup.check()?;
        let mut rows = std::mem::take(&mut self.buffers.rows.engaged);
        if leave {
            rows.extend(self.buffers.rebounds.contacts(self.g));
            rows.sort_unstable();
        }
        let result = self.project_fields(&rows);
        rows.retain(|&row| !self.buffers.rebounds.leaves(row));
        self.buffers.rows.engaged = rows;
        result
    }

    /// Whether an engaged contact sticks.
    fn sticks(&self, row: usize) -> bool {
        self.contacts.sliding.get(row) == Some(&false) && !self.contacts.tangents.of(row).is_empty()
    }

    /// The number of past states that may be edited. States not known yet, while a multistep scheme is started, have
    /// no covector.
    fn places(&self) -> usize {
        self.past.states.len().min(self.scheme.read.len().min(self.scheme.covector.len()).saturating_sub(1))
    }

    /// Projects all past values that later rows read.
    fn project_fields(&mut self, rows: &[usize]) -> Result<()> {
        let places = self.places();
        if !self.scheme.read[1..=places].iter().flatten().any(|&read| read) {
            return Ok(());
        }
        self.read_slip_rates()?;
        self.past.backup.keep(self.past.states);
        for k in 1..=places {
            for field in (0..3).filter(|&field| self.scheme.read[k][field]) {
                self.project_field(k, field, rows)?;
            }
        }
        Ok(())
    }

    /// Projects one field of past state k onto the engaged contacts: gaps and their rates vanish, and slips if the
    /// contact sticks. If it slides, the past gets the friction of the normal impulse applied here.
    fn project_field(&mut self, k: usize, field: usize, engaged: &[usize]) -> Result<()> {
        let Self { past, constraints, buffers, new, .. } = self;
        let Readings { gaps, past_slips, .. } = &mut buffers.readings;
        let motion = &past.states[k - 1];
        // The past motion uses its own part of a curved surface, so that u, v and a agree.
        constraints.0.elsewhere(field, motion.place(), (new.t, &new.u), gaps)?;
        constraints.0.slip_rates(motion.t, &motion.u, &motion.v, past_slips)?;
        if self.constraints.0.turn() {
            // Rows that are nearly equal, but have turned in between, may contradict each other in the past and
            // together move it very far. With the current rows it moves at most as far as the bodies have moved.
            let current = self.solve_past((k, field), engaged, MeasuredBy::CurrentRows)?;
            let own = self.solve_past((k, field), engaged, MeasuredBy::PastRows)?;
            if own > T::of(FARTHEST * FARTHEST) * current {
                self.solve_past((k, field), engaged, MeasuredBy::CurrentRows)?;
            }
        } else {
            self.solve_past((k, field), engaged, MeasuredBy::PastRows)?;
        }
        if field == 2 {
            let problem = &mut self.buffers.problem;
            let (rows, mut increments) = (std::mem::take(&mut problem.rows), std::mem::take(&mut problem.increments));
            let result = self.limit_forces(&rows, &mut increments, T::zero());
            (self.buffers.problem.rows, self.buffers.problem.increments) = (rows, increments);
            result?;
        }
        // In a stage before the last, the state at the start of the step loses energy that later stages do not see.
        if field == 1 && !self.scheme.is_last() && k == self.scheme.stage + 1 {
            self.book_past(k)?;
        }
        let Self { past, buffers, projection, g, contacts, scheme, .. } = self;
        let problem = &buffers.problem;
        let (motion, h) = (&mut past.states[k - 1], scheme.h);
        let psi = scheme.covector.get(k).map_or(0.0, |c| c[field]);
        let (values, unit) = match field {
            0 => (&mut motion.u, psi / h),
            1 => (&mut motion.v, psi),
            _ => (&mut motion.a, psi * h),
        };
        projection.push(g, (&problem.rows, &problem.increments), T::one(), values)?;
        for (&row, &multiplier) in problem.rows.iter().zip(&problem.increments) {
            contacts.impulse[row] += T::of(unit) * multiplier;
        }
        self.record_past(k, field, T::of(unit));
        Ok(())
    }

    /// Books the energy that the projection of the velocities of past state k takes.
    fn book_past(&mut self, k: usize) -> Result<()> {
        let Self { past, constraints, buffers, contacts, energy, before: previous, new, g, .. } = self;
        let Buffers { problem, rebounds, readings: Readings { rates, past_slips, .. }, .. } = &mut **buffers;
        let motion = &past.states[k - 1];
        let ago = T::of(new.t - motion.t);
        constraints.0.rates(motion.t, &motion.u, &motion.v, rates)?;
        let first = constraints.0.tangents().all().start;
        let jumps = problem.jump.iter().zip(&problem.left);
        for ((&row, &impulse), (&before, &after)) in problem.rows.iter().zip(&problem.increments).zip(jumps) {
            let gain = impulse * (T::of(0.5) * (before + after) + rebounds.past(row, 1, ago));
            let own = if g.is_tangential(row) { past_slips[row - first].rate } else { rates[row].rate };
            if previous.closed_at_start[contacts.tangents.owner(row)] {
                **energy += gain - impulse * own;
            }
            if !g.is_tangential(row) {
                contacts.dissipated[row] -= gain;
            }
        }
        Ok(())
    }

    /// Finds the multipliers that project one field of past state k onto the engaged contacts. Returns the squared
    /// distance that the past moves in the mass norm.
    fn solve_past(&mut self, (k, field): (usize, usize), engaged: &[usize], by: MeasuredBy) -> Result<T> {
        let Self { past, constraints, buffers, projection, solver, g, contacts, new, .. } = self;
        let Buffers { problem, rebounds, readings, .. } = &mut **buffers;
        let Readings { rates, gaps, slips, past_slips } = readings;
        let motion = &past.states[k - 1];
        let ago = T::of(new.t - motion.t);
        if by == MeasuredBy::CurrentRows {
            constraints.0.rates(new.t, &new.u, &new.v, rates)?;
        }
        let tangents = constraints.0.tangents();
        let first = tangents.all().start;
        let moved = |row: usize| g.row(row).map(|(dof, weight)| weight * (motion.u[dof] - new.u[dof])).sum::<T>();
        let gap = |row: usize| match (by, field) {
            (MeasuredBy::PastRows, _) => gaps[row],
            (MeasuredBy::CurrentRows, 0) => contacts.gap[row] + moved(row) - ago * rates[row].rate,
            (MeasuredBy::CurrentRows, 1) => g.product(row, &motion.v) + rates[row].rate,
            (MeasuredBy::CurrentRows, _) => g.product(row, &motion.a) + rates[row].acceleration,
        };
        let slip = |row: usize| match field {
            // From the current position back along the motion of the obstacle.
            0 => moved(row) - ago * (slips[row - first].rate - T::of(0.5) * ago * slips[row - first].acceleration),
            1 => g.product(row, &motion.v) + past_slips[row - first].rate,
            _ => g.product(row, &motion.a) + past_slips[row - first].acceleration,
        };
        // A law that reads the gap at the start of a stage holds it at its current value.
        let target = |row: usize| match field == 0 && !g.is_tangential(row) && constraints.0.law(row).reads_start() {
            true => contacts.gap[row],
            false => rebounds.past(row, field, ago),
        };
        problem.clear();
        for &row in engaged {
            let own = tangents.of(row);
            let slides = !own.is_empty() && contacts.sliding[row] && !rebounds.leaves(row);
            if slides {
                let direction = problem.direction(row).map(|f| T::of(tangents.friction(row)) * f);
                let block = Block::new(row, own.len(), AdmissibleSet::Free);
                problem.add_block(&Block { direction: Some(direction), ..block });
            }
            for row in std::iter::once(row).chain(own) {
                if !slides {
                    problem.add_block(&Block::new(row, 0, AdmissibleSet::Free));
                }
                let jump = if g.is_tangential(row) { slip(row) } else { gap(row) } - target(row);
                let values = [&motion.u, &motion.v, &motion.a][field];
                problem.add_row(row, jump, rounding(g.magnitude(row, values) + jump.abs()), T::zero());
            }
        }
        let ids = &contacts.ids;
        problem.solve(
            (g, projection),
            &mut **solver,
            FrictionOf::Changes,
            (new.t, |row: usize| ids[tangents.owner(row)]),
        )?;
        let changes = problem.jump.iter().zip(&problem.left).map(|(&jump, &left)| left - jump);
        Ok(problem.increments.iter().zip(changes).map(|(&multiplier, change)| multiplier * change).sum())
    }

    /// Changes past states as if they had always had the velocity change of an impulse: v_k += Δv, u_k −= k h Δv if
    /// later rows read them. Otherwise a scheme that computes velocities from differences of displacements would see
    /// only a part of Δv, or more than Δv. The impulse itself must be applied first, by
    /// [`apply_impulses`](Self::apply_impulses) or [`exchange_energy`](Self::exchange_energy).
    ///
    /// # Errors
    ///
    /// [`Error::Incompatible`](crate::Error::Incompatible) if later rows read past states and the corrector's
    /// [`edits`](crate::corrector::Effects::edits) is not [`Edits::Past`](crate::corrector::Edits::Past); the
    /// errors of [`compliances`](Self::compliances).
    pub fn move_past(&mut self, row: usize, impulse: T) -> Result<()> {
        let places = self.places();
        let Self { past: Past { states, backup }, projection, g, contacts, scheme, .. } = self;
        // States between stages are dropped.
        let first = scheme.stages;
        if (first..=places).any(|k| scheme.read[k][0] || scheme.read[k][1]) {
            backup.check()?;
            backup.keep(states);
        }
        for k in first..=places {
            let (motion, steps) = (&mut states[k - 1], (k + 1 - scheme.stages) as f64);
            let [by_u, by_v, _] = scheme.covector[k];
            if scheme.read[k][0] {
                projection.push(g, (&[row], &[impulse]), T::of(-steps * scheme.h), &mut motion.u)?;
                contacts.impulse[row] -= T::of(steps * by_u) * impulse;
            }
            if scheme.read[k][1] {
                projection.push(g, (&[row], &[impulse]), T::one(), &mut motion.v)?;
                contacts.impulse[row] += T::of(by_v) * impulse;
            }
        }
        Ok(())
    }
}
