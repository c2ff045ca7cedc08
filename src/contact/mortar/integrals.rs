//! Weighted gaps over the facets of a surface, and their derivatives by the positions of all nodes.
//!
//! With points of the slave facet that stay on its material, the normal n of its middle, area J and the master facet's
//! normal ν where the ray meets it, the gap at a point is g = n·(x_m − x_s), and
//!
//! δg = μ·(δx_m − δx_s − g δn), μ = ν/(ν·n), δ∫N g dA = Σ ω N (J δg + g δJ):
//!
//! where the ray moves on along the master facet nothing changes to first order but what μ holds. The limits of the
//! common parts move as well; over the sides that facets share this adds nothing, since gaps are continuous there, at a
//! rim it adds (g − its mean), which is left out. Sums are invariant under translations and rotations, term by term: so
//! forces along the derivative conserve linear and angular momentum to rounding.

use super::overlap::{Base, Sample, middle};
use crate::contact::surface::{Facet, Point, Surface, add_scaled, cross, dot, norm};

/// Least share of what a node's shape function would cover for a row: below, one node alone may look at a sliver.
const LEAST: f64 = 1e-6;

/// What is integrated for a slave node.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// ∫N dA over what is covered, and over all facets of the node.
    pub(super) area: f64,
    whole: f64,
    /// ∫N g dA.
    moment: f64,
    /// ∫N x dA, and −∫N μ dA.
    position: Point,
    normal: Point,
}

impl Sums {
    /// Whether enough is covered for a row.
    pub(super) fn is_covered(&self) -> bool {
        self.area > LEAST * self.whole
    }

    /// The mean of the gap with the weights of the node.
    pub(super) fn gap(&self) -> f64 {
        self.moment / self.area
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
    moment: Point,
    area: Point,
    /// ∫N_row N_node dA: positive for slave nodes, negative for master nodes.
    pub(super) share: f64,
}

impl Entry {
    /// The derivative of the mean gap.
    pub(super) fn weight(&self, sums: &Sums) -> Point {
        add_scaled(self.moment, -sums.gap(), self.area).map(|x| x / sums.area)
    }

    fn add(&mut self, other: &Self) {
        self.moment = add_scaled(self.moment, 1.0, other.moment);
        self.area = add_scaled(self.area, 1.0, other.area);
        self.share += other.share;
    }
}

/// Sums by place of the slave node, and the entries of their rows, ascending by row and node.
#[derive(Debug, Default)]
pub(super) struct Integrals {
    pub(super) sums: Vec<Sums>,
    entries: Vec<(usize, Entry)>,
    merged: Vec<Entry>,
    /// Where the entries of each row begin.
    starts: Vec<usize>,
}

/// What one slave facet adds, by its corners.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    moments: [[Point; 4]; 4],
    areas: [[Point; 4]; 4],
    shares: [[f64; 4]; 4],
    /// What the derivative of n is multiplied by.
    turns: [[Point; 2]; 4],
}

impl Integrals {
    /// The entries of a row.
    pub(super) fn row(&self, place: usize) -> &[Entry] {
        &self.merged[self.starts[place]..self.starts[place + 1]]
    }

    /// Integrates over all facets of the slave surface what the master facets listed for each cover.
    pub(super) fn integrate<'p>(
        &mut self,
        slave: &Surface,
        master: &Surface,
        positions: &[Point],
        partners: impl Fn(usize) -> &'p [usize],
    ) {
        self.sums.clear();
        self.sums.resize(slave.nodes().len(), Sums::default());
        self.entries.clear();
        for (index, facet) in slave.facets().iter().enumerate() {
            let Some(base) = Base::new(facet, positions) else { continue };
            let nodes = facet.nodes();
            let places: [usize; 4] = facet.nodes.map(|node| slave.place(node));
            let whole = norm(base.middle) * [1.0, 0.5, 4.0][nodes.len() - 2] / nodes.len() as f64;
            places[..nodes.len()].iter().for_each(|&place| self.sums[place].whole += whole);
            let mut block = Block::default();
            let mut touched = false;
            for &partner in partners(index) {
                let other = &master.facets()[partner];
                touched |= self.integrate_pair(&base, other, positions, &places, &mut block);
            }
            if touched {
                self.close_block(&base, nodes, &places, &mut block);
            }
        }
        self.merge();
    }

    /// Adds what a master facet covers; says whether it covers anything.
    fn integrate_pair(
        &mut self,
        base: &Base,
        other: &Facet,
        positions: &[Point],
        places: &[usize; 4],
        block: &mut Block,
    ) -> bool {
        let count = base.count();
        let mut moments = [[[0.0; 3]; 4]; 4];
        let mut shares = [[0.0; 4]; 4];
        let mut touched = false;
        base.each_sample(other, positions, &mut |sample: &Sample| {
            touched = true;
            let Sample { area, slave, master, gap, direction } = *sample;
            let point = base.shape.point(&slave);
            // (Of a segment the second tangent is the unit vector out of the plane, and this its length times n.)
            let [first, second] = base.shape.tangents_at(&slave);
            let product = cross(first, if count == 2 { [0.0, 0.0, 1.0] } else { second });
            let omega = area / base.stretch(&slave);
            let stretched = base.turned(&slave, base.normal);
            for a in 0..count {
                let weight = area * slave[a];
                let sums = &mut self.sums[places[a]];
                sums.area += weight;
                sums.moment += weight * gap;
                sums.position = add_scaled(sums.position, weight, point);
                sums.normal = add_scaled(sums.normal, -weight, direction);
                let by_area = omega * slave[a];
                for b in 0..count {
                    let moment = &mut block.moments[a][b];
                    *moment = add_scaled(*moment, -weight * slave[b], direction);
                    *moment = add_scaled(*moment, by_area * gap, stretched[b]);
                    block.areas[a][b] = add_scaled(block.areas[a][b], by_area, stretched[b]);
                    block.shares[a][b] += weight * slave[b];
                }
                let [of_moment, of_area] = &mut block.turns[a];
                *of_moment = add_scaled(*of_moment, -weight * gap, direction);
                *of_moment = add_scaled(*of_moment, by_area * gap, product);
                *of_area = add_scaled(*of_area, by_area, product);
                for (c, &share) in master.iter().enumerate() {
                    moments[a][c] = add_scaled(moments[a][c], weight * share, direction);
                    shares[a][c] -= weight * share;
                }
            }
        });
        if touched {
            for a in 0..count {
                for (c, &node) in other.nodes().iter().enumerate() {
                    self.push(Entry {
                        row: places[a],
                        node,
                        moment: moments[a][c],
                        area: [0.0; 3],
                        share: shares[a][c],
                    });
                }
            }
        }
        touched
    }

    /// Adds that the normal of the slave facet turns, and makes entries of all.
    fn close_block(&mut self, base: &Base, nodes: &[usize], places: &[usize; 4], block: &mut Block) {
        let count = nodes.len();
        // δn = (I − n nᵀ) δ(t₁ × t₂) / |t₁ × t₂|.
        let across = |x: Point| add_scaled(x, -dot(x, base.normal), base.normal).map(|x| x / norm(base.middle));
        for (a, &row) in places.iter().enumerate().take(count) {
            let [of_moment, of_area] = block.turns[a].map(|turn| base.turned(&middle(count), across(turn)));
            for b in 0..count {
                self.push(Entry {
                    row,
                    node: nodes[b],
                    moment: add_scaled(block.moments[a][b], 1.0, of_moment[b]),
                    area: add_scaled(block.areas[a][b], 1.0, of_area[b]),
                    share: block.shares[a][b],
                });
            }
        }
    }

    fn push(&mut self, entry: Entry) {
        self.entries.push((self.entries.len(), entry));
    }

    /// Sums entries of a row that belong to one node, in the order in which they were found.
    fn merge(&mut self) {
        self.entries.sort_unstable_by_key(|(number, entry)| (entry.row, entry.node, *number));
        self.merged.clear();
        self.starts.clear();
        for (_, entry) in &self.entries {
            match self.merged.last_mut() {
                Some(last) if (last.row, last.node) == (entry.row, entry.node) => last.add(entry),
                _ => self.merged.push(*entry),
            }
        }
        let mut next = 0;
        for place in 0..=self.sums.len() {
            while self.merged.get(next).is_some_and(|entry| entry.row < place) {
                next += 1;
            }
            self.starts.push(next);
        }
    }
}
