//! Lemke's complementary pivoting: a finite method for friction in the plane.

use super::blocks::{BlockAcceptance, failure};
use super::{AdmissibleSet, ContactFailure, ContactProblem, ContactSolver};
use crate::contact_solver::acceptance::Settings;
use crate::dense::dot;
use crate::real::Real;
use std::cmp::Ordering;

/// Lemke's complementary pivoting on the dense Delassus operator, for contacts with friction in the plane
/// ([`AdmissibleSet::Cone2`]) beside rows without: the finite reference for small problems.
///
/// In the plane Coulomb's law is a linear complementarity problem, with f = f⁺ − f⁻ and a σ that is the size of the
/// slip (A. Klarbring, Comput. Methods Appl. Mech. Eng. 58, 1986; Stewart and Trinkle, Int. J. Numer. Methods Eng. 39,
/// 1996):
///
/// ```text
/// 0 ≤ y_n ⊥ p ≥ 0,   0 ≤ σ + y_t ⊥ f⁺ ≥ 0,   0 ≤ σ − y_t ⊥ f⁻ ≥ 0,   0 ≤ μ p − f⁺ − f⁻ ⊥ σ ≥ 0
/// ```
///
/// Free rows are eliminated first. Then a multiple of one is added to all conditions, which makes them hold, and goes
/// to zero along a path of bases, each of which differs from the one before by a pair of variables (C. E. Lemke,
/// Management Science 11, 1965; Cottle, Pang and Stone, The Linear Complementarity Problem, section 4.4). Ties are
/// broken by the lexicographic rule, so that no basis comes twice. Rows and columns are measured by the roots of the
/// diagonal of W, so units do not matter. The inverse of the basis is kept; in the end the equations of the last basis
/// are solved once more, from W and q.
///
/// The path ends at a solution, however large the coefficients, for every positive definite W, symmetric or not, and
/// for a symmetric semidefinite one if q is in its range, as it is where q is what the same bodies do without contact
/// (Stewart and Trinkle). Else it may end on a ray. If this is one of normal and free multipliers that W answers with
/// nothing, while q works against them, there is no solution: [`ContactFailure::Contradictory`] names the two largest
/// rows of the ray, and with every choice of multipliers some row stays violated by the residual or more. If not
/// (bodies that jam, as in Painlevé's paradox), nothing is proven: after paths from other starts the failure is
/// [`ContactFailure::NotConverged`], with the worst row where the last one ended.
///
/// A pivot costs O(n²), for four unknowns a contact, and there are as a rule O(n) of them, from zero in every solve:
/// cubic, and some 100 contacts are many. The guess is not used, so the multipliers never depend on it.
/// [`AdmissibleSet::Cone3`] is refused ([`ContactFailure::Friction`]): a round cone is not linear. So are contacts that
/// do not open ([`AdmissibleSet::Held2`]): runs with friction are [uncorrected](crate::SimulationBuilder::uncorrected).
///
/// Known weakness: where large coefficients leave several solutions it finds one of them, which need not be that of
/// [`ActiveSet`](super::ActiveSet). Ties are told from differences by their rounding; where that is mistaken the path
/// may return to a basis, and ends at a limit of pivots, or end at multipliers that miss the conditions: both are
/// [`ContactFailure::NotConverged`]. In the worst case pivots are exponentially many (never seen, and limited). Of
/// free rows that depend on one another some keep λ = 0, and where these contradict the others no proof is given; of a
/// W that is not symmetric the block of the free rows must not be singular.
///
/// ```
/// use contact_dynamics::contact_solver::{AdmissibleSet, ContactProblem, ContactSolver, Lemke};
///
/// // A contact that is pressed down, and pushed along: it holds.
/// let sets = [AdmissibleSet::Cone2 { friction: 0.5 }];
/// let w = [2.0, 0.0, 0.0, 4.0];
/// let problem = ContactProblem::new(&w, &[-2.0, 0.8], &sets, &[1e-15; 2]).unwrap();
/// let mut multipliers = [0.0_f64; 2];
/// Lemke::default().solve(&problem, &mut multipliers).unwrap();
/// assert!((multipliers[0] - 1.0).abs() < 1e-15 && (multipliers[1] + 0.2).abs() < 1e-15);
///
/// // Pushed harder it slides, against a friction of μ p.
/// let problem = ContactProblem::new(&w, &[-2.0, 8.0], &sets, &[1e-15; 2]).unwrap();
/// Lemke::default().solve(&problem, &mut multipliers).unwrap();
/// assert!((multipliers[1] + 0.5).abs() < 1e-15 && problem.gap(1, &multipliers) > 0.0);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Lemke<T = f64> {
    conditions: Vec<Condition<T>>,
    /// √W_ii of the rows over the largest one, or one where W_ii is zero; and the largest W_ii.
    roots: Vec<T>,
    largest: T,
    /// What is basic, condition by condition, its values and the inverse of its columns, row by row.
    basis: Vec<Variable>,
    values: Vec<T>,
    inverse: Vec<T>,
    /// The right-hand side: q, measured.
    right: Vec<T>,
    /// How uneven the cover is.
    tilt: T,
    /// A column as it is given and by the basis, and what of the latter is rounding.
    given: Vec<T>,
    column: Vec<T>,
    noise: Vec<T>,
    /// Rows of the basis between which a pivot is to be chosen.
    tied: Vec<usize>,
    /// What the values leave of the equations.
    rest: Vec<T>,
}

/// A condition slack ≥ 0 ⊥ unknown ≥ 0, or slack = 0 for a free unknown; the number is the row of the problem.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Condition<T> {
    Free(usize),
    /// y and λ, or y_n and p.
    Normal(usize),
    /// σ + y_t and f⁺.
    Along(usize),
    /// σ − y_t and f⁻.
    Against(usize),
    /// μ p − f⁺ − f⁻ and σ, of the contact with this tangential row; μ as the rows are measured.
    Rim(usize, T),
}

/// What a basis has or has not; the number is that of a condition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Variable {
    Slack(usize),
    Unknown(usize),
    /// The multiple of one, or thereabouts, that is added to all conditions.
    Cover,
}

/// How a path ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// The conditions hold without the cover.
    Complementary,
    /// Nothing ends the growth of the variable that enters.
    Ray(Variable),
    Limit,
}

/// Paths before the problem is given up. After a basis whose values are negative by more than rounding, since they were
/// taken for that on the way, the next one begins there; after a ray, which may be one of rounding, from the slacks
/// with another cover.
const PATHS: usize = 4;

/// Passes in which the equations of the last basis are solved: iterative refinement with its inverse.
const PASSES: usize = 3;

/// The share of a number that is its rounding after many pivots.
fn lost<T: Real>() -> T {
    T::epsilon().powf(T::of(2.0 / 3.0))
}

impl<T: Real> Condition<T> {
    /// The row of the problem whose multiplier the unknown adds to, and its sign.
    fn row(self) -> Option<(usize, T)> {
        match self {
            Self::Free(row) | Self::Normal(row) | Self::Along(row) => Some((row, T::one())),
            Self::Against(row) => Some((row, -T::one())),
            Self::Rim(..) => None,
        }
    }
}

impl<T: Real> Lemke<T> {
    /// Takes the rows of a problem, but those that no multiplier can move, and begins; returns the pivots spent.
    fn pose(&mut self, problem: &ContactProblem<'_, T>) -> usize {
        let Self { conditions, roots, largest, .. } = self;
        let own = |row: usize| problem.delassus(row, row);
        *largest = (0..problem.size()).fold(T::zero(), |largest, row| largest.max(own(row)));
        roots.clear();
        roots.extend((0..problem.size()).map(|row| match (own(row) / *largest).sqrt() {
            root if root > T::zero() => root,
            _ => T::one(),
        }));
        conditions.clear();
        for (rows, set) in problem.blocks().filter(|(rows, _)| own(rows.start) > T::zero()) {
            let (first, tangent) = (rows.start, rows.start + 1);
            match set {
                AdmissibleSet::Free => conditions.push(Condition::Free(first)),
                // (The others have been refused.)
                AdmissibleSet::NonNegative
                | AdmissibleSet::Cone3 { .. }
                | AdmissibleSet::Held2 { .. }
                | AdmissibleSet::Held3 { .. } => conditions.push(Condition::Normal(first)),
                AdmissibleSet::Cone2 { friction } => {
                    let friction = T::of(friction) * (roots[tangent] / roots[first]);
                    conditions.extend([
                        Condition::Normal(first),
                        Condition::Along(tangent),
                        Condition::Against(tangent),
                        Condition::Rim(tangent, friction),
                    ]);
                }
            }
        }
        self.right.clear();
        self.right.extend(
            conditions.iter().map(|condition| {
                condition.row().map_or(T::zero(), |(row, sign)| sign * problem.offset[row] / roots[row])
            }),
        );
        self.tilt = T::zero();
        self.begin(problem)
    }

    /// Begins a path with the slacks as basis, and free rows eliminated; returns the pivots spent.
    fn begin(&mut self, problem: &ContactProblem<'_, T>) -> usize {
        let size = self.conditions.len();
        self.values.clear();
        self.values.extend_from_slice(&self.right);
        self.basis.clear();
        self.basis.extend((0..size).map(Variable::Slack));
        self.inverse.clear();
        self.inverse.resize(size * size, T::zero());
        self.inverse.iter_mut().step_by(size + 1).for_each(|one| *one = T::one());
        self.enter_free(problem)
    }

    /// What one of an unknown adds to the slack of a condition.
    fn entry(&self, problem: &ContactProblem<'_, T>, slack: usize, unknown: usize) -> T {
        let (slack, unknown) = (self.conditions[slack], self.conditions[unknown]);
        match (slack, unknown) {
            (Condition::Rim(tangent, friction), Condition::Normal(row)) if row + 1 == tangent => friction,
            (Condition::Rim(tangent, _), Condition::Along(row) | Condition::Against(row)) if row == tangent => {
                -T::one()
            }
            (Condition::Along(row) | Condition::Against(row), Condition::Rim(tangent, _)) if row == tangent => T::one(),
            _ => match (slack.row(), unknown.row()) {
                (Some((i, sign)), Some((j, other))) => {
                    let w = problem.delassus(i, j) / self.largest;
                    sign * other * (w / (self.roots[i] * self.roots[j]))
                }
                _ => T::zero(),
            },
        }
    }

    /// The column of a variable in the equations slack − M unknown − cover = q.
    fn give(&mut self, problem: &ContactProblem<'_, T>, variable: Variable) {
        let size = self.conditions.len();
        let mut given = std::mem::take(&mut self.given);
        given.clear();
        match variable {
            Variable::Slack(condition) => {
                given.resize(size, T::zero());
                given[condition] = T::one();
            }
            Variable::Unknown(condition) => given.extend((0..size).map(|i| -self.entry(problem, i, condition))),
            Variable::Cover => given.extend(self.conditions.iter().enumerate().map(|(i, condition)| match condition {
                Condition::Free(_) => T::zero(),
                // (Multiples of the golden ratio are spread evenly.)
                _ => -T::one() - self.tilt * T::of((0.618_033_988_749_894_8 * i as f64).fract()),
            })),
        }
        self.given = given;
    }

    /// The column of a variable as the basis has it: by how much the basic ones fall as it grows by one.
    fn express(&mut self, problem: &ContactProblem<'_, T>, variable: Variable) {
        self.give(problem, variable);
        let Self { inverse, given, column, noise, .. } = self;
        let rows = || inverse.chunks_exact(given.len());
        column.clear();
        column.extend(rows().map(|row| dot(row, given)));
        noise.clear();
        let most = T::largest(given);
        noise.extend(rows().map(|row| lost::<T>() * T::largest(row) * most));
    }

    /// The variable whose column was expressed takes the place of a basic one, which is returned.
    fn exchange(&mut self, place: usize, variable: Variable) -> Variable {
        let Self { inverse, column, values, basis, .. } = self;
        let size = column.len();
        let pivot = column[place];
        let value = values[place] / pivot;
        let (before, rest) = inverse.split_at_mut(place * size);
        let (own, after) = rest.split_at_mut(size);
        for x in own.iter_mut() {
            *x /= pivot;
        }
        let others = before.chunks_exact_mut(size).chain(after.chunks_exact_mut(size));
        let at = (0..size).filter(|&i| i != place);
        for (i, row) in at.zip(others) {
            if column[i] != T::zero() {
                T::axpy(-column[i], own, row);
                values[i] -= column[i] * value;
            }
        }
        values[place] = value;
        std::mem::replace(&mut basis[place], variable)
    }

    /// The unknowns of free rows enter for good, those with the largest pivots first; the rest, whose rows are
    /// combinations of these, keep λ = 0. Returns how many enter.
    fn enter_free(&mut self, problem: &ContactProblem<'_, T>) -> usize {
        let size = self.conditions.len();
        let mut entered = 0;
        loop {
            let mut best: Option<(usize, T)> = None;
            for place in 0..size {
                let waits = self.basis[place] == Variable::Slack(place);
                if !waits || !matches!(self.conditions[place], Condition::Free(_)) {
                    continue;
                }
                self.give(problem, Variable::Unknown(place));
                let own = &self.inverse[place * size..(place + 1) * size];
                let pivot = -dot(own, &self.given);
                let terms = own.iter().zip(&self.given).map(|(a, b)| (*a * *b).abs());
                if pivot > lost::<T>() * terms.sum() && best.is_none_or(|(_, largest)| pivot > largest) {
                    best = Some((place, pivot));
                }
            }
            let Some((place, _)) = best else { return entered };
            self.express(problem, Variable::Unknown(place));
            self.exchange(place, Variable::Unknown(place));
            entered += 1;
        }
    }

    /// Whether a basic variable must not be negative.
    fn bounded(&self, variable: Variable) -> bool {
        match variable {
            Variable::Slack(condition) | Variable::Unknown(condition) => {
                !matches!(self.conditions[condition], Condition::Free(_))
            }
            Variable::Cover => true,
        }
    }

    /// Of the tied rows of the basis those that are first by the lexicographic rule: of values and the columns of the
    /// inverse, over the size of the entry of the column.
    fn first_of_ties(&mut self) -> Option<usize> {
        let Self { inverse, column, tied, conditions, .. } = self;
        let size = column.len();
        // What free rows have to do with each other decides nothing.
        let is_free = |&k: &usize| matches!(conditions[k], Condition::Free(_));
        for k in (0..size).filter(|k| !is_free(k)).chain((0..size).filter(is_free)) {
            if tied.len() < 2 {
                break;
            }
            let ratio = |&i: &usize| inverse[i * size + k] / column[i].abs();
            let rounding = |&i: &usize| {
                let row = &inverse[i * size..(i + 1) * size];
                lost::<T>() * T::largest(row) / column[i].abs()
            };
            let least = tied.iter().min_by(|i, j| ratio(i).partial_cmp(&ratio(j)).unwrap_or(Ordering::Equal));
            let Some(&first) = least else { break };
            let (bound, own) = (ratio(&first), rounding(&first));
            tied.retain(|i| ratio(i) <= bound + own + rounding(i));
        }
        let larger = |&i: &usize, &j: &usize| column[i].abs().partial_cmp(&column[j].abs()).unwrap_or(Ordering::Equal);
        tied.iter().copied().max_by(larger)
    }

    /// The row of the basis whose variable leaves as the one whose column was expressed grows.
    fn leaving(&mut self, most: T) -> Option<usize> {
        let slop = lost::<T>() * most;
        let mut tied = std::mem::take(&mut self.tied);
        tied.clear();
        tied.extend((0..self.column.len()).filter(|&i| self.column[i] > self.noise[i] && self.bounded(self.basis[i])));
        let reach = |i: usize| (self.values[i].max(T::zero()) + slop) / self.column[i];
        let bound = tied.iter().fold(T::infinity(), |bound, &i| bound.min(reach(i)));
        tied.retain(|&i| self.values[i].max(T::zero()) / self.column[i] <= bound);
        self.tied = tied;
        // A tie with the cover ends the path.
        let cover = self.tied.iter().copied().find(|&i| self.basis[i] == Variable::Cover);
        cover.or_else(|| self.first_of_ties())
    }

    /// Goes along the path; counts pivots up to `limit`.
    fn follow(&mut self, problem: &ContactProblem<'_, T>, pivots: &mut usize, limit: usize) -> End {
        let size = self.conditions.len();
        let mut least = T::zero();
        for i in (0..size).filter(|&i| self.bounded(self.basis[i])) {
            least = least.min(self.values[i]);
        }
        if least >= T::zero() {
            return End::Complementary;
        }
        // The cover enters where it makes the last condition hold.
        self.express(problem, Variable::Cover);
        let mut tied = std::mem::take(&mut self.tied);
        tied.clear();
        tied.extend((0..size).filter(|&i| self.bounded(self.basis[i]) && self.column[i] < -self.noise[i]));
        let ratio = |i: usize| self.values[i] / self.column[i];
        let bound = tied.iter().fold(T::zero(), |bound, &i| bound.max(ratio(i)));
        tied.retain(|&i| ratio(i) >= bound - lost::<T>() * bound);
        self.tied = tied;
        let Some(place) = self.first_of_ties() else { return End::Ray(Variable::Cover) };
        let mut left = self.exchange(place, Variable::Cover);
        while *pivots < limit {
            *pivots += 1;
            let enters = match left {
                Variable::Slack(condition) => Variable::Unknown(condition),
                Variable::Unknown(condition) => Variable::Slack(condition),
                Variable::Cover => return End::Complementary,
            };
            self.express(problem, enters);
            let Some(place) = self.leaving(bound) else { return End::Ray(enters) };
            left = self.exchange(place, enters);
        }
        End::Limit
    }

    /// Solves the equations of the basis once more.
    fn polish(&mut self, problem: &ContactProblem<'_, T>) {
        let size = self.conditions.len();
        for _ in 0..PASSES {
            let mut rest = std::mem::take(&mut self.rest);
            rest.clear();
            rest.extend_from_slice(&self.right);
            for place in 0..size {
                let value = self.values[place];
                if value != T::zero() {
                    self.give(problem, self.basis[place]);
                    T::axpy(-value, &self.given, &mut rest);
                }
            }
            for (value, row) in self.values.iter_mut().zip(self.inverse.chunks_exact(size.max(1))) {
                *value += dot(row, &rest);
            }
            self.rest = rest;
        }
    }

    /// Multipliers of the unknowns `amount(place)` of the basis.
    fn multipliers(&self, amount: impl Fn(usize) -> T, multipliers: &mut [T]) {
        multipliers.fill(T::zero());
        for (place, variable) in self.basis.iter().enumerate() {
            if let Variable::Unknown(condition) = *variable {
                self.add(condition, amount(place), multipliers);
            }
        }
    }

    /// Adds what an amount of an unknown is as a multiplier.
    fn add(&self, condition: usize, amount: T, multipliers: &mut [T]) {
        if let Some((row, sign)) = self.conditions[condition].row() {
            multipliers[row] += sign * amount / self.roots[row] / self.largest;
        }
    }

    /// What is left of the cones is rounding.
    fn tidy(problem: &ContactProblem<'_, T>, multipliers: &mut [T]) {
        for (rows, set) in problem.blocks() {
            let first = rows.start;
            multipliers[first] = set.nearest(multipliers[first]);
            if let Some(friction) = set.friction() {
                multipliers[first] = multipliers[first].max(T::zero());
                let most = T::of(friction) * multipliers[first];
                for tangent in &mut multipliers[rows][1..] {
                    *tangent = tangent.max(-most).min(most);
                }
            }
        }
    }

    /// The failure that the ray of the variable whose column was expressed proves: multipliers d ≥ 0 of normal and free
    /// rows with Wᵀ d = 0 and qᵀ d < 0. As dᵀ y = dᵀ q, some row stays violated by −qᵀ d / Σ |d| or more.
    fn contradiction(&self, problem: &ContactProblem<'_, T>, enters: Variable) -> Option<ContactFailure<T>> {
        let mut ray = vec![T::zero(); problem.size()];
        self.multipliers(|place| -self.column[place], &mut ray);
        if let Variable::Unknown(condition) = enters {
            self.add(condition, T::one(), &mut ray);
        }
        let small = lost::<T>().sqrt();
        let own = |row: usize| ray[row].abs() * problem.delassus(row, row).max(T::zero()).sqrt();
        let hardest = |but: Option<usize>| {
            let rows = (0..ray.len()).filter(|&row| Some(row) != but);
            rows.reduce(|hardest, row| if own(row) > own(hardest) { row } else { hardest })
        };
        let row = hardest(None)?;
        let negligible = |other: usize| own(other) <= small * own(row);
        let normal = problem.blocks().all(|(rows, set)| {
            let first = rows.start;
            let pushes = set == AdmissibleSet::Free || ray[first] >= T::zero() || negligible(first);
            pushes && rows.skip(1).all(negligible)
        });
        let unanswered = (0..ray.len()).all(|j| {
            let terms = || ray.iter().enumerate().map(|(i, &d)| problem.delassus(i, j) * d);
            terms().sum::<T>().abs() <= small * terms().map(T::abs).sum()
        });
        let work = || ray.iter().zip(problem.offset).map(|(&d, &q)| d * q);
        let against = work().sum::<T>() < -small * work().map(T::abs).sum();
        (normal && unanswered && against).then(|| ContactFailure::Contradictory {
            row,
            other: hardest(Some(row)).unwrap_or(row),
            residual: -work().sum::<T>() / ray.iter().map(|d| d.abs()).sum(),
        })
    }
}

impl<T: Real> ContactSolver<T> for Lemke<T> {
    /// All but cones in space.
    fn admits(&self, set: AdmissibleSet) -> bool {
        matches!(set, AdmissibleSet::NonNegative | AdmissibleSet::Free | AdmissibleSet::Cone2 { .. })
    }

    fn reserve(&mut self, size: usize) {
        // Two rows of a contact are four conditions.
        let conditions = 2 * size;
        let reals = || Vec::with_capacity(conditions);
        *self = Self {
            conditions: Vec::with_capacity(conditions),
            roots: Vec::with_capacity(size),
            largest: T::zero(),
            basis: Vec::with_capacity(conditions),
            values: reals(),
            inverse: Vec::with_capacity(conditions * conditions),
            right: reals(),
            tilt: T::zero(),
            given: reals(),
            column: reals(),
            noise: reals(),
            tied: Vec::with_capacity(conditions),
            rest: reals(),
        };
    }

    fn solve(&mut self, problem: &ContactProblem<'_, T>, multipliers: &mut [T]) -> Result<usize, ContactFailure<T>> {
        if let Some((rows, _)) = problem.blocks().find(|(_, set)| !self.admits(*set)) {
            return Err(ContactFailure::Friction { row: rows.start });
        }
        let acceptance = BlockAcceptance::begin(problem, Settings::default().tolerance(), multipliers)?;
        problem.check_finite(false)?;
        let mut pivots = self.pose(problem);
        // Far above anything seen.
        let limit = 100 + 20 * self.conditions.len();
        for _ in 0..PATHS {
            let end = self.follow(problem, &mut pivots, limit);
            let contradiction = match end {
                End::Ray(enters) => self.contradiction(problem, enters),
                End::Complementary | End::Limit => None,
            };
            self.polish(problem);
            self.multipliers(|place| self.values[place], multipliers);
            Self::tidy(problem, multipliers);
            if acceptance.accepts(problem, multipliers) {
                return Ok(pivots);
            }
            match (end, contradiction) {
                (_, Some(contradiction)) => return Err(contradiction),
                (End::Limit, _) => break,
                (End::Ray(_), _) => {
                    self.tilt += T::of(0.5);
                    pivots += self.begin(problem);
                }
                (End::Complementary, _) => {}
            }
        }
        Err(failure(problem, pivots, multipliers))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A contact that rounding pulls has no force, and no friction of either sign.
    #[test]
    fn what_is_left_of_cones_is_nothing() {
        let (w, offset) = ([1.0, 0.0, 0.0, 1.0], [1.0, 0.0]);
        let sets = [AdmissibleSet::Cone2 { friction: 0.5 }];
        let problem = ContactProblem::of(&w, &offset, &sets, &offset, 0);
        for (before, after) in
            [([-1e-17, 1e-17], [0.0; 2]), ([-1e-17, -1e-17], [0.0; 2]), ([2.0, -1.5], [2.0_f64, -1.0])]
        {
            let mut multipliers: [f64; 2] = before;
            Lemke::tidy(&problem, &mut multipliers);
            let miss = multipliers.iter().zip(&after).fold(0.0_f64, |miss, (x, y)| miss.max((x - y).abs()));
            assert!(miss <= 0.0, "{before:?}: {multipliers:?}");
        }
    }
}
