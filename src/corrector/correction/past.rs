//! Edits of past states: projection onto newly closed contacts, and velocity changes applied together with the
//! state's.

use super::{Buffers, Correction};
use crate::error::Result;
use crate::real::Real;

/// Largest accepted ratio of the distance that a projection moves the past, in the mass norm, to the distance with
/// the current rows.
pub(super) const FARTHEST: f64 = 2.0;

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
        let leave = self.note_outgoing()?;
        let begins = |&row: &usize| !self.was_closed[row] || self.sticks(row) && !self.was_sticking[row];
        if !leave && !self.buffers.engaged.iter().any(begins) {
            return Ok(());
        }
        self.backup.check()?;
        let mut rows = std::mem::take(&mut self.buffers.engaged);
        if leave {
            rows.extend(self.buffers.rebounds.contacts(self.g));
            rows.sort_unstable();
        }
        let mut closing = match self.rubs() {
            true => self.read_slip_rates(),
            false => self.close(&rows),
        };
        // Past states not known yet, while a multistep scheme is started, have no covector.
        let places = self.past.len().min(self.scheme.read.len().min(self.scheme.covector.len()).saturating_sub(1));
        if closing.is_ok() && self.scheme.read[1..=places].iter().flatten().any(|&read| read) {
            self.backup.keep(self.past);
            for k in 1..=places {
                for field in 0..3 {
                    if closing.is_ok() && self.scheme.read[k][field] {
                        closing = match self.rubs() {
                            true => self.project_rubbing_field(k, field, &rows),
                            false => self.project_field(k, field, &rows),
                        };
                    }
                }
            }
        }
        rows.retain(|&row| !self.buffers.rebounds.leaves(row));
        self.buffers.engaged = rows;
        closing
    }

    /// Projects one field of past state k onto the engaged rows.
    fn project_field(&mut self, k: usize, field: usize, rows: &[usize]) -> Result<()> {
        let Self { past, constraints, buffers, projection, contacts, scheme, h, new, .. } = self;
        let Buffers { gaps, jump, tolerance: before, rebounds, .. } = &mut **buffers;
        let motion = &mut past[k - 1];
        let ago = T::of(new.t - motion.t);
        let (h, psi) = (*h, scheme.covector.get(k).map_or(0.0, |c| c[field]));
        // The past motion uses its own part of a curved surface, so that u, v and a agree.
        constraints.0.elsewhere(field, motion.place(), (new.t, &new.u), gaps)?;
        // The value at which a gap is held under a law that reads it at the start of a stage.
        let held = |row: usize| match field == 0 && constraints.0.law(row).reads_start() {
            true => contacts.gap[row],
            false => rebounds.past(row, field, ago),
        };
        jump.clear();
        jump.extend(rows.iter().map(|&row| gaps[row] - held(row)));
        before.clear();
        before.extend_from_slice(jump);
        projection.solve(jump);
        if constraints.0.turn() {
            self.see_straight((k, field), rows)?;
        }
        if field == 2 {
            let mut forces = std::mem::take(&mut self.buffers.jump);
            let result = self.limit_forces(rows, &mut forces, T::zero());
            self.buffers.jump = forces;
            result?;
        }
        let Self { past, constraints, buffers, projection, g, contacts, scheme, energy, closed_at_start, .. } = self;
        let Buffers { rates, jump, tolerance: before, rebounds, .. } = &mut **buffers;
        let motion = &mut past[k - 1];
        let ago = T::of(self.t - motion.t);
        // In a stage before the last, the state at the start of the step loses energy that later stages do not see.
        if field == 1 && !scheme.is_last() && k == scheme.stage + 1 {
            constraints.0.rates(motion.t, &motion.u, &motion.v, rates)?;
            for ((&row, &multiplier), &before) in rows.iter().zip(jump.iter()).zip(before.iter()) {
                let taken = multiplier * (T::of(0.5) * before + rebounds.past(row, field, ago));
                contacts.dissipated[row] += taken;
                if closed_at_start[row] {
                    **energy += multiplier * rates[row].rate - taken;
                }
            }
        }
        let (values, unit) = match field {
            0 => (&mut motion.u, psi / h),
            1 => (&mut motion.v, psi),
            _ => (&mut motion.a, psi * h),
        };
        projection.push(g, (rows, jump), -T::one(), values)?;
        for (&row, &multiplier) in rows.iter().zip(jump.iter()) {
            contacts.impulse[row] -= T::of(unit) * multiplier;
        }
        Ok(())
    }

    /// Uses the jumps of one field of past state k measured with the current rows, if the rows of the past would move
    /// it much farther. Rows that are nearly equal, but have turned in between, may contradict each other in the past
    /// and together move it very far. With the current rows it moves at most as far as the bodies have moved.
    fn see_straight(&mut self, (k, field): (usize, usize), rows: &[usize]) -> Result<()> {
        self.look_straight((k, field), rows)?;
        let Self { buffers, projection, past, new, .. } = self;
        let Buffers { jump, tolerance: before, straight, by_straight, rebounds, .. } = &mut **buffers;
        let ago = T::of(new.t - past[k - 1].t);
        for (straight, &row) in straight.iter_mut().zip(rows) {
            *straight -= rebounds.past(row, field, ago);
        }
        by_straight.clear();
        by_straight.extend_from_slice(straight);
        projection.solve(by_straight);
        let square = |jumps: &[T], by: &[T]| jumps.iter().zip(by).map(|(&jump, &by)| jump * by).sum::<T>();
        if square(before, jump) > T::of(FARTHEST * FARTHEST) * square(straight, by_straight) {
            std::mem::swap(before, straight);
            std::mem::swap(jump, by_straight);
        }
        Ok(())
    }

    /// Computes one field of past state k with the current rows.
    pub(super) fn look_straight(&mut self, (k, field): (usize, usize), rows: &[usize]) -> Result<()> {
        let Self { past, constraints, buffers, g, contacts, new, .. } = self;
        let Buffers { rates, straight, .. } = &mut **buffers;
        let motion = &past[k - 1];
        constraints.0.rates(new.t, &new.u, &new.v, rates)?;
        let since = T::of(new.t - motion.t);
        let by_rows = |row: usize| match field {
            0 => {
                let way = g.product(row, &new.u) - g.product(row, &motion.u);
                let held = if constraints.0.law(row).reads_start() { T::zero() } else { contacts.gap[row] };
                held - way - since * rates[row].rate
            }
            1 => g.product(row, &motion.v) + rates[row].rate,
            _ => g.product(row, &motion.a) + rates[row].acceleration,
        };
        straight.clear();
        straight.extend(rows.iter().map(|&row| by_rows(row)));
        Ok(())
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
        let Self { past, backup, projection, g, contacts, scheme, h, .. } = self;
        // Past states not known yet, while a multistep scheme is started, have no covector; states between stages are
        // dropped.
        let places = past.len().min(scheme.read.len().min(scheme.covector.len()).saturating_sub(1));
        let first = scheme.stages;
        if (first..=places).any(|k| scheme.read[k][0] || scheme.read[k][1]) {
            backup.check()?;
            backup.keep(past);
        }
        for k in first..=places {
            let (motion, steps) = (&mut past[k - 1], (k + 1 - scheme.stages) as f64);
            let [by_u, by_v, _] = scheme.covector[k];
            if scheme.read[k][0] {
                projection.push(g, (&[row], &[impulse]), T::of(-steps * *h), &mut motion.u)?;
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
