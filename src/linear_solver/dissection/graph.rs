//! Undirected graphs with weights: the quotient of a matrix by its indistinguishable dofs, and parts of it.

use crate::sparse::scattered;
use faer::sparse::SymbolicSparseColMatRef;

/// An undirected graph without loops, in compressed columns; every edge is stored at both ends.
#[derive(Clone, Debug)]
pub(super) struct Graph {
    starts: Vec<usize>,
    neighbors: Vec<usize>,
    /// For each neighbor the weight of the edge to it.
    edges: Vec<i64>,
    /// For each vertex, the number of dofs it stands for.
    weights: Vec<i64>,
}

impl Graph {
    /// A graph without vertices, with room for some.
    pub(super) fn with_capacity(vertices: usize, entries: usize) -> Self {
        let mut starts = Vec::with_capacity(vertices + 1);
        starts.push(0);
        let (neighbors, edges) = (Vec::with_capacity(entries), Vec::with_capacity(entries));
        Self { starts, neighbors, edges, weights: Vec::with_capacity(vertices) }
    }

    /// Adds an edge of the vertex that the next [`close`](Self::close) adds, and returns its place.
    pub(super) fn push(&mut self, neighbor: usize, edges: i64) -> usize {
        self.neighbors.push(neighbor);
        self.edges.push(edges);
        self.neighbors.len() - 1
    }

    /// Makes the edge at a place heavier.
    pub(super) fn thicken(&mut self, place: usize, edges: i64) {
        self.edges[place] += edges;
    }

    /// Adds a vertex with the edges pushed since the last one.
    pub(super) fn close(&mut self, weight: i64) {
        self.starts.push(self.neighbors.len());
        self.weights.push(weight);
    }

    /// Makes every edge as heavy as the number of neighbors that its ends have in common: pairs along heavy edges are
    /// compact. Graphs so dense that this would take long are left as they are.
    pub(super) fn weigh_edges(&mut self) {
        let work: usize = (0..self.size()).map(|vertex| self.neighbors(vertex).len().pow(2)).sum();
        if work > 100 * self.entries() {
            return;
        }
        let mut near = vec![usize::MAX; self.size()];
        for vertex in 0..self.size() {
            self.neighbors(vertex).iter().for_each(|&neighbor| near[neighbor] = vertex);
            for at in self.starts[vertex]..self.starts[vertex + 1] {
                let common = self.neighbors(self.neighbors[at]).iter().filter(|&&next| near[next] == vertex);
                self.edges[at] = 1 + common.map(|_| 1).sum::<i64>();
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

    pub(super) fn weight(&self, vertex: usize) -> i64 {
        self.weights[vertex]
    }

    pub(super) fn total(&self) -> i64 {
        self.weights.iter().sum()
    }

    pub(super) fn neighbors(&self, vertex: usize) -> &[usize] {
        &self.neighbors[self.starts[vertex]..self.starts[vertex + 1]]
    }

    /// Neighbors with the weights of the edges to them.
    pub(super) fn edges(&self, vertex: usize) -> impl Iterator<Item = (usize, i64)> {
        let range = self.starts[vertex]..self.starts[vertex + 1];
        self.neighbors[range.clone()].iter().copied().zip(self.edges[range].iter().copied())
    }

    pub(super) fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        SymbolicSparseColMatRef::new_unsorted_checked(self.size(), self.size(), &self.starts, None, &self.neighbors)
    }

    /// The graph of some of the vertices; `local` has room for all of them, with `usize::MAX` everywhere, and is left
    /// so.
    pub(super) fn part(&self, vertices: &[usize], local: &mut [usize]) -> Self {
        let entries = vertices.iter().map(|&vertex| self.neighbors(vertex).len()).sum();
        let mut part = Self::with_capacity(vertices.len(), entries);
        for (place, &vertex) in vertices.iter().enumerate() {
            local[vertex] = place;
        }
        for &vertex in vertices {
            for (neighbor, edges) in self.edges(vertex) {
                if local[neighbor] != usize::MAX {
                    part.push(local[neighbor], edges);
                }
            }
            part.close(self.weights[vertex]);
        }
        for &vertex in vertices {
            local[vertex] = usize::MAX;
        }
        part
    }

    /// The connected parts, each as a list of its vertices.
    pub(super) fn components(&self) -> Vec<Vec<usize>> {
        let mut components = Vec::new();
        let mut reached = vec![false; self.size()];
        for start in 0..self.size() {
            if reached[start] {
                continue;
            }
            reached[start] = true;
            let (mut component, mut next) = (vec![start], 0);
            while let Some(&vertex) = component.get(next) {
                next += 1;
                for &neighbor in self.neighbors(vertex) {
                    if !reached[neighbor] {
                        reached[neighbor] = true;
                        component.push(neighbor);
                    }
                }
            }
            components.push(component);
        }
        components
    }
}

/// The graph of a symmetric matrix without some dofs, with dofs that have the same neighbors as one vertex (those of a
/// node, as a rule).
#[derive(Debug)]
pub(super) struct Quotient {
    pub(super) graph: Graph,
    /// The dofs of all vertices, one vertex after the other, and where each one's start.
    dofs: Vec<usize>,
    starts: Vec<usize>,
}

impl Quotient {
    /// Nothing if the pattern is not symmetric.
    pub(super) fn new(pattern: SymbolicSparseColMatRef<'_, usize>, without: &[usize]) -> Option<Self> {
        const OUT: usize = usize::MAX;
        const OPEN: usize = usize::MAX - 1;
        let n = pattern.nrows();
        let mut vertex = vec![OPEN; n];
        for &dof in without {
            vertex[dof] = OUT;
        }
        // Sums of hashes over columns and rows: neighbors with equal sums have the same neighbors. (A collision would
        // cost fill, nothing else.)
        let (mut columns, mut rows) = (vec![0_u64; n], vec![0_u64; n]);
        for j in (0..n).filter(|&j| vertex[j] != OUT) {
            for &i in pattern.row_idx_of_col_raw(j) {
                if i != j && vertex[i] != OUT {
                    columns[j] = columns[j].wrapping_add(scattered(i));
                    rows[i] = rows[i].wrapping_add(scattered(j));
                }
            }
        }
        if columns != rows {
            return None;
        }
        for (dof, sum) in columns.iter_mut().enumerate() {
            *sum = sum.wrapping_add(scattered(dof));
        }
        let (mut dofs, mut starts) = (Vec::with_capacity(n), vec![0]);
        for j in 0..n {
            if vertex[j] != OPEN {
                continue;
            }
            let name = starts.len() - 1;
            vertex[j] = name;
            dofs.push(j);
            for &i in pattern.row_idx_of_col_raw(j) {
                if vertex[i] == OPEN && columns[i] == columns[j] {
                    vertex[i] = name;
                    dofs.push(i);
                }
            }
            starts.push(dofs.len());
        }
        let vertices = starts.len() - 1;
        let mut graph = Graph::with_capacity(vertices, vertices);
        let mut seen = vec![OUT; vertices];
        for (name, range) in starts.windows(2).enumerate() {
            seen[name] = name;
            for &i in pattern.row_idx_of_col_raw(dofs[range[0]]) {
                if vertex[i] != OUT && seen[vertex[i]] != name {
                    seen[vertex[i]] = name;
                    graph.push(vertex[i], 1);
                }
            }
            graph.close((range[0]..range[1]).map(|_| 1).sum());
        }
        Some(Self { graph, dofs, starts })
    }

    pub(super) fn dofs(&self, vertex: usize) -> &[usize] {
        &self.dofs[self.starts[vertex]..self.starts[vertex + 1]]
    }

    /// The dofs in an order of the vertices.
    pub(super) fn expanded(&self, vertices: &[usize]) -> Vec<usize> {
        vertices.iter().flat_map(|&vertex| self.dofs(vertex)).copied().collect()
    }
}
