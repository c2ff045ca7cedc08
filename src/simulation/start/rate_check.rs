//! Compares gap rates and rows with gaps: a moving constraint must give nonzero rates, and a constraint whose gaps
//! turn must report that its rows change.

use crate::contact::{ContactJacobian, GapRates};
use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::TURNED;
use crate::simulation::rows::constraints::Constraints;
use crate::state::Motion;

/// Memory for the comparison, one entry a row.
pub(crate) struct RateCheck<T> {
    /// Gaps at two times.
    before: Vec<T>,
    now: Vec<T>,
    rates: Vec<GapRates<T>>,
    /// Whether the gap has changed at every time so far with zero rates.
    silent: Vec<bool>,
    /// The version of the rows before the search of the step.
    pub(crate) version: u64,
}

impl<T: Real> RateCheck<T> {
    /// Memory for `rows` rows.
    pub(crate) fn new(rows: usize) -> Self {
        let mut check = Self { before: Vec::new(), now: Vec::new(), rates: Vec::new(), silent: Vec::new(), version: 0 };
        check.resize(rows);
        check
    }

    /// Memory for `rows` rows.
    pub(crate) fn resize(&mut self, rows: usize) {
        self.before.resize(rows, T::zero());
        self.now.resize(rows, T::zero());
        self.rates.resize(rows, GapRates::default());
        self.silent.resize(rows, false);
    }

    /// Refuses rows whose gap, at fixed displacements, changes throughout the time h from a motion on while their
    /// rates are zero. A jump changes a gap only once, and a wall that starts or stops has a rate at some of the
    /// times.
    pub(crate) fn check(
        &mut self,
        constraints: &mut Constraints<'_, T>,
        motion: &Motion<T>,
        h: f64,
        jacobian: &ContactJacobian<T>,
    ) -> Result<()> {
        /// Times, in shares of h, uneven so that an oscillation does not have the same gap at all of them.
        const SHARES: [f64; 5] = [0.0, 0.19, 0.42, 0.71, 1.0];
        let count = constraints.len();
        let Self { before, now, rates, silent, .. } = self;
        for (row, silent) in silent[..count].iter_mut().enumerate() {
            // The force of a spring does not depend on rates.
            *silent = constraints.law(row).reads_rates();
        }
        for (k, share) in SHARES.into_iter().enumerate() {
            if !silent[..count].contains(&true) {
                return Ok(());
            }
            let t = motion.t + share * h;
            std::mem::swap(before, now);
            constraints.finite_gaps(t, &motion.u, now)?;
            constraints.finite_rates(t, &motion.u, &motion.v, rates)?;
            for row in 0..count {
                let rounded = constraints.gap_rounding(row, jacobian.magnitude(row, &motion.u), now[row]);
                let moves = k == 0 || (now[row] - before[row]).abs() > rounded;
                silent[row] &= moves && rates[row].rate == T::zero() && constraints.gives_rates(row);
            }
        }
        let Some(row) = silent[..count].iter().position(|silent| *silent) else { return Ok(()) };
        constraints.finite_gaps(motion.t, &motion.u, before)?;
        Err(Error::SilentMotion {
            contact: constraints.ids[row],
            t: [motion.t, motion.t + h],
            gap: [before[row].value(), now[row].value()],
        })
    }

    /// Refuses rows that their constraints have reported as unchanged in this step, if the change of the gap between
    /// the displacements of the step differs from the change along the row.
    pub(crate) fn check_rows(
        &mut self,
        constraints: &mut Constraints<'_, T>,
        [start, new]: [&Motion<T>; 2],
        jacobian: &ContactJacobian<T>,
    ) -> Result<()> {
        let count = constraints.len();
        if !(0..count).any(|row| constraints.is_unchanged(row, self.version)) {
            return Ok(());
        }
        let Self { before, now, .. } = self;
        constraints.finite_gaps(new.t, &start.u, before)?;
        constraints.finite_gaps(new.t, &new.u, now)?;
        for row in (0..count).filter(|&row| constraints.is_unchanged(row, self.version)) {
            let (mut by_row, mut way, mut size) = (T::zero(), T::zero(), T::zero());
            for (dof, weight) in jacobian.row(row) {
                let moved = new.u[dof] - start.u[dof];
                by_row += weight * moved;
                (way, size) = (way.max((weight * moved).abs()), size + (weight * start.u[dof]).abs());
            }
            let change = now[row] - before[row];
            let rounded = constraints.gap_rounding(row, jacobian.magnitude(row, &new.u) + size, now[row]);
            if (change - by_row).abs() > T::of(TURNED) * way.max(change.abs()) + rounded {
                return Err(Error::SilentTurn {
                    contact: constraints.ids[row],
                    t: [start.t, new.t],
                    change: [change.value(), by_row.value()],
                });
            }
        }
        Ok(())
    }
}
