//! Restitution: closing contacts rebound with a share of their approach rate, ġ′ = −e ġ⁻ (theory, section 7.5).

use super::{Correction, Pressed};
use crate::contact::GapRates;
use crate::corrector::Buffers;
use crate::corrector::buffers::{Readings, StageRows};
use crate::corrector::rebounds::Rebounds;
use crate::error::Result;
use crate::real::Real;
use crate::rounding::{rounding, share_of_rounding};

impl<T: Real> Correction<'_, T> {
    /// Finds the contacts that close, under a law with restitution, fast enough not to return within two steps.
    ///
    /// The rate before the impact is evaluated at zero gap, from gap, rate and acceleration at the start of the
    /// stage: an elastic impact then conserves energy, including the potential energy of the remaining gap.
    pub(super) fn find_rebounds(&mut self) -> Result<bool> {
        self.buffers.rebounds.any = false;
        self.buffers.rebounds.leaving.clear();
        let may_rebound = |row: &usize| self.constraints.0.law(*row).rebounds();
        if !self.buffers.rows.closed.iter().any(may_rebound) || self.past.states.is_empty() {
            return Ok(false);
        }
        self.read_rates()?;
        let Self { buffers, constraints, g, past, new, before, scheme, .. } = self;
        let Buffers { rebounds, rows: StageRows { closed, .. }, readings: Readings { gaps, rates, .. }, .. } =
            &mut **buffers;
        let (Some(start), h) = (past.states.first(), T::of(scheme.h)) else { return Ok(false) };
        let comes = |&row: &usize| !before.closed[row] || g.product(row, &start.v) + rates[row].rate < T::zero();
        if !closed.iter().any(|row| constraints.0.law(*row).rebounds() && comes(row)) {
            return Ok(false);
        }
        let Rebounds { before, targets, outgoing, share, .. } = &mut **rebounds;
        for values in [&mut *before, targets] {
            values.clear();
            values.resize(g.rows(), T::zero());
        }
        outgoing.clear();
        outgoing.resize(g.rows(), [T::zero(); 2]);
        *share = T::one();
        // `outgoing` temporarily holds gap and acceleration.
        for field in 0..3 {
            constraints.0.elsewhere(field, start.place(), (new.t, &new.u), gaps)?;
            for &row in closed.iter() {
                match field {
                    0 => outgoing[row][0] = gaps[row].max(T::zero()),
                    1 => before[row] = gaps[row],
                    _ => outgoing[row][1] = gaps[row],
                }
            }
        }
        for k in 0..self.buffers.rows.closed.len() {
            let row = self.buffers.rows.closed[k];
            let e = self.constraints.0.law(row).restitution().unwrap_or(0.0);
            let (rate, [gap, acceleration]) = (self.buffers.rebounds.before[row], self.buffers.rebounds.outgoing[row]);
            let square = rate * rate - T::of(2.0) * acceleration * gap;
            if e == 0.0 || square <= T::zero() || rate >= T::zero() && acceleration >= T::zero() {
                continue;
            }
            let approach = square.sqrt();
            // A contact that would return within two steps, pulled by loads that its force also balances, stays: it
            // would chatter.
            let pulled = self.compliance(row)? * self.buffers.rows.reported[row].max(T::zero()) - acceleration;
            let least = (h * pulled).max(self.noise_of_rate(row, h));
            let Rebounds { any, before, targets, .. } = &mut *self.buffers.rebounds;
            before[row] = -approach;
            if T::of(e) * approach > least {
                (targets[row], *any) = (T::of(e) * approach, true);
            }
        }
        let Self { buffers, constraints, g, past, .. } = self;
        let Buffers { rebounds, readings: Readings { past_slips, .. }, .. } = &mut **buffers;
        let (Some(start), Rebounds { any, before, .. }) = (past.states.first(), &mut **rebounds) else {
            return Ok(false);
        };
        let tangents = constraints.0.tangents();
        if *any && !tangents.is_empty() {
            past_slips.resize(past_slips.len().max(tangents.len()), GapRates::default());
            constraints.0.slip_rates(start.t, &start.u, &start.v, past_slips)?;
            let tangents = constraints.0.tangents();
            for k in tangents.all() {
                before[k] = g.product(k, &start.v) + past_slips[k - tangents.all().start].rate;
            }
        }
        Ok(rebounds.any)
    }

    /// The rounding error of a rate, as in the jumps of a step.
    fn noise_of_rate(&self, row: usize, h: T) -> T {
        let Some(start) = self.past.states.first() else { return T::zero() };
        let share = share_of_rounding::<T>();
        let of_gap = self.constraints.0.gap_rounding(row, self.g.magnitude(row, &start.u), self.contacts.gap[row]);
        let of_rates = self.g.magnitude(row, &start.v) + h * self.g.magnitude(row, &start.a);
        share * of_rates + share / rounding(T::one()) * of_gap / h
    }

    /// Finds impulses with which the contacts of [`find_rebounds`](Self::find_rebounds) leave and others stay or
    /// open; no total pulls. The law may add energy with friction or with different coefficients in one impact;
    /// contacts then leave with the largest fraction of the target rates that adds none.
    pub(super) fn solve_rebounds(&mut self) -> Result<()> {
        /// Halvings of the share.
        const HALVINGS: usize = 45;
        self.solve_velocity(Pressed::MaySeparate)?;
        if self.rebounds_gain() {
            let half = T::of(0.5);
            let (mut least, mut most) = (T::zero(), T::one());
            for _ in 0..HALVINGS {
                self.buffers.rebounds.share = half * (least + most);
                self.solve_velocity(Pressed::MaySeparate)?;
                let bound = if self.rebounds_gain() { &mut most } else { &mut least };
                *bound = self.buffers.rebounds.share;
            }
            self.buffers.rebounds.share = least;
            self.solve_velocity(Pressed::MaySeparate)?;
        }
        let Self { buffers, constraints, contacts, .. } = self;
        let Buffers { rebounds, problem, rows: StageRows { engaged, .. }, .. } = &mut **buffers;
        for block in &problem.blocks {
            let total = problem.totals[block.place];
            let parts = total == T::zero() && contacts.lambda_raw[block.row] > T::zero();
            if !block.set.is_bilateral() && (parts || total > T::zero() && rebounds.target(block.row) > T::zero()) {
                rebounds.leaving.push(block.row);
            }
        }
        engaged.retain(|row| rebounds.leaving.binary_search(row).is_err());
        let contacts = rebounds.leaving.len();
        for place in 0..contacts {
            rebounds.leaving.extend(constraints.0.tangents().of(rebounds.leaving[place]));
        }
        rebounds.leaving.sort_unstable();
        Ok(())
    }

    /// Whether the impulses add energy: X·(ẏ⁻ + ẏ′)/2 over all rows.
    fn rebounds_gain(&self) -> bool {
        let Buffers { rebounds, problem, .. } = &*self.buffers;
        let (mut work, mut size) = (T::zero(), T::zero());
        for ((&row, &total), &left) in problem.rows.iter().zip(&problem.totals).zip(&problem.left) {
            let [before, after] = [rebounds.before[row], left + rebounds.target(row)];
            work += total * (before + after);
            size += total.abs() * (before.abs() + after.abs());
        }
        work > share_of_rounding::<T>() * size
    }

    /// Removes the forces of leaving contacts from the accelerations and from the reported forces: they no longer
    /// act.
    pub(super) fn release_rebounds(&mut self) -> Result<()> {
        let rows = std::mem::take(&mut self.buffers.rebounds.leaving);
        let result = self.remove_raw_forces(&rows);
        for &row in &rows {
            self.contacts.lambda[row] = T::zero();
            self.contacts.lambda_v[row] = -T::of(self.scheme.h / self.scheme.balance) * self.contacts.lambda_raw[row];
        }
        self.buffers.rebounds.leaving = rows;
        result
    }

    /// Stores rates and accelerations of leaving contacts; returns whether there are any.
    pub(super) fn record_outgoing(&mut self) -> Result<bool> {
        if self.buffers.rebounds.leaving.is_empty() {
            return Ok(false);
        }
        self.read_rates()?;
        self.read_slip_rates()?;
        let Self { buffers, constraints, g, new, .. } = self;
        let Buffers { rebounds, readings: Readings { rates, slips, .. }, .. } = &mut **buffers;
        let first = constraints.0.tangents().all().start;
        for &row in &rebounds.leaving {
            let own = if g.is_tangential(row) { slips[row - first] } else { rates[row] };
            rebounds.outgoing[row] = [g.product(row, &new.v) + own.rate, g.product(row, &new.a) + own.acceleration];
        }
        Ok(true)
    }
}
