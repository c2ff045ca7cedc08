//! The elimination tree of a graph for an order of its vertices, and the fill of that order.

use super::graph::{Graph, NONE, number};

/// For each vertex, the first vertex coupled to it by its elimination (Liu, SIAM J. Matrix Anal. Appl. 11, 1990).
#[derive(Debug)]
pub(super) struct EliminationTree {
    /// For each place in the order the place of its parent; [`NONE`] at roots.
    parents: Vec<u32>,
    /// For each place the number of dofs below the dofs of its vertex in the factor.
    below: Vec<u32>,
    /// Entries of the factor, counted in the dofs of the vertices.
    pub(super) fill: u64,
}

impl EliminationTree {
    pub(super) fn new(graph: &Graph, order: &[u32]) -> Self {
        let n = order.len();
        let mut place = vec![NONE; n];
        for (k, &vertex) in order.iter().enumerate() {
            place[vertex as usize] = number(k);
        }
        let (mut parents, mut below, mut reached) = (vec![NONE; n], vec![0_u32; n], vec![NONE; n]);
        let mut fill = 0;
        for (&vertex, k) in order.iter().zip(0_u32..) {
            let weight = graph.weight(vertex);
            reached[k as usize] = k;
            // A row of the factor: from each earlier neighbor up the tree, up to the first vertex already reached.
            for &neighbor in graph.neighbors(vertex) {
                let mut i = place[neighbor as usize] as usize;
                while i < k as usize && reached[i] != k {
                    reached[i] = k;
                    below[i] += weight;
                    if parents[i] == NONE {
                        parents[i] = k;
                    }
                    i = parents[i] as usize;
                }
            }
        }
        for (&vertex, &below) in order.iter().zip(&below) {
            let weight = u64::from(graph.weight(vertex));
            fill += weight * (weight + 1) / 2 + weight * u64::from(below);
        }
        Self { parents, below, fill }
    }

    /// An order with the same fill in which every branch of the tree has consecutive places. The tallest of several
    /// children has the last ones, so that it can form one supernode with its parent. Places from `interior` on are
    /// unchanged.
    pub(super) fn postordered(&self, order: &[u32], interior: usize) -> Vec<u32> {
        // The children of each place as a list, the tallest first; roots are children of one extra place.
        let mut children: Vec<u32> = (0..number(interior)).collect();
        children.sort_by_key(|&child| self.below[child as usize]);
        let (mut head, mut next) = (vec![NONE; interior + 1], vec![NONE; interior]);
        for child in children {
            let parent = (self.parents[child as usize] as usize).min(interior);
            next[child as usize] = std::mem::replace(&mut head[parent], child);
        }
        // Backward: a place, then its children, each with its whole branch.
        let mut places = Vec::with_capacity(interior);
        let mut open = vec![head[interior]];
        while let Some(place) = open.pop() {
            if place != NONE {
                places.push(place);
                open.extend([next[place as usize], head[place as usize]]);
            }
        }
        let branches = places.iter().rev().map(|&place| order[place as usize]);
        branches.chain(order[interior..].iter().copied()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_solver::quotient::Quotient;
    use crate::linear_solver::quotient::patterns::{chain, cube, frame, pattern, strewn};
    use std::collections::BTreeSet;

    /// Entries of the factor, by eliminating vertices one by one.
    fn eliminated(graph: &Graph, order: &[u32]) -> u64 {
        let mut near: Vec<BTreeSet<u32>> =
            (0..number(graph.size())).map(|vertex| graph.neighbors(vertex).iter().copied().collect()).collect();
        let mut fill = 0;
        for &vertex in order {
            let later = std::mem::take(&mut near[vertex as usize]);
            let (weight, below) = (graph.weight(vertex), later.iter().map(|&next| graph.weight(next)).sum::<u32>());
            fill += u64::from(weight * (weight + 1) / 2 + weight * below);
            for &next in &later {
                near[next as usize].extend(&later);
                near[next as usize].remove(&next);
                near[next as usize].remove(&vertex);
            }
        }
        fill
    }

    #[test]
    fn fill_is_that_of_the_elimination() {
        for (n, pairs) in [cube(4), frame(60), (90, chain(90)), (150, strewn(150, 200, 4)), (9, vec![])] {
            for last in [vec![], (0..n).step_by(5).collect::<Vec<_>>()] {
                let quotient = Quotient::new(pattern(n, &pairs).as_ref(), &last).unwrap().unwrap();
                let graph = &quotient.graph;
                let size = number(graph.size());
                // Interior vertices scattered, the others after them.
                let strewn = (0..size).map(|k| (k * 7919) % size);
                let (interior, last): (Vec<_>, Vec<_>) = strewn.partition(|&vertex| !quotient.is_last(vertex));
                let order = [&interior[..], &last].concat();
                let tree = EliminationTree::new(graph, &order);
                assert_eq!(tree.fill, eliminated(graph, &order), "{n} dofs, {} last", last.len());

                let postordered = tree.postordered(&order, interior.len());
                assert_eq!(eliminated(graph, &postordered), tree.fill);
                assert_eq!(postordered[interior.len()..], last);
                let mut names = postordered.clone();
                names.sort_unstable();
                assert!(names.into_iter().eq(0..size));
                // The number of vertices of each branch equals the number of its places.
                let tree = EliminationTree::new(graph, &postordered);
                let interior = interior.len();
                let (mut first, mut count): (Vec<_>, Vec<_>) = (0..interior).map(|place| (place, 1)).unzip();
                for place in 0..interior {
                    assert_eq!(count[place], place - first[place] + 1);
                    let parent = tree.parents[place] as usize;
                    if parent < interior {
                        first[parent] = first[parent].min(first[place]);
                        count[parent] += count[place];
                    }
                }
            }
        }
    }
}
