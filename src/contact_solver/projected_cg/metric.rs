//! N = G D⁻¹ Gᵀ + c of the closed rows: the Delassus operator of a body whose dofs do not move one another.

use super::WHAT;
use super::rows::Rows;
use super::statuses::{Role, Statuses};
use crate::contact::RowProducts;
use crate::dense::DenseCholesky;
use crate::error::{Error, Result};
use crate::linear_solver::{Automatic, Factorization, LinearSolver, negligible};
use crate::memory;
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
    /// The factor of a few rows, which needs no analysis, and whether it is the present one.
    dense: DenseCholesky<T>,
    is_dense: bool,
    /// The pattern that the factor was analyzed for, and the values that were factorized.
    analyzed: [Vec<usize>; 2],
    factorized: Vec<T>,
    /// Which rows the factor takes as closed, with their compliances.
    closed: Vec<Option<T>>,
    right: Vec<T>,
    products: RowProducts<T>,
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

/// Added to the diagonal of N, as a share of it, because rows may depend on one another: at least twice the pivot that
/// a factorization refuses. Repeated projections remove its effect. Rows of two surfaces that lie on each other may have
/// eigenvalues down to 1e-8.
const SHIFT: f64 = 1e-10;

/// The change of a compliance, as a share of the diagonal, from which on N is factorized again.
const ANOTHER: f64 = 1e-3;

/// Rows up to which N has a dense factor.
const FEW: usize = 64;

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

    /// The size of forces Gᵀ λ, in the norm of D⁻¹.
    pub(super) fn norm(&self, multipliers: &[T]) -> T {
        let column = |j: usize| self.starts[j]..self.starts[j + 1];
        let product = |j: usize| {
            let terms = self.places[column(j)].iter().zip(&self.values[column(j)]);
            terms.map(|(&i, &value)| value * multipliers[i]).sum::<T>()
        };
        let terms = multipliers.iter().enumerate().filter(|(_, x)| **x != T::zero());
        terms.map(|(j, &x)| x * product(j)).sum::<T>().max(T::zero()).sqrt()
    }

    /// Forms and factorizes N, as far as needed. Returns whether it could be factorized.
    pub(super) fn follow(&mut self, rows: &Rows<T>, statuses: &Statuses<T>, inverse: &[T]) -> Result<bool> {
        if self.is_old {
            self.closed.clear();
            self.form(rows, inverse)?;
            (self.is_old, self.is_near) = (false, false);
        }
        let differs = |row: usize, own: T| match (statuses.roles[row], self.closed[row]) {
            (Role::Closed, Some(c)) => (c - own).abs() > T::of(ANOTHER) * (self.diagonal[row] + own),
            (Role::Closed, None) => true,
            (Role::Open | Role::Given, c) => c.is_some(),
        };
        let mut own = statuses.compliance.iter().enumerate();
        if self.closed.len() == rows.len() && !own.any(|(row, &own)| differs(row, own)) {
            return Ok(true);
        }
        let closes = |row: usize| statuses.roles[row] == Role::Closed;
        self.closed.clear();
        memory::make_room(&mut self.closed, rows.len(), WHAT)?;
        self.closed.extend((0..rows.len()).map(|row| closes(row).then(|| statuses.compliance[row])));
        let found = self.factorize();
        if found.is_err() {
            self.closed.clear();
        }
        match found {
            Err(error @ Error::OutOfMemory { .. }) => Err(error),
            found => Ok(found.is_ok()),
        }
    }

    fn factorize(&mut self) -> Result<()> {
        let Self { starts, places, values, diagonal, factor, dense, analyzed, factorized, closed, right, .. } = self;
        let size = diagonal.len();
        let shift = T::one() + T::of(SHIFT).max(T::of(2.0) * negligible(size));
        memory::grow(right, size, 1, WHAT)?;
        factorized.clear();
        memory::make_room(factorized, values.len(), WHAT)?;
        for j in 0..size {
            let column = starts[j]..starts[j + 1];
            factorized.extend(places[column.clone()].iter().zip(&values[column]).map(|(&i, &value)| {
                match (i == j, closed[i], closed[j]) {
                    (true, Some(own), _) => shift * value + own,
                    // An open row is an equation of its own.
                    (true, None, _) if value > T::zero() => value,
                    (true, None, _) => T::one(),
                    (false, Some(_), Some(_)) => value,
                    (false, ..) => T::zero(),
                }
            }));
        }
        self.is_dense = size <= FEW;
        if self.is_dense {
            let fill = |i: usize, row: &mut [T]| {
                row.fill(T::zero());
                let column = starts[i]..starts[i + 1];
                let entries = places[column.clone()].iter().zip(&factorized[column]);
                entries.take_while(|(j, _)| **j <= i).for_each(|(&j, &value)| row[j] = value);
            };
            return dense
                .factorize_rows(size, 0.0, fill)
                .map_err(|dof| Error::Singular { matrix: "rows of contact", dof });
        }
        let pattern = SymbolicSparseColMatRef::new_checked(size, size, starts, None, places);
        let [known_starts, known_places] = analyzed;
        let factor = match factor {
            Some(factor) if known_starts == starts && known_places == places => factor,
            _ => {
                known_starts.clear();
                let analyzed = factor.insert(Automatic.analyze(pattern, &[])?);
                memory::copy(known_places, places, WHAT)?;
                memory::copy(known_starts, starts, WHAT)?;
                analyzed
            }
        };
        factor.factorize(SparseColMatRef::new(pattern, factorized))
    }

    /// G D⁻¹ Gᵀ of all rows.
    fn form(&mut self, rows: &Rows<T>, inverse: &[T]) -> Result<()> {
        let Self { starts, places, values, diagonal, products, .. } = self;
        let (size, dofs) = (rows.len(), inverse.len() - rows.len());
        products.list(size, dofs, |row| rows.row(row))?;
        starts.clear();
        places.clear();
        values.clear();
        diagonal.clear();
        memory::make_room(starts, size + 1, WHAT)?;
        memory::make_room(diagonal, size, WHAT)?;
        starts.push(0);
        for j in 0..size {
            let first = places.len();
            memory::make_room(places, size, WHAT)?;
            memory::make_room(values, size, WHAT)?;
            products.each(rows.row(j).map(|(dof, weight)| (dof, weight * inverse[dof])), |i, product| {
                places.push(i);
                values.push(product);
            });
            let own = places[first..].binary_search(&j);
            diagonal.push(own.map_or(T::zero(), |at| values[first + at]));
            starts.push(places.len());
        }
        Ok(())
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
        let Self { factor, dense, is_dense, right, .. } = self;
        if *is_dense {
            dense.solve(right);
            return T::all_finite(right);
        }
        factor.as_mut().is_some_and(|factor| factor.solve(right).is_ok()) && T::all_finite(right)
    }
}
