//! When a contact problem counts as solved: initial guess, the rule of acceptance, and failures, for all solvers.

use super::structure::{Structure, Symmetry};
use super::{AdmissibleSet, ContactFailure, ContactProblem};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::{conditioned_share, half_digits, rounding, smallest_gap};
use std::ops::Range;

/// Tolerance and iteration limit of a solver.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settings<T> {
    /// The admissible residual, as a fraction of the largest |q_i|.
    tolerance: T,
    /// Iteration limit.
    pub(super) iterations: usize,
}

impl<T: Real> Default for Settings<T> {
    fn default() -> Self {
        Self { tolerance: T::of(1e-12).max(T::of(8.0) * T::epsilon()), iterations: 10_000 }
    }
}

impl<T: Real> Settings<T> {
    pub(super) fn with_tolerance(self, tolerance: f64) -> Result<Self> {
        match (0.0..1.0).contains(&tolerance) {
            true => Ok(Self { tolerance: T::of(tolerance), ..self }),
            false => Err(Error::Parameter { name: "tolerance", value: tolerance, range: "in [0, 1)" }),
        }
    }

    /// Makes the guess admissible. Rejects values that are not finite, and rows without W_ii whose y_i, which no
    /// multiplier can change, is violated. W is not checked again if it is `known` to be finite.
    ///
    /// The guess is replaced by λ = 0 if that is a solution, so that the magnitude of an old guess does not persist,
    /// and if there is friction: of several solutions the guess must not select one.
    pub(super) fn begin<'a>(
        &self,
        problem: &'a ContactProblem<'a, T>,
        known: bool,
        multipliers: &mut [T],
    ) -> std::result::Result<Acceptance<'a, T>, ContactFailure<T>> {
        problem.check_finite(known)?;
        let acceptance = self.rule(problem);
        let at_rest = |(&q, &set): (&T, &AdmissibleSet)| {
            if set == AdmissibleSet::Free { q == T::zero() } else { q >= T::zero() }
        };
        let forgets = problem.has_cones() || problem.offset.iter().zip(problem.sets).all(at_rest);
        for (rows, set) in problem.blocks() {
            let (row, q) = (rows.start, problem.offset[rows.start]);
            let dead = problem.delassus(row, row) <= T::zero();
            let miss = if set.is_bilateral() { q.abs() } else { -q };
            if dead && miss > acceptance.accepted.max(problem.tolerance[row]) {
                return Err(ContactFailure::NotConverged { iterations: 0, row, residual: miss });
            }
            for lambda in &mut multipliers[rows] {
                *lambda = if dead || forgets || !lambda.is_finite() { T::zero() } else { set.nearest(*lambda) };
            }
        }
        Ok(acceptance)
    }

    /// The rule for a problem that is already checked.
    pub(super) fn rule<'a>(&self, problem: &'a ContactProblem<'a, T>) -> Acceptance<'a, T> {
        let scale = T::largest(problem.offset);
        let alone = |i: usize| problem.offset[i].abs() / problem.delassus(i, i).sqrt();
        let coupled = (0..problem.size()).filter(|&i| problem.delassus(i, i) > T::zero());
        let reach = coupled.map(alone).fold(T::zero(), T::max);
        let share = conditioned_share::<T>();
        Acceptance {
            problem,
            accepted: (self.tolerance * scale).max(smallest_gap()),
            reach: share * reach,
            largest: share * scale,
        }
    }
}

/// The acceptance rule: every block misses its conditions ([`AdmissibleSet::residual`]) by rounding, or by at most a
/// given fraction of the largest |q_i|.
///
/// Both sides have the unit of y and scale with the problem, so the result does not depend on the units. The problem
/// [bounds](Self::bears) what counts as rounding: otherwise contradictory rows could be met within the rounding of
/// multipliers that grow without bound.
#[derive(Clone, Copy, Debug)]
pub(super) struct Acceptance<'a, T> {
    problem: &'a ContactProblem<'a, T>,
    accepted: T,
    /// A small share of the largest |q_j|/√W_jj. Row j closed alone takes the energy ½ (|q_j|/√W_jj)², which by
    /// Cauchy and Schwarz moves row i by at most √W_ii |q_j|/√W_jj. Light bodies would move far with the energy of
    /// heavy ones, so the same share of the largest |q_j| is a second bound.
    reach: T,
    largest: T,
}

impl<'a, T: Real> Acceptance<'a, T> {
    pub(super) fn problem(&self) -> &'a ContactProblem<'a, T> {
        self.problem
    }

    /// The residual that is accepted in every row: a fraction of the largest |q_i|.
    pub(super) fn accepted(&self) -> T {
        self.accepted
    }

    /// Whether row i may miss complementarity by `miss`, for any multipliers.
    fn bears(&self, i: usize, miss: T) -> bool {
        let tolerance = self.problem.tolerance[i];
        let moved = self.reach * self.problem.delassus(i, i).max(T::zero()).sqrt();
        miss <= self.accepted.max(tolerance + moved.min(self.largest))
    }

    /// Whether row i may miss complementarity by `miss`, with this rounding of y.
    fn admits(&self, i: usize, miss: T, rounding: impl FnOnce() -> T) -> bool {
        // NaN fails both comparisons.
        miss <= self.accepted || self.bears(i, miss) && miss <= rounding()
    }

    pub(super) fn accepts(&self, multipliers: &[T]) -> bool {
        let problem = self.problem;
        problem.blocks().all(|(rows, set)| {
            let [first, tangential] = problem.block_misses(rows.clone(), set, multipliers);
            let admits = |row: usize, miss: T| self.admits(row, miss, || problem.rounding(row, multipliers));
            // Slips may be known less accurately than gaps; whether a contact pulls depends on the gap only.
            admits(rows.start, first) && (rows.len() == 1 || rows.skip(1).any(|row| admits(row, tangential)))
        })
    }

    /// The same for a problem without friction, with the evaluated gaps of these multipliers.
    pub(super) fn accepts_gaps(&self, gaps: &Gaps<T>, multipliers: &[T]) -> bool {
        let mut misses = self.misses(gaps, multipliers).enumerate();
        misses.all(|(i, miss)| self.admits(i, miss, || gaps.rounding(self.problem, i)))
    }

    /// The residual of each row of a problem without friction, with the evaluated gaps of these multipliers.
    pub(super) fn misses(&self, gaps: &Gaps<T>, multipliers: &[T]) -> impl Iterator<Item = T> {
        let rows = self.problem.sets.iter().zip(&gaps.y).zip(multipliers).enumerate();
        rows.map(|(i, ((set, &y), &lambda))| set.residual(&[y], &[lambda], &[self.problem.delassus(i, i)]))
    }

    /// Whether the residual of every row is a negligible contradiction: at most √ε of the motion that the other rows
    /// may cause in it.
    pub(super) fn is_negligible(&self, multipliers: &[T]) -> bool {
        let share = half_digits::<T>() / conditioned_share();
        self.problem.blocks().all(|(rows, set)| {
            let [miss, _] = self.problem.block_misses(rows.clone(), set, multipliers);
            self.bears(rows.start, miss / share)
        })
    }

    /// The failure of a problem without solution, at multipliers with the least violation: the row with the largest
    /// residual, and the row that presses most against it.
    pub(super) fn contradiction(&self, multipliers: &[T]) -> ContactFailure<T> {
        let (row, residual) = self.problem.residual(multipliers);
        let push = |i: usize| (self.problem.delassus(row, i) * multipliers[i]).abs();
        let others = (0..self.problem.size()).filter(|&i| i != row);
        let other = others.reduce(|other, i| if push(i) > push(other) { i } else { other }).unwrap_or(row);
        ContactFailure::Contradictory { row, other, residual }
    }

    /// The failure with the worst block, or with a contact that jams.
    pub(super) fn failure(&self, iterations: usize, multipliers: &[T]) -> ContactFailure<T> {
        let (row, residual) = self.problem.residual(multipliers);
        jammed(self.problem).unwrap_or(ContactFailure::NotConverged { iterations, row, residual })
    }
}

/// A contact without solution that no other contact affects, neither its gap nor its slip. A contact affected by
/// others is not proven to jam: they may push it open.
fn jammed<T: Real>(problem: &ContactProblem<'_, T>) -> Option<ContactFailure<T>> {
    let failure = |(rows, set): (Range<usize>, AdmissibleSet)| {
        let (row, friction) = (rows.start, set.friction()?);
        let is_apart = |i: usize| {
            let mut others = problem.row(i).iter().enumerate().filter(|(j, _)| !rows.contains(j));
            others.all(|(_, &w)| w == T::zero())
        };
        let jams = rows.clone().all(is_apart) && problem.block(rows.clone(), set).jams();
        let normal = problem.delassus(row, row);
        let coupling = rows.skip(1).fold(T::zero(), |size, k| size.hypot(problem.delassus(row, k)));
        jams.then_some(ContactFailure::Jammed { row, friction, normal, coupling })
    };
    problem.blocks().find_map(failure)
}

/// y = W λ + q of all rows, with its rounding.
#[derive(Clone, Debug, Default)]
pub(super) struct Gaps<T> {
    pub(super) y: Vec<T>,
    /// The tolerance of each row, and the rounding of its own sum.
    own: Vec<T>,
}

impl<T: Real> Gaps<T> {
    /// Evaluates y for the multipliers `solution` of the active `rows`, column by column.
    pub(super) fn evaluate(
        &mut self,
        problem: &ContactProblem<'_, T>,
        structure: &Structure,
        (rows, solution): (&[usize], &[T]),
    ) {
        let (size, symmetry) = (problem.size().max(1), structure.symmetry());
        self.y.clear();
        self.y.extend_from_slice(problem.offset);
        self.own.clear();
        self.own.extend(problem.offset.iter().map(|q| q.abs()));
        for (&j, &lambda) in rows.iter().zip(solution) {
            let range = if symmetry == Symmetry::Symmetric { structure.range(j) } else { 0..problem.size() };
            let sums = self.y[range.clone()].iter_mut().zip(&mut self.own[range.clone()]);
            let add = |(w, (y, own)): (&T, (&mut T, &mut T))| {
                *y += *w * lambda;
                *own += (*w * lambda).abs();
            };
            match symmetry {
                // Rows are contiguous in memory.
                Symmetry::Symmetric => problem.row(j)[range].iter().zip(sums).for_each(add),
                Symmetry::General => problem.delassus[j..].iter().step_by(size).zip(sums).for_each(add),
            }
        }
        for (own, &tolerance) in self.own.iter_mut().zip(problem.tolerance) {
            *own = tolerance + rounding(*own);
        }
    }

    /// Whether a miss of row i exceeds its rounding.
    pub(super) fn exceeds(&self, problem: &ContactProblem<'_, T>, i: usize, miss: T) -> bool {
        // Most rows have no miss and need no look at other rows.
        miss > self.own[i] && miss > self.rounding(problem, i)
    }

    /// Rounding of y_i: that of its own sum, and of the multipliers of other rows.
    ///
    /// A multiplier is known to the rounding of its own row and carries it into coupled rows: a row of a body at rest
    /// next to a loaded body must not be judged by its own small values. Over many rows rounding adds up like a random
    /// walk. The plain sum would hide real violations among hundreds of rows in single precision.
    fn rounding(&self, problem: &ContactProblem<'_, T>, i: usize) -> T {
        let carried = |j: usize| self.own[j] / problem.delassus(j, j);
        let others = problem.row(i).iter().enumerate().filter(|&(j, _)| j != i);
        let largest = others.fold(T::zero(), |largest, (j, &w)| {
            let carried = carried(j);
            let counts = carried > T::zero() && carried.is_finite();
            if counts { largest.max(w.abs() * carried) } else { largest }
        });
        self.own[i] + T::of(self.own.len() as f64).sqrt() * largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_guess_is_admissible_and_forgotten_where_nothing_is_to_be_pressed() {
        let sets = [AdmissibleSet::NonNegative, AdmissibleSet::NonNegative, AdmissibleSet::Free];
        let w = [2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0];
        for (q, guess, begun) in [
            ([0.0, 0.5, 0.0], [1e300, 3.0, -7.0], [0.0; 3]),
            ([-0.1, 0.5, 0.0], [-3.0, 3.0, -7.0], [0.0, 3.0, -7.0]),
            ([0.0, 0.5, 0.1], [1.0, f64::NAN, 0.0], [1.0, 0.0, 0.0]),
        ] {
            let problem = ContactProblem::new(&w, &q, &sets, &[0.0; 3]).unwrap();
            let mut multipliers = guess;
            Settings::default().begin(&problem, false, &mut multipliers).unwrap();
            let same = multipliers.iter().zip(begun).all(|(x, y)| x.to_bits() == f64::to_bits(y));
            assert!(same, "{q:?} {guess:?}: {multipliers:?}");
        }
    }
}
