//! Vertex separators, grown from a vertex and made lighter by moves of single vertices.

use crate::linear_solver::graph::{Graph, number};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The label of vertices that separate side 0 from side 1.
pub(super) const BETWEEN: u8 = 2;

/// Largest share of the total weight in either side.
const BALANCE: f64 = 0.57;

/// Number of moves without improvement after which a pass ends.
const PATIENCE: usize = 100;

/// Largest number of refinement passes on one graph.
const PASSES: usize = 6;

/// A partition into two sides without an edge between them, and their separator.
#[derive(Clone, Debug)]
pub(super) struct Separator {
    /// For each vertex its side, or [`BETWEEN`].
    pub(super) label: Vec<u8>,
    /// Weights of the sides and of the separator.
    pub(super) weights: [i64; 3],
}

impl Separator {
    pub(super) fn new(graph: &Graph, label: Vec<u8>) -> Self {
        let mut weights = [0; 3];
        for (vertex, &label) in (0..).zip(&label) {
            weights[usize::from(label)] += i64::from(graph.weight(vertex));
        }
        Self { label, weights }
    }

    /// The minimized cost: first the excess weight of a side, then the weight of the separator, then the difference
    /// of the sides.
    pub(super) fn cost(&self) -> [i64; 3] {
        let [one, other, between] = self.weights;
        [(one.max(other) - self.limit()).max(0), between, (one - other).abs()]
    }

    /// The vertices with a label.
    pub(super) fn labeled(&self, label: u8) -> Vec<u32> {
        (0..).zip(&self.label).filter(|(_, found)| **found == label).map(|(vertex, _)| vertex).collect()
    }

    /// The same separator in the finer graph, whose vertex i is part of vertex `coarse[i]` of this graph.
    pub(super) fn projected(&self, coarse: &[u32]) -> Self {
        Self { label: coarse.iter().map(|&vertex| self.label[vertex as usize]).collect(), weights: self.weights }
    }

    /// The largest weight of a side.
    fn limit(&self) -> i64 {
        // Weights are counts of dofs.
        #[allow(clippy::cast_possible_truncation)]
        let limit = (BALANCE * self.weights.iter().sum::<i64>() as f64) as i64;
        limit
    }
}

/// A separator whose vertices are moved to one of the sides, with memory for that.
struct Mover<'g> {
    graph: &'g Graph,
    separator: Separator,
    /// The side to which vertices are moved.
    side: u8,
    /// For each vertex of the separator, the weight of its neighbors on the other side, which would replace it.
    beyond: Vec<i64>,
    /// Vertices of the separator by the weight that the separator loses by moving them; some entries are outdated.
    queue: BinaryHeap<(i64, Reverse<u32>)>,
    /// Vertices that have changed their label, with the previous label.
    log: Vec<(u32, u8)>,
}

impl<'g> Mover<'g> {
    fn new(graph: &'g Graph, separator: Separator) -> Self {
        Self { graph, separator, side: 0, beyond: vec![0; graph.size()], queue: BinaryHeap::new(), log: Vec::new() }
    }

    fn weight(&self, vertex: u32) -> i64 {
        i64::from(self.graph.weight(vertex))
    }

    fn gain(&self, vertex: u32) -> i64 {
        self.weight(vertex) - self.beyond[vertex as usize]
    }

    fn offer(&mut self, vertex: u32) {
        self.queue.push((self.gain(vertex), Reverse(vertex)));
    }

    /// Adds a vertex of the separator to the queue.
    fn enter(&mut self, vertex: u32) {
        let other = 1 - self.side;
        let beyond = self.graph.neighbors(vertex).iter().filter(|&&next| self.separator.label[next as usize] == other);
        self.beyond[vertex as usize] = beyond.map(|&next| self.weight(next)).sum();
        self.offer(vertex);
    }

    /// The vertex whose move makes the separator lightest.
    fn best(&mut self) -> Option<u32> {
        while let Some((gain, Reverse(vertex))) = self.queue.pop() {
            if self.separator.label[vertex as usize] == BETWEEN && self.gain(vertex) == gain {
                return Some(vertex);
            }
        }
        None
    }

    fn relabel(&mut self, vertex: u32, to: u8) {
        let from = std::mem::replace(&mut self.separator.label[vertex as usize], to);
        let weight = self.weight(vertex);
        self.separator.weights[usize::from(from)] -= weight;
        self.separator.weights[usize::from(to)] += weight;
    }

    /// Moves a vertex from the separator to the side; its neighbors on the other side replace it.
    fn shift(&mut self, vertex: u32) {
        let (graph, other) = (self.graph, 1 - self.side);
        self.relabel(vertex, self.side);
        self.log.push((vertex, BETWEEN));
        for &neighbor in graph.neighbors(vertex) {
            if self.separator.label[neighbor as usize] != other {
                continue;
            }
            self.relabel(neighbor, BETWEEN);
            self.log.push((neighbor, other));
            for &next in graph.neighbors(neighbor) {
                if self.separator.label[next as usize] == BETWEEN {
                    self.beyond[next as usize] -= self.weight(neighbor);
                    self.offer(next);
                }
            }
            self.enter(neighbor);
        }
    }

    /// One pass of Fiduccia and Mattheyses (19th Design Automation Conference, 1982) toward a side: makes the best
    /// moves one by one, even if they temporarily make the separator heavier, and keeps the best separator found.
    /// Returns whether it is better than before.
    fn pass(&mut self, side: u8) -> bool {
        self.side = side;
        self.log.clear();
        self.queue.clear();
        for vertex in 0..number(self.graph.size()) {
            if self.separator.label[vertex as usize] == BETWEEN {
                self.enter(vertex);
            }
        }
        let (limit, start) = (self.separator.limit(), self.separator.cost());
        let (mut best, mut kept, mut idle) = (start, 0, 0);
        while idle < PATIENCE {
            let Some(vertex) = self.best() else { break };
            let weights = self.separator.weights;
            let [here, there] = [side, 1 - side].map(|side| weights[usize::from(side)]);
            if here + self.weight(vertex) > limit && here >= there {
                break;
            }
            self.shift(vertex);
            let cost = self.separator.cost();
            idle += 1;
            if cost < best {
                (best, kept, idle) = (cost, self.log.len(), 0);
            }
        }
        for (vertex, from) in self.log.split_off(kept).into_iter().rev() {
            self.relabel(vertex, from);
        }
        best < start
    }
}

/// Makes a separator lighter or better balanced: passes toward both sides in turn, the lighter one first, until
/// neither helps. A slanted separator becomes straight by moving to one side and back; a pass in both directions at
/// once would only move vertices to and fro.
pub(super) fn refine(graph: &Graph, separator: Separator) -> Separator {
    let mut side = u8::from(separator.weights[1] < separator.weights[0]);
    let mut mover = Mover::new(graph, separator);
    let mut idle = 0;
    for _ in 0..PASSES {
        idle = if mover.pass(side) { 0 } else { idle + 1 };
        side = 1 - side;
        if idle == 2 {
            break;
        }
    }
    mover.separator
}

/// Grows side 0 from a vertex, always adding the vertex that makes its boundary lightest, until it weighs as much as
/// the rest.
pub(super) fn grow(graph: &Graph, seed: u32) -> Separator {
    let mut label = vec![1; graph.size()];
    label[seed as usize] = BETWEEN;
    let mut mover = Mover::new(graph, Separator::new(graph, label));
    mover.enter(seed);
    while mover.separator.weights[0] < mover.separator.weights[1] {
        match mover.best() {
            Some(vertex) => mover.shift(vertex),
            None => break,
        }
    }
    mover.separator
}
