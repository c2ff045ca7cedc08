//! Undirected graphs with weights, and parts of them.

use crate::error::Result;
use crate::memory;
use faer::sparse::SymbolicSparseColMatRef;

/// No vertex: the numbers of vertices are smaller.
pub(super) const NONE: u32 = u32::MAX;

/// The number of a vertex or edge. Callers check that graphs are not too large.
pub(super) fn number(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(NONE)
}

/// An undirected graph without loops, in compressed columns; every edge is stored at both ends.
#[derive(Clone, Debug)]
pub(super) struct Graph {
    starts: Vec<u32>,
    neighbors: Vec<u32>,
    /// The weight of the edge to each neighbor.
    edges: Vec<u32>,
    /// The number of dofs of each vertex.
    weights: Vec<u32>,
}

impl Graph {
    /// A graph without vertices, with reserved memory.
    pub(super) fn with_capacity(vertices: usize, entries: usize) -> Result<Self> {
        let room = |entries: usize| memory::reserve(entries, 1, "the graph of a matrix, whose order is sought");
        let mut starts = room(vertices + 1)?;
        starts.push(0);
        Ok(Self { starts, neighbors: room(entries)?, edges: room(entries)?, weights: room(vertices)? })
    }

    /// An empty graph for one smaller than an existing graph; its memory grows as needed.
    pub(super) fn smaller() -> Self {
        Self { starts: vec![0], neighbors: Vec::new(), edges: Vec::new(), weights: Vec::new() }
    }

    /// Adds an edge of the vertex that the next [`close`](Self::close) adds, and returns its place.
    #[inline]
    pub(super) fn push(&mut self, neighbor: u32, edges: u32) -> u32 {
        self.neighbors.push(neighbor);
        self.edges.push(edges);
        number(self.neighbors.len() - 1)
    }

    /// Increases the weight of the edge at a place.
    #[inline]
    pub(super) fn thicken(&mut self, place: u32, edges: u32) {
        let edge = &mut self.edges[place as usize];
        *edge = edge.saturating_add(edges);
    }

    /// Adds a vertex with the edges pushed since the last one.
    pub(super) fn close(&mut self, weight: u32) {
        self.starts.push(number(self.neighbors.len()));
        self.weights.push(weight);
    }

    /// Sets the weight of each edge to the number of common neighbors of its ends: pairs along heavy edges are
    /// compact. Very dense graphs, for which this would take long, are left unchanged.
    pub(super) fn weigh_edges(&mut self) {
        let work: usize = (0..self.size()).map(|vertex| self.neighbors(number(vertex)).len().pow(2)).sum();
        if work > 100 * self.entries() {
            return;
        }
        let mut near = vec![NONE; self.size()];
        for vertex in 0..number(self.size()) {
            let range = self.range(vertex);
            self.neighbors[range.clone()].iter().for_each(|&neighbor| near[neighbor as usize] = vertex);
            for at in range {
                let next = self.range(self.neighbors[at]);
                let common = self.neighbors[next].iter().map(|&next| u32::from(near[next as usize] == vertex));
                self.edges[at] = 1 + common.sum::<u32>();
            }
        }
    }

    pub(super) fn size(&self) -> usize {
        self.weights.len()
    }

    /// Number of edges, each counted at both ends.
    pub(super) fn entries(&self) -> usize {
        self.neighbors.len()
    }

    #[inline]
    pub(super) fn weight(&self, vertex: u32) -> u32 {
        self.weights[vertex as usize]
    }

    pub(super) fn total(&self) -> i64 {
        self.weights.iter().copied().map(i64::from).sum()
    }

    #[inline]
    fn range(&self, vertex: u32) -> std::ops::Range<usize> {
        self.starts[vertex as usize] as usize..self.starts[vertex as usize + 1] as usize
    }

    #[inline]
    pub(super) fn neighbors(&self, vertex: u32) -> &[u32] {
        &self.neighbors[self.range(vertex)]
    }

    /// Neighbors with the weights of the edges to them.
    #[inline]
    pub(super) fn edges(&self, vertex: u32) -> impl Iterator<Item = (u32, u32)> {
        let range = self.range(vertex);
        self.neighbors[range.clone()].iter().copied().zip(self.edges[range].iter().copied())
    }

    pub(super) fn pattern(&self) -> SymbolicSparseColMatRef<'_, u32> {
        SymbolicSparseColMatRef::new_unsorted_checked(self.size(), self.size(), &self.starts, None, &self.neighbors)
    }

    /// The graph of some of the vertices; `local` has an entry for each vertex of this graph, [`NONE`] on entry and
    /// on return.
    pub(super) fn part(&self, vertices: &[u32], local: &mut [u32]) -> Result<Self> {
        let entries = vertices.iter().map(|&vertex| self.neighbors(vertex).len()).sum();
        let mut part = Self::with_capacity(vertices.len(), entries)?;
        for (place, &vertex) in vertices.iter().enumerate() {
            local[vertex as usize] = number(place);
        }
        for &vertex in vertices {
            for (neighbor, edges) in self.edges(vertex) {
                if local[neighbor as usize] != NONE {
                    part.push(local[neighbor as usize], edges);
                }
            }
            part.close(self.weight(vertex));
        }
        for &vertex in vertices {
            local[vertex as usize] = NONE;
        }
        Ok(part)
    }

    /// The connected parts, each as a list of its vertices.
    pub(super) fn components(&self) -> Vec<Vec<u32>> {
        let mut components = Vec::new();
        let mut reached = vec![false; self.size()];
        for start in 0..self.size() {
            if reached[start] {
                continue;
            }
            reached[start] = true;
            let (mut component, mut next) = (vec![number(start)], 0);
            while let Some(&vertex) = component.get(next) {
                next += 1;
                for &neighbor in self.neighbors(vertex) {
                    if !std::mem::replace(&mut reached[neighbor as usize], true) {
                        component.push(neighbor);
                    }
                }
            }
            components.push(component);
        }
        components
    }
}
