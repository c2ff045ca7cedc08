//! Rows that turn: derivatives of contact forces Gᵀ x along a path of displacements, by differences of the rows.

use crate::contact::ContactJacobian;
use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::{DIFFERENCES, rounding};
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
    /// `out += c dᵏ/dsᵏ Gᵀ x` along a path, for rows and their multipliers x, with k = 1 or 2. Where rows jump, as at a
    /// vertex of a facet, a difference across the jump is no derivative: it must agree with one over a quarter of its
    /// distance.
    pub(super) fn add_derivative(
        &mut self,
        order: u8,
        path: Path<'_, T>,
        (rows, x): (&[usize], &[T]),
        c: T,
        out: &mut [T],
    ) -> Result<()> {
        const PARTS: [f64; 4] = [1.0, 0.25, 0.0625, 0.015_625];
        let Some((reach, curvature)) = self.reach(path, rows, order) else { return Ok(()) };
        let bound = curvature * x.iter().map(|x| x.abs()).sum::<T>();
        let mut wider: Option<Vec<T>> = None;
        for part in PARTS {
            let difference = self.difference(order, path, part * reach, (rows, x))?;
            if let Some(wider) = wider {
                let apart = wider.iter().zip(&difference).fold(T::zero(), |most, (a, b)| (*a - *b).abs().max(most));
                if apart <= T::of(DIFFERENCES) * (bound + T::largest(&difference)) {
                    T::axpy(c, &wider, out);
                    return Ok(());
                }
            }
            wider = Some(difference);
        }
        let reason = "a contact is where its rows jump: at a vertex, which other steps may pass by, or anywhere with \
                      `Mortar` in space, where `NodeToFacet` has smooth rows";
        Err(Error::Incompatible { part: "the gradient through rows that turn".into(), reason })
    }

    /// dᵏ/dsᵏ Gᵀ x along a path, by central differences over a distance s.
    fn difference(&mut self, order: u8, path: Path<'_, T>, s: f64, (rows, x): (&[usize], &[T])) -> Result<Vec<T>> {
        let ((t, u), (dt, du)) = (path.from, path.rates);
        let stencil: &[(f64, f64)] =
            if order == 1 { &[(1.0, 0.5), (-1.0, -0.5)] } else { &[(1.0, 1.0), (0.0, -2.0), (-1.0, 1.0)] };
        let mut out = vec![T::zero(); u.len()];
        let mut there = vec![T::zero(); u.len()];
        for &(place, weight) in stencil {
            there.copy_from_slice(u);
            T::axpy(T::of(place * s), du, &mut there);
            self.constraints.follow(t + place * s * dt, &there, self.g)?;
            let weight = T::of(weight / s.powi(order.into()));
            rows.iter().zip(x).for_each(|(&row, &x)| self.g.scatter(row, weight * x, &mut out));
        }
        Ok(out)
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
        self.add_derivative(1, Path { from, rates: (0.0, w) }, (rows, &change.multipliers), T::one(), &mut new.u)?;
        if change.field == 1 {
            return self.add_derivative(1, moves, (rows, sigma), -T::one(), &mut new.u);
        }
        self.add_derivative(1, Path { from, rates: (0.0, &solved.a) }, (rows, sigma), -T::one(), &mut new.u)?;
        self.add_derivative(2, moves, (rows, sigma), -T::one(), &mut new.u)?;
        self.add_derivative(1, moves, (rows, sigma), -T::of(2.0), &mut new.v)
    }

    /// The distance along a path at which a difference of this order is most exact, in units of its parameter, and what
    /// the derivative of a row is if it turns by 1 over the length from which it is computed; none for a path that does
    /// not move.
    fn reach(&self, path: Path<'_, T>, rows: &[usize], order: u8) -> Option<(f64, T)> {
        let (u, (dt, du)) = (path.from.1, path.rates);
        let scale = |row: usize| self.constraints.gap_rounding(row, self.g.magnitude(row, u), T::zero());
        let scale = rows.iter().map(|&row| scale(row)).fold(T::zero(), T::max) / rounding(T::one());
        let speed = rows.iter().map(|&row| self.g.magnitude(row, du)).fold(T::zero(), T::max);
        let share = T::epsilon().value().powf((f64::from(order) + 2.0).recip());
        let by_distance = if speed > T::zero() { share * (scale / speed).value() } else { f64::INFINITY };
        // Obstacles move smoothly within a step.
        let most = if dt > 0.0 { self.h } else { f64::INFINITY };
        let s = by_distance.min(most);
        (s.is_finite() && s > 0.0).then(|| (s, T::of((share / s).powi(order.into()))))
    }
}
