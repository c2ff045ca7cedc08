//! Rows of G with the gaps at their point of linearization. Between two linearizations gaps are affine.

use super::ContactJacobian;
use crate::real::Real;

/// Rows, gaps g* and displacements u* of the linearization: `g = g* + G (u − u*)`.
#[derive(Debug)]
pub(super) struct AffineRows<T> {
    pub(super) jacobian: ContactJacobian<T>,
    gaps: Vec<f64>,
    /// u*, one value per entry of G.
    displacements: Vec<T>,
}

impl<T: Real> AffineRows<T> {
    pub(super) fn with_capacity(rows: usize, entries: usize) -> Self {
        Self {
            jacobian: ContactJacobian::with_capacity(rows, entries),
            gaps: Vec::with_capacity(rows),
            displacements: Vec::with_capacity(entries),
        }
    }

    pub(super) fn clear(&mut self) {
        self.jacobian.clear();
        self.gaps.clear();
        self.displacements.clear();
    }

    /// Appends a row by its (place, weight) pairs; zeros are left out.
    pub(super) fn push(&mut self, gap: f64, entries: impl Iterator<Item = (usize, f64)>, u: &[T]) {
        entries.for_each(|(place, weight)| self.add(place, weight, u));
        self.end_row(gap);
    }

    /// Appends a row by the vectors of its nodes, with the places of their dofs; zeros are left out.
    pub(super) fn push_vectors<'a>(
        &mut self,
        gap: f64,
        vectors: impl Iterator<Item = (&'a [usize], [f64; 3])>,
        u: &[T],
    ) {
        for (places, vector) in vectors {
            places.iter().zip(vector).for_each(|(&place, weight)| self.add(place, weight, u));
        }
        self.end_row(gap);
    }

    fn add(&mut self, place: usize, weight: f64, u: &[T]) {
        let weight = T::of(weight);
        if weight != T::zero() {
            self.jacobian.dofs.push(place);
            self.jacobian.weights.push(weight);
            self.displacements.push(u[place]);
        }
    }

    fn end_row(&mut self, gap: f64) {
        self.jacobian.pointers.push(self.jacobian.dofs.len());
        self.gaps.push(gap);
    }

    /// Appends a copy of a row of another list.
    pub(super) fn keep(&mut self, other: &Self, row: usize) {
        let range = other.jacobian.pointers[row]..other.jacobian.pointers[row + 1];
        self.jacobian.dofs.extend_from_slice(&other.jacobian.dofs[range.clone()]);
        self.jacobian.weights.extend_from_slice(&other.jacobian.weights[range.clone()]);
        self.displacements.extend_from_slice(&other.displacements[range]);
        self.jacobian.pointers.push(self.jacobian.dofs.len());
        self.gaps.push(other.gaps[row]);
    }

    pub(super) fn gap(&self, row: usize, u: &[T]) -> T {
        let Self { jacobian, gaps, displacements } = self;
        let start = &displacements[jacobian.pointers[row]..jacobian.pointers[row + 1]];
        let moved = jacobian.row(row).zip(start).map(|((place, weight), &start)| weight * (u[place] - start));
        T::of(gaps[row]) + moved.sum()
    }
}
