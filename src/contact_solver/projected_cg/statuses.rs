//! Which rows are closed, and which contacts stick or slide.
//!
//! A sliding contact has its friction given, μ times its last normal force along its slip. In space it has one equation
//! more, across the slip: friction turns with the slip there, as if the row had the compliance |slip| / (μ p). Both are
//! given anew at each look: normal forces depend little on the friction of the same step.

use super::WHAT;
use super::metric::Metric;
use super::rows::{Block, Rows};
use crate::error::Result;
use crate::memory;
use crate::real::Real;
use crate::rounding::projected_residual;
use std::ops::Range;

/// The part of a row in the equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// λ = 0.
    Open,
    /// G x + c λ + q = 0.
    Closed,
    /// λ is given: friction along the slip.
    Given,
}

/// The status of each row, in the tangents of [`Rows`].
#[derive(Debug, Default)]
pub(super) struct Statuses<T> {
    pub(super) roles: Vec<Role>,
    pub(super) multipliers: Vec<T>,
    /// Compliances of the laws, and across the slip.
    pub(super) compliance: Vec<T>,
    /// How often they have been decided for the present problem.
    pub(super) looks: usize,
}

/// The angle (its sine) between slip and first tangent from which on the tangents are turned.
const TURNED: f64 = 0.3;

/// The friction beyond μ p, as a share of it, at which a contact begins to slide.
const BEYOND: f64 = 1e-9;

/// Looks in which all contacts may change their status. Later every second one may.
const TOGETHER: usize = 8;

/// Multiples of the residual that may be left between two looks.
const SAME: f64 = 16.0;

impl<T: Real> Statuses<T> {
    /// Before the first solution: rows are closed that are violated or equations, or carry a force in the guess; no
    /// contact slides.
    pub(super) fn begin(&mut self, rows: &Rows<T>, guess: &[T]) -> Result<()> {
        let Self { roles, multipliers, compliance, looks } = self;
        *looks = 0;
        memory::copy(compliance, &rows.compliance, WHAT)?;
        multipliers.clear();
        memory::grow(multipliers, rows.len(), 1, WHAT)?;
        roles.clear();
        memory::make_room(roles, rows.len(), WHAT)?;
        for Block { first, set, along, is_bilateral, .. } in rows.blocks.iter().copied() {
            let pressed = guess[first] > T::zero() && set.friction().is_none();
            let is_closed = is_bilateral || pressed || rows.offset[first] < T::zero();
            let role = if is_closed { Role::Closed } else { Role::Open };
            roles.push(role);
            let of_tangents = if along.is_some() || !is_closed { Role::Given } else { role };
            roles.extend(std::iter::repeat_n(of_tangents, set.rows() - 1));
        }
        Ok(())
    }

    /// The same statuses for rows linearized elsewhere.
    pub(super) fn keep(&mut self, rows: &Rows<T>) {
        self.looks = 0;
        for block in &rows.blocks {
            self.compliance[block.first] = rows.compliance[block.first];
        }
    }

    /// Decides anew from the present multipliers and x, of which the last entries are the displacements of compliant
    /// rows. Returns whether the equations have changed.
    pub(super) fn update(&mut self, rows: &mut Rows<T>, x: &mut [T], metric: &mut Metric<T>) -> bool {
        let share = projected_residual::<T>();
        let scaled = |lambda: T, row: usize, metric: &Metric<T>| lambda * metric.diagonal(row).sqrt();
        let scaled_sizes = (0..rows.len()).map(|row| scaled(self.multipliers[row], row, metric).abs());
        let largest = scaled_sizes.fold(T::zero(), T::max);
        let widest = T::largest(&rows.offset);
        let mut change = false;
        self.looks += 1;
        for at in 0..rows.blocks.len() {
            let Block { first, set, along, is_bilateral, .. } = rows.blocks[at];
            let lambda = self.multipliers[first];
            let tangents = rows.blocks[at].tangents();
            let closes = match self.roles[first] {
                Role::Closed if is_bilateral => true,
                Role::Closed => scaled(lambda, first, metric) >= -share * largest,
                _ => rows.gap(first, x) < -(rows.tolerance[first] + share * widest),
            };
            let rubs = |row: usize| self.roles[row] == Role::Closed || self.multipliers[row] != T::zero();
            let was_closed = self.roles[first] == Role::Closed;
            if closes != was_closed {
                change = true;
                if self.waits(at) {
                    continue;
                }
                // A contact is without friction before it opens, and as it closes: friction may pull, or push apart.
                if !was_closed || along.is_some() || !tangents.clone().any(rubs) {
                    self.set(first..first + 1, if closes { Role::Closed } else { Role::Open }, 0..0, x);
                }
                self.set(tangents.clone(), Role::Given, tangents, x);
                continue;
            }
            if let Some(along) = along {
                let small = |row: usize| share * largest / metric.diagonal(row).sqrt();
                for (row, along) in tangents.zip(along) {
                    if self.give(row, along * self.multipliers[first], small(row)) {
                        change = true;
                    }
                }
            } else if closes && let Some(friction) = set.friction() {
                let radius = T::of(friction) * lambda.max(T::zero());
                if self.slide(at, radius, share * largest, (rows, x, metric)) {
                    change = true;
                }
            }
        }
        change
    }

    /// Whether a contact must wait with a new status: redundant contacts that change together may do so for ever.
    fn waits(&self, at: usize) -> bool {
        self.looks > TOGETHER && !(at + self.looks).is_multiple_of(2)
    }

    /// Gives some rows the same role, without force unless they are closed; no slip turns their friction.
    fn set(&mut self, rows: Range<usize>, role: Role, tangents: Range<usize>, x: &mut [T]) {
        let dofs = x.len() - self.roles.len();
        for row in rows {
            self.roles[row] = role;
            if role != Role::Closed {
                (self.multipliers[row], x[dofs + row]) = (T::zero(), T::zero());
            }
        }
        for row in tangents {
            (self.compliance[row], x[dofs + row]) = (T::zero(), T::zero());
        }
    }

    /// Decides whether a closed contact sticks or slides, with the radius μ p of its disc of friction. `small` is a
    /// force over √N_ii that counts as rounding. Returns whether the equations have changed.
    fn slide(
        &mut self,
        at: usize,
        radius: T,
        small: T,
        (rows, x, metric): (&mut Rows<T>, &mut [T], &mut Metric<T>),
    ) -> bool {
        let (tangents, dofs) = (rows.blocks[at].tangents(), x.len() - rows.len());
        let own = tangents.clone().map(|row| metric.diagonal(row)).fold(T::zero(), T::max);
        if own <= T::zero() {
            return false;
        }
        let small = small / own.sqrt();
        let slides = self.roles[tangents.start] == Role::Given;
        let mut slip = [T::zero(); 2];
        let mut trial = [T::zero(); 2];
        for (k, row) in tangents.clone().enumerate() {
            if slides {
                slip[k] = rows.gap(row, x);
            }
            trial[k] = self.multipliers[row] - slip[k] / own;
        }
        let size = trial[0].hypot(trial[1]);
        let sticks = if slides { size <= radius } else { size <= radius + T::of(BEYOND) * radius + small };
        if sticks {
            if slides && self.waits(at) {
                return true;
            }
            if slides {
                self.set(tangents.clone(), Role::Closed, tangents, x);
                return true;
            }
            return false;
        }
        if !slides && self.waits(at) {
            return true;
        }
        let mut along = trial.map(|trial| trial / size);
        let slipped = slip[0].hypot(slip[1]);
        if tangents.len() == 2 && (along[0] <= T::zero() || along[1].abs() > T::of(TURNED)) {
            let [x, y] = [self.multipliers[tangents.start], self.multipliers[tangents.start + 1]];
            let [c, s] = along;
            rows.turn(at, along);
            metric.forget();
            (self.multipliers[tangents.start], self.multipliers[tangents.start + 1]) = (c * x + s * y, c * y - s * x);
            along = [T::one(), T::zero()];
        }
        let mut change = self.give(tangents.start, radius * along[0], small);
        if !slides {
            change = true;
        }
        if tangents.len() == 2 {
            let row = tangents.start + 1;
            if radius > T::zero() {
                let compliance = slipped / radius;
                let moved = (compliance - self.compliance[row]) * self.multipliers[row];
                self.roles[row] = Role::Closed;
                self.compliance[row] = compliance;
                x[dofs + row] = compliance * self.multipliers[row];
                if moved.abs() > T::of(SAME) * small * own {
                    change = true;
                }
            } else {
                if self.give(row, T::zero(), small) {
                    change = true;
                }
                (self.compliance[row], x[dofs + row]) = (T::zero(), T::zero());
            }
        }
        change
    }

    /// Gives the friction of a row. Returns whether it differs by more than a few times `small`.
    fn give(&mut self, row: usize, given: T, small: T) -> bool {
        let moved = (self.multipliers[row] - given).abs();
        (self.roles[row], self.multipliers[row]) = (Role::Given, given);
        moved > T::of(SAME) * small
    }
}
