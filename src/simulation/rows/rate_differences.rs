//! Gap rates of constraints that do not give them, from differences of their gaps in time.

use crate::contact::{GapRates, Variation};
use crate::error::Result;
use crate::real::Real;
use crate::rounding::{rounding, time_resolution};
use crate::simulation::rows::part::Part;

/// Memory for differences of gaps.
pub(crate) struct RateDifferences<T> {
    /// Gaps before, now and after, one a candidate.
    before: Vec<T>,
    now: Vec<T>,
    after: Vec<T>,
    /// u + s v.
    moved: Vec<T>,
}

impl<T> Default for RateDifferences<T> {
    fn default() -> Self {
        Self { before: Vec::new(), now: Vec::new(), after: Vec::new(), moved: Vec::new() }
    }
}

/// Time increments of the first and second differences of gaps, as shares of the time ahead.
///
/// With such an increment δ, the rate has the errors δ²/6 |g⃛| and ε m/δ, the acceleration δ²/12 |g⁗| and 4 ε m/δ²,
/// where m is the magnitude of the terms of a gap. In f64 these are 2e-7 h² |g⃛| + 1e3 ε m/h and
/// h²/3072 |g⁗| + 1e3 ε m/h², to be compared with the error of a scheme of order 2 and with the rounding of a gap
/// over a step.
fn shares<T: Real>() -> [f64; 2] {
    if T::epsilon().value() < 1e-10 { [1e-3, 1.0 / 16.0] } else { [1.0 / 16.0, 0.25] }
}

impl<T: Real> RateDifferences<T> {
    /// Central differences of the gaps at t ± δ: with u held for the rate ∂g/∂t, along u ± δ v for the acceleration
    /// Ġ v + ∂ġ/∂t. Differences within rounding are zero. Rows that follow u are linearized where they were before.
    pub(crate) fn find(
        &mut self,
        part: &mut Part<'_, T>,
        (t, u, v): (f64, &[T], &[T]),
        ahead: f64,
        out: &mut [GapRates<T>],
    ) -> Result<()> {
        let found = self.difference(part, (t, u, v), ahead, out);
        match part.variation {
            Variation::Follows => found.and(part.constraint.follow(part.place.0, &part.place.1).map(drop)),
            _ => found,
        }
    }

    fn difference(
        &mut self,
        part: &mut Part<'_, T>,
        (t, u, v): (f64, &[T], &[T]),
        ahead: f64,
        out: &mut [GapRates<T>],
    ) -> Result<()> {
        let Part { constraint, contacts, variation, .. } = part;
        let Self { before, now, after, moved } = self;
        for gaps in [&mut *before, &mut *now, &mut *after] {
            gaps.clear();
            gaps.resize(out.len(), T::zero());
        }
        let mut gaps = |s: f64, speed: T, gaps: &mut [T]| {
            moved.clear();
            moved.extend(u.iter().zip(v).map(|(&u, &v)| u + speed * v));
            if *variation == Variation::Follows {
                constraint.follow(t + s, moved)?;
            }
            constraint.gaps(t + s, moved, gaps)
        };
        // Increments that are representable at t.
        let [single, double] = shares::<T>().map(|share| (t + (share * ahead).max(time_resolution(t))) - t);
        gaps(-single, T::zero(), before)?;
        gaps(single, T::zero(), after)?;
        let size = |row: usize| -> T {
            let sum: T = contacts.row(row).map(|(place, weight)| (weight * u[place]).abs()).sum();
            rounding(sum + contacts.magnitude(row))
        };
        let rounded = |row: usize, gaps: [T; 3]| {
            let most = gaps.into_iter().fold(T::zero(), |most, gap| most.max(gap.abs()));
            size(row) + rounding(most)
        };
        for (row, out) in out.iter_mut().enumerate() {
            let change = after[row] - before[row];
            let noise = change.abs() <= rounded(row, [before[row], after[row], T::zero()]);
            out.rate = if noise { T::zero() } else { change / T::of(2.0 * single) };
        }
        gaps(0.0, T::zero(), now)?;
        gaps(-double, -T::of(double), before)?;
        gaps(double, T::of(double), after)?;
        for (row, out) in out.iter_mut().enumerate() {
            let change = (after[row] - now[row]) - (now[row] - before[row]);
            let noise = change.abs() <= rounded(row, [before[row], now[row], after[row]]);
            out.acceleration = if noise { T::zero() } else { change / T::of(double * double) };
        }
        Ok(())
    }
}
