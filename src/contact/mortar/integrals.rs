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
use super::second_order::{Pair, Shares};
use crate::contact::surface::{Base, Facet, Point, RimSample, Sample, Surface, add_scaled, cross, dot, middle, norm};

/// Least share of what a node's shape function would cover for a row: below, one node alone may look at a sliver.
const LEAST: f64 = 1e-6;

/// How far surfaces lie outside of their facets: by node, times a factor. A list of none is zero.
#[derive(Clone, Copy, Debug)]
pub(super) struct Offsets<'a> {
    pub(super) by_node: &'a [f64],
    pub(super) factor: f64,
}

impl Offsets<'_> {
    /// At the corners of a slave facet and of a master facet, without the factor.
    fn between(&self, slave: &Facet, master: &Facet) -> Outside {
        let of = |facet: &Facet| facet.nodes.map(|node| self.by_node.get(node).copied().unwrap_or(0.0));
        Outside([of(slave), of(master)])
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
    fn begin(sums: &mut [Self], slave: &Surface, facet: &Facet, base: &Base) -> [usize; 4] {
        let (places, count) = (facet.nodes.map(|node| slave.place(node)), base.count());
        let whole = dual::area(base) / count as f64;
        places[..count].iter().for_each(|&place| sums[place].whole += whole);
        places
    }

    /// Takes out what the corners of a facet have had, if the facet's own sums are to be told apart.
    fn take(sums: &mut [Self], places: &[usize], multiplier: Multiplier) -> Option<[Self; 4]> {
        (multiplier == Multiplier::Dual).then(|| {
            let mut before = [Self::default(); 4];
            before.iter_mut().zip(places).for_each(|(before, &place)| *before = std::mem::take(&mut sums[place]));
            before
        })
    }

    /// Makes a facet's own sums those of dual functions, and puts back what its corners had before.
    fn put_back(sums: &mut [Self], places: &[usize; 4], base: &Base, before: &[Self; 4]) -> Blend {
        let mut own = [Self::default(); 4];
        own.iter_mut().zip(&places[..base.count()]).for_each(|(own, &place)| *own = sums[place]);
        let blend = Blend::of(base, &mut own);
        for ((&place, own), before) in places[..base.count()].iter().zip(&own).zip(before) {
            sums[place] = *before;
            sums[place].add_scaled(1.0, own);
        }
        blend
    }

    /// Adds all that is summed over what is covered.
    pub(super) fn add_scaled(&mut self, factor: f64, other: &Self) {
        self.area += factor * other.area;
        self.moment += factor * other.moment;
        self.offset += factor * other.offset;
        self.position = add_scaled(self.position, factor, other.position);
        self.normal = add_scaled(self.normal, factor, other.normal);
    }

    /// Adds a point.
    fn add(&mut self, weight: f64, gap: f64, offset: f64) {
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
    merged: Vec<Entry>,
    /// Where the merged entries of each row begin.
    starts: Vec<usize>,
    /// (node, place among the entries) by row, and where each row begins there.
    sorted: Vec<(usize, usize)>,
    begins: Vec<usize>,
}

/// What a facet adds to the rows of a slave facet's corners, by its own corners.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    moments: [[Point; 4]; 4],
    areas: [[Point; 4]; 4],
    shares: [[f64; 4]; 4],
    /// What the derivative of n is multiplied by, in moments and areas.
    turns: [[Point; 2]; 4],
}

impl Block {
    /// Adds that the rim of a master moves over the slave facet, to this one and to the master's.
    fn add_rim(&mut self, sample: &RimSample, offset: f64, count: usize, onto: &mut Self) {
        let RimSample { length, slave, master, gap: distance, outward } = *sample;
        let gap = distance - offset;
        for a in 0..count {
            let weight = length * slave[a];
            for k in 0..4 {
                let (own, other) = (-weight * slave[k], weight * master[k]);
                self.moments[a][k] = add_scaled(self.moments[a][k], own * gap, outward);
                self.areas[a][k] = add_scaled(self.areas[a][k], own, outward);
                onto.moments[a][k] = add_scaled(onto.moments[a][k], other * gap, outward);
                onto.areas[a][k] = add_scaled(onto.areas[a][k], other, outward);
            }
            let [of_moment, of_area] = &mut self.turns[a];
            *of_moment = add_scaled(*of_moment, -weight * gap * distance, outward);
            *of_area = add_scaled(*of_area, -weight * distance, outward);
        }
    }

    /// Adds that the normal of the slave facet turns.
    fn turn(&mut self, base: &Base) {
        let (count, length) = (base.count(), norm(base.product));
        // δn = (I − n nᵀ) δ(t₁ × t₂) / |t₁ × t₂|.
        let across = |x: Point| add_scaled(x, -dot(x, base.normal), base.normal).map(|x| x / length);
        let Self { moments, areas, turns, .. } = self;
        for (turns, rows) in turns.iter().zip(moments.iter_mut().zip(areas)).take(count) {
            let [of_moment, of_area] = turns.map(|turn| base.turned(&middle(count), across(turn)));
            for b in 0..count {
                rows.0[b] = add_scaled(rows.0[b], 1.0, of_moment[b]);
                rows.1[b] = add_scaled(rows.1[b], 1.0, of_area[b]);
            }
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
            let places = Sums::begin(sums, slave, facet, &base);
            if partners(index).is_empty() {
                continue;
            }
            let base = base.see_beside(slave, index, positions);
            let before = Sums::take(sums, &places[..base.count()], multiplier);
            for other in partners(index).iter().map(|&partner| &master.facets()[partner]) {
                let (outside, curved) = (offsets.between(facet, other), Pair::new(facet, other, positions));
                base.each_sample(other, positions, &mut |sample: &Sample| {
                    let offset = outside.at(&sample.slave, &sample.master);
                    let mut gap = sample.gap - offsets.factor * offset;
                    if let Some(pair) = &curved {
                        gap += pair.gap(&base, &sample.slave, &sample.master);
                    }
                    for (&place, share) in places.iter().zip(sample.slave).take(base.count()) {
                        sums[place].add(sample.area * share, gap, offset);
                    }
                });
            }
            if let Some(before) = before {
                Sums::put_back(sums, &places, &base, &before);
            }
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
            let places = Sums::begin(&mut self.sums, slave, facet, &base);
            if partners(index).is_empty() {
                continue;
            }
            let base = base.see_beside(slave, index, positions);
            let before = Sums::take(&mut self.sums, &places[..base.count()], multiplier);
            let (mut block, mut shares) = (Block::default(), Shares::default());
            let (mut touched, first) = (false, self.entries.len());
            for &partner in partners(index) {
                let other = (&master.facets()[partner], master.open_sides(partner));
                let own = (&mut block, &mut shares);
                touched |= self.integrate_pair((&base, facet), other, (positions, offsets), &places, own);
            }
            if touched {
                block.turn(&base);
                self.push_all(&places[..base.count()], facet, &block);
                self.entries.extend(shares.entries(&places[..base.count()], facet, base.normal));
            }
            if let Some(before) = before {
                let blend = Sums::put_back(&mut self.sums, &places, &base, &before);
                blend.weigh(&mut self.entries[first..]);
                self.entries.extend(blend.of_whole(&base, &places, facet));
            }
        }
        self.merge();
    }

    /// Adds what a master facet covers; says whether it covers anything.
    fn integrate_pair(
        &mut self,
        (base, facet): (&Base, &Facet),
        (other, open): (&Facet, [bool; 4]),
        (positions, offsets): (&[Point], Offsets<'_>),
        places: &[usize; 4],
        (block, shares): (&mut Block, &mut Shares),
    ) -> bool {
        let count = base.count();
        let (outside, curved) = (offsets.between(facet, other), Pair::new(facet, other, positions));
        let (mut onto, mut shares_onto) = (Block::default(), Shares::default());
        let mut touched = false;
        base.each_sample(other, positions, &mut |sample: &Sample| {
            touched = true;
            let Sample { area, slave, master, gap: distance, direction: mut normal } = *sample;
            let mut point = base.shape.point(&slave);
            let (mut gap, mut offset) = (distance, 0.0);
            if let Some(pair) = &curved {
                let excess = pair.at(&slave, &master);
                gap += dot(base.normal, excess.apart);
                normal = pair.direction(base, sample);
                point = add_scaled(point, 1.0, excess.off);
                for (a, [of_moment, _]) in block.turns.iter_mut().enumerate().take(count) {
                    let weight = area * slave[a];
                    excess.add(a, weight, [&mut *shares, &mut shares_onto]);
                    *of_moment = add_scaled(*of_moment, weight, excess.apart);
                }
            }
            let mut direction = normal;
            if !offsets.by_node.is_empty() {
                offset = outside.at(&slave, &master);
                gap -= offsets.factor * offset;
                direction = add_scaled(normal, offsets.factor, base.slope(other, positions, &master, &outside.0[1]));
            }
            // (Of a segment the second tangent is the unit vector out of the plane, and this its length times n.)
            let [first, second] = base.shape.tangents_at(&slave);
            let product = cross(first, if count == 2 { [0.0, 0.0, 1.0] } else { second });
            let omega = area / base.stretch(&slave);
            let stretched = base.turned(&slave, base.normal);
            for a in 0..count {
                let weight = area * slave[a];
                let sums = &mut self.sums[places[a]];
                sums.add(weight, gap, offset);
                sums.position = add_scaled(sums.position, weight, point);
                sums.normal = add_scaled(sums.normal, -weight, normal);
                let by_area = omega * slave[a];
                for b in 0..count {
                    let moment = &mut block.moments[a][b];
                    *moment = add_scaled(*moment, -weight * slave[b], direction);
                    *moment = add_scaled(*moment, by_area * gap, stretched[b]);
                    block.areas[a][b] = add_scaled(block.areas[a][b], by_area, stretched[b]);
                    block.shares[a][b] += weight * slave[b];
                }
                let [of_moment, of_area] = &mut block.turns[a];
                *of_moment = add_scaled(*of_moment, -weight * distance, direction);
                *of_moment = add_scaled(*of_moment, by_area * gap, product);
                *of_area = add_scaled(*of_area, by_area, product);
                for (c, &share) in master.iter().enumerate() {
                    onto.moments[a][c] = add_scaled(onto.moments[a][c], weight * share, direction);
                    onto.shares[a][c] -= weight * share;
                }
            }
        });
        if touched {
            base.each_rim_sample(other, open, positions, &mut |sample: &RimSample| {
                let mut offset = offsets.factor * outside.at(&sample.slave, &sample.master);
                if let Some(pair) = &curved {
                    offset -= pair.gap(base, &sample.slave, &sample.master);
                }
                block.add_rim(sample, offset, count, &mut onto);
            });
            self.push_all(&places[..count], other, &onto);
            self.entries.extend(shares_onto.entries(&places[..count], other, base.normal));
        }
        touched
    }

    /// Makes entries of what rows have of the nodes of a facet, all rows of a node after each other.
    fn push_all(&mut self, places: &[usize], facet: &Facet, block: &Block) {
        for (b, &node) in facet.nodes().iter().enumerate() {
            for (a, &row) in places.iter().enumerate() {
                let (moment, area, share) = (block.moments[a][b], block.areas[a][b], block.shares[a][b]);
                self.entries.push(Entry { row, node, moment, area, share });
            }
        }
    }

    /// Sums entries of a row that belong to one node, in the order in which they were found.
    ///
    /// (Rows are told apart by counting: a sort of all entries of a large surface takes as long as finding them.)
    fn merge(&mut self) {
        let Self { sums, entries, merged, starts, sorted, begins } = self;
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
