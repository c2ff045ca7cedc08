//! Minimum degree of small parts of a graph, with bit sets.

use crate::linear_solver::graph::{Graph, NONE, number};

/// Limit of vertices counted as neighbors: graphs whose vertices have hundreds of neighbors would take long.
const MOST: usize = 1024;

/// An order of some vertices of a graph that are eliminated before all their other neighbors. These other neighbors
/// count in the degrees, so vertices at the boundary of the part are eliminated late (Pellegrini, Roman and Amestoy,
/// Concurrency: Pract. Exper. 12, 2000). `local` is as for [`Graph::part`]. The order contains places in `vertices`.
pub(super) fn order(graph: &Graph, vertices: &[u32], local: &mut [u32]) -> Vec<u32> {
    let size = vertices.len();
    let mut met = vertices.to_vec();
    for (place, &vertex) in vertices.iter().enumerate() {
        local[vertex as usize] = number(place);
    }
    for &vertex in vertices {
        for &neighbor in graph.neighbors(vertex) {
            if local[neighbor as usize] == NONE && met.len() < MOST {
                local[neighbor as usize] = number(met.len());
                met.push(neighbor);
            }
        }
    }
    let words = met.len().div_ceil(64);
    let mut near = vec![0_u64; size * words];
    for (near, &vertex) in near.chunks_exact_mut(words.max(1)).zip(vertices) {
        for &neighbor in graph.neighbors(vertex) {
            let bit = local[neighbor as usize];
            if bit != NONE {
                near[bit as usize / 64] |= 1 << (bit % 64);
            }
        }
    }
    for vertex in met {
        local[vertex as usize] = NONE;
    }
    eliminate(size, words, &mut near)
}

/// Minimum degree of the first `size` vertices, whose neighbors are sets of `words` words each.
fn eliminate(size: usize, words: usize, near: &mut [u64]) -> Vec<u32> {
    let count = |set: &[u64]| set.iter().map(|word| word.count_ones()).sum::<u32>();
    let mut degrees: Vec<u32> = near.chunks_exact(words.max(1)).map(count).collect();
    let mut order = Vec::with_capacity(size);
    let mut pivot = vec![0; words];
    for _ in 0..size {
        let Some(least) = (0..size).min_by_key(|&vertex| degrees[vertex]) else { break };
        degrees[least] = NONE;
        order.push(number(least));
        pivot.copy_from_slice(&near[least * words..][..words]);
        // The neighbors become neighbors of each other. Eliminated vertices are in no set.
        for word in 0..size.div_ceil(64) {
            let mut rest = pivot[word];
            while rest != 0 {
                let vertex = 64 * word + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                if vertex >= size {
                    break;
                }
                let set = &mut near[vertex * words..][..words];
                set.iter_mut().zip(&pivot).for_each(|(set, pivot)| *set |= pivot);
                set[vertex / 64] &= !(1 << (vertex % 64));
                set[least / 64] &= !(1 << (least % 64));
                degrees[vertex] = count(set);
            }
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_solver::quotient::Quotient;
    use crate::linear_solver::quotient::patterns::{chain, cube, pattern, strewn};
    use std::collections::BTreeSet;

    /// Degrees count the neighbors outside the part, and each pivot has the least.
    #[test]
    fn pivots_have_the_least_degree() {
        for (n, pairs) in [cube(5), (200, chain(200)), (150, strewn(150, 300, 9))] {
            let graph = Quotient::new(pattern(n, &pairs).as_ref(), &[]).unwrap().unwrap().graph;
            let vertices: Vec<u32> = (0..number(graph.size())).filter(|vertex| vertex % 3 != 1).take(90).collect();
            let mut local = vec![NONE; graph.size()];
            let order = order(&graph, &vertices, &mut local);
            assert!(local.iter().all(|&local| local == NONE));
            let mut near: Vec<BTreeSet<u32>> =
                (0..number(graph.size())).map(|vertex| graph.neighbors(vertex).iter().copied().collect()).collect();
            let mut left: BTreeSet<u32> = vertices.iter().copied().collect();
            for vertex in order.into_iter().map(|place| vertices[place as usize]) {
                let degree = |vertex: u32| near[vertex as usize].len();
                assert_eq!(degree(vertex), left.iter().map(|&vertex| degree(vertex)).min().unwrap());
                assert!(left.remove(&vertex));
                let later = std::mem::take(&mut near[vertex as usize]);
                for &next in &later {
                    near[next as usize].extend(&later);
                    near[next as usize].remove(&next);
                    near[next as usize].remove(&vertex);
                }
            }
            assert!(left.is_empty());
        }
    }

    #[test]
    fn what_touches_the_boundary_comes_late() {
        let graph = Quotient::new(pattern(60, &chain(60)).as_ref(), &[]).unwrap().unwrap().graph;
        // The front end of the chain: vertex 19 is connected to the rest.
        let part: Vec<u32> = (0..20).collect();
        let order = order(&graph, &part, &mut vec![NONE; 60]);
        assert_eq!((order[0], order[19]), (0, 19));
    }
}
