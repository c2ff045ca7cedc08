//! The jumps of a stage and their removal. With friction the unknowns are the total impulses of the stage and the
//! corrected forces, both in the friction cone. Removing a spike of a raw multiplier also removes μ times it (theory,
//! section 18).

use super::{Correction, Jump, Pressed};
use crate::contact::GapRates;
use crate::contact_solver::AdmissibleSet;
use crate::corrector::buffers::{Readings, Removal};
use crate::corrector::jump_problem::{Block, FrictionOf, JumpProblem};
use crate::corrector::{Buffers, slides};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::{ROUNDINGS_OF_STEP, rounding, share_of_rounding};

impl<T: Real> Correction<'_, T> {
    /// Finds the engaged rows and the impulses that make the gap rates of the closed rows vanish (pressed rows) or
    /// nonnegative (touching rows, and contacts with friction). Rows that close under a law with restitution get their
    /// rebound rates and are then not engaged.
    ///
    /// # Errors
    ///
    /// [`Error::ContactNotFinite`], [`Error::Contact`].
    pub fn solve_velocity_jumps(&mut self) -> Result<()> {
        if self.find_rebounds()? { self.solve_rebounds() } else { self.solve_velocity(Pressed::Stays) }
    }

    /// [`solve_velocity_jumps`](Self::solve_velocity_jumps) with the rebound rates given, if there are any.
    pub(in crate::corrector) fn solve_velocity(&mut self, pressed: Pressed) -> Result<()> {
        let rows = std::mem::take(&mut self.buffers.rows.closed);
        // Raw multipliers have changed v by M⁻¹ Gᵀ times this factor.
        let share = T::of(self.scheme.h * self.scheme.response[1]);
        let result = self.solve_jumps(&rows, (Jump::Velocity, pressed), share);
        self.buffers.rows.closed = rows;
        result?;
        let Self { buffers, contacts, constraints, .. } = self;
        let Buffers { rows, impulses, problem, .. } = &mut **buffers;
        rows.engaged.clear();
        for block in &problem.blocks {
            let (row, totals) = (block.row, &problem.totals[block.places()]);
            let is_pressed = block.tangents > 0 && pressed == Pressed::Stays && contacts.lambda_raw[row] > T::zero();
            if block.set.is_bilateral() || is_pressed || totals[0] > T::zero() {
                rows.engaged.push(row);
            }
            if block.tangents > 0 {
                let bound = T::of(constraints.0.tangents().friction(row)) * totals[0];
                let tangents = block.places().start + 1..block.places().end;
                let noise = T::largest(&problem.noise[tangents.clone()]);
                // A contact that has just stopped sliding has friction at its bound but no slip rate.
                contacts.sliding[row] = slides(length(&totals[1..]), bound) && length(&problem.left[tangents]) > noise;
            }
        }
        // The acceleration problem needs the directions of friction.
        problem.keep_directions();
        impulses.store(problem);
        self.record_solution(1, share);
        Ok(())
    }

    /// Finds the forces that make the gap accelerations of the engaged rows vanish (pressed rows) or nonnegative
    /// (touching rows, and contacts with friction). A sliding contact keeps its direction.
    ///
    /// # Errors
    ///
    /// [`Error::ContactNotFinite`], [`Error::Contact`].
    pub fn solve_acceleration_jumps(&mut self) -> Result<()> {
        let rows = std::mem::take(&mut self.buffers.rows.engaged);
        let share = T::of(self.scheme.acceleration / self.scheme.balance);
        let result = self.solve_jumps(&rows, (Jump::Acceleration, Pressed::Stays), share);
        self.buffers.rows.engaged = rows;
        result?;
        let Buffers { forces, problem, .. } = &mut *self.buffers;
        forces.store(problem);
        self.record_solution(2, share);
        Ok(())
    }

    /// Solves for the totals of the contacts `rows`; raw multipliers already contribute `share` times their values.
    fn solve_jumps(&mut self, rows: &[usize], (jump, pressed): (Jump, Pressed), share: T) -> Result<()> {
        self.read_rates()?;
        self.read_slip_rates()?;
        self.pose(rows, (jump, pressed), share);
        let mut solved = self.solve_posed();
        // Rows that contradict each other by less than their errors are solved with these errors as tolerance.
        for error_of in [Self::rounding_of_gap, Self::share_of_rate, Self::acceleration_of_turn] {
            if !matches!(solved, Err(Error::ContradictoryContacts { .. } | Error::Contact { .. })) {
                break;
            }
            for k in 0..self.buffers.problem.blocks.len() {
                let Block { row, place, .. } = self.buffers.problem.blocks[k];
                let error = error_of(self, row, jump);
                self.buffers.problem.tolerance[place] += error;
            }
            solved = self.solve_posed();
        }
        solved
    }

    /// Sets up the problem of the contacts `rows`; raw multipliers already contribute `share` times their values.
    fn pose(&mut self, rows: &[usize], (jump, pressed): (Jump, Pressed), share: T) {
        let Self { buffers, constraints, contacts, g, new, .. } = self;
        let Buffers { problem, rebounds, readings, .. } = &mut **buffers;
        let Readings { rates, slips, .. } = readings;
        let tangents = constraints.0.tangents();
        problem.clear();
        for &row in rows {
            let (own, friction) = (tangents.of(row), tangents.friction(row));
            let is_pressed = pressed == Pressed::Stays && contacts.lambda_raw[row] > T::zero();
            let set = match own.len() {
                0 if is_pressed || constraints.0.law(row).is_equality() => AdmissibleSet::Free,
                0 => AdmissibleSet::NonNegative,
                // It is not held: where it pulled, it would have no friction (theory, section 18).
                count => AdmissibleSet::with_friction(friction, count),
            };
            let slides = jump == Jump::Acceleration && !own.is_empty() && contacts.sliding[row];
            let direction = slides.then(|| problem.direction(row).map(|f| T::of(friction) * f));
            problem.add_block(&Block { direction, ..Block::new(row, own.len(), set) });
            for k in std::iter::once(row).chain(own.clone()) {
                let rate = if k == row { rates[row] } else { slips[k - tangents.all().start] };
                let (values, own_rate) = jump.terms(new, &rate);
                // A row without friction that stays closed admits any multiplier.
                let is_any = own.is_empty() && pressed == Pressed::Stays;
                let base = if is_any { T::zero() } else { share * contacts.lambda_raw[k] };
                let size = g.magnitude(k, values) + own_rate.abs();
                let target = if jump == Jump::Velocity { rebounds.target(k) } else { T::zero() };
                problem.add_row(k, g.product(k, values) + own_rate - target, rounding(size), base);
            }
        }
    }

    fn solve_posed(&mut self) -> Result<()> {
        let Self { buffers, contacts, g, projection, solver, new, .. } = self;
        let ids = &contacts.ids;
        buffers.problem.solve((g, projection), &mut **solver, FrictionOf::Pressing, (new.t, |row: usize| ids[row]))
    }

    /// The jump caused by the rounding of a gap in the scheme. Dependent rows may contradict each other by this much.
    fn rounding_of_gap(&self, row: usize, jump: Jump) -> T {
        let [by_u, by_v, by_a] = self.scheme.response;
        let per_gap = T::of(ROUNDINGS_OF_STEP)
            * T::of(match jump {
                Jump::Velocity => (by_v / by_u).abs() / self.scheme.h,
                Jump::Acceleration => (by_a / by_u).abs() / (self.scheme.h * self.scheme.h),
            });
        let magnitude = self.g.magnitude(row, &self.new.u);
        per_gap * self.constraints.0.gap_rounding(row, magnitude, self.contacts.gap[row])
    }

    /// A share ε^⅓ of the rates in a jump. If two nodes face each other and each lies on the facets of the other,
    /// their rows and rates differ by the angle between these facets. S contains the square of this angle, and pivots
    /// below ε^⅔ count as zero ([`DenseCholesky`](crate::dense::DenseCholesky)).
    fn share_of_rate(&self, row: usize, jump: Jump) -> T {
        let (values, own) = jump.terms(self.new, &self.buffers.readings.rates[row]);
        share_of_rounding::<T>().sqrt() * (self.g.magnitude(row, values) + own.abs())
    }

    /// The acceleration of a gap along a row that turns. Where two nodes face each other their rows are the same, but
    /// not these accelerations: the facets turn at different rates, and the nodes slide along them.
    fn acceleration_of_turn(&self, row: usize, jump: Jump) -> T {
        match jump {
            Jump::Velocity => T::zero(),
            Jump::Acceleration => jump.terms(self.new, &self.buffers.readings.rates[row]).1.abs(),
        }
    }

    /// Reads the slip rates that the constraints add.
    pub(super) fn read_slip_rates(&mut self) -> Result<()> {
        if self.constraints.0.tangents().is_empty() {
            return Ok(());
        }
        let Readings { slips, past_slips, .. } = &mut self.buffers.readings;
        for rates in [&mut *slips, past_slips] {
            rates.resize(rates.len().max(self.constraints.0.tangents().len()), GapRates::default());
        }
        self.constraints.0.slip_rates(self.new.t, &self.new.u, &self.new.v, slips)
    }

    /// Applies the impulses of [`solve_velocity_jumps`](Self::solve_velocity_jumps) to v, and the resulting change of
    /// damping forces to a, as [`apply_impulses`](Self::apply_impulses) does.
    ///
    /// # Errors
    ///
    /// As [`apply_impulses`](Self::apply_impulses).
    pub fn push_velocity(&mut self) -> Result<()> {
        let impulses = std::mem::take(&mut self.buffers.impulses);
        self.record_removal(1);
        let mut result = self.apply(&impulses.rows, &impulses.multipliers);
        for (&row, &impulse) in impulses.rows.iter().zip(&impulses.multipliers) {
            if impulse != T::zero() {
                self.contacts.lambda_a[row] = -T::of(self.scheme.h) * impulse;
            }
        }
        self.buffers.impulses = impulses;
        if result.is_ok() && self.buffers.rebounds.any() {
            result = self.release_rebounds();
        }
        result
    }

    /// Applies the forces of [`solve_acceleration_jumps`](Self::solve_acceleration_jumps) to a and to the reported
    /// contact force.
    ///
    /// If bodies have damping and steps start from a, the forces first cancel the contribution of the raw
    /// multipliers. The remainder y is reduced to min(1, s/d)² y, with one factor for all rows that S couples: s = yᵀ
    /// S y is the power of inertia, d the power of the damping force due to the velocity that y produces in a step. A
    /// step that resolves the damping keeps all of y. In a longer step y would act during a part of the next step
    /// although the velocities that it belongs to have decayed by then (theory, section 7.1).
    ///
    /// # Errors
    ///
    /// The errors of a solve with a consistent mass, [`Error::LinearNotConverged`] and [`Error::Singular`].
    pub fn push_acceleration(&mut self) -> Result<()> {
        let mut forces = std::mem::take(&mut self.buffers.forces);
        let given = T::of(self.scheme.acceleration / self.scheme.balance);
        let result = self.limit_forces(&forces.rows, &mut forces.multipliers, given);
        self.record_removal(2);
        let result = result.and_then(|()| self.push_forces(&forces.rows, &forces.multipliers));
        self.buffers.forces = forces;
        result
    }
}

impl<T: Real> Removal<T> {
    /// Stores the increments of a solved problem.
    fn store(&mut self, problem: &JumpProblem<T>) {
        let JumpProblem { blocks, rows, increments, .. } = problem;
        self.rows.clone_from(rows);
        self.multipliers.clone_from(increments);
        self.normal.clear();
        self.normal.extend(blocks.iter().map(|block| increments[block.place]));
    }
}

/// The length of a tangential vector.
fn length<T: Real>(x: &[T]) -> T {
    x.iter().fold(T::zero(), |length, &x| length.hypot(x))
}
