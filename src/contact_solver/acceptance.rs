//! Shared parts of the solvers: initial guess, acceptance rule and failure of a contact problem.

use super::{AdmissibleSet, ContactFailure, ContactProblem};
use crate::error::{Error, Result};
use crate::real::Real;

impl<T: Real> ContactProblem<'_, T> {
    /// The row and column of the largest asymmetry of W, if it exceeds a share of √(W_ii W_jj).
    pub(super) fn asymmetry(&self, share: T) -> Option<(usize, usize)> {
        /// Size of the tiles in which W is compared. The mirrored entries are copied row by row first, because
        /// columns of a large W map to cache lines that evict each other.
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

    /// Rejects values that are not finite; W is skipped if it is `known` to be finite.
    pub(super) fn check_finite(&self, known: bool) -> std::result::Result<(), ContactFailure<T>> {
        let finite = |i: &usize| self.offset[*i].is_finite() && (known || T::all_finite(self.row(*i)));
        match (0..self.size()).find(|i| !finite(i)) {
            Some(row) => Err(ContactFailure::NotConverged { iterations: 0, row, residual: T::nan() }),
            None => Ok(()),
        }
    }

    /// Rejects an unsymmetric W. Asymmetry from rounding of badly conditioned responses is tolerated here; the
    /// acceptance rule judges its effect.
    pub(super) fn check_symmetric(&self) -> std::result::Result<(), ContactFailure<T>> {
        match self.asymmetry(T::epsilon().sqrt()) {
            Some((row, other)) => Err(ContactFailure::Unsymmetric { row, other }),
            None => Ok(()),
        }
    }
}

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

    /// Makes the guess admissible. Rejects values that are not finite, and rows without W_ii whose y_i, which no
    /// multiplier can change, is violated.
    ///
    /// The guess is replaced by λ = 0 if that is a solution, so that the magnitude of an old guess does not persist.
    pub(super) fn begin<'a>(
        &self,
        problem: &'a ContactProblem<'a, T>,
        multipliers: &mut [T],
    ) -> std::result::Result<Acceptance<'a, T>, ContactFailure<T>> {
        self.begin_with(problem, false, multipliers)
    }

    /// The same; W is not checked again if it is `known` to be finite.
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

/// Violations up to this size have lost their digits: motions that have died out need no solve.
pub(super) fn nothing<T: Real>() -> T {
    T::min_positive_value() / T::epsilon()
}

/// The acceptance rule: in every row `|min(y_i, W_ii λ_i)|`, or `|y_i|` of a free row, is rounding or at most a given
/// fraction of the largest |q_i|.
///
/// Both sides have the unit of y and scale with the problem, so the result does not depend on the units. The problem
/// [bounds](Self::bears) what counts as rounding: otherwise contradictory rows could be met within the rounding of
/// multipliers that grow without bound.
#[derive(Debug)]
pub(super) struct Acceptance<'a, T> {
    problem: &'a ContactProblem<'a, T>,
    accepted: T,
    /// A small share of the largest |q_j|/√W_jj. Row j closed alone takes the energy ½ (|q_j|/√W_jj)², which by
    /// Cauchy and Schwarz moves row i by at most √W_ii |q_j|/√W_jj. Light bodies would move far with the energy of
    /// heavy ones, so the same share of a multiple of the largest |q_j| is a second bound.
    reach: T,
    largest: T,
    /// The row that failed last, checked first: far from the solution a check then costs one row.
    suspect: usize,
}

impl<T: Real> Acceptance<'_, T> {
    /// Whether row i may miss complementarity by `miss`, for any multipliers.
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
            // NaN fails both comparisons.
            let fine = miss <= self.accepted || miss <= self.problem.rounding(*i, multipliers) && self.bears(*i, miss);
            !fine
        };
        let size = self.problem.size();
        let failing = (self.suspect..size).chain(0..self.suspect).find(fails);
        self.suspect = failing.unwrap_or(self.suspect);
        failing.is_none()
    }

    /// Whether the residual of every row is rounding.
    pub(super) fn is_exact(&self, multipliers: &[T]) -> bool {
        (0..self.problem.size()).all(|i| {
            let miss = self.problem.miss(i, multipliers);
            miss <= self.problem.rounding(i, multipliers) && self.bears(i, miss)
        })
    }

    /// Whether the residual of every row is a negligible contradiction: at most √ε of the motion that the other rows
    /// may cause in it.
    pub(super) fn is_negligible(&self, multipliers: &[T]) -> bool {
        // `bears` allows ε^0.4.
        let share = T::epsilon().powf(T::of(0.1));
        (0..self.problem.size()).all(|i| self.bears(i, self.problem.miss(i, multipliers) / share))
    }

    /// The failure with the row of the largest residual.
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
