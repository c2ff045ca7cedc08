//! The integrals of shape functions over the covered part of a surface, found once, and the rows from them, in axes
//! that turn with the facets.

use crate::contact::surface::{
    Base, ByNode, Facet, Neighborhood, Nodes, Point, Sample, Surface, add_scaled, cross, dot, norm, sub, unit,
};
use crate::rounding::{LEAST_COVER, half_digits};
use std::ops::Range;

const SPACE: [Point; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The tied nodes and the data of their rows.
#[derive(Debug, Default)]
pub(super) struct Joint {
    /// Nodes of the slave with rows, ascending, and ∫ N dA over their covered part.
    pub(super) tied: Vec<usize>,
    pub(super) areas: Vec<f64>,
    /// Whether surfaces do not coincide, so that axes must turn.
    pub(super) turns: bool,
    pieces: Vec<Piece>,
    terms: Vec<Term>,
    /// The nodes on which the rows of each tied node act, ascending.
    starts: Vec<usize>,
    columns: Vec<usize>,
    /// The gaps at the start by tied node, in axes of space.
    initial: Vec<Point>,
    /// For each tied node the axes of its rows in the reference configuration: the axes of space, or its normal and
    /// tangents.
    frames: Vec<[Point; 3]>,
    /// For each entry of `columns` the weights of the rows of the three axes.
    weights: Vec<[Point; 3]>,
    gaps: Vec<Point>,
    /// By tied node the mean directions of the axes.
    directions: Vec<[Point; 3]>,
}

/// A slave facet that is at least partly covered.
#[derive(Debug)]
struct Piece {
    facet: Facet,
    /// Its frame in the reference configuration.
    frame: [Point; 3],
    terms: Range<usize>,
    /// For each corner with rows its place among the tied nodes, and the slots of the facet's corners in its rows.
    rows: [Option<(usize, [usize; 4])>; 4],
}

/// ∫ N_a N_node dA over a facet, divided by ∫ N_a dA: positive for nodes of the master.
#[derive(Clone, Copy, Debug)]
struct Term {
    corner: usize,
    node: usize,
    /// The slot of the node in the rows of a.
    slot: usize,
    weight: f64,
}

/// Integrals over a slave facet: (corner, node, ∫ N_corner N_node dA with the sign of a term).
struct Covered {
    facet: Facet,
    frame: [Point; 3],
    parts: Vec<(usize, usize, f64)>,
}

impl Joint {
    /// Finds the parts of the slave that are covered by facets of the master within `reach` along the normal.
    pub(super) fn new(slave: &Surface, master: &Surface, positions: &[Point], reach: f64) -> Self {
        let (covered, areas) = cover(slave, master, positions, reach);
        let whole = slave.areas_at(positions);
        let is_tied = |&place: &usize| areas[place] > LEAST_COVER * whole[place];
        let places: Vec<usize> = (0..areas.len()).filter(is_tied).collect();
        let mut joint = Self {
            tied: places.iter().map(|&place| slave.nodes()[place]).collect(),
            areas: places.iter().map(|&place| areas[place]).collect(),
            ..Self::default()
        };
        joint.list_columns(&covered);
        joint.take(&covered, positions);
        joint
    }

    fn place(&self, node: usize) -> Option<usize> {
        self.tied.binary_search(&node).ok()
    }

    /// The slot of a node in the rows of a tied node.
    fn slot(&self, place: usize, node: usize) -> usize {
        let range = self.starts[place]..self.starts[place + 1];
        range.start + self.columns[range].partition_point(|&other| other < node)
    }

    fn list_columns(&mut self, covered: &[Covered]) {
        let mut columns: Vec<(usize, usize)> = Vec::new();
        for Covered { facet, parts, .. } in covered {
            for &(corner, node, _) in parts {
                columns.extend(self.place(facet.nodes()[corner]).map(|place| (place, node)));
            }
        }
        columns.sort_unstable();
        columns.dedup();
        self.starts = (0..=self.tied.len()).map(|place| columns.partition_point(|x| x.0 < place)).collect();
        self.columns = columns.into_iter().map(|(_, node)| node).collect();
    }

    /// Stores the data of the rows, and the gaps at the start.
    fn take(&mut self, covered: &[Covered], positions: &[Point]) {
        for Covered { facet, frame, parts } in covered {
            let mut rows = [None; 4];
            for (row, &node) in rows.iter_mut().zip(facet.nodes()) {
                let place = self.place(node);
                *row = place.map(|place| (place, facet.nodes.map(|corner| self.slot(place, corner))));
            }
            let start = self.terms.len();
            for &(corner, node, integral) in parts {
                if let Some((place, _)) = rows[corner] {
                    let (slot, weight) = (self.slot(place, node), integral / self.areas[place]);
                    self.terms.push(Term { corner, node, slot, weight });
                }
            }
            self.pieces.push(Piece { facet: *facet, frame: *frame, terms: start..self.terms.len(), rows });
        }
        let tied = self.tied.len();
        (self.initial, self.gaps) = (vec![[0.0; 3]; tied], vec![[0.0; 3]; tied]);
        self.directions = vec![[[0.0; 3]; 3]; tied];
        self.frames = vec![SPACE; tied];
        self.weights = vec![[[0.0; 3]; 3]; self.columns.len()];
        for piece in &self.pieces {
            let size = piece.facet.shape(positions).size();
            for (apart, row) in self.apart(piece, positions).into_iter().zip(piece.rows) {
                if let Some((place, _)) = row {
                    // Rows of surfaces that coincide are constant.
                    self.turns |= norm(apart) > half_digits::<f64>() * size;
                    self.initial[place] = add_scaled(self.initial[place], 1.0, apart);
                }
            }
        }
    }

    /// Makes axes turn, with the slave's mean normal over a node's area as the first axis.
    pub(super) fn align(&mut self, nodes: &Nodes) {
        self.turns = true;
        let mut normals = vec![[0.0; 3]; self.tied.len()];
        for piece in &self.pieces {
            for term in &self.terms[piece.terms.clone()] {
                if let Some((place, _)) = piece.rows[term.corner].filter(|_| piece.is_of_master(term)) {
                    normals[place] = add_scaled(normals[place], term.weight, piece.frame[2]);
                }
            }
        }
        for (frame, normal) in self.frames.iter_mut().zip(normals) {
            // The sum vanishes only for a sheet folded flat, where any direction is as good.
            let normal = unit(normal).unwrap_or(SPACE[0]);
            frame[0] = normal;
            frame[1..].iter_mut().zip(nodes.tangents(normal)).for_each(|(axis, tangent)| *axis = tangent);
        }
    }

    /// Σ weight · x of the terms of each corner: the vector from slave to master. Weights sum to zero.
    fn apart(&self, piece: &Piece, positions: &[Point]) -> [Point; 4] {
        let origin = positions[piece.facet.nodes[0]];
        let mut apart = [[0.0; 3]; 4];
        for term in &self.terms[piece.terms.clone()] {
            apart[term.corner] = add_scaled(apart[term.corner], term.weight, sub(positions[term.node], origin));
        }
        apart
    }

    /// The axes of the rows of a piece's corners, with its facet at `base`. Without `base` the facet has lost its
    /// area: then the axes are NaN, and the gaps are rejected.
    fn axes(&self, piece: &Piece, base: Option<&Base>) -> [[Point; 3]; 4] {
        let space = match (base, self.turns) {
            (Some(base), true) => turned(&piece.frame, &base.frame()),
            (None, true) => [[f64::NAN; 3]; 3],
            (_, false) => SPACE,
        };
        piece.rows.map(|row| row.map_or(space, |(place, _)| within(&space, &self.frames[place])))
    }

    /// Finds the [gaps](Self::gap) at these positions of the nodes, without changing the rows.
    pub(super) fn gaps_at(&mut self, positions: &[Point]) {
        let mut gaps = std::mem::take(&mut self.gaps);
        gaps.fill([0.0; 3]);
        for piece in self.pieces.iter().filter(|_| self.turns) {
            let axes = self.axes(piece, Base::new(&piece.facet, positions).as_ref());
            for ((apart, row), axes) in self.apart(piece, positions).into_iter().zip(piece.rows).zip(axes) {
                let Some((place, _)) = row else { continue };
                gaps[place].iter_mut().zip(axes).for_each(|(gap, axis)| *gap += dot(apart, axis));
            }
        }
        self.gaps = gaps;
    }

    /// Makes the rows at these positions of the nodes.
    pub(super) fn turn(&mut self, positions: &[Point]) {
        self.gaps_at(positions);
        self.weights.fill([[0.0; 3]; 3]);
        self.directions.fill([[0.0; 3]; 3]);
        for piece in &self.pieces {
            let base = Base::new(&piece.facet, positions).filter(|_| self.turns);
            let axes = self.axes(piece, base.as_ref());
            let apart = self.apart(piece, positions);
            for term in &self.terms[piece.terms.clone()] {
                let Some((place, _)) = piece.rows[term.corner] else { continue };
                let is_of_master = piece.is_of_master(term);
                for (k, axis) in axes[term.corner].iter().enumerate() {
                    let weight = &mut self.weights[term.slot][k];
                    *weight = add_scaled(*weight, term.weight, *axis);
                    if is_of_master {
                        let direction = &mut self.directions[place][k];
                        *direction = add_scaled(*direction, term.weight, *axis);
                    }
                }
            }
            for ((apart, row), axes) in apart.into_iter().zip(piece.rows).zip(axes) {
                let (Some((_, corners)), Some(base)) = (row, &base) else { continue };
                for (k, &axis) in axes.iter().enumerate() {
                    let by_corner = base.rotated(cross(axis, apart));
                    for (&slot, by) in corners[..piece.facet.count].iter().zip(by_corner) {
                        self.weights[slot][k] = add_scaled(self.weights[slot][k], 1.0, by);
                    }
                }
            }
        }
    }

    /// The gap of a tied node along an axis, at the positions of the rows or of the last `gaps_at`.
    pub(super) fn gap(&self, place: usize, axis: usize) -> f64 {
        match self.turns {
            true => self.gaps[place][axis] - dot(self.initial[place], self.frames[place][axis]),
            false => 0.0,
        }
    }

    /// Its row: nodes, and the weights of their displacements.
    pub(super) fn row(&self, place: usize, axis: usize) -> impl Iterator<Item = (usize, Point)> + '_ {
        let range = self.starts[place]..self.starts[place + 1];
        range.map(move |slot| (self.columns[slot], self.weights[slot][axis]))
    }

    pub(super) fn direction(&self, place: usize, axis: usize) -> Point {
        self.directions[place][axis]
    }

    /// The nodes of a surface on which the rows act, ascending.
    pub(super) fn nodes_of(&self, surface: &Surface) -> Vec<usize> {
        let mut nodes: Vec<usize> = self.columns.clone();
        nodes.sort_unstable();
        nodes.dedup();
        let movers = surface.moved_by();
        nodes.retain(|node| movers.binary_search(node).is_ok());
        nodes
    }
}

impl Piece {
    /// Whether a term belongs to a node of the master.
    fn is_of_master(&self, term: &Term) -> bool {
        self.facet.all_nodes().all(|node| node != term.node)
    }
}

/// The vectors of a frame, given the current directions of the axes of space.
fn within(space: &[Point; 3], frame: &[Point; 3]) -> [Point; 3] {
    let vector = |v: Point| v.iter().zip(space).fold([0.0; 3], |sum, (&v, &axis)| add_scaled(sum, v, axis));
    frame.map(vector)
}

/// The axes of space, turned by the rotation from one frame to another.
fn turned(from: &[Point; 3], to: &[Point; 3]) -> [Point; 3] {
    let axis = |k: usize| from.iter().zip(to).fold([0.0; 3], |sum, (from, &to)| add_scaled(sum, from[k], to));
    [axis(0), axis(1), axis(2)]
}

/// The covered part of each slave facet, and ∫ N dA over it by place of the slave's nodes.
fn cover(slave: &Surface, master: &Surface, positions: &[Point], reach: f64) -> (Vec<Covered>, Vec<f64>) {
    let mut lists = Neighborhood::default();
    lists.build(slave.boxes(positions), master.boxes(positions), reach);
    let mut areas = vec![0.0; slave.nodes().len()];
    let mut all = Vec::new();
    for (index, facet) in slave.facets().iter().enumerate() {
        let Some(base) = Base::new(facet, positions) else { continue };
        let (count, mut own, mut parts) = (facet.count, [ByNode::default(); 4], Vec::new());
        for &partner in lists.of(index) {
            let other = &master.facets()[partner];
            if !other.normal(positions).is_some_and(|normal| base.may_meet(normal, other, positions, reach)) {
                continue;
            }
            let mut onto = [ByNode::default(); 4];
            let mut touched = false;
            base.each_sample(other, positions, &mut |sample: &Sample| {
                if sample.gap.abs() > reach {
                    return;
                }
                touched = true;
                let (beneath, above) = (facet.shapes(&sample.slave), other.shapes(&sample.master));
                for a in 0..count {
                    let weight = sample.area * sample.slave[a];
                    areas[slave.places(index)[a]] += weight;
                    own[a].iter_mut().zip(beneath).for_each(|(own, share)| *own -= weight * share);
                    onto[a].iter_mut().zip(above).for_each(|(onto, share)| *onto += weight * share);
                }
            });
            if touched {
                push_parts(other, &onto[..count], &mut parts);
            }
        }
        if !parts.is_empty() {
            push_parts(facet, &own[..count], &mut parts);
            all.push(Covered { facet: *facet, frame: base.frame(), parts });
        }
    }
    (all, areas)
}

/// Lists the integrals of the corners of a slave facet with the nodes of a facet.
fn push_parts(facet: &Facet, integrals: &[ByNode], parts: &mut Vec<(usize, usize, f64)>) {
    for (corner, integrals) in integrals.iter().enumerate() {
        parts.extend(facet.all_nodes().zip(integrals).map(|(node, &integral)| (corner, node, integral)));
    }
}
