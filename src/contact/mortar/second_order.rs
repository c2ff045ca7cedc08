//! Contributions of facets of second order to weighted gaps: their points lie off the linear parts that are
//! intersected.
//!
//! With x = x_lin + c, c = Σ (N_b − w_b) x_b, the shape functions N of second order and w of the linear part, the gap
//! is the gap of the parts plus n·(c_m − c_s). Its derivative is n·(δc_m − δc_s) + δn·(c_m − c_s). Also, n·c_m
//! changes as the intersection moves along the part: its gradient s replaces μ by μ − s, as with the offsets in
//! `integrals.rs`.

use super::points::{Column, column};
use crate::contact::surface::{Base, ByNode, Facet, Point, Sample, add_scaled, dot, sub};

/// A pair of facets of which at least one is a part of a facet of second order.
pub(super) struct Pair<'a> {
    slave: &'a Facet,
    master: &'a Facet,
    positions: &'a [Point],
}

/// The deviation from the linear parts at a point.
pub(super) struct Excess {
    slave: ByNode,
    master: ByNode,
    /// c_s, and c_m − c_s.
    pub(super) off: Point,
    pub(super) apart: Point,
}

/// Integrals of the shape functions less the linear ones, by corner of the slave facet and node of a facet.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shares([ByNode; 4]);

impl<'a> Pair<'a> {
    /// None for two linear facets.
    pub(super) fn new(slave: &'a Facet, master: &'a Facet, positions: &'a [Point]) -> Option<Self> {
        (slave.whole.is_some() || master.whole.is_some()).then_some(Self { slave, master, positions })
    }

    /// The deviation at the points with these shape functions of the parts.
    pub(super) fn at(&self, slave: &[f64; 4], master: &[f64; 4]) -> Excess {
        let excess = |facet: &Facet, weights| facet.whole.map_or([0.0; 9], |whole| whole.excess(weights));
        let (slave, master) = (excess(self.slave, slave), excess(self.master, master));
        let off = self.slave.combine(&slave, self.positions);
        let apart = sub(self.master.combine(&master, self.positions), off);
        Excess { slave, master, off, apart }
    }

    /// The gap along n less the gap of the linear parts.
    pub(super) fn gap(&self, base: &Base, slave: &[f64; 4], master: &[f64; 4]) -> f64 {
        dot(base.normal, self.at(slave, master).apart)
    }

    /// μ − s.
    pub(super) fn direction(&self, base: &Base, sample: &Sample) -> Point {
        sub(sample.direction, base.slope_of_second_order(self.master, self.positions, &sample.master))
    }
}

impl Excess {
    /// Adds a point of this weight to the shares of both facets for a corner of the slave facet.
    pub(super) fn add(&self, corner: usize, weight: f64, [own, onto]: [Option<&mut Shares>; 2]) {
        let add = |shares: Option<&mut Shares>, weight: f64, excess: &ByNode| {
            let shares = shares.into_iter().flat_map(|shares| &mut shares.0[corner]);
            shares.zip(excess).for_each(|(share, excess)| *share += weight * excess);
        };
        add(own, -weight, &self.slave);
        add(onto, weight, &self.master);
    }
}

impl Shares {
    /// Calls `act` with the nodes of a facet of second order and their contributions to the rows of a slave facet's
    /// corners.
    pub(super) fn each_column(&self, facet: &Facet, normal: Point, mut act: impl FnMut(usize, [Column; 4])) {
        if facet.whole.is_none() {
            return;
        }
        for (k, node) in facet.all_nodes().enumerate() {
            act(node, self.0.map(|shares| column(add_scaled([0.0; 3], shares[k], normal), [0.0; 3], shares[k])));
        }
    }
}
