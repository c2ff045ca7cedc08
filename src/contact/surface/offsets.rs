//! Offsets of surfaces from their facets, as for shells and coatings, with a factor that may change in time.

use super::Facet;
use super::ramp::Ramp;
use crate::real::Real;

/// Offsets by node of a mesh, at full size, and their factor in time. An empty list means zero.
#[derive(Clone, Debug)]
pub(crate) struct Thickness {
    by_node: Vec<f64>,
    pub(crate) ramp: Ramp,
}

impl Thickness {
    /// With one offset per node, or none.
    pub(crate) fn new<T: Real>(offsets: &[T], ramp: Ramp) -> Self {
        Self { by_node: offsets.iter().map(|offset| offset.value()).collect(), ramp }
    }

    pub(crate) fn is_none(&self) -> bool {
        self.by_node.is_empty()
    }

    pub(crate) fn at(&self, t: f64) -> Offsets<'_> {
        Offsets { by_node: &self.by_node, factor: self.ramp.at(t) }
    }

    /// Lower bound (≤ 0) and upper bound (≥ 0) of the sum of the offsets of a node of one body and a node of the
    /// other, with this factor.
    pub(crate) fn bounds(&self, bodies: &[Vec<usize>; 2], factor: f64) -> [f64; 2] {
        if self.is_none() {
            return [0.0; 2];
        }
        let of = |body: &Vec<usize>| range(body.iter().map(|&node| factor * self.by_node[node]));
        let [one, other] = bodies.each_ref().map(of);
        [(one[0] + other[0]).min(0.0), (one[1] + other[1]).max(0.0)]
    }

    /// Bounds of the absolute value of that sum between two times, and of its change between them.
    pub(crate) fn sizes(&self, bodies: &[Vec<usize>; 2], times: [f64; 2]) -> [f64; 2] {
        let size = |factor: f64| self.bounds(bodies, factor).into_iter().fold(0.0, |most, x| f64::max(most, x.abs()));
        let [before, after] = times.map(|t| self.ramp.at(t));
        [size(before).max(size(after)), size(after - before)]
    }

    /// The largest penetration, at any time, of the facets of two surfaces that just touch.
    pub(crate) fn overlap(&self, bodies: &[Vec<usize>; 2]) -> f64 {
        self.ramp.factors.map(|factor| -self.bounds(bodies, factor)[0]).into_iter().fold(0.0, f64::max)
    }
}

/// Offsets of surfaces from their facets: by node, times a factor. An empty list means zero.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Offsets<'a> {
    pub(crate) by_node: &'a [f64],
    pub(crate) factor: f64,
}

impl Offsets<'_> {
    pub(crate) fn is_none(&self) -> bool {
        self.by_node.is_empty()
    }

    /// The offset of a node, without the factor.
    pub(crate) fn of(&self, node: usize) -> f64 {
        self.by_node.get(node).copied().unwrap_or(0.0)
    }

    /// The offsets at the corners of a facet, without the factor.
    pub(crate) fn at_corners(&self, facet: &Facet) -> [f64; 4] {
        facet.nodes.map(|node| self.of(node))
    }

    /// The offset of a node plus the offset of a facet at the point with these shape functions, without the factor.
    pub(crate) fn upon(&self, node: usize, facet: &Facet, weights: &[f64; 4]) -> f64 {
        if self.is_none() {
            return 0.0;
        }
        let corners = self.at_corners(facet);
        self.of(node) + weights.iter().zip(corners).map(|(weight, offset)| weight * offset).sum::<f64>()
    }

    /// A bound of the absolute value of that sum, with the factor.
    pub(crate) fn most(&self, node: usize, facet: &Facet) -> f64 {
        if self.is_none() {
            return 0.0;
        }
        let ends = range(self.at_corners(facet).into_iter()).map(|end| self.factor * (self.of(node) + end));
        ends[0].abs().max(ends[1].abs())
    }
}

/// The least and the largest of some values.
pub(super) fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}
