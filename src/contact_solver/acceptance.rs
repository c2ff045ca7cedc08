//! When a contact problem counts as solved: the start, the acceptance rule and the failure that solvers share.

use super::{AdmissibleSet, ContactFailure, ContactProblem};
use crate::error::{Error, Result};
use crate::real::Real;

impl<T: Real> ContactProblem<'_, T> {
    /// The rows whose entries of W across the diagonal differ most, if by more than a share of √(W_ii W_jj).
    pub(super) fn asymmetry(&self, share: T) -> Option<(usize, usize)> {
        /// Rows and columns that are looked at together. What lies across the diagonal is read row by row first:
        /// columns of a large W are lines of memory that push each other out of the cache.
        const TILE: usize = 32;
        let size = self.size();
        let mut worst = (share, None);
        let mut across = [[T::zero(); TILE]; TILE];
        let root = |i: usize| if i < size { self.delassus(i, i).abs().sqrt() } else { T::zero() };
        let tiles = (0..size).step_by(TILE);
        for (first, columns) in tiles.flat_map(|first| (0..=first).step_by(TILE).map(move |columns| (first, columns))) {
            let (end, last) = ((first + TILE).min(size), (columns + TILE).min(size));
            for (across, j) in across.iter_mut().zip(columns..last) {
                across[..end - first].copy_from_slice(&self.row(j)[first..end]);
            }
            let roots: [T; TILE] = std::array::from_fn(|k| root(columns + k));
            for i in first..end {
                let own = root(i);
                for (k, &w) in self.row(i)[columns..last.min(i)].iter().enumerate() {
                    let mirrored = across[k][i - first];
                    let (difference, own) = ((w - mirrored).abs(), own * roots[k]);
                    let sum = w.abs() + mirrored.abs();
                    let scale = if own > sum { own } else { sum };
                    if difference > worst.0 * scale {
                        worst = (difference / scale, Some((i, columns + k)));
                    }
                }
            }
        }
        worst.1
    }

    /// Refuses numbers that are not finite; W need not be looked at if it is `known` to be.
    pub(super) fn check_finite(&self, known: bool) -> std::result::Result<(), ContactFailure<T>> {
        let finite = |i: &usize| self.offset[*i].is_finite() && (known || T::all_finite(self.row(*i)));
        match (0..self.size()).find(|i| !finite(i)) {
            Some(row) => Err(ContactFailure::NotConverged { iterations: 0, row, residual: T::nan() }),
            None => Ok(()),
        }
    }

    /// Refuses a W that is not symmetric. What rounding of badly conditioned responses makes of a symmetric one passes;
    /// that little is for the acceptance rule to judge.
    pub(super) fn check_symmetric(&self) -> std::result::Result<(), ContactFailure<T>> {
        match self.asymmetry(T::epsilon().sqrt()) {
            Some((row, other)) => Err(ContactFailure::Unsymmetric { row, other }),
            None => Ok(()),
        }
    }
}

/// How exactly, and how long, a solver tries.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settings<T> {
    /// The admissible residual, as a fraction of the largest |q_i|.
    tolerance: T,
    /// Iterations granted.
    pub(super) iterations: usize,
}

impl<T: Real> Default for Settings<T> {
    fn default() -> Self {
        Self { tolerance: T::of(1e-12).max(T::of(8.0) * T::epsilon()), iterations: 10_000 }
    }
}

impl<T: Real> Settings<T> {
    /// The admissible residual, as a fraction of the largest |q_i|.
    pub(super) fn tolerance(&self) -> T {
        self.tolerance
    }

    pub(super) fn with_tolerance(self, tolerance: f64) -> Result<Self> {
        match (0.0..1.0).contains(&tolerance) {
            true => Ok(Self { tolerance: T::of(tolerance), ..self }),
            false => Err(Error::Parameter { name: "tolerance", value: tolerance, range: "in [0, 1)" }),
        }
    }

    /// Makes the guess admissible and refuses what no iteration could mend: numbers that are not finite, and rows
    /// without W_ii whose y_i, which nothing can change, is wrong.
    ///
    /// λ = 0 is the guess wherever it is a solution, so that the scale of a guess cannot outlive its cause.
    pub(super) fn begin<'a>(
        &self,
        problem: &'a ContactProblem<'a, T>,
        multipliers: &mut [T],
    ) -> std::result::Result<Acceptance<'a, T>, ContactFailure<T>> {
        self.begin_with(problem, false, multipliers)
    }

    /// The same; W need not be looked at again if it is `known` to be finite.
    pub(super) fn begin_with<'a>(
        &self,
        problem: &'a ContactProblem<'a, T>,
        known: bool,
        multipliers: &mut [T],
    ) -> std::result::Result<Acceptance<'a, T>, ContactFailure<T>> {
        if problem.has_cones() {
            let friction = problem.blocks().find(|(_, set)| set.friction().is_some());
            return Err(ContactFailure::Friction { row: friction.map_or(0, |(rows, _)| rows.start) });
        }
        problem.check_finite(known)?;
        let scale = problem.offset.iter().fold(T::zero(), |scale, q| scale.max(q.abs()));
        let alone = |i: usize| problem.offset[i].abs() / problem.delassus(i, i).sqrt();
        let coupled = (0..problem.size()).filter(|&i| problem.delassus(i, i) > T::zero());
        let reach = coupled.map(alone).fold(T::zero(), T::max);
        let accepted = (self.tolerance * scale).max(nothing());
        let at_rest = |(&q, &set): (&T, &AdmissibleSet)| {
            if set == AdmissibleSet::Free { q == T::zero() } else { q >= T::zero() }
        };
        let open = problem.offset.iter().zip(problem.sets).all(at_rest);
        for (i, lambda) in multipliers.iter_mut().enumerate() {
            let (q, set) = (problem.offset[i], problem.sets[i]);
            let dead = problem.delassus(i, i) <= T::zero();
            *lambda = if dead || open || !lambda.is_finite() { T::zero() } else { set.nearest(*lambda) };
            let miss = if set == AdmissibleSet::Free { q.abs() } else { -q };
            if dead && miss > accepted.max(problem.tolerance[i]) {
                return Err(ContactFailure::NotConverged { iterations: 0, row: i, residual: miss });
            }
        }
        let share = T::epsilon().powf(T::of(0.4));
        Ok(Acceptance { problem, accepted, reach: share * reach, largest: share * T::of(32.0) * scale, suspect: 0 })
    }
}

/// Violations so small have lost their digits: motions that have died out leave nothing to be solved.
pub(super) fn nothing<T: Real>() -> T {
    T::min_positive_value() / T::epsilon()
}

/// The acceptance rule: in every row `|min(y_i, W_ii λ_i)|`, or `|y_i|` of a free row, is rounding or at most a given
/// fraction of the largest |q_i|.
///
/// Both sides have the unit of y and scale with the problem, so that the result does not depend on the units chosen.
/// What counts as rounding is [bounded](Self::bears) by the problem: rows that contradict each other can be met but for
/// the rounding of multipliers that grow beyond all bounds.
#[derive(Debug)]
pub(super) struct Acceptance<'a, T> {
    problem: &'a ContactProblem<'a, T>,
    accepted: T,
    /// A small share of the largest |q_j|/√W_jj: row j closed alone takes the energy ½ (|q_j|/√W_jj)², and by Cauchy
    /// and Schwarz this moves row i by at most √W_ii times the root. Light bodies would move far with the energy of
    /// heavy ones: the same share of many times the largest |q_j| bounds what they do.
    reach: T,
    largest: T,
    /// The row that failed last, asked first: far from the solution one row costs the check.
    suspect: usize,
}

impl<T: Real> Acceptance<'_, T> {
    /// Whether row i may miss complementarity by so much, whatever the multipliers are.
    pub(super) fn bears(&self, i: usize, miss: T) -> bool {
        let tolerance = self.problem.tolerance[i];
        miss <= self.accepted.max(tolerance) || {
            let moved = self.reach * self.problem.delassus(i, i).max(T::zero()).sqrt();
            miss <= tolerance + moved.min(self.largest)
        }
    }

    pub(super) fn accepts(&mut self, multipliers: &[T]) -> bool {
        let fails = |i: &usize| {
            let miss = self.problem.miss(*i, multipliers);
            // NaN fails both.
            let fine = miss <= self.accepted || miss <= self.problem.rounding(*i, multipliers) && self.bears(*i, miss);
            !fine
        };
        let size = self.problem.size();
        let failing = (self.suspect..size).chain(0..self.suspect).find(fails);
        self.suspect = failing.unwrap_or(self.suspect);
        failing.is_none()
    }

    /// Whether what every row misses is rounding.
    pub(super) fn is_exact(&self, multipliers: &[T]) -> bool {
        (0..self.problem.size()).all(|i| {
            let miss = self.problem.miss(i, multipliers);
            miss <= self.problem.rounding(i, multipliers) && self.bears(i, miss)
        })
    }

    /// Whether what every row misses is no more than a contradiction that nobody would notice: √ε of the way by which
    /// what is asked of the others may move it.
    pub(super) fn is_negligible(&self, multipliers: &[T]) -> bool {
        // (`bears` grants ε^0.4.)
        let share = T::epsilon().powf(T::of(0.1));
        (0..self.problem.size()).all(|i| self.bears(i, self.problem.miss(i, multipliers) / share))
    }

    /// The failure that names the worst row.
    pub(super) fn failure(&self, iterations: usize, multipliers: &[T]) -> ContactFailure<T> {
        let misses = (0..self.problem.size()).map(|i| (i, self.problem.miss(i, multipliers)));
        let worse = |worst: (usize, T), x: (usize, T)| if x.1 > worst.1 || x.1.is_nan() { x } else { worst };
        let (row, residual) = misses.fold((0, T::zero()), worse);
        ContactFailure::NotConverged { iterations, row, residual }
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
            Settings::default().begin(&problem, &mut multipliers).unwrap();
            let same = multipliers.iter().zip(begun).all(|(x, y)| x.to_bits() == f64::to_bits(y));
            assert!(same, "{q:?} {guess:?}: {multipliers:?}");
        }
    }
}
