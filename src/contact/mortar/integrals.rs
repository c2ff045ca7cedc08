//! Weighted gaps over the facets of a surface, and their derivatives with respect to the positions of all nodes.
//!
//! For material points of the slave facet, with the normal n at its middle, area J, and the master facet's normal ν
//! at the intersection with the ray, the gap at a point is g = n·(x_m − x_s), and
//!
//! δg = μ·(δx_m − δx_s − g δn), μ = ν/(ν·n), δ∫N g dA = Σ ω N (J δg + g δJ):
//!
//! The motion of the intersection along the master facet is already contained in μ, to first order. The limits of the
//! common parts move as well. Over sides that facets share this adds nothing, since gaps are continuous there. Where
//! the master ends it adds ∮ N g m·(δx_m − δx_s − g δn) ds, with m outward in the plane. Every term is invariant
//! under translations and rotations, so that forces along the derivative conserve linear and angular momentum to
//! rounding.
//!
//! With offsets o of the surfaces from their facets the gap is n·(x_m − x_s) − o_s − o_m. Then μ + ∇o_m multiplies
//! δx_m − δx_s − (n·(x_m − x_s)) δn, with the gradient ∇o_m of o_m by the motion of the intersection.

use super::dual::{Blend, Multiplier};
use super::pairs::Pairs;
use super::parts::Parts;
use super::points::{self, Addends, Column, NORMAL, OTHERS, OWN, Points, column};
use super::second_order::{Pair, Shares};
use super::sums::Sums;
use crate::contact::surface::{Base, Facet, Offsets, Point, RimSample, Sample, Surface, add_scaled, dot};

impl Offsets<'_> {
    /// The offsets at the corners of a slave facet and of a master facet, without the factor.
    fn between(&self, slave: &Facet, master: &Facet) -> Outside {
        Outside([slave, master].map(|facet| self.at_corners(facet)))
    }
}

/// Offsets at the corners of two facets.
struct Outside([[f64; 4]; 2]);

impl Outside {
    /// Their sum at the points with these shape functions.
    fn at(&self, slave: &[f64; 4], master: &[f64; 4]) -> f64 {
        let Self([own, others]) = self;
        (0..4).map(|k| slave[k] * own[k] + master[k] * others[k]).sum()
    }
}

/// The entry of a row for a node, before it is divided by the covered area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) node: usize,
    /// The derivatives of ∫N g dA and of ∫N dA with respect to the position of the node.
    pub(super) moment: Point,
    pub(super) area: Point,
    /// ∫N_row N_node dA: positive for slave nodes, negative for master nodes.
    pub(super) share: f64,
}

impl Entry {
    pub(super) fn weight(&self, sums: &Sums) -> Point {
        add_scaled(self.moment, -sums.gap(), self.area).map(|x| x / sums.area)
    }
}

/// Sums by place of the slave node, and the contributions to rows.
#[derive(Debug, Default)]
pub(super) struct Integrals {
    pub(super) sums: Vec<Sums>,
    parts: Parts,
    /// Nodes of master facets over one slave facet, and their contributions to the rows of its corners.
    others: Vec<(usize, [Column; 4])>,
    points: Points,
    /// The row requested last, and work space.
    row: Vec<Entry>,
    heads: Vec<[usize; 3]>,
}

/// Sums over one slave facet.
#[derive(Default)]
struct Own {
    sums: [Sums; 4],
    addends: [Addends; 4],
    shares: Shares,
    is_touched: bool,
}

/// Adds the contribution of a node to the rows of a slave facet's corners.
fn add_to(others: &mut Vec<(usize, [Column; 4])>, node: usize, columns: &[Column; 4]) {
    match others.iter_mut().find(|(other, _)| *other == node) {
        Some((_, sums)) => sums.iter_mut().zip(columns).for_each(|(sum, column)| points::add(sum, column)),
        None => others.push((node, *columns)),
    }
}

impl Integrals {
    /// The entries of the row of a slave node, ascending by node. `around` are the facets around the slave node, with
    /// their corners at this node.
    pub(super) fn row(&mut self, around: &[(usize, usize)]) -> &[Entry] {
        let Self { parts, row, heads, .. } = self;
        row.clear();
        parts.each_of_row(around, heads, |node, &[x, y, z, p, q, r, share, _]| {
            row.push(Entry { node, moment: [x, y, z], area: [p, q, r], share });
        });
        row
    }

    /// As [`integrate`](Self::integrate), without the data for derivatives: areas and gaps.
    pub(super) fn sum(
        &mut self,
        [slave, master]: [&Surface; 2],
        positions: &[Point],
        offsets: Offsets<'_>,
        multiplier: Multiplier,
        pairs: &Pairs,
    ) {
        let sums = &mut self.sums;
        sums.clear();
        sums.resize(slave.nodes().len(), Sums::default());
        for (index, facet) in slave.facets().iter().enumerate() {
            let Some(base) = Base::new(facet, positions) else { continue };
            let places = Sums::begin(sums, slave, index, &base);
            if pairs.of(index).is_empty() {
                continue;
            }
            let mut own = [Sums::default(); 4];
            for other in pairs.of(index).iter().map(|&partner| &master.facets()[partner]) {
                let (outside, curved) = (offsets.between(facet, other), Pair::new(facet, other, positions));
                base.each_sample(other, positions, &mut |sample: &Sample| {
                    let offset = outside.at(&sample.slave, &sample.master);
                    let mut gap = sample.gap - offsets.factor * offset;
                    if let Some(pair) = &curved {
                        gap += pair.gap(&base, &sample.slave, &sample.master);
                    }
                    for (own, share) in own.iter_mut().zip(sample.slave) {
                        own.add(share, sample.area, gap, offset);
                    }
                });
            }
            if multiplier == Multiplier::Dual {
                Blend::of(&base, &mut own);
            }
            Sums::end(sums, &places[..base.count()], &own);
        }
    }

    /// Integrates, over all facets of the slave surface, the parts covered by the master facets listed for each.
    pub(super) fn integrate(
        &mut self,
        [slave, master]: [&Surface; 2],
        positions: &[Point],
        offsets: Offsets<'_>,
        multiplier: Multiplier,
        pairs: &Pairs,
    ) {
        self.sums.clear();
        self.sums.resize(slave.nodes().len(), Sums::default());
        self.parts.clear();
        for (index, facet) in slave.facets().iter().enumerate() {
            if let Some(base) = Base::new(facet, positions) {
                let places = *Sums::begin(&mut self.sums, slave, index, &base);
                if !pairs.of(index).is_empty() {
                    let own =
                        self.integrate_facet((&base, facet), master, (positions, offsets), pairs.of(index), multiplier);
                    Sums::end(&mut self.sums, &places[..base.count()], &own);
                }
            }
            self.parts.end_facet(facet.nodes().len());
        }
    }

    /// Adds the part of a slave facet covered by master facets to its parts; returns its sums.
    fn integrate_facet(
        &mut self,
        (base, facet): (&Base, &Facet),
        master: &Surface,
        (positions, offsets): (&[Point], Offsets<'_>),
        partners: &[usize],
        multiplier: Multiplier,
    ) -> [Sums; 4] {
        let mut own = Own::default();
        self.others.clear();
        for &partner in partners {
            let other = (&master.facets()[partner], master.open_sides(partner));
            self.integrate_pair((base, facet), other, (positions, offsets), &mut own);
        }
        if own.is_touched {
            let columns = points::own(&mut own.addends, base);
            facet.nodes().iter().zip(columns).for_each(|(&node, columns)| self.parts.push(node, columns));
            self.others.drain(..).for_each(|(node, columns)| self.parts.push(node, columns));
            own.shares.each_column(facet, base.normal, |node, columns| self.parts.push(node, columns));
        }
        if multiplier == Multiplier::Dual {
            let blend = Blend::of(base, &mut own.sums);
            blend.weigh(self.parts.of_facet_mut());
            blend.each_of_whole(base, facet, |node, columns| self.parts.push(node, columns));
        }
        own.sums
    }

    /// Adds the part covered by one master facet.
    fn integrate_pair(
        &mut self,
        (base, facet): (&Base, &Facet),
        (other, open): (&Facet, [bool; 4]),
        (positions, offsets): (&[Point], Offsets<'_>),
        own: &mut Own,
    ) {
        let Own { sums, addends, shares, is_touched } = own;
        let (outside, curved) = (offsets.between(facet, other), Pair::new(facet, other, positions));
        let points = &mut self.points;
        let mut shares_onto = curved.is_some().then(Shares::default);
        base.each_sample(other, positions, &mut |sample: &Sample| {
            let Sample { area, slave, master, gap: distance, direction: mut normal } = *sample;
            let mut point = base.shape.point(&slave);
            let (mut gap, mut offset, mut apart) = (distance, 0.0, [0.0; 3]);
            if let Some(pair) = &curved {
                let excess = pair.at(&slave, &master);
                gap += dot(base.normal, excess.apart);
                normal = pair.direction(base, sample);
                point = add_scaled(point, 1.0, excess.off);
                apart = excess.apart;
                for (a, share) in slave.iter().enumerate().take(base.count()) {
                    excess.add(a, area * share, [Some(&mut *shares), shares_onto.as_mut()]);
                }
            }
            let mut direction = normal;
            if !offsets.by_node.is_empty() {
                offset = outside.at(&slave, &master);
                gap -= offsets.factor * offset;
                direction = add_scaled(normal, offsets.factor, base.slope(other, positions, &master, &outside.0[1]));
            }
            for (sums, share) in sums.iter_mut().zip(slave) {
                sums.add(share, area, gap, offset);
                sums.position = add_scaled(sums.position, share * area, point);
                sums.normal = add_scaled(sums.normal, -share * area, normal);
            }
            let (product, stretched) = base.stretch(&slave);
            let omega = area / dot(base.normal, product);
            let addends = points.push(slave);
            for k in 0..4 {
                let (grown, share) = (stretched[k].map(|x| omega * x), area * slave[k]);
                addends[OWN + k] = column(add_scaled(direction.map(|x| -share * x), gap, grown), grown, share);
                let share = area * master[k];
                addends[OTHERS + k] = column(direction.map(|x| share * x), [0.0; 3], -share);
            }
            let grown = product.map(|x| omega * x);
            let turned = add_scaled(grown.map(|x| gap * x), -area * distance, direction);
            addends[NORMAL] = column(add_scaled(turned, area, apart), grown, 0.0);
        });
        if points.is_empty() {
            return;
        }
        *is_touched = true;
        base.each_rim_sample(other, open, positions, &mut |sample: &RimSample| {
            let mut offset = offsets.factor * outside.at(&sample.slave, &sample.master);
            if let Some(pair) = &curved {
                offset -= pair.gap(base, &sample.slave, &sample.master);
            }
            points.push_rim(sample, offset);
        });
        points.add_to(addends);
        for (corner, &node) in other.nodes().iter().enumerate() {
            add_to(&mut self.others, node, &points::take_other(addends, corner));
        }
        if let Some(shares_onto) = shares_onto {
            shares_onto.each_column(other, base.normal, |node, columns| self.parts.push(node, columns));
        }
    }
}
