//! Rows of G with the gaps at their point of linearization. Between two linearizations gaps are affine.

use super::surface::{Nodes, Point};
use super::{Candidates, Contact, ContactJacobian};
use crate::real::Real;

/// The state at a search: time, displacements, velocities, and the time that the search looks ahead.
#[derive(Clone, Copy, Debug)]
pub(super) struct SearchState<'a, T> {
    pub(super) t: f64,
    pub(super) u: &'a [T],
    pub(super) v: &'a [T],
    pub(super) ahead: f64,
}

/// Gives a contact Coulomb's friction with this coefficient. `shares` are its nodes and their shares in the slip.
pub(super) fn set_friction<T: Real>(
    contact: &mut Contact<'_, T>,
    coefficient: f64,
    (nodes, normal): (&Nodes, Point),
    shares: &(impl Iterator<Item = (usize, f64)> + Clone),
) {
    if coefficient == 0.0 {
        return;
    }
    contact.friction(coefficient);
    for tangent in nodes.tangents(normal) {
        contact.tangent_entries(shares.clone().flat_map(|(node, share)| {
            let along = tangent.map(|along| T::of(share * along));
            nodes.places(node).iter().copied().zip(along)
        }));
    }
}

/// Rows, gaps g* and displacements u* of the linearization: `g = g* + G (u − u*)`.
#[derive(Debug, Default)]
pub(super) struct AffineRows<T> {
    pub(super) jacobian: ContactJacobian<T>,
    gaps: Vec<f64>,
    /// u*, one value per entry of G.
    displacements: Vec<T>,
}

impl<T: Real> AffineRows<T> {
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

/// The linearized rows of a search. Each row has an identity, the data of its point of contact, and the offset of the
/// surfaces.
#[derive(Debug)]
pub(super) struct Rows<T, Identity, Spot> {
    pub(super) affine: AffineRows<T>,
    pub(super) identities: Vec<Identity>,
    pub(super) spots: Vec<Spot>,
    /// The offset at full size, and its factor in the gap of the linearization.
    pub(super) offsets: Vec<(f64, f64)>,
    /// The same number of tangents for each row, where they are found together with the rows.
    pub(super) tangents: ContactJacobian<T>,
}

impl<T: Real, Identity: Copy + PartialEq, Spot: Copy> Rows<T, Identity, Spot> {
    pub(super) fn new() -> Self {
        Self {
            affine: AffineRows::default(),
            identities: Vec::new(),
            spots: Vec::new(),
            offsets: Vec::new(),
            tangents: ContactJacobian::default(),
        }
    }

    pub(super) fn clear(&mut self) {
        self.affine.clear();
        self.identities.clear();
        self.spots.clear();
        self.offsets.clear();
        self.tangents.clear();
    }

    /// Appends what belongs to a row, beside its entries and tangents.
    pub(super) fn describe(&mut self, identity: Identity, spot: Spot, offset: (f64, f64)) {
        self.identities.push(identity);
        self.spots.push(spot);
        self.offsets.push(offset);
    }

    /// Appends a copy of a row of another list.
    pub(super) fn keep(&mut self, other: &Self, row: usize) {
        self.affine.keep(&other.affine, row);
        self.describe(other.identities[row], other.spots[row], other.offsets[row]);
        let count = other.tangents.rows() / other.identities.len();
        (row * count..(row + 1) * count).for_each(|tangent| self.tangents.push_row(&other.tangents, tangent));
    }

    /// Exchanges the rows for those found now, and returns whether these are others.
    pub(super) fn replace(&mut self, found: &mut Self) -> Candidates {
        let same = self.identities == found.identities && self.affine.jacobian == found.affine.jacobian;
        std::mem::swap(self, found);
        Candidates::changed_if(!same)
    }

    /// The gap of a row at u, with this factor of the offsets.
    pub(super) fn gap(&self, row: usize, factor: f64, u: &[T]) -> T {
        let (offset, then) = self.offsets[row];
        self.affine.gap(row, u) - T::of((factor - then) * offset)
    }

    /// The gaps of all rows.
    pub(super) fn gaps(&self, factor: f64, u: &[T], gaps: &mut [T]) {
        for (row, gap) in gaps.iter_mut().enumerate().take(self.identities.len()) {
            *gap = self.gap(row, factor, u);
        }
    }
}
