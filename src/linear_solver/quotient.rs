//! The graph of a symmetric matrix in which dofs with the same neighbors, usually the dofs of a node, form one
//! vertex.

#[cfg(test)]
pub(super) mod patterns;

use super::graph::{Graph, NONE, number};
use crate::error::Result;
use crate::sparse::scattered;
use faer::sparse::SymbolicSparseColMatRef;

/// The graph, and the dofs of its vertices. Dofs eliminated last and other dofs are in different vertices.
#[derive(Debug)]
pub(super) struct Quotient {
    pub(super) graph: Graph,
    /// The dofs of all vertices, one vertex after the other, and the start of each.
    dofs: Vec<usize>,
    starts: Vec<usize>,
    /// For each vertex, whether its dofs are eliminated last.
    last: Vec<bool>,
}

impl Quotient {
    /// `None` if the pattern is not symmetric, or too large for 32 bits.
    pub(super) fn new(pattern: SymbolicSparseColMatRef<'_, usize>, last: &[usize]) -> Result<Option<Self>> {
        let n = pattern.nrows();
        if n.max(pattern.row_idx().len()) >= NONE as usize {
            return Ok(None);
        }
        let Some(keys) = keys(pattern, last) else { return Ok(None) };
        // The vertex of each dof, and the dofs of each vertex.
        let mut vertex = vec![NONE; n];
        let (mut dofs, mut starts) = (Vec::with_capacity(n), vec![0]);
        for j in 0..n {
            if vertex[j] != NONE {
                continue;
            }
            let name = number(starts.len() - 1);
            vertex[j] = name;
            dofs.push(j);
            for &i in pattern.row_idx_of_col_raw(j) {
                if keys[i] == keys[j] && vertex[i] == NONE {
                    vertex[i] = name;
                    dofs.push(i);
                }
            }
            starts.push(dofs.len());
        }
        let vertices = starts.len() - 1;
        let first = |vertex: usize| dofs[starts[vertex]];
        let entries = (0..vertices).map(|vertex| pattern.row_idx_of_col_raw(first(vertex)).len()).sum::<usize>();
        let mut graph = Graph::with_capacity(vertices, entries * vertices / n.max(1))?;
        let mut seen = vec![NONE; vertices];
        for name in 0..vertices {
            seen[name] = number(name);
            for &i in pattern.row_idx_of_col_raw(first(name)) {
                if std::mem::replace(&mut seen[vertex[i] as usize], number(name)) != number(name) {
                    graph.push(vertex[i], 1);
                }
            }
            graph.close(number(starts[name + 1] - starts[name]));
        }
        let last = (0..vertices).map(|vertex| last.binary_search(&first(vertex)).is_ok()).collect();
        Ok(Some(Self { graph, dofs, starts, last }))
    }

    /// Number of dofs.
    pub(super) fn size(&self) -> usize {
        self.dofs.len()
    }

    pub(super) fn dofs(&self, vertex: u32) -> &[usize] {
        &self.dofs[self.starts[vertex as usize]..self.starts[vertex as usize + 1]]
    }

    /// Whether the dofs of a vertex are eliminated last.
    pub(super) fn is_last(&self, vertex: u32) -> bool {
        self.last[vertex as usize]
    }

    /// The dofs in an order of the vertices.
    pub(super) fn expanded(&self, vertices: &[u32]) -> Vec<usize> {
        vertices.iter().flat_map(|&vertex| self.dofs(vertex)).copied().collect()
    }
}

/// For each dof a number that it shares with the neighbors that have the same neighbors and, like it, are in `last`
/// or not. A collision would only increase fill. `None` if the pattern is not symmetric.
fn keys(pattern: SymbolicSparseColMatRef<'_, usize>, last: &[usize]) -> Option<Vec<u64>> {
    let n = pattern.nrows();
    let scattered: Vec<u64> = (0..n).map(scattered).collect();
    let mut keys = vec![0_u64; n];
    // The sum of h(i) g(j) − h(j) g(i) over all entries (i, j): entries on both sides of the diagonal cancel. Both
    // functions are hashes: with g(j) = j other entries would cancel too, such as (0, 1) and (0, 2) with (3, 0).
    let mut asymmetry = 0_u64;
    let other = |i: usize| scattered[i].rotate_left(32);
    for j in 0..n {
        let (mut hashes, mut others) = (0_u64, 0_u64);
        for &i in pattern.row_idx_of_col_raw(j) {
            hashes = hashes.wrapping_add(scattered[i]);
            others = others.wrapping_add(other(i));
        }
        keys[j] = hashes;
        let balance = hashes.wrapping_mul(other(j)).wrapping_sub(scattered[j].wrapping_mul(others));
        asymmetry = asymmetry.wrapping_add(balance);
    }
    for &dof in last {
        keys[dof] = !keys[dof];
    }
    (asymmetry == 0).then_some(keys)
}

#[cfg(test)]
mod tests {
    use super::patterns::{chain, cube, frame, pattern, strewn};
    use super::*;
    use faer::sparse::SymbolicSparseColMat;
    use std::collections::BTreeSet;

    #[test]
    fn dofs_of_a_node_are_one_vertex() {
        let (n, pairs) = cube(4);
        let pattern = pattern(n, &pairs);
        let whole = Quotient::new(pattern.as_ref(), &[]).unwrap().unwrap();
        assert_eq!((whole.graph.size(), whole.graph.total()), (64, 192));
        // A node with one dof eliminated last, and one with all dofs eliminated last.
        let parts = Quotient::new(pattern.as_ref(), &[0, 3, 4, 5]).unwrap().unwrap();
        assert_eq!((parts.graph.size(), parts.graph.total()), (65, 192));
        let last: Vec<_> = (0..65).filter(|&vertex| parts.is_last(vertex)).map(|vertex| parts.dofs(vertex)).collect();
        assert_eq!(last, [&[0][..], &[3, 4, 5]]);
        assert!((0..65).any(|vertex| parts.dofs(vertex) == [1, 2]));
    }

    /// Nodes with one dof and with three, and nodes tied by only one of their dofs.
    #[test]
    fn vertices_are_dofs_with_the_same_neighbors() {
        for (n, pairs) in [frame(40), cube(3), (60, chain(60)), (80, strewn(80, 120, 7)), (30, vec![])] {
            let mut near: Vec<BTreeSet<usize>> = (0..n).map(|dof| [dof].into()).collect();
            for &(i, j) in &pairs {
                near[i].insert(j);
                near[j].insert(i);
            }
            let last: Vec<usize> = (0..n).step_by(4).collect();
            let quotient = Quotient::new(pattern(n, &pairs).as_ref(), &last).unwrap().unwrap();
            let mut vertex = vec![NONE; n];
            for name in 0..number(quotient.graph.size()) {
                quotient.dofs(name).iter().for_each(|&dof| vertex[dof] = name);
                assert_eq!(quotient.dofs(name).len(), quotient.graph.weight(name) as usize);
            }
            for i in 0..n {
                for j in 0..n {
                    let alike = near[i] == near[j] && (i % 4 == 0) == (j % 4 == 0);
                    assert_eq!(vertex[i] == vertex[j], alike, "dofs {i} and {j} of {n}");
                    let adjacent = quotient.graph.neighbors(vertex[i]).contains(&vertex[j]);
                    assert_eq!(adjacent, near[i].contains(&j) && !alike, "dofs {i} and {j} of {n}");
                }
            }
            assert!(quotient.expanded(&(0..number(quotient.graph.size())).collect::<Vec<_>>()).len() == n);
        }
    }

    #[test]
    fn one_sided_patterns_have_no_graph() {
        let one_sided = SymbolicSparseColMat::new_checked(2, 2, vec![0, 2, 3], None, vec![0, 1, 1]);
        assert!(Quotient::new(one_sided.as_ref(), &[]).unwrap().is_none());
        // As many entries above the diagonal as below, in all rows and columns.
        let rows = (0..5).flat_map(|j: usize| {
            let mut rows = [j, (j + 1) % 5];
            rows.sort_unstable();
            rows
        });
        let circle = SymbolicSparseColMat::new_checked(5, 5, vec![0, 2, 4, 6, 8, 10], None, rows.collect());
        assert!(Quotient::new(circle.as_ref(), &[]).unwrap().is_none());
    }
}
