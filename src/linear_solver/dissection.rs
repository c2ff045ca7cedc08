//! Nested dissection: the vertices that separate two parts of a structure are eliminated after both parts, each of
//! which is ordered in the same way (George, SIAM J. Numer. Anal. 10, 1973).

mod coordinates;
mod leaf;
mod multilevel;
mod parts;
mod separator;

use super::graph::{Graph, NONE, number};
use super::minimum_degree::minimum_degree;
use super::quotient::Quotient;
use crate::error::Result;
use crate::threads;
use separator::{BETWEEN, Separator};

/// Parts of at most this many vertices are ordered by minimum degree.
const LEAF: usize = 64;

/// The smallest part, in vertices, that gets a thread of its own.
const GRAIN: usize = 2000;

/// The order of all vertices not eliminated last, by separators of the graph.
pub(super) fn by_graph(quotient: &Quotient) -> Result<Vec<u32>> {
    dissect(quotient, true, |part, _| multilevel::bisect(part))
}

/// The same by separators across the longest axis, from the coordinates of all dofs.
pub(super) fn by_coordinates(quotient: &Quotient, places: &[[f64; 3]]) -> Result<Vec<u32>> {
    let place = |&vertex: &u32| places[quotient.dofs(vertex)[0]];
    dissect(quotient, false, |part, names| coordinates::bisect(part, &names.iter().map(place).collect::<Vec<_>>()))
}

/// The part of each dof, with `count` parts of similar size (at least one); dofs with the same neighbors stay
/// together.
pub(super) fn parts(quotient: &Quotient, count: usize) -> Result<Vec<usize>> {
    let graph = &quotient.graph;
    let of_vertices = parts::parts(graph, count)?;
    let mut parts = vec![0; quotient.size()];
    for (vertex, part) in (0..).zip(of_vertices) {
        quotient.dofs(vertex).iter().for_each(|&dof| parts[dof] = part);
    }
    Ok(parts)
}

/// `bisect` receives connected parts of the graph with the names of their vertices; `weigh` is whether it reads edge
/// weights.
fn dissect(quotient: &Quotient, weigh: bool, bisect: impl Fn(&Graph, &[u32]) -> Separator + Sync) -> Result<Vec<u32>> {
    let whole = &quotient.graph;
    let mut local = vec![NONE; whole.size()];
    let interior: Vec<u32> = (0..number(whole.size())).filter(|&vertex| !quotient.is_last(vertex)).collect();
    let (sparse, dense) = without_dense(whole, interior);
    let mut part = whole.part(&sparse, &mut local)?;
    if weigh {
        part.weigh_edges();
    }
    let mut order = vec![0; sparse.len()];
    let dissection = Dissection { whole, bisect };
    dissection.pieces(&part, &sparse, part.components(), &mut order, &mut local)?;
    order.extend(dense);
    Ok(order)
}

/// Splits vertices into sparse and dense ones. Dense ones have so many neighbors that every separator would contain
/// them; they are eliminated last.
fn without_dense(graph: &Graph, vertices: Vec<u32>) -> (Vec<u32>, Vec<u32>) {
    let many = 10.0 * (vertices.len() as f64).sqrt().max(1.6);
    vertices.into_iter().partition(|&vertex| graph.neighbors(vertex).len() as f64 <= many)
}

/// A graph, and the function that bisects connected parts of it.
struct Dissection<'g, F> {
    whole: &'g Graph,
    bisect: F,
}

impl<F: Fn(&Graph, &[u32]) -> Separator + Sync> Dissection<'_, F> {
    /// Orders unconnected pieces of a part one after the other; `names` are the names of the part's vertices, `local`
    /// is scratch as for [`Graph::part`].
    fn pieces(
        &self,
        part: &Graph,
        names: &[u32],
        pieces: Vec<Vec<u32>>,
        mut order: &mut [u32],
        local: &mut [u32],
    ) -> Result<()> {
        let mut large = Vec::new();
        for piece in pieces {
            let (first, rest) = std::mem::take(&mut order).split_at_mut(piece.len());
            order = rest;
            match piece.len() < GRAIN {
                true => self.piece(part, names, &piece, first, local)?,
                false => large.push((piece, first)),
            }
        }
        // The order of a piece does not depend on the others.
        if let [(piece, order)] = &mut large[..] {
            return self.piece(part, names, piece, order, local);
        }
        threads::try_each(&mut large, &|(piece, order)| {
            self.piece(part, names, piece, order, &mut vec![NONE; self.whole.size()])
        })
    }

    /// Orders one piece.
    fn piece(&self, part: &Graph, names: &[u32], piece: &[u32], order: &mut [u32], local: &mut [u32]) -> Result<()> {
        let names: Vec<u32> = piece.iter().map(|&vertex| names[vertex as usize]).collect();
        let put = |order: &mut [u32], vertices: &[u32]| {
            order.iter_mut().zip(vertices).for_each(|(place, &vertex)| *place = names[vertex as usize]);
        };
        if piece.len() <= LEAF {
            put(order, &leaf::order(self.whole, &names, local));
            return Ok(());
        }
        let part = part.part(piece, local)?;
        let components = part.components();
        if components.len() > 1 {
            return self.pieces(&part, &names, components, order, local);
        }
        let separator = (self.bisect)(&part, &names);
        let [one, other, _] = separator.weights;
        if one.min(other) * 8 < one + other {
            // Too unequal for separators to help.
            put(order, &minimum_degree(part.pattern())?);
            return Ok(());
        }
        let [one, other, between] = [0, 1, BETWEEN].map(|label| separator.labeled(label));
        let (sides, last) = order.split_at_mut(one.len() + other.len());
        put(last, &between);
        self.pieces(&part, &names, vec![one, other], sides, local)
    }
}

#[cfg(test)]
mod tests {
    use super::separator::{grow, refine};
    use super::*;
    use crate::linear_solver::quotient::patterns::{chain, clique, cube, frame, pattern, strewn};

    #[test]
    fn orders_name_each_dof_once() {
        let two_chains: Vec<_> = chain(400).into_iter().filter(|&(i, _)| i != 170).collect();
        let cliques = [clique(0, 30), clique(30, 90), clique(90, 100)].concat();
        let (cube_size, cube) = cube(6);
        let cases = [
            (0, vec![]),
            (1, vec![]),
            (700, vec![]),
            (500, chain(500)),
            (400, two_chains),
            (100, cliques),
            (900, (1..900).map(|i| (0, i)).collect()),
            (900, (2..900).flat_map(|i| [(0, i), (1, i)]).collect()),
            (cube_size, cube),
            frame(600),
            (500, strewn(500, 400, 1)),
            (500, strewn(500, 1500, 2)),
            (500, strewn(500, 9000, 3)),
        ];
        for (n, pairs) in cases {
            let pattern = pattern(n, &pairs);
            let places: Vec<[f64; 3]> = (0..n).map(|i| [(i % 7) as f64, (i % 11) as f64, (i / 77) as f64]).collect();
            let side: Vec<usize> = (0..n / 5).collect();
            for last in [vec![], side, (0..n).step_by(3).collect(), (0..n).collect()] {
                let quotient = Quotient::new(pattern.as_ref(), &last).unwrap().unwrap();
                for vertices in [by_graph(&quotient).unwrap(), by_coordinates(&quotient, &places).unwrap()] {
                    let mut order = quotient.expanded(&vertices);
                    order.extend(&last);
                    order.sort_unstable();
                    assert!(order.into_iter().eq(0..n), "{n} dofs, {} pairs, {} last", pairs.len(), last.len());
                }
            }
        }
    }

    #[test]
    fn orders_are_the_same_in_every_run() {
        let (n, pairs) = cube(7);
        let pattern = pattern(n, &pairs);
        let order = || by_graph(&Quotient::new(pattern.as_ref(), &[1]).unwrap().unwrap()).unwrap();
        assert_eq!(order(), order());
    }

    fn check_separates(graph: &Graph, separator: &Separator) {
        let mut weights = [0; 3];
        for (vertex, &label) in (0..).zip(&separator.label) {
            weights[usize::from(label)] += i64::from(graph.weight(vertex));
            let crosses = |&next: &u32| label != BETWEEN && separator.label[next as usize] == 1 - label;
            assert!(!graph.neighbors(vertex).iter().any(crosses), "vertex {vertex}");
        }
        assert_eq!(weights, separator.weights);
    }

    #[test]
    fn separators_separate_and_refinement_makes_them_lighter() {
        for (n, pairs) in [cube(8), (600, strewn(600, 900, 5)), (300, chain(300))] {
            let graph = Quotient::new(pattern(n, &pairs).as_ref(), &[]).unwrap().unwrap().graph;
            let largest = graph.components().into_iter().max_by_key(Vec::len).unwrap();
            let graph = graph.part(&largest, &mut vec![NONE; graph.size()]).unwrap();
            for seed in [0, graph.size() / 3, graph.size() - 1] {
                let grown = grow(&graph, number(seed));
                check_separates(&graph, &grown);
                let refined = refine(&graph, grown.clone());
                check_separates(&graph, &refined);
                assert!(refined.cost() <= grown.cost());
            }
            check_separates(&graph, &multilevel::bisect(&graph));
        }
    }

    #[test]
    fn a_cube_is_cut_into_halves_by_a_plane() {
        for side in [9, 12, 15, 24] {
            let (n, pairs) = cube(side);
            let mut graph = Quotient::new(pattern(n, &pairs).as_ref(), &[]).unwrap().unwrap().graph;
            graph.weigh_edges();
            let separator = multilevel::bisect(&graph);
            check_separates(&graph, &separator);
            let [one, other, between] = separator.weights;
            let plane = 3 * i64::try_from(side * side).unwrap();
            assert!(10 * between <= 11 * plane, "{side}: {between} for {plane}");
            assert!(100 * one.max(other) <= 57 * graph.total(), "{side}: {one} and {other}");
        }
    }
}
