//! N = G D⁻¹ Gᵀ + c of the closed rows: the Delassus operator of a body whose dofs do not move one another.

use super::rows::Rows;
use super::statuses::{Role, Statuses};
use crate::linear_solver::{Automatic, Factorization, LinearSolver};
use crate::real::Real;
use crate::rounding::rounding;
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};

/// N of all rows, and the factor of its part for the closed ones.
#[derive(Debug, Default)]
pub(super) struct Metric<T> {
    /// G D⁻¹ Gᵀ column by column, both triangles.
    starts: Vec<usize>,
    places: Vec<usize>,
    values: Vec<T>,
    diagonal: Vec<T>,
    /// Whether `values` must be formed anew.
    is_old: bool,
    /// Whether `values` are of rows linearized elsewhere.
    pub(super) is_near: bool,
    factor: Option<Box<dyn Factorization<T>>>,
    /// The pattern that the factor was analyzed for, and the values that were factorized.
    analyzed: [Vec<usize>; 2],
    factorized: Vec<T>,
    /// Which rows the factor takes as closed, with their compliances.
    closed: Vec<Option<T>>,
    right: Vec<T>,
    /// For each dof the rows that act on it, with their weights, and a row of N.
    lists: Vec<usize>,
    acting: Vec<(usize, T)>,
    sums: Vec<T>,
    touched: Vec<usize>,
}

/// The largest value of a closed row beyond its tolerance, and the largest sum of magnitudes, both over √N_ii.
#[derive(Clone, Copy, Debug)]
pub(super) struct Miss<T> {
    left: T,
    size: T,
}

impl<T: Real> Miss<T> {
    pub(super) fn is_met(&self) -> bool {
        self.left <= rounding(self.size).max(T::of(LEFT) * self.size)
    }

    /// As a share of the magnitude.
    pub(super) fn share(&self) -> f64 {
        (self.left / self.size).value()
    }
}

/// Added to the diagonal of N, as a share of it: rows may depend on one another. Repeated projections remove its
/// effect. Rows of two surfaces that lie on each other may have eigenvalues down to 1e-8.
const SHIFT: f64 = 1e-10;

/// The change of a compliance, as a share of the diagonal, from which on N is factorized again.
const ANOTHER: f64 = 1e-3;

/// Projections of one residual: each reduces what is left by the share that the factor misses.
const PASSES: usize = 8;

/// The part of a residual along the closed rows that may remain, as a share of it.
const LEFT: f64 = 1e-10;

/// Projections go on while each leaves less than this share of the residual before it.
const STALLS: f64 = 0.5;

impl<T: Real> Metric<T> {
    /// The rows are others, or have turned.
    pub(super) fn forget(&mut self) {
        self.is_old = true;
    }

    /// N of rows that have been linearized elsewhere serves as well, with one projection more.
    pub(super) fn keep(&mut self) {
        self.is_near = true;
    }

    /// Another problem with the rows of the last one. A factor for other rows or statuses does not serve it.
    pub(super) fn begin(&mut self, statuses: &Statuses<T>) {
        self.is_old |= self.is_near;
        let wanted = |row: usize| (statuses.roles[row] == Role::Closed).then(|| statuses.compliance[row]);
        if !self.closed.iter().copied().eq((0..statuses.roles.len()).map(wanted)) {
            self.closed.clear();
        }
    }

    /// The diagonal of G D⁻¹ Gᵀ.
    pub(super) fn diagonal(&self, row: usize) -> T {
        self.diagonal[row]
    }

    /// λᵀ G D⁻¹ Gᵀ λ.
    pub(super) fn square(&self, multipliers: &[T]) -> T {
        let column = |j: usize| self.starts[j]..self.starts[j + 1];
        let product = |j: usize| {
            let terms = self.places[column(j)].iter().zip(&self.values[column(j)]);
            terms.map(|(&i, &value)| value * multipliers[i]).sum::<T>()
        };
        multipliers.iter().enumerate().filter(|(_, x)| **x != T::zero()).map(|(j, &x)| x * product(j)).sum()
    }

    /// Forms and factorizes N, as far as needed. Returns whether it could be factorized.
    pub(super) fn follow(&mut self, rows: &Rows<T>, statuses: &Statuses<T>, inverse: &[T]) -> bool {
        if self.is_old {
            self.closed.clear();
            if self.form(rows, inverse).is_none() {
                return false;
            }
            (self.is_old, self.is_near) = (false, false);
        }
        let differs = |row: usize, own: T| match (statuses.roles[row], self.closed[row]) {
            (Role::Closed, Some(c)) => (c - own).abs() > T::of(ANOTHER) * (self.diagonal[row] + own),
            (Role::Closed, None) => true,
            (Role::Open | Role::Given, c) => c.is_some(),
        };
        let mut own = statuses.compliance.iter().enumerate();
        if self.closed.len() == rows.len() && !own.any(|(row, &own)| differs(row, own)) {
            return true;
        }
        let closes = |row: usize| statuses.roles[row] == Role::Closed;
        self.closed.clear();
        self.closed.extend((0..rows.len()).map(|row| closes(row).then(|| statuses.compliance[row])));
        self.factorize().is_some()
    }

    fn factorize(&mut self) -> Option<()> {
        let Self { starts, places, values, diagonal, factor, analyzed, factorized, closed, right, .. } = self;
        let size = diagonal.len();
        right.resize(size, T::zero());
        factorized.clear();
        for j in 0..size {
            let column = starts[j]..starts[j + 1];
            factorized.extend(places[column.clone()].iter().zip(&values[column]).map(|(&i, &value)| {
                match (i == j, closed[i], closed[j]) {
                    (true, Some(own), _) => value + T::of(SHIFT).max(T::epsilon()) * value + own,
                    // An open row is an equation of its own.
                    (true, None, _) => {
                        if value > T::zero() {
                            value
                        } else {
                            T::one()
                        }
                    }
                    (false, Some(_), Some(_)) => value,
                    (false, ..) => T::zero(),
                }
            }));
        }
        let pattern = SymbolicSparseColMatRef::new_checked(size, size, starts, None, places);
        let [known_starts, known_places] = analyzed;
        if factor.is_none() || known_starts != starts || known_places != places {
            *factor = Some(Automatic.analyze(pattern, &[]).ok()?);
            known_starts.clone_from(starts);
            known_places.clone_from(places);
        }
        let found = factor.as_mut()?.factorize(SparseColMatRef::new(pattern, factorized));
        if found.is_err() {
            closed.clear();
        }
        found.ok()
    }

    /// G D⁻¹ Gᵀ of all rows, if there is memory for it.
    fn form(&mut self, rows: &Rows<T>, inverse: &[T]) -> Option<()> {
        let Self { starts, places, values, diagonal, lists, acting, sums, touched, .. } = self;
        let (size, dofs) = (rows.len(), inverse.len() - rows.len());
        // Counts become starts, and starts of the next dof as lists are filled.
        lists.clear();
        lists.resize(dofs + 2, 0);
        (0..size).flat_map(|i| rows.row(i)).for_each(|(dof, _)| lists[dof + 2] += 1);
        (2..lists.len()).for_each(|dof| lists[dof] += lists[dof - 1]);
        acting.clear();
        acting.resize(lists[dofs + 1], (0, T::zero()));
        for i in 0..size {
            for (dof, weight) in rows.row(i) {
                acting[lists[dof + 1]] = (i, weight);
                lists[dof + 1] += 1;
            }
        }
        for list in [&mut *starts, places] {
            list.clear();
        }
        values.clear();
        diagonal.clear();
        sums.clear();
        sums.resize(size, T::zero());
        starts.push(0);
        let untouched = usize::MAX;
        let mut seen = std::mem::take(touched);
        seen.clear();
        seen.resize(size, untouched);
        for j in 0..size {
            let first = places.len();
            places.try_reserve(size).ok()?;
            values.try_reserve(size).ok()?;
            seen[j] = j;
            places.push(j);
            for (dof, weight) in rows.row(j) {
                let scaled = weight * inverse[dof];
                for &(i, other) in &acting[lists[dof]..lists[dof + 1]] {
                    if seen[i] != j {
                        seen[i] = j;
                        places.push(i);
                    }
                    sums[i] += scaled * other;
                }
            }
            places[first..].sort_unstable();
            values.extend(places[first..].iter().map(|&i| std::mem::replace(&mut sums[i], T::zero())));
            starts.push(places.len());
            let own = places[first..].binary_search(&j).map_or(T::zero(), |at| values[first + at]);
            diagonal.push(own);
        }
        *touched = seen;
        Some(())
    }

    /// Removes from a residual of the norm `size` what the closed rows can carry: r −= Gᵀ l and λ −= l, so that
    /// G D⁻¹ r = 0.
    pub(super) fn project(
        &mut self,
        rows: &Rows<T>,
        statuses: &mut Statuses<T>,
        inverse: &[T],
        (residual, size): (&mut [T], T),
    ) {
        let dofs = inverse.len() - rows.len();
        let mut before = T::infinity();
        for _ in 0..PASSES {
            let along = |row: usize| {
                let terms = rows.row(row).map(|(dof, weight)| weight * (inverse[dof] * residual[dof]));
                terms.sum::<T>() + inverse[dofs + row] * residual[dofs + row]
            };
            let left = self.set_right(statuses, along, |_| [T::zero(); 2]).left;
            if left <= T::of(LEFT) * size || left > T::of(STALLS) * before || !self.solve() {
                return;
            }
            before = left;
            for (row, &l) in self.right.iter().enumerate().filter(|(_, l)| **l != T::zero()) {
                statuses.multipliers[row] -= l;
                rows.scatter(row, -l, residual);
                if inverse[dofs + row] > T::zero() {
                    residual[dofs + row] -= l;
                }
            }
        }
    }

    /// How far the closed rows are from closed; their values are the right-hand side of the next solve.
    pub(super) fn miss(&mut self, rows: &Rows<T>, statuses: &Statuses<T>, x: &[T]) -> Miss<T> {
        let dofs = x.len() - rows.len();
        let gap = |row: usize| rows.gap(row, x) + x[dofs + row];
        self.set_right(statuses, gap, |row| [rows.tolerance[row], rows.magnitude(row, x)])
    }

    /// Closes the closed rows: x −= D⁻¹ Gᵀ l. Returns how far they are from closed then.
    pub(super) fn close(&mut self, rows: &Rows<T>, statuses: &Statuses<T>, inverse: &[T], x: &mut [T]) -> Miss<T> {
        let dofs = inverse.len() - rows.len();
        let mut before = Miss { left: T::infinity(), size: T::zero() };
        for _ in 0..PASSES {
            let miss = self.miss(rows, statuses, x);
            if miss.left <= rounding(miss.size) || miss.left > T::of(STALLS) * before.left || !self.solve() {
                return miss;
            }
            before = miss;
            for (row, &l) in self.right.iter().enumerate().filter(|(_, l)| **l != T::zero()) {
                for (dof, weight) in rows.row(row) {
                    x[dof] -= inverse[dof] * (l * weight);
                }
                x[dofs + row] -= inverse[dofs + row] * l;
            }
        }
        before
    }

    /// Writes the value of each closed row to the right-hand side, and zeros. Returns the largest value beyond its
    /// tolerance, and the largest magnitude.
    fn set_right(
        &mut self,
        statuses: &Statuses<T>,
        value: impl Fn(usize) -> T,
        scale: impl Fn(usize) -> [T; 2],
    ) -> Miss<T> {
        let mut miss = Miss { left: T::zero(), size: T::zero() };
        for (row, right) in self.right.iter_mut().enumerate() {
            *right = T::zero();
            if statuses.roles[row] == Role::Closed {
                *right = value(row);
                let ([tolerance, magnitude], root) =
                    (scale(row), (self.diagonal[row] + statuses.compliance[row]).sqrt());
                miss.left = miss.left.max((right.abs() - tolerance) / root);
                miss.size = miss.size.max(magnitude / root);
            }
        }
        miss
    }

    fn solve(&mut self) -> bool {
        let Self { factor, right, .. } = self;
        factor.as_mut().is_some_and(|factor| factor.solve(right).is_ok()) && T::all_finite(right)
    }
}
