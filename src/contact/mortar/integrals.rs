//! Weighted gaps over the facets of a surface, and their derivatives by the positions of all nodes.
//!
//! With points of the slave facet that stay on its material, the normal n of its middle, area J and the master facet's
//! normal ν where the ray meets it, the gap at a point is g = n·(x_m − x_s), and
//!
//! δg = μ·(δx_m − δx_s − g δn), μ = ν/(ν·n), δ∫N g dA = Σ ω N (J δg + g δJ):
//!
//! where the ray moves on along the master facet nothing changes to first order but what μ holds. The limits of the
//! common parts move as well: over the sides that facets share this adds nothing, since gaps are continuous there;
//! where the master ends it adds ∮ N g m·(δx_m − δx_s − g δn) ds, m outward in the plane. Sums are invariant under
//! translations and rotations, term by term: so forces along the derivative conserve linear and angular momentum to
//! rounding.
//!
//! Where surfaces lie outside of their facets by offsets o the gap is n·(x_m − x_s) − o_s − o_m. What is multiplied by
//! δx_m − δx_s − (n·(x_m − x_s)) δn is then μ + ∇o_m, ∇o_m the slope of o_m where the foot of the ray moves on.

use super::dual::{self, Blend, Multiplier};
use super::points::{self, Addends, Column, Points, column};
use super::second_order::{Pair, Shares};
use crate::contact::surface::{Base, Facet, Offsets, Point, RimSample, Sample, Surface, add_scaled, dot};

/// Least share of what a node's shape function would cover for a row: below, one node alone may look at a sliver.
const LEAST: f64 = 1e-6;

impl Offsets<'_> {
    /// At the corners of a slave facet and of a master facet, without the factor.
    fn between(&self, slave: &Facet, master: &Facet) -> Outside {
        Outside([slave, master].map(|facet| self.at_corners(facet)))
    }
}

/// Offsets at the corners of two facets.
struct Outside([[f64; 4]; 2]);

impl Outside {
    /// Their sum where the shape functions are these.
    fn at(&self, slave: &[f64; 4], master: &[f64; 4]) -> f64 {
        let Self([own, others]) = self;
        (0..4).map(|k| slave[k] * own[k] + master[k] * others[k]).sum()
    }
}

/// What is integrated for a slave node; N are the weights, be they shape functions or others.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// ∫N dA over what is covered, and over all facets of the node.
    pub(super) area: f64,
    whole: f64,
    /// ∫N g dA.
    pub(super) moment: f64,
    /// ∫N o dA with the offsets of both surfaces.
    offset: f64,
    /// ∫N x dA, and −∫N μ dA.
    position: Point,
    normal: Point,
}

impl Sums {
    /// Adds the whole of a slave facet to the sums of its nodes; returns their places.
    fn begin<'s>(sums: &mut [Self], slave: &'s Surface, facet: usize, base: &Base) -> &'s [usize; 4] {
        let (places, count) = (slave.places(facet), base.count());
        let whole = dual::area(base) / count as f64;
        places[..count].iter().for_each(|&place| sums[place].whole += whole);
        places
    }

    /// Adds what is covered of a slave facet to the sums of its nodes.
    fn end(sums: &mut [Self], places: &[usize], own: &[Self; 4]) {
        places.iter().zip(own).for_each(|(&place, own)| sums[place].add_scaled(1.0, own));
    }

    /// Adds all that is summed over what is covered.
    pub(super) fn add_scaled(&mut self, factor: f64, other: &Self) {
        self.area += factor * other.area;
        self.moment += factor * other.moment;
        self.offset += factor * other.offset;
        self.position = add_scaled(self.position, factor, other.position);
        self.normal = add_scaled(self.normal, factor, other.normal);
    }

    /// Adds a point, for a node whose shape function is `share` there.
    fn add(&mut self, share: f64, area: f64, gap: f64, offset: f64) {
        let weight = share * area;
        self.area += weight;
        self.moment += weight * gap;
        self.offset += weight * offset;
    }

    /// Whether enough is covered for a row.
    pub(super) fn is_covered(&self) -> bool {
        self.area > LEAST * self.whole
    }

    /// The mean of the gap with the weights of the node.
    pub(super) fn gap(&self) -> f64 {
        self.moment / self.area
    }

    /// The same; NaN unless enough is covered.
    pub(super) fn gap_if_covered(&self) -> f64 {
        if self.is_covered() { self.gap() } else { f64::NAN }
    }

    /// The mean of the offsets of both surfaces, where they have their full size.
    pub(super) fn offset(&self) -> f64 {
        self.offset / self.area
    }

    /// The mean of the covered points.
    pub(super) fn position(&self) -> Point {
        self.position.map(|x| x / self.area)
    }

    /// The mean direction in which the gap opens.
    pub(super) fn normal(&self) -> Option<Point> {
        crate::contact::surface::unit(self.normal)
    }
}

/// What a row has of a node, before it is divided by the covered area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// Place of the slave node whose row it is, and the node.
    pub(super) row: usize,
    pub(super) node: usize,
    /// The derivatives of ∫N g dA and of ∫N dA by the position of the node.
    pub(super) moment: Point,
    pub(super) area: Point,
    /// ∫N_row N_node dA: positive for slave nodes, negative for master nodes.
    pub(super) share: f64,
}

impl Entry {
    /// One that does not change the area.
    pub(super) fn new(row: usize, node: usize, moment: Point, share: f64) -> Self {
        Self { row, node, moment, area: [0.0; 3], share }
    }

    /// The derivative of the mean gap.
    pub(super) fn weight(&self, sums: &Sums) -> Point {
        add_scaled(self.moment, -sums.gap(), self.area).map(|x| x / sums.area)
    }

    pub(super) fn add_scaled(&mut self, factor: f64, other: &Self) {
        self.moment = add_scaled(self.moment, factor, other.moment);
        self.area = add_scaled(self.area, factor, other.area);
        self.share += factor * other.share;
    }
}

/// Sums by place of the slave node, and the entries of their rows, ascending by row and node.
#[derive(Debug, Default)]
pub(super) struct Integrals {
    pub(super) sums: Vec<Sums>,
    entries: Vec<Entry>,
    /// Nodes of master facets over one slave facet, and what they add to the rows of its corners.
    others: Vec<(usize, [Column; 4])>,
    points: Points,
    merged: Vec<Entry>,
    /// Where the merged entries of each row begin.
    starts: Vec<usize>,
    /// (node, place among the entries) by row, and where each row begins there.
    sorted: Vec<(usize, usize)>,
    begins: Vec<usize>,
}

/// What is summed over one slave facet.
#[derive(Default)]
struct Own {
    sums: [Sums; 4],
    addends: [Addends; 4],
    shares: Shares,
    is_touched: bool,
}

/// Adds what a node adds to the rows of a slave facet's corners to what it has added before.
fn add_to(others: &mut Vec<(usize, [Column; 4])>, node: usize, columns: &[Column; 4]) {
    match others.iter_mut().find(|(other, _)| *other == node) {
        Some((_, sums)) => sums.iter_mut().zip(columns).for_each(|(sum, column)| points::add(sum, column)),
        None => others.push((node, *columns)),
    }
}

/// Makes entries of what rows have of nodes, all rows of a node after each other.
fn push_all(entries: &mut Vec<Entry>, rows: &[usize], columns: impl Iterator<Item = (usize, [Column; 4])>) {
    for (node, columns) in columns {
        for (&row, &[x, y, z, p, q, r, share, _]) in rows.iter().zip(&columns) {
            entries.push(Entry { row, node, moment: [x, y, z], area: [p, q, r], share });
        }
    }
}

impl Integrals {
    /// The entries of a row.
    pub(super) fn row(&self, place: usize) -> &[Entry] {
        &self.merged[self.starts[place]..self.starts[place + 1]]
    }

    /// Integrates as [`integrate`](Self::integrate) does, without what derivatives need: areas and gaps.
    pub(super) fn sum<'p>(
        &mut self,
        [slave, master]: [&Surface; 2],
        positions: &[Point],
        offsets: Offsets<'_>,
        multiplier: Multiplier,
        partners: impl Fn(usize) -> &'p [usize],
    ) {
        let sums = &mut self.sums;
        sums.clear();
        sums.resize(slave.nodes().len(), Sums::default());
        for (index, facet) in slave.facets().iter().enumerate() {
            let Some(base) = Base::new(facet, positions) else { continue };
            let places = Sums::begin(sums, slave, index, &base);
            if partners(index).is_empty() {
                continue;
            }
            let mut own = [Sums::default(); 4];
            for other in partners(index).iter().map(|&partner| &master.facets()[partner]) {
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

    /// Integrates over all facets of the slave surface what the master facets listed for each cover.
    pub(super) fn integrate<'p>(
        &mut self,
        [slave, master]: [&Surface; 2],
        positions: &[Point],
        offsets: Offsets<'_>,
        multiplier: Multiplier,
        partners: impl Fn(usize) -> &'p [usize],
    ) {
        self.sums.clear();
        self.sums.resize(slave.nodes().len(), Sums::default());
        self.entries.clear();
        for (index, facet) in slave.facets().iter().enumerate() {
            let Some(base) = Base::new(facet, positions) else { continue };
            let places = *Sums::begin(&mut self.sums, slave, index, &base);
            if partners(index).is_empty() {
                continue;
            }
            let (places, first) = (&places[..base.count()], self.entries.len());
            let mut own = Own::default();
            self.others.clear();
            for &partner in partners(index) {
                let other = (&master.facets()[partner], master.open_sides(partner));
                self.integrate_pair((&base, facet), other, (positions, offsets), places, &mut own);
            }
            if own.is_touched {
                let columns = facet.nodes().iter().copied().zip(points::own(own.addends, &base));
                push_all(&mut self.entries, places, columns.chain(self.others.drain(..)));
                self.entries.extend(own.shares.entries(places, facet, base.normal));
            }
            if multiplier == Multiplier::Dual {
                let blend = Blend::of(&base, &mut own.sums);
                blend.weigh(&mut self.entries[first..]);
                self.entries.extend(blend.of_whole(&base, places, facet));
            }
            Sums::end(&mut self.sums, places, &own.sums);
        }
        self.merge();
    }

    /// Adds what a master facet covers.
    fn integrate_pair(
        &mut self,
        (base, facet): (&Base, &Facet),
        (other, open): (&Facet, [bool; 4]),
        (positions, offsets): (&[Point], Offsets<'_>),
        places: &[usize],
        own: &mut Own,
    ) {
        let Own { sums, addends, shares, is_touched } = own;
        let (outside, curved) = (offsets.between(facet, other), Pair::new(facet, other, positions));
        let (points, mut shares_onto) = (&mut self.points, Shares::default());
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
                    excess.add(a, area * share, [&mut *shares, &mut shares_onto]);
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
            let own = std::array::from_fn(|k| {
                let (grown, share) = (stretched[k].map(|x| omega * x), area * slave[k]);
                column(add_scaled(direction.map(|x| -share * x), gap, grown), grown, share)
            });
            let others = master.map(|share| column(direction.map(|x| area * share * x), [0.0; 3], -area * share));
            let grown = product.map(|x| omega * x);
            let turned = add_scaled(grown.map(|x| gap * x), -area * distance, direction);
            points.push(slave, &points::addends(own, others, column(add_scaled(turned, area, apart), grown, 0.0)));
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
        self.entries.extend(shares_onto.entries(places, other, base.normal));
    }

    /// Sums entries of a row that belong to one node, in the order in which they were found.
    ///
    /// (Rows are told apart by counting: a sort of all entries of a large surface takes as long as finding them.)
    fn merge(&mut self) {
        let Self { sums, entries, merged, starts, sorted, begins, .. } = self;
        begins.clear();
        begins.resize(sums.len() + 2, 0);
        // Counted two places on, so that after the sums each row's place is where its next entry goes.
        for entry in &*entries {
            begins[entry.row + 2] += 1;
        }
        for row in 2..begins.len() {
            begins[row] += begins[row - 1];
        }
        sorted.clear();
        sorted.resize(entries.len(), (0, 0));
        for (number, entry) in entries.iter().enumerate() {
            let place = &mut begins[entry.row + 1];
            sorted[*place] = (entry.node, number);
            *place += 1;
        }
        merged.clear();
        starts.clear();
        for row in 0..sums.len() {
            let first = merged.len();
            starts.push(first);
            let of_row = &mut sorted[begins[row]..begins[row + 1]];
            of_row.sort_unstable();
            for &(node, number) in &*of_row {
                match merged[first..].last_mut() {
                    Some(last) if last.node == node => last.add_scaled(1.0, &entries[number]),
                    _ => merged.push(entries[number]),
                }
            }
        }
        starts.push(merged.len());
    }
}
