//! Parts of a structure with similar weights, by the same separators: pieces far smaller than a part, assigned to
//! parts in the order of the dissection tree.

use super::multilevel;
use super::separator::BETWEEN;
use crate::error::Result;
use crate::linear_solver::graph::{Graph, NONE, number};

/// Pieces per part. Pieces are compact, and neighbors in the tree are usually neighbors in space. So parts are as
/// compact as their largest pieces, and their weights differ by the smallest ones.
const PIECES: i64 = 32;

/// The part of each vertex.
pub(super) fn parts(graph: &Graph, count: usize) -> Result<Vec<usize>> {
    let many = i64::try_from(count).unwrap_or(i64::MAX);
    let mut pieces = Pieces { largest: graph.total() / many.saturating_mul(PIECES), order: Vec::new() };
    let mut whole = graph.clone();
    whole.weigh_edges();
    pieces.cut(&whole, &(0..number(graph.size())).collect::<Vec<_>>())?;
    let (total, mut before) = (graph.total() as f64, 0.0);
    let mut parts = vec![0; graph.size()];
    for vertex in pieces.order {
        let weight = f64::from(graph.weight(vertex));
        // The part in which the middle of the vertex lies.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the number of parts")]
        let part = ((before + 0.5 * weight) / total * count as f64) as usize;
        parts[vertex as usize] = part.min(count - 1);
        before += weight;
    }
    Ok(parts)
}

struct Pieces {
    /// Parts of at most this weight are not cut.
    largest: i64,
    /// Vertices, piece by piece.
    order: Vec<u32>,
}

impl Pieces {
    /// Cuts a part of the graph, whose vertices have these names, recursively into halves.
    fn cut(&mut self, part: &Graph, names: &[u32]) -> Result<()> {
        if part.total() <= self.largest || part.size() < 2 {
            self.order.extend(names);
            return Ok(());
        }
        let mut local = vec![NONE; part.size()];
        let mut sides = part.components();
        if sides.len() == 1 {
            let separator = multilevel::bisect(part);
            sides = [0, 1].map(|side| separator.labeled(side)).to_vec();
            if sides.iter().any(Vec::is_empty) {
                // All vertices are neighbors.
                self.order.extend(names);
                return Ok(());
            }
            // The separator is added to the lighter side.
            let [one, other, _] = separator.weights;
            sides[usize::from(other < one)].extend(separator.labeled(BETWEEN));
        }
        for side in sides {
            let names: Vec<u32> = side.iter().map(|&vertex| names[vertex as usize]).collect();
            self.cut(&part.part(&side, &mut local)?, &names)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_solver::quotient::Quotient;
    use crate::linear_solver::quotient::patterns::{chain, clique, cube, pattern, strewn};

    fn weights(graph: &Graph, parts: &[usize], count: usize) -> Vec<i64> {
        let mut weights = vec![0; count];
        (0..).zip(parts).for_each(|(vertex, &part)| weights[part] += i64::from(graph.weight(vertex)));
        weights
    }

    /// Number of edges between vertices of different parts.
    fn cut(graph: &Graph, parts: &[usize]) -> usize {
        let crossing = |(vertex, part): (u32, &usize)| {
            graph.neighbors(vertex).iter().filter(|&&next| parts[next as usize] != *part).count()
        };
        (0..).zip(parts).map(crossing).sum::<usize>() / 2
    }

    #[test]
    fn parts_weigh_alike() {
        let (size, cube) = cube(8);
        let two = [clique(0, 30), clique(30, 90)].concat();
        let cases =
            [(size, cube), (500, chain(500)), (90, two), (400, strewn(400, 900, 3)), (60, vec![]), (3, chain(3))];
        for (n, pairs) in cases {
            let graph = Quotient::new(pattern(n, &pairs).as_ref(), &[]).unwrap().unwrap().graph;
            let heaviest = (0..number(graph.size())).map(|vertex| i64::from(graph.weight(vertex))).max().unwrap();
            for count in [1, 2, 3, 5, 8] {
                let parts = parts(&graph, count).unwrap();
                assert!(parts.iter().all(|&part| part < count));
                let even = graph.total() / i64::try_from(count).unwrap();
                let weights = weights(&graph, &parts, count);
                assert!(weights.iter().all(|weight| (weight - even).abs() <= heaviest), "{n}: {weights:?}");
            }
        }
    }

    /// A chain in p parts has at least p − 1 edges between them, and two more for each piece apart from the rest of
    /// its part: at most the pieces along one path of the tree.
    #[test]
    fn few_edges_join_parts() {
        for count in [2, 3, 7] {
            let graph = Quotient::new(pattern(700, &chain(700)).as_ref(), &[]).unwrap().unwrap().graph;
            let cut = cut(&graph, &parts(&graph, count).unwrap());
            assert!(cut >= count - 1 && cut <= 5 * count, "{cut} for {count} parts");
        }
        // Slabs of a cube: a plane of edges, nine per node (fewer at the rim), times the number of cuts.
        for (side, count) in [(8, 2), (12, 2), (12, 3), (12, 4), (12, 8)] {
            let (n, pairs) = cube(side);
            let graph = Quotient::new(pattern(n, &pairs).as_ref(), &[]).unwrap().unwrap().graph;
            let plane = (3 * side - 2_usize).pow(2);
            let cut = cut(&graph, &parts(&graph, count).unwrap());
            let slabs = (count - 1) * plane;
            let most = if count.is_power_of_two() { slabs } else { 2 * slabs };
            assert!(cut <= most, "{cut} edges are cut of {side}³ nodes in {count} parts, {plane} by a plane");
        }
    }
}
