//! Separators from the graph alone: computed on a coarsened graph and refined on each finer one.

use super::separator::{Separator, grow, refine};
use crate::linear_solver::graph::{Graph, NONE, number};

/// Number of vertices at which coarsening ends.
const COARSEST: usize = 50;

/// Total weight divided by the largest weight of a coarse vertex.
const HEAVIEST: i64 = 33;

/// Number of start vertices of the coarsest graph from which a side is grown.
const STARTS: usize = 5;

/// Pseudo-random numbers, the same in every run (xorshift of Marsaglia, J. Stat. Softw. 8, 2003).
struct Random(u64);

impl Random {
    fn new(attempt: u64) -> Self {
        Self(0x9e37_79b9_7f4a_7c15 ^ (attempt << 20))
    }

    /// A number below `bound`, which is not zero.
    fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from((self.0 >> 11) % bound as u64).unwrap_or(0)
    }

    fn shuffle(&mut self, items: &mut [u32]) {
        for k in (1..items.len()).rev() {
            items.swap(k, self.below(k + 1));
        }
    }
}

/// Graphs with more vertices are bisected twice, and the lighter separator is used: a slightly too heavy one
/// increases fill there, which costs more time than a second attempt.
const LARGE: usize = 10_000;

/// A separator of a connected graph (Karypis and Kumar, SIAM J. Sci. Comput. 20, 1998).
pub(super) fn bisect(graph: &Graph) -> Separator {
    let first = bisect_by(graph, &mut Random::new(0));
    if graph.size() <= LARGE {
        return first;
    }
    let second = bisect_by(graph, &mut Random::new(1));
    if second.cost() < first.cost() { second } else { first }
}

/// One attempt.
fn bisect_by(graph: &Graph, random: &mut Random) -> Separator {
    let heaviest = 1 + graph.total() / HEAVIEST;
    let mut levels: Vec<(Graph, Vec<u32>)> = Vec::new();
    loop {
        let finest = levels.last().map_or(graph, |(graph, _)| graph);
        if finest.size() <= COARSEST {
            break;
        }
        let Some(level) = coarsen(finest, heaviest, random) else { break };
        levels.push(level);
    }
    let coarsest = levels.last().map_or(graph, |(graph, _)| graph);
    let starts = (0..STARTS).map(|k| refine(coarsest, grow(coarsest, number(k * coarsest.size() / STARTS))));
    let best = starts.min_by_key(Separator::cost);
    let mut separator = best.unwrap_or_else(|| Separator::new(graph, Vec::new()));
    while let Some((_, coarse)) = levels.pop() {
        let finer = levels.last().map_or(graph, |(graph, _)| graph);
        separator = refine(finer, separator.projected(&coarse));
    }
    separator
}

/// A smaller graph, with vertices joined in pairs along the heaviest edges, and for each vertex the coarse vertex
/// that contains it; `None` if hardly any pair has a weight of at most `heaviest`.
fn coarsen(graph: &Graph, heaviest: i64, random: &mut Random) -> Option<(Graph, Vec<u32>)> {
    let n = graph.size();
    // If visited in order of their numbers, the vertices of a regular mesh would all be paired along one axis.
    let mut visits: Vec<u32> = (0..number(n)).collect();
    random.shuffle(&mut visits);
    let mut coarse = vec![NONE; n];
    let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(n / 2 + 1);
    for vertex in visits {
        if coarse[vertex as usize] != NONE {
            continue;
        }
        let room = heaviest - i64::from(graph.weight(vertex));
        let mut best = (0, vertex);
        for (neighbor, edges) in graph.edges(vertex) {
            if edges > best.0 && coarse[neighbor as usize] == NONE && i64::from(graph.weight(neighbor)) <= room {
                best = (edges, neighbor);
            }
        }
        coarse[vertex as usize] = number(pairs.len());
        coarse[best.1 as usize] = number(pairs.len());
        pairs.push((vertex, best.1));
    }
    if pairs.len() * 20 > n * 19 {
        return None;
    }
    let mut joined = Graph::smaller();
    let mut place = vec![(NONE, 0); pairs.len()];
    for (name, &(one, other)) in (0_u32..).zip(&pairs) {
        let both = if one == other { &[one][..] } else { &[one, other][..] };
        for &vertex in both {
            for (neighbor, edges) in graph.edges(vertex) {
                let to = coarse[neighbor as usize];
                match place[to as usize] {
                    _ if to == name => {}
                    (seen, at) if seen == name => joined.thicken(at, edges),
                    _ => place[to as usize] = (name, joined.push(to, edges)),
                }
            }
        }
        joined.close(both.iter().map(|&vertex| graph.weight(vertex)).sum());
    }
    Some((joined, coarse))
}
