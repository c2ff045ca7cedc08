//! Gaps between two searches: the rows of G, and the rates that do not come from them.

use crate::error::Result;
use crate::memory::{grow, make_room};
use crate::real::Real;
use crate::rounding::share_of_rounding;
use std::ops::Range;

/// The parts of the gap rates that do not come from v and a: ġ = G v + `rate`, g̈ = G a + `acceleration`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GapRates<T> {
    /// ∂g/∂t at fixed u (length/time).
    pub rate: T,
    /// Ġ v + ∂ġ/∂t at fixed u, v, a (length/time²).
    pub acceleration: T,
}

impl<T: Real> GapRates<T> {
    /// The rates of slip along the tangents of an obstacle with these velocities and accelerations along them.
    pub(super) fn dragged([velocities, accelerations]: [[T; 2]; 2]) -> [Self; 2] {
        std::array::from_fn(|k| Self { rate: -velocities[k], acceleration: -accelerations[k] })
    }
}

/// The rows of G, stored row by row.
///
/// ```
/// use contact_dynamics::contact::ContactJacobian;
/// let mut g = ContactJacobian::default();
/// g.push(&[(0, -1.0), (2, 1.0)]); // g = u2 − u0
/// assert_eq!(g.product(0, &[1.0, 5.0, 4.0]), 3.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ContactJacobian<T> {
    pub(super) pointers: Vec<usize>,
    pub(super) dofs: Vec<usize>,
    pub(super) weights: Vec<T>,
    /// For each entry the place of its dof on the interface, after [`locate`](Self::locate); `NO_RESPONSE` for
    /// prescribed dofs.
    places: Vec<usize>,
    /// The largest Σ |weight| of a row, after [`locate`](Self::locate).
    largest: Option<T>,
    /// The number of normal rows, if tangential rows follow them.
    normals: Option<usize>,
}

/// The place of dofs that are not on the interface.
pub(crate) const NO_RESPONSE: usize = usize::MAX;

impl<T> Default for ContactJacobian<T> {
    fn default() -> Self {
        let (dofs, weights, places) = (Vec::new(), Vec::new(), Vec::new());
        Self { pointers: vec![0], dofs, weights, places, largest: None, normals: None }
    }
}

impl<T> ContactJacobian<T> {
    pub(crate) fn clear(&mut self) {
        self.pointers.truncate(1);
        self.dofs.clear();
        self.weights.clear();
        self.places.clear();
        self.normals = None;
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.pointers.len() - 1
    }
}

impl<T: Real> ContactJacobian<T> {
    /// Marks the rows so far as normal rows; tangential rows follow.
    pub(crate) fn end_normals(&mut self) {
        self.normals = Some(self.rows());
    }

    /// Whether a row is tangential. In lists of rows with friction it belongs to the contact before it.
    pub(crate) fn is_tangential(&self, row: usize) -> bool {
        self.normals.is_some_and(|normals| row >= normals)
    }

    /// Stores the places of the dofs on the interface; `places` has one entry per dof of the system.
    pub(crate) fn locate(&mut self, places: &[usize]) {
        self.places.clear();
        self.places.extend(self.dofs.iter().map(|&dof| places[dof]));
        let sum = |row| self.row(row).fold(T::zero(), |sum, (_, weight)| sum + weight.abs());
        self.largest = (0..self.rows()).map(sum).reduce(T::max);
    }

    /// The largest Σ |weight| of a row: a product of a row is at most this times the largest |x|.
    pub(crate) fn largest_row(&self) -> T {
        self.largest.unwrap_or(T::zero())
    }

    /// Appends a row of (dof, weight) pairs.
    pub fn push(&mut self, entries: &[(usize, T)]) {
        self.push_entries(entries.iter().copied());
    }

    pub(crate) fn push_entries(&mut self, entries: impl Iterator<Item = (usize, T)>) {
        for (dof, weight) in entries {
            self.dofs.push(dof);
            self.weights.push(weight);
        }
        self.pointers.push(self.dofs.len());
    }

    /// Removes all rows, and takes memory for others.
    pub(crate) fn begin(&mut self, rows: usize, entries: usize) -> Result<()> {
        const WHAT: &str = "the rows of a contact problem";
        self.clear();
        make_room(&mut self.pointers, rows, WHAT)?;
        make_room(&mut self.dofs, entries, WHAT)?;
        make_room(&mut self.weights, entries, WHAT)
    }

    /// Combines a row and the next one, which acts on the same dofs: c of it and s of the other, and across.
    pub(crate) fn turn(&mut self, row: usize, [c, s]: [T; 2]) {
        let [start, middle, end] = [0, 1, 2].map(|k| self.pointers[row + k]);
        let (one, other) = self.weights[start..end].split_at_mut(middle - start);
        for (x, y) in one.iter_mut().zip(other) {
            (*x, *y) = (c * *x + s * *y, c * *y - s * *x);
        }
    }

    /// Copies another matrix into the existing memory.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.pointers.clone_from(&other.pointers);
        self.dofs.clone_from(&other.dofs);
        self.weights.clone_from(&other.weights);
        self.places.clone_from(&other.places);
        self.largest = other.largest;
        self.normals = other.normals;
    }

    pub(crate) fn push_row(&mut self, other: &Self, row: usize) {
        let range = other.pointers[row]..other.pointers[row + 1];
        self.dofs.extend_from_slice(&other.dofs[range.clone()]);
        self.weights.extend_from_slice(&other.weights[range]);
        self.pointers.push(self.dofs.len());
    }

    /// Appends the rows of another matrix, whose dofs are places in `list`.
    pub(crate) fn append(&mut self, other: &Self, list: &[usize]) {
        let before = self.dofs.len();
        self.dofs.extend(other.dofs.iter().map(|&place| list[place]));
        self.weights.extend_from_slice(&other.weights);
        self.pointers.extend(other.pointers[1..].iter().map(|end| before + end));
    }

    /// Appends some rows of another matrix, whose dofs are places in `list`.
    pub(crate) fn append_rows(&mut self, (other, rows): (&Self, Range<usize>), list: &[usize]) {
        for row in rows {
            self.push_entries(other.row(row).map(|(place, weight)| (list[place], weight)));
        }
    }

    /// The (dof, weight) pairs of a row.
    pub fn row(&self, row: usize) -> impl Iterator<Item = (usize, T)> + '_ {
        let range = self.pointers[row]..self.pointers[row + 1];
        self.dofs[range.clone()].iter().copied().zip(self.weights[range].iter().copied())
    }

    /// Whether two rows are multiples of each other up to rounding: the same contact, listed twice.
    pub(crate) fn are_multiples(&self, row: usize, other: usize) -> bool {
        let largest = |row| self.row(row).map(|(_, weight)| weight.abs()).fold(T::zero(), T::max);
        let (own, size, near) = (largest(row), largest(other), share_of_rounding::<T>());
        let same = |((dof, x), (at, y)): ((usize, T), (usize, T))| dof == at && (x / own - y / size).abs() <= near;
        self.row(row).count() == self.row(other).count() && self.row(row).zip(self.row(other)).all(same)
    }

    /// `G_row · x`.
    pub fn product(&self, row: usize, x: &[T]) -> T {
        self.row(row).map(|(dof, weight)| weight * x[dof]).sum()
    }

    /// Σ_j G_row,j F_other,j with a row of another matrix.
    pub(crate) fn dot(&self, row: usize, (others, other): (&Self, usize)) -> T {
        let of_other = |dof: usize| others.row(other).filter(move |&(at, _)| at == dof);
        self.row(row).flat_map(|(dof, weight)| of_other(dof).map(move |(_, other)| weight * other)).sum()
    }

    /// Whether a row acts on any of the dofs given (ascending).
    pub(crate) fn acts_on(&self, row: usize, dofs: &[usize]) -> bool {
        self.row(row).any(|(dof, weight)| weight != T::zero() && dofs.binary_search(&dof).is_ok())
    }

    /// `Σ_j |G_row,j| |x_j|`: the scale of the rounding in [`product`](Self::product).
    pub(crate) fn magnitude(&self, row: usize, x: &[T]) -> T {
        self.row(row).map(|(dof, weight)| (weight * x[dof]).abs()).sum()
    }

    /// The (place on the interface, weight) pairs of a row, without prescribed dofs.
    pub(crate) fn located(&self, row: usize) -> impl Iterator<Item = (usize, T)> + '_ {
        let range = self.pointers[row]..self.pointers[row + 1];
        let entries = self.places[range.clone()].iter().copied().zip(self.weights[range].iter().copied());
        entries.filter(|&(place, _)| place != NO_RESPONSE)
    }

    /// `G_row · x` for x on the interface.
    pub(crate) fn interface_product(&self, row: usize, x: &[T]) -> T {
        self.located(row).map(|(place, weight)| weight * x[place]).sum()
    }

    /// `Σ_j |G_row,j| |x_j|` for x on the interface.
    pub(crate) fn interface_magnitude(&self, row: usize, x: &[T]) -> T {
        self.located(row).map(|(place, weight)| (weight * x[place]).abs()).sum()
    }

    /// `x += c G_rowᵀ` for x on the interface.
    pub(crate) fn interface_scatter(&self, row: usize, c: T, x: &mut [T]) {
        for (place, weight) in self.located(row) {
            x[place] += c * weight;
        }
    }

    /// `x += c G_rowᵀ`.
    pub(crate) fn scatter(&self, row: usize, c: T, x: &mut [T]) {
        for (dof, weight) in self.row(row) {
            x[dof] += c * weight;
        }
    }
}

/// Products of vectors with the rows of a list. Rows that share no dof with a vector are not visited.
#[derive(Debug, Default)]
pub(crate) struct RowProducts<T> {
    /// The dofs that rows act on, in the order in which they were met, and the number of each dof among them.
    dofs: Vec<usize>,
    numbers: Vec<usize>,
    /// By number: the rows that act on a dof, ascending, with their weights.
    starts: Vec<usize>,
    acting: Vec<(usize, T)>,
    /// Products of the present vector by row, and the rows that it has visited.
    sums: Vec<T>,
    visited: Vec<usize>,
    is_visited: Vec<bool>,
}

/// The number of a dof that no row acts on.
const NO_ROW: usize = usize::MAX;

impl<T: Real> RowProducts<T> {
    /// Lists rows, of which `row` returns the (dof, weight) pairs, on this number of dofs.
    pub(crate) fn list<R: Iterator<Item = (usize, T)>>(
        &mut self,
        rows: usize,
        dofs: usize,
        row: impl Fn(usize) -> R,
    ) -> Result<()> {
        const WHAT: &str = "the products of contact rows";
        let Self { dofs: met, numbers, starts, acting, sums, visited, is_visited } = self;
        met.drain(..).for_each(|dof| numbers[dof] = NO_ROW);
        if numbers.len() < dofs {
            make_room(numbers, dofs - numbers.len(), WHAT)?;
            numbers.resize(dofs, NO_ROW);
        }
        let entries: usize = (0..rows).map(|k| row(k).count()).sum();
        make_room(met, entries.min(dofs), WHAT)?;
        starts.clear();
        make_room(starts, entries.min(dofs) + 2, WHAT)?;
        acting.clear();
        sums.clear();
        grow(sums, rows, 1, WHAT)?;
        visited.clear();
        make_room(visited, rows, WHAT)?;
        is_visited.clear();
        make_room(is_visited, rows, WHAT)?;
        is_visited.resize(rows, false);
        make_room(acting, entries, WHAT)?;
        acting.resize(entries, (0, T::zero()));
        // Counts, two places behind; then starts, one place behind; each moves to its place as entries are written.
        starts.extend([0, 0]);
        for (dof, _) in (0..rows).flat_map(&row) {
            if numbers[dof] == NO_ROW {
                numbers[dof] = met.len();
                met.push(dof);
                starts.push(0);
            }
            starts[numbers[dof] + 2] += 1;
        }
        (2..starts.len()).for_each(|number| starts[number] += starts[number - 1]);
        for k in 0..rows {
            for (dof, weight) in row(k) {
                let at = &mut starts[numbers[dof] + 1];
                acting[*at] = (k, weight);
                *at += 1;
            }
        }
        Ok(())
    }

    /// Calls `put` with each row that shares a dof with a vector, in ascending order, and their product.
    pub(crate) fn each(&mut self, vector: impl Iterator<Item = (usize, T)>, mut put: impl FnMut(usize, T)) {
        let Self { numbers, starts, acting, sums, visited, is_visited, .. } = self;
        for (dof, own) in vector {
            let number = numbers[dof];
            if number == NO_ROW {
                continue;
            }
            for &(row, weight) in &acting[starts[number]..starts[number + 1]] {
                if !is_visited[row] {
                    is_visited[row] = true;
                    visited.push(row);
                }
                sums[row] += own * weight;
            }
        }
        visited.sort_unstable();
        for row in visited.drain(..) {
            is_visited[row] = false;
            put(row, std::mem::replace(&mut sums[row], T::zero()));
        }
    }
}
