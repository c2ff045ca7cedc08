//! Jumps over contacts with friction: the unknowns are the total impulses of the stage and the corrected forces, both
//! in the friction cone. Removing a spike of a raw multiplier also removes μ times it (theory, section 18).

use super::past::FARTHEST;
use super::{Correction, Jump, Pressed};
use crate::contact::GapRates;
use crate::contact_solver::AdmissibleSet;
use crate::corrector::rubbing_problem::{Block, Rubbing};
use crate::corrector::{Buffers, slides};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;

impl<T: Real> Correction<'_, T> {
    /// Whether any contact of the run has friction.
    pub(super) fn rubs(&self) -> bool {
        !self.constraints.0.tangents().is_empty()
    }

    /// Whether an engaged contact sticks.
    pub(super) fn sticks(&self, row: usize) -> bool {
        self.contacts.sliding.get(row) == Some(&false) && !self.contacts.tangents.of(row).is_empty()
    }

    /// [`solve_velocity_jumps`](Self::solve_velocity_jumps) where contacts have friction: total impulses in the cone.
    pub(in crate::corrector) fn solve_rubbing_velocity(&mut self, pressed: Pressed) -> Result<()> {
        let rows = std::mem::take(&mut self.buffers.closed);
        // Raw multipliers have changed v by M⁻¹ Gᵀ times this factor.
        let share = T::of(self.h * self.scheme.response[1]);
        let result = self.solve_rubbing(&rows, (Jump::Velocity, pressed), share);
        let Self { buffers, contacts, constraints, .. } = self;
        let Buffers { engaged, impulses, rubbing, .. } = &mut **buffers;
        engaged.clear();
        impulses.clear();
        for block in &rubbing.blocks {
            let (row, totals) = (block.row, &rubbing.totals[block.places()]);
            impulses.push(rubbing.increments[block.places().start]);
            if block.set.is_bilateral() || totals[0] > T::zero() {
                engaged.push(row);
            }
            if block.tangents > 0 {
                let bound = T::of(constraints.0.tangents().friction(row)) * totals[0];
                let tangents = block.places().start + 1..block.places().end;
                let noise = T::largest(&rubbing.noise[tangents.clone()]);
                // A contact that has just stopped sliding has friction at its bound but no slip rate.
                contacts.sliding[row] = slides(length(&totals[1..]), bound) && length(&rubbing.left[tangents]) > noise;
            }
        }
        // The acceleration problem needs the directions of friction.
        rubbing.keep_directions();
        self.buffers.closed = rows;
        result
    }

    /// The same for the accelerations of the engaged rows: a sliding contact keeps its direction.
    pub(super) fn solve_rubbing_acceleration(&mut self) -> Result<()> {
        let rows = std::mem::take(&mut self.buffers.engaged);
        let share = T::of(self.scheme.acceleration / self.scheme.balance);
        let result = self.solve_rubbing(&rows, (Jump::Acceleration, Pressed::Stays), share);
        let Buffers { forces, rubbing, .. } = &mut *self.buffers;
        forces.clear();
        forces.extend(rubbing.blocks.iter().map(|block| rubbing.increments[block.places().start]));
        self.buffers.engaged = rows;
        result
    }

    /// Solves for the totals of the contacts `rows`; raw multipliers already contribute `share` times their values.
    fn solve_rubbing(&mut self, rows: &[usize], (jump, pressed): (Jump, Pressed), share: T) -> Result<()> {
        self.read_rates()?;
        self.read_slip_rates()?;
        self.pose_rubbing(rows, (jump, pressed), share);
        let mut solved = self.solve_posed();
        for excuse in [Self::rounding_of_gap, Self::share_of_rate] {
            if !matches!(solved, Err(Error::ContradictoryContacts { .. } | Error::Contact { .. })) {
                break;
            }
            for k in 0..self.buffers.rubbing.blocks.len() {
                let Block { row, .. } = self.buffers.rubbing.blocks[k];
                let (miss, place) = (excuse(self, row, jump), self.buffers.rubbing.blocks[k].places().start);
                self.buffers.rubbing.tolerance[place] += miss;
            }
            solved = self.solve_posed();
        }
        solved
    }

    /// Sets up the problem of the contacts `rows`; raw multipliers already contribute `share` times their values.
    fn pose_rubbing(&mut self, rows: &[usize], (jump, presses): (Jump, Pressed), share: T) {
        let Self { buffers, constraints, contacts, g, new, .. } = self;
        let Buffers { rubbing, rebounds, rates, slips, .. } = &mut **buffers;
        let tangents = constraints.0.tangents();
        rubbing.clear();
        for &row in rows {
            let held = presses == Pressed::Stays && contacts.lambda_raw[row] > T::zero();
            let pressed = held || constraints.0.law(row).is_equality();
            let (own, friction) = (tangents.of(row), tangents.friction(row));
            let set = match (own.len(), pressed) {
                (0, true) => AdmissibleSet::Free,
                (0, false) => AdmissibleSet::NonNegative,
                (count, pressed) => AdmissibleSet::with_friction(friction, count, pressed),
            };
            let slides = jump == Jump::Acceleration && !own.is_empty() && contacts.sliding[row];
            let direction = slides.then(|| rubbing.direction(row).map(|f| T::of(friction) * f));
            rubbing.push(&Block { direction, ..Block::new(row, own.len(), set) });
            for k in std::iter::once(row).chain(own.clone()) {
                let rate = if k == row { rates[row] } else { slips[k - tangents.all().start] };
                let (values, own_rate) = match jump {
                    Jump::Velocity => (&new.v, rate.rate),
                    Jump::Acceleration => (&new.a, rate.acceleration),
                };
                // A row without friction that stays closed admits any multiplier.
                let is_any = own.is_empty() && presses == Pressed::Stays;
                let base = if is_any { T::zero() } else { share * contacts.lambda_raw[k] };
                let size = g.magnitude(k, values) + own_rate.abs();
                let asked = if jump == Jump::Velocity { rebounds.asked(k) } else { T::zero() };
                rubbing.demand(k, g.product(k, values) + own_rate - asked, rounding(size), base);
            }
        }
        // The projection of past states makes each row a block of its own.
        rubbing.blocks.reserve(rubbing.rows.len() - rubbing.blocks.len());
    }

    fn solve_posed(&mut self) -> Result<()> {
        let Self { buffers, contacts, g, projection, solver, t, .. } = self;
        let ids = &contacts.ids;
        buffers.rubbing.solve((g, projection), &mut **solver, T::one(), (*t, |row: usize| ids[row]))
    }

    /// Projects one field of past state k onto the engaged contacts: gaps and their rates vanish, and slips if the
    /// contact sticks. If it slides, the past gets the friction of the normal impulse applied here.
    pub(super) fn project_rubbing_field(&mut self, k: usize, field: usize, engaged: &[usize]) -> Result<()> {
        let Self { past, constraints, buffers, new, .. } = self;
        let Buffers { gaps, past_slips, .. } = &mut **buffers;
        let motion = &past[k - 1];
        constraints.0.elsewhere(field, motion.place(), (new.t, &new.u), gaps)?;
        constraints.0.slip_rates(motion.t, &motion.u, &motion.v, past_slips)?;
        if self.constraints.0.turn() {
            // As for contacts without friction, see `see_straight`.
            self.look_straight((k, field), engaged)?;
            let straight = self.solve_past((k, field), engaged, true)?;
            if self.solve_past((k, field), engaged, false)? > T::of(FARTHEST * FARTHEST) * straight {
                self.solve_past((k, field), engaged, true)?;
            }
        } else {
            self.solve_past((k, field), engaged, false)?;
        }
        if field == 2 {
            let Rubbing { rows, increments, .. } = &mut *self.buffers.rubbing;
            let (rows, mut increments) = (std::mem::take(rows), std::mem::take(increments));
            let result = self.limit_forces(&rows, &mut increments, T::zero());
            (self.buffers.rubbing.rows, self.buffers.rubbing.increments) = (rows, increments);
            result?;
        }
        let Self { past, constraints, buffers, projection, g, contacts, scheme, h, energy, closed_at_start, .. } = self;
        let Buffers { rubbing, rates, past_slips, .. } = &mut **buffers;
        let motion = &mut past[k - 1];
        let (h, psi) = (*h, scheme.covector.get(k).map_or(0.0, |c| c[field]));
        let first = constraints.0.tangents().all().start;
        if field == 1 && !scheme.is_last() && k == scheme.stage + 1 {
            constraints.0.rates(motion.t, &motion.u, &motion.v, rates)?;
            let jumps = rubbing.jump.iter().zip(&rubbing.left);
            for ((&row, &impulse), (&before, &after)) in rubbing.rows.iter().zip(&rubbing.increments).zip(jumps) {
                let gain = impulse * T::of(0.5) * (before + after);
                let own = if row < first { rates[row].rate } else { past_slips[row - first].rate };
                if closed_at_start[contacts.tangents.owner(row)] {
                    **energy += gain - impulse * own;
                }
                if row < first {
                    contacts.dissipated[row] -= gain;
                }
            }
        }
        let (values, unit) = match field {
            0 => (&mut motion.u, psi / h),
            1 => (&mut motion.v, psi),
            _ => (&mut motion.a, psi * h),
        };
        projection.push(g, (&rubbing.rows, &rubbing.increments), T::one(), values)?;
        for (&row, &multiplier) in rubbing.rows.iter().zip(&rubbing.increments) {
            contacts.impulse[row] += T::of(unit) * multiplier;
        }
        Ok(())
    }

    /// Finds the multipliers that project one field of past state k onto the engaged contacts, with the gaps at the
    /// past state, or, if `straight`, the gaps measured with the current rows. Returns the squared distance that the
    /// past moves in the mass norm.
    fn solve_past(&mut self, (k, field): (usize, usize), engaged: &[usize], straight: bool) -> Result<T> {
        let Self { past, constraints, buffers, projection, solver, g, contacts, t, new, .. } = self;
        let Buffers { rubbing, rebounds, gaps, straight: seen, slips, past_slips, .. } = &mut **buffers;
        let motion = &past[k - 1];
        let before = T::of(new.t - motion.t);
        let tangents = constraints.0.tangents();
        let first = tangents.all().start;
        let slip = |row: usize| match field {
            // From the current position back along the motion of the obstacle.
            0 => {
                let now = slips[row - first];
                let way = g.row(row).map(|(dof, weight)| weight * (motion.u[dof] - new.u[dof])).sum::<T>();
                way - before * (now.rate - T::of(0.5) * before * now.acceleration)
            }
            1 => g.product(row, &motion.v) + past_slips[row - first].rate,
            _ => g.product(row, &motion.a) + past_slips[row - first].acceleration,
        };
        let size = |row: usize, jump: T| {
            let values = [&motion.u, &motion.v, &motion.a][field.min(2)];
            rounding(g.magnitude(row, values) + jump.abs())
        };
        rubbing.clear();
        for (place, &row) in engaged.iter().enumerate() {
            let own = tangents.of(row);
            let gap = if straight { seen[place] } else { gaps[row] };
            if own.is_empty() || !contacts.sliding[row] || rebounds.leaves(row) {
                for row in std::iter::once(row).chain(own) {
                    let jump = if row < first { gap } else { slip(row) } - rebounds.past(row, field, before);
                    rubbing.push(&Block::new(row, 0, AdmissibleSet::Free));
                    rubbing.demand(row, jump, size(row, jump), T::zero());
                }
            } else {
                let direction = rubbing.direction(row).map(|f| T::of(tangents.friction(row)) * f);
                let set = AdmissibleSet::with_friction(0.0, own.len(), true);
                rubbing.push(&Block { direction: Some(direction), ..Block::new(row, own.len(), set) });
                rubbing.demand(row, gap, size(row, gap), T::zero());
                own.for_each(|row| rubbing.demand(row, slip(row), size(row, slip(row)), T::zero()));
            }
        }
        // A body that came from a positive gap has received a positive impulse: its past displacement is moved back
        // accordingly.
        let presses = if field == 0 { -T::one() } else { T::one() };
        let ids = &contacts.ids;
        rubbing.solve((g, projection), &mut **solver, presses, (*t, |row: usize| ids[tangents.owner(row)]))?;
        let changes = rubbing.jump.iter().zip(&rubbing.left).map(|(&jump, &left)| left - jump);
        Ok(rubbing.increments.iter().zip(changes).map(|(&multiplier, change)| multiplier * change).sum())
    }

    /// Reads the slip rates that the constraints add.
    pub(super) fn read_slip_rates(&mut self) -> Result<()> {
        if self.constraints.0.tangents().is_empty() {
            return Ok(());
        }
        let Buffers { slips, past_slips, .. } = &mut *self.buffers;
        for rates in [&mut *slips, past_slips] {
            rates.resize(rates.len().max(self.constraints.0.tangents().len()), GapRates::default());
        }
        self.constraints.0.slip_rates(self.t, &self.new.u, &self.new.v, slips)
    }

    /// Applies the impulses found along normals and tangents.
    pub(in crate::corrector) fn push_rubbing_velocity(&mut self) -> Result<()> {
        let Rubbing { rows, increments, .. } = &mut *self.buffers.rubbing;
        let (rows, increments) = (std::mem::take(rows), std::mem::take(increments));
        let result = self.apply(&rows, &increments);
        for (&row, &impulse) in rows.iter().zip(&increments) {
            self.contacts.lambda_a[row] = -T::of(self.h) * impulse;
        }
        (self.buffers.rubbing.rows, self.buffers.rubbing.increments) = (rows, increments);
        result
    }

    /// Applies the forces found along normals and tangents.
    pub(super) fn push_rubbing_acceleration(&mut self) -> Result<()> {
        let Rubbing { rows, increments, .. } = &mut *self.buffers.rubbing;
        let (rows, mut increments) = (std::mem::take(rows), std::mem::take(increments));
        let result = self.push_limited_forces(&rows, &mut increments);
        (self.buffers.rubbing.rows, self.buffers.rubbing.increments) = (rows, increments);
        result
    }
}

/// The length of a tangential vector.
fn length<T: Real>(x: &[T]) -> T {
    x.iter().fold(T::zero(), |length, &x| length.hypot(x))
}
