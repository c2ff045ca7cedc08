//! Surfaces that lie outside of their facets, as those of shells and coatings do, by amounts that time may change.

use super::Facet;
use super::ramp::Ramp;
use crate::error::{Error, Result};
use crate::real::Real;

/// Offsets by node of a mesh, in full size, and the factor that time gives them. A list of none is zero.
#[derive(Clone, Debug, Default)]
pub(crate) struct Thickness {
    by_node: Vec<f64>,
    pub(crate) ramp: Ramp,
}

impl Thickness {
    /// Takes one offset a node; refuses lists of another length, and what is not finite.
    pub(crate) fn set<T: Real>(&mut self, offsets: &[T], nodes: usize) -> Result<()> {
        let (expected, found) = (nodes, offsets.len());
        if found != expected {
            return Err(Error::Dimension { what: "the list of offsets by node", expected, found });
        }
        let by_node: Vec<f64> = offsets.iter().map(|offset| offset.value()).collect();
        if let Some((index, &value)) = by_node.iter().enumerate().find(|(_, offset)| !offset.is_finite()) {
            return Err(Error::NotFinite { what: "the list of offsets (by node)", index, value });
        }
        self.by_node = by_node;
        Ok(())
    }

    pub(crate) fn is_none(&self) -> bool {
        self.by_node.is_empty()
    }

    /// The offsets at t.
    pub(crate) fn at(&self, t: f64) -> Offsets<'_> {
        Offsets { by_node: &self.by_node, factor: self.ramp.at(t) }
    }

    /// Bounds of the sum of the offsets of a node of one body and of one of the other, below and above zero, where
    /// their factor is this.
    pub(crate) fn bounds(&self, bodies: &[Vec<usize>; 2], factor: f64) -> [f64; 2] {
        if self.is_none() {
            return [0.0; 2];
        }
        let of = |body: &Vec<usize>| {
            let sizes = body.iter().map(|&node| factor * self.by_node[node]);
            sizes.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        };
        let [one, other] = bodies.each_ref().map(of);
        [(one[0] + other[0]).min(0.0), (one[1] + other[1]).max(0.0)]
    }

    /// A bound of the size of that sum at the two times between which it lies, and of its change.
    pub(crate) fn sizes(&self, bodies: &[Vec<usize>; 2], times: [f64; 2]) -> [f64; 2] {
        let size = |factor: f64| self.bounds(bodies, factor).into_iter().fold(0.0, |most, x| f64::max(most, x.abs()));
        let [before, after] = times.map(|t| self.ramp.at(t));
        [size(before).max(size(after)), size(after - before)]
    }

    /// How deep one surface lies in the other, at any time, where they just touch.
    pub(crate) fn overlap(&self, bodies: &[Vec<usize>; 2]) -> f64 {
        self.ramp.factors().map(|factor| -self.bounds(bodies, factor)[0]).into_iter().fold(0.0, f64::max)
    }
}

/// How far surfaces lie outside of their facets: by node, times a factor. A list of none is zero.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Offsets<'a> {
    pub(crate) by_node: &'a [f64],
    pub(crate) factor: f64,
}

impl Offsets<'_> {
    pub(crate) fn is_none(&self) -> bool {
        self.by_node.is_empty()
    }

    /// That of a node, without the factor.
    pub(crate) fn of(&self, node: usize) -> f64 {
        self.by_node.get(node).copied().unwrap_or(0.0)
    }

    /// Those at the corners of a facet, without the factor.
    pub(crate) fn at_corners(&self, facet: &Facet) -> [f64; 4] {
        facet.nodes.map(|node| self.of(node))
    }

    /// The sum of that of a node and of that of a facet where the shape functions are these, without the factor.
    pub(crate) fn upon(&self, node: usize, facet: &Facet, weights: &[f64; 4]) -> f64 {
        if self.is_none() {
            return 0.0;
        }
        let corners = self.at_corners(facet);
        self.of(node) + weights.iter().zip(corners).map(|(weight, offset)| weight * offset).sum::<f64>()
    }

    /// A bound of the size of that sum, with the factor.
    pub(crate) fn most(&self, node: usize, facet: &Facet) -> f64 {
        let corners = self.at_corners(facet);
        let [low, high] =
            corners.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(*x), high.max(*x)]);
        let own = self.of(node);
        (self.factor * (own + low)).abs().max((self.factor * (own + high)).abs())
    }
}
