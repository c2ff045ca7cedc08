//! The rows of edges on edges: entries of G, where the edges are closest, and the gaps there.

use super::lines::Crossing;
use crate::contact::affine_rows::AffineRows;
use crate::real::Real;

/// How often a pair may come and go within the iterations of a step, at one time, before it stays.
const PATIENCE: u8 = 4;

/// How two edges stand on each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stand {
    /// With the normal along which the first edge opens.
    pub(super) crossing: Crossing,
    /// Whether the closest points were on both edges when the search found the pair.
    pub(super) held: bool,
    /// Whether they can press on each other; if not the row is open whatever the lines do.
    pub(super) meets: bool,
    flips: u8,
    /// Whether they could at the two times that rows are followed to in a step, the one seen last first.
    seen: [Option<(f64, bool)>; 2],
}

impl Stand {
    /// As a search finds it.
    pub(super) fn new(crossing: Crossing, held: bool) -> Self {
        Self { crossing, held, meets: true, flips: 0, seen: [None; 2] }
    }

    /// The stand at t after this one. A pair that comes and goes while an iteration goes on stays in the end.
    pub(super) fn followed_by(&self, crossing: Crossing, t: f64, meets: bool) -> Self {
        let same = |seen: &(f64, bool)| seen.0.to_bits() == t.to_bits();
        let before = self.seen.iter().flatten().find(|seen| same(seen)).map(|seen| seen.1);
        let other = self.seen.iter().flatten().find(|seen| !same(seen)).copied();
        let flips = self.flips.saturating_add(u8::from(before.is_some_and(|before| before != meets)));
        let meets = meets || flips > PATIENCE;
        Self { crossing, meets, flips, seen: [Some((t, meets)), other], ..*self }
    }
}

/// The rows that a search found, where they are linearized.
#[derive(Debug)]
pub(super) struct Rows<T> {
    pub(super) affine: AffineRows<T>,
    /// The edges of the two surfaces.
    pub(super) pairs: Vec<[usize; 2]>,
    pub(super) stands: Vec<Stand>,
}

impl<T: Real> Rows<T> {
    pub(super) fn new() -> Self {
        Self { affine: AffineRows::with_capacity(0, 0), pairs: Vec::new(), stands: Vec::new() }
    }

    pub(super) fn clear(&mut self) {
        self.affine.clear();
        self.pairs.clear();
        self.stands.clear();
    }

    /// Appends the row of two edges with a gap, by their four nodes.
    pub(super) fn push<'a>(
        &mut self,
        pair: [usize; 2],
        stand: Stand,
        gap: f64,
        (nodes, places): ([usize; 4], impl Fn(usize) -> &'a [usize]),
        u: &[T],
    ) {
        let entries = nodes.into_iter().zip(stand.crossing.weights()).flat_map(|(node, share)| {
            let along = stand.crossing.normal.map(|component| share * component);
            places(node).iter().copied().zip(along)
        });
        self.affine.push(gap, entries, u);
        self.pairs.push(pair);
        self.stands.push(stand);
    }

    /// Appends a row as another list has it.
    pub(super) fn keep(&mut self, other: &Self, row: usize) {
        self.affine.keep(&other.affine, row);
        self.pairs.push(other.pairs[row]);
        self.stands.push(other.stands[row]);
    }
}
