//! The rows of weighted gaps: entries of G, tangents, and positions of contacts.

use super::integrals::{Entry, Integrals};
use crate::contact::ContactJacobian;
use crate::contact::affine_rows::AffineRows;
use crate::contact::surface::{Nodes, Point, Surface};
use crate::real::Real;

/// The rows of a search, at their point of linearization.
#[derive(Debug)]
pub(super) struct Rows<T> {
    pub(super) affine: AffineRows<T>,
    /// The slave node of each row, by its place among the nodes of its surface.
    pub(super) places: Vec<usize>,
    pub(super) spots: Vec<Spot>,
    /// `dimension` − 1 tangents per row, if there is friction.
    pub(super) tangents: ContactJacobian<T>,
}

/// Data from which rows are made: nodes, slave, whether there is friction, factor of offsets, and displacements.
pub(super) struct Made<'a, T> {
    pub(super) nodes: &'a Nodes,
    pub(super) slave: &'a Surface,
    pub(super) rubs: bool,
    pub(super) factor: f64,
    pub(super) u: &'a [T],
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub(super) position: Point,
    pub(super) normal: Point,
    pub(super) area: f64,
    /// The mean offset of the two surfaces at full size, and its factor in the gap.
    pub(super) offset: f64,
    pub(super) factor: f64,
}

impl<T: Real> Rows<T> {
    pub(super) fn new() -> Self {
        Self {
            affine: AffineRows::default(),
            places: Vec::new(),
            spots: Vec::new(),
            tangents: ContactJacobian::default(),
        }
    }

    pub(super) fn clear(&mut self) {
        self.affine.clear();
        self.places.clear();
        self.spots.clear();
        self.tangents.clear();
    }

    /// Appends the row of a slave node, if it is covered; returns whether it is.
    pub(super) fn push(&mut self, place: usize, integrals: &mut Integrals, made: &Made<'_, T>) -> bool {
        let Made { nodes, slave, rubs, factor, u } = *made;
        let sums = integrals.sums[place];
        let Some(normal) = sums.normal().filter(|_| sums.is_covered()) else { return false };
        let entries = integrals.row(slave.corners_at(place));
        let vectors = entries.iter().map(|entry| (nodes.places(entry.node), entry.weight(&sums)));
        self.affine.push_vectors(sums.gap(), vectors, u);
        self.places.push(place);
        let (position, offset) = (sums.position(), sums.offset());
        self.spots.push(Spot { position, normal, area: sums.area, offset, factor });
        if rubs {
            for direction in nodes.tangents(normal) {
                let slip = |entry: &Entry| direction.map(|x| entry.share / sums.area * x);
                let along = entries.iter().flat_map(|entry| on_axes(nodes, entry, slip(entry)));
                self.tangents.push_entries(along.map(|(place, weight)| (place, T::of(weight))));
            }
        }
        true
    }

    /// Appends a copy of a row of another list.
    pub(super) fn keep(&mut self, other: &Self, row: usize, tangents: usize) {
        self.affine.keep(&other.affine, row);
        self.places.push(other.places[row]);
        self.spots.push(other.spots[row]);
        for tangent in row * tangents..(row + 1) * tangents {
            self.tangents.push_row(&other.tangents, tangent);
        }
    }
}

/// The components of a node's weight, with the places of its dofs.
fn on_axes<'n>(nodes: &'n Nodes, entry: &Entry, weight: Point) -> impl Iterator<Item = (usize, f64)> + use<'n> {
    nodes.places(entry.node).iter().copied().zip(weight)
}
