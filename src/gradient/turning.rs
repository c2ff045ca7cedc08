//! Rows that turn: derivatives of contact forces Gᵀ x along a path of displacements, by differences of the rows.

use crate::contact::ContactJacobian;
use crate::corrector::Gaps;
use crate::error::Result;
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::Constraints;
use crate::state::{Change, Motion};

/// The rows of the constraints, moved to other displacements.
pub(super) struct Turning<'s, 'a, T: Real> {
    pub(super) constraints: &'s mut Constraints<'a, T>,
    pub(super) g: &'s mut ContactJacobian<T>,
    /// The step size: differences in time are no longer.
    pub(super) h: f64,
}

/// A path of displacements: time, displacements, and their rates.
#[derive(Clone, Copy)]
pub(super) struct Path<'p, T> {
    pub(super) from: (f64, &'p [T]),
    pub(super) rates: (f64, &'p [T]),
}

impl<T: Real> Turning<'_, '_, T> {
    /// `out += c d/ds Gᵀ x` along a path, for rows and their multipliers x.
    pub(super) fn add_first(
        &mut self,
        path: Path<'_, T>,
        (rows, x): (&[usize], &[T]),
        c: T,
        out: &mut [T],
    ) -> Result<()> {
        let Some(s) = self.reach(path, rows, 3) else { return Ok(()) };
        for side in [1.0, -1.0] {
            self.scatter_at(path, side * s, (rows, x), c * T::of(side / (2.0 * s)), out)?;
        }
        Ok(())
    }

    /// `out += c d²/ds² Gᵀ x` along a path.
    pub(super) fn add_second(
        &mut self,
        path: Path<'_, T>,
        (rows, x): (&[usize], &[T]),
        c: T,
        out: &mut [T],
    ) -> Result<()> {
        let Some(s) = self.reach(path, rows, 4) else { return Ok(()) };
        for (side, weight) in [(1.0, 1.0), (0.0, -2.0), (-1.0, 1.0)] {
            self.scatter_at(path, side * s, (rows, x), c * T::of(weight / (s * s)), out)?;
        }
        Ok(())
    }

    /// The part of a removed jump of v or a that comes from rows turning with the displacements of the state: with
    /// M (x' − x) = Gᵀ m and G x' + γ = 0, where γ is Ġ v for accelerations. `solved` is the state with its corrected
    /// velocities and accelerations.
    pub(super) fn undo_change(
        &mut self,
        change: &Change<T>,
        sigma: &[T],
        w: &[T],
        solved: &Motion<T>,
        new: &mut Motion<T>,
    ) -> Result<()> {
        let (from, rows) = ((solved.t, &solved.u[..]), &change.rows[..]);
        let moves = Path { from, rates: (1.0, &solved.v) };
        self.add_first(Path { from, rates: (0.0, w) }, (rows, &change.multipliers), T::one(), &mut new.u)?;
        if change.field == 1 {
            return self.add_first(moves, (rows, sigma), -T::one(), &mut new.u);
        }
        self.add_first(Path { from, rates: (0.0, &solved.a) }, (rows, sigma), -T::one(), &mut new.u)?;
        self.add_second(moves, (rows, sigma), -T::one(), &mut new.u)?;
        self.add_first(moves, (rows, sigma), -T::of(2.0), &mut new.v)
    }

    /// The distance along a path at which a difference of this order is most exact, in units of its parameter; none for
    /// a path that does not move.
    fn reach(&self, path: Path<'_, T>, rows: &[usize], order: i32) -> Option<f64> {
        let (u, (dt, du)) = (path.from.1, path.rates);
        let scale = |row: usize| self.constraints.gap_rounding(row, self.g.magnitude(row, u), T::zero());
        let scale = rows.iter().map(|&row| scale(row)).fold(T::zero(), T::max) / rounding(T::one());
        let speed = rows.iter().map(|&row| self.g.magnitude(row, du)).fold(T::zero(), T::max);
        let share = T::epsilon().value().powf(f64::from(order).recip());
        let by_distance = if speed > T::zero() { share * (scale / speed).value() } else { f64::INFINITY };
        // Obstacles move smoothly within a step.
        let most = if dt > 0.0 { self.h } else { f64::INFINITY };
        Some(by_distance.min(most)).filter(|s| s.is_finite() && *s > 0.0)
    }

    /// `out += c Gᵀ x` at a place of a path.
    fn scatter_at(
        &mut self,
        path: Path<'_, T>,
        s: f64,
        (rows, x): (&[usize], &[T]),
        c: T,
        out: &mut [T],
    ) -> Result<()> {
        let ((t, u), (dt, du)) = (path.from, path.rates);
        let mut there = u.to_vec();
        T::axpy(T::of(s), du, &mut there);
        self.constraints.follow(t + s * dt, &there, self.g)?;
        rows.iter().zip(x).for_each(|(&row, &x)| self.g.scatter(row, c * x, out));
        Ok(())
    }
}
