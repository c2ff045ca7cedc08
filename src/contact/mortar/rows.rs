//! The rows of weighted gaps: entries of G, tangents, and positions of contacts.

use super::integrals::{Entry, Integrals};
use crate::contact::affine_rows;
use crate::contact::surface::{Nodes, Point, Surface};
use crate::real::Real;

/// Rows by the slave node, as its place among the nodes of its surface; their offset is the mean one of both surfaces.
pub(super) type Rows<T> = affine_rows::Rows<T, usize, Spot>;

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
}

impl<T: Real> Rows<T> {
    /// Appends the row of a slave node, if it is covered; returns whether it is.
    pub(super) fn push(&mut self, place: usize, integrals: &mut Integrals, made: &Made<'_, T>) -> bool {
        let Made { nodes, slave, rubs, factor, u } = *made;
        let sums = integrals.sums[place];
        let Some(normal) = sums.normal().filter(|_| sums.is_covered()) else { return false };
        let entries = integrals.row(slave.corners_at(place));
        let vectors = entries.iter().map(|entry| (nodes.places(entry.node), entry.weight(&sums)));
        self.affine.push_vectors(sums.gap(), vectors, u);
        let spot = Spot { position: sums.position(), normal, area: sums.area };
        self.describe(place, spot, (sums.offset(), factor));
        if rubs {
            for direction in nodes.tangents(normal) {
                let slip = |entry: &Entry| direction.map(|x| entry.share / sums.area * x);
                let along = entries.iter().flat_map(|entry| on_axes(nodes, entry, slip(entry)));
                self.tangents.push_entries(along.map(|(place, weight)| (place, T::of(weight))));
            }
        }
        true
    }
}

/// The components of a node's weight, with the places of its dofs.
fn on_axes<'n>(nodes: &'n Nodes, entry: &Entry, weight: Point) -> impl Iterator<Item = (usize, f64)> + use<'n> {
    nodes.places(entry.node).iter().copied().zip(weight)
}
