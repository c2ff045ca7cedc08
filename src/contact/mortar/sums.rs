//! Integrals of gaps and areas with the weights of a slave node.

use crate::contact::surface::{Base, Point, Surface, add_scaled, norm, unit};
use crate::rounding::LEAST_COVER;

/// Integrals for a slave node; N are its weights, standard or dual.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// ∫N dA over the covered part, and over all facets of the node.
    pub(super) area: f64,
    whole: f64,
    /// ∫N g dA.
    pub(super) moment: f64,
    /// ∫N o dA with the offsets of both surfaces.
    offset: f64,
    /// ∫N x dA, and −∫N μ dA.
    pub(super) position: Point,
    pub(super) normal: Point,
}

impl Sums {
    /// Adds the area of a slave facet to the sums of its nodes; returns their places.
    pub(super) fn begin<'s>(sums: &mut [Self], slave: &'s Surface, facet: usize, base: &Base) -> &'s [usize; 4] {
        let (places, count) = (slave.places(facet), base.count());
        let whole = area(base) / count as f64;
        places[..count].iter().for_each(|&place| sums[place].whole += whole);
        places
    }

    /// Adds the covered part of a slave facet to the sums of its nodes.
    pub(super) fn end(sums: &mut [Self], places: &[usize], own: &[Self; 4]) {
        places.iter().zip(own).for_each(|(&place, own)| sums[place].add_scaled(1.0, own));
    }

    /// Adds all integrals over the covered part.
    pub(super) fn add_scaled(&mut self, factor: f64, other: &Self) {
        self.area += factor * other.area;
        self.moment += factor * other.moment;
        self.offset += factor * other.offset;
        self.position = add_scaled(self.position, factor, other.position);
        self.normal = add_scaled(self.normal, factor, other.normal);
    }

    /// Adds a quadrature point, for a node with the shape function `share` there.
    pub(super) fn add(&mut self, share: f64, area: f64, gap: f64, offset: f64) {
        let weight = share * area;
        self.area += weight;
        self.moment += weight * gap;
        self.offset += weight * offset;
    }

    /// Whether the covered part is large enough for a row.
    pub(super) fn is_covered(&self) -> bool {
        self.area > LEAST_COVER * self.whole
    }

    /// The mean of the gap with the weights of the node.
    pub(super) fn gap(&self) -> f64 {
        self.moment / self.area
    }

    /// As [`gap`](Self::gap); NaN unless the covered part is large enough.
    pub(super) fn gap_if_covered(&self) -> f64 {
        if self.is_covered() { self.gap() } else { f64::NAN }
    }

    /// The mean of the offsets of both surfaces, at full size.
    pub(super) fn offset(&self) -> f64 {
        self.offset / self.area
    }

    pub(super) fn position(&self) -> Point {
        self.position.map(|x| x / self.area)
    }

    /// The mean direction in which the gap opens.
    pub(super) fn normal(&self) -> Option<Point> {
        unit(self.normal)
    }
}

/// A facet's area divided by the length of the product of its tangents at the middle.
pub(super) fn factor(count: usize) -> f64 {
    [1.0, 0.5, 4.0][count - 2]
}

/// The area of a facet in its plane.
pub(super) fn area(base: &Base) -> f64 {
    norm(base.product) * factor(base.count())
}
