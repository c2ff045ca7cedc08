//! Nested dissection: what separates two parts of a structure is eliminated after both, each of which is ordered in the
//! same way (George, SIAM J. Numer. Anal. 10, 1973).

mod coordinates;
mod graph;
mod multilevel;
mod separator;

use super::minimum_degree::minimum_degree;
use crate::error::Result;
use faer::sparse::SymbolicSparseColMatRef;
use graph::{Graph, Quotient};
use multilevel::Random;
use separator::{BETWEEN, Separator};

/// Parts of at most this many nodes are ordered by minimum degree.
const LEAF: usize = 8;

/// The order of all dofs but those of `last`, by separators of the graph; nothing for a pattern that is not symmetric.
pub(super) fn by_graph(pattern: SymbolicSparseColMatRef<'_, usize>, last: &[usize]) -> Result<Option<Vec<usize>>> {
    let Some(mut quotient) = Quotient::new(pattern, last) else { return Ok(None) };
    quotient.graph.weigh_edges();
    let mut random = Random::new();
    let vertices = dissect(&quotient.graph, |part, _| multilevel::bisect(part, &mut random))?;
    Ok(Some(quotient.expanded(&vertices)))
}

/// The same by separators across the longest axis, from the coordinates of all dofs.
pub(super) fn by_coordinates(
    pattern: SymbolicSparseColMatRef<'_, usize>,
    last: &[usize],
    places: &[[f64; 3]],
) -> Result<Option<Vec<usize>>> {
    let Some(quotient) = Quotient::new(pattern, last) else { return Ok(None) };
    let place = |&vertex: &usize| places[quotient.dofs(vertex)[0]];
    let bisect =
        |part: &Graph, names: &[usize]| coordinates::bisect(part, &names.iter().map(place).collect::<Vec<_>>());
    let vertices = dissect(&quotient.graph, bisect)?;
    Ok(Some(quotient.expanded(&vertices)))
}

/// An order of the vertices of a graph; `bisect` gets connected parts of it with the names of their vertices.
fn dissect(graph: &Graph, mut bisect: impl FnMut(&Graph, &[usize]) -> Separator) -> Result<Vec<usize>> {
    let mut local = vec![usize::MAX; graph.size()];
    let (sparse, dense) = without_dense(graph);
    let mut order = vec![0; sparse.len()];
    // Parts still to be ordered: graph, names of its vertices, first place in the order.
    let mut parts = vec![(graph.part(&sparse, &mut local), sparse, 0)];
    while let Some((part, names, start)) = parts.pop() {
        // Writes vertices of the part into the last places that it has left.
        let mut end = start + names.len();
        let mut put = |vertices: &[usize]| {
            end -= vertices.len();
            for (place, &vertex) in order[end..].iter_mut().zip(vertices) {
                *place = names[vertex];
            }
        };
        if part.size() <= LEAF {
            put(&minimum_degree(part.pattern())?);
            continue;
        }
        let mut pieces = part.components();
        if pieces.len() == 1 {
            let separator = bisect(&part, &names);
            let [one, other, _] = separator.weights;
            if one.min(other) * 8 < one + other {
                // So unequal that separators gain nothing.
                put(&minimum_degree(part.pattern())?);
                continue;
            }
            let all = |label| (0..part.size()).filter(|&vertex| separator.label[vertex] == label).collect::<Vec<_>>();
            put(&all(BETWEEN));
            pieces = vec![all(0), all(1)];
        } else {
            // Small pieces are ordered together.
            let (small, large): (Vec<_>, Vec<_>) = pieces.into_iter().partition(|piece| piece.len() <= LEAF);
            let crumbs = small.concat();
            let order = minimum_degree(part.part(&crumbs, &mut local).pattern())?;
            put(&order.into_iter().map(|vertex| crumbs[vertex]).collect::<Vec<_>>());
            pieces = large;
        }
        let mut first = start;
        for piece in pieces {
            let names = piece.iter().map(|&vertex| names[vertex]).collect();
            parts.push((part.part(&piece, &mut local), names, first));
            first += piece.len();
        }
    }
    order.extend(dense);
    Ok(order)
}

/// The vertices of a graph, and those with so many neighbors that every separator would contain them: they are
/// eliminated last.
fn without_dense(graph: &Graph) -> (Vec<usize>, Vec<usize>) {
    let n = graph.size();
    let many = 10.0 * (n as f64).sqrt().max(1.6);
    (0..n).partition(|&vertex| graph.neighbors(vertex).len() as f64 <= many)
}

#[cfg(test)]
mod tests {
    use super::separator::{grow, refine};
    use super::*;
    use faer::sparse::SymbolicSparseColMat;

    /// The pattern with these pairs, both triangles.
    fn pattern(n: usize, pairs: &[(usize, usize)]) -> SymbolicSparseColMat<usize> {
        let mut columns: Vec<Vec<usize>> = (0..n).map(|i| vec![i]).collect();
        for &(i, j) in pairs {
            columns[i].push(j);
            columns[j].push(i);
        }
        let mut starts = vec![0];
        for column in &mut columns {
            column.sort_unstable();
            column.dedup();
            starts.push(starts[starts.len() - 1] + column.len());
        }
        SymbolicSparseColMat::new_checked(n, n, starts, None, columns.concat())
    }

    fn chain(n: usize) -> Vec<(usize, usize)> {
        (1..n).map(|i| (i - 1, i)).collect()
    }

    fn clique(from: usize, to: usize) -> Vec<(usize, usize)> {
        (from..to).flat_map(|i| (from..i).map(move |j| (j, i))).collect()
    }

    /// A cube of nodes with 27 neighbors each, the node itself included, and three dofs a node.
    fn cube(side: usize) -> (usize, Vec<(usize, usize)>) {
        let node = |x: usize, y: usize, z: usize| x + side * (y + side * z);
        let near = |x: usize| x.saturating_sub(1)..(x + 2).min(side);
        let mut pairs = Vec::new();
        for (x, y, z) in (0..side.pow(3)).map(|i| (i % side, i / side % side, i / side / side)) {
            for (a, b, c) in near(x).flat_map(|a| near(y).flat_map(move |b| near(z).map(move |c| (a, b, c)))) {
                let (one, other) = (3 * node(x, y, z), 3 * node(a, b, c));
                pairs.extend((0..9).map(|k| (one + k / 3, other + k % 3)));
            }
        }
        (3 * side.pow(3), pairs)
    }

    /// Pairs by a linear congruential generator (Knuth's MMIX): the package has the tests of this file, but no crate for
    /// them.
    fn strewn(n: usize, pairs: usize, mut state: u64) -> Vec<(usize, usize)> {
        let mut dof = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            usize::try_from(state >> 33).unwrap() % n
        };
        (0..pairs).map(|_| (dof(), dof())).collect()
    }

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
            (500, strewn(500, 400, 1)),
            (500, strewn(500, 1500, 2)),
            (500, strewn(500, 9000, 3)),
        ];
        for (n, pairs) in cases {
            let pattern = pattern(n, &pairs);
            let places: Vec<[f64; 3]> = (0..n).map(|i| [(i % 7) as f64, (i % 11) as f64, (i / 77) as f64]).collect();
            let side: Vec<usize> = (0..n / 5).collect();
            for last in [vec![], side, (0..n).step_by(3).collect(), (0..n).collect()] {
                let orders = [
                    by_graph(pattern.as_ref(), &last).unwrap().unwrap(),
                    by_coordinates(pattern.as_ref(), &last, &places).unwrap().unwrap(),
                ];
                for mut order in orders {
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
        assert_eq!(by_graph(pattern.as_ref(), &[1]).unwrap(), by_graph(pattern.as_ref(), &[1]).unwrap());
    }

    #[test]
    fn dofs_of_a_node_are_one_vertex() {
        let (n, pairs) = cube(4);
        let pattern = pattern(n, &pairs);
        let whole = Quotient::new(pattern.as_ref(), &[]).unwrap();
        assert_eq!((whole.graph.size(), whole.graph.total()), (64, 192));
        // A node of which some dofs are left, and one of which none are.
        let part = Quotient::new(pattern.as_ref(), &[0, 3, 4, 5]).unwrap();
        assert_eq!((part.graph.size(), part.graph.total(), part.graph.weight(0)), (63, 188, 2));
        assert_eq!(part.dofs(0), [1, 2]);
    }

    #[test]
    fn one_sided_patterns_have_no_graph() {
        let one_sided = SymbolicSparseColMat::new_checked(2, 2, vec![0, 2, 3], None, vec![0, 1, 1]);
        assert!(Quotient::new(one_sided.as_ref(), &[]).is_none());
    }

    fn check_separates(graph: &Graph, separator: &Separator) {
        let mut weights = [0; 3];
        for vertex in 0..graph.size() {
            let label = separator.label[vertex];
            weights[label] += graph.weight(vertex);
            let crosses = |&next: &usize| label != BETWEEN && separator.label[next] == 1 - label;
            assert!(!graph.neighbors(vertex).iter().any(crosses), "vertex {vertex}");
        }
        assert_eq!(weights, separator.weights);
    }

    #[test]
    fn separators_separate_and_refinement_makes_them_lighter() {
        let mut random = Random::new();
        for (n, pairs) in [cube(8), (600, strewn(600, 900, 5)), (300, chain(300))] {
            let graph = Quotient::new(pattern(n, &pairs).as_ref(), &[]).unwrap().graph;
            let largest = graph.components().into_iter().max_by_key(Vec::len).unwrap();
            let graph = graph.part(&largest, &mut vec![usize::MAX; graph.size()]);
            for seed in [0, graph.size() / 3, graph.size() - 1] {
                let grown = grow(&graph, seed);
                check_separates(&graph, &grown);
                let refined = refine(&graph, grown.clone());
                check_separates(&graph, &refined);
                assert!(refined.cost() <= grown.cost());
            }
            check_separates(&graph, &multilevel::bisect(&graph, &mut random));
        }
    }

    #[test]
    fn a_cube_is_cut_into_halves_by_a_plane() {
        for side in [9, 12, 15] {
            let (n, pairs) = cube(side);
            let mut graph = Quotient::new(pattern(n, &pairs).as_ref(), &[]).unwrap().graph;
            graph.weigh_edges();
            let separator = multilevel::bisect(&graph, &mut Random::new());
            check_separates(&graph, &separator);
            let [one, other, between] = separator.weights;
            let plane = 3 * i64::try_from(side * side).unwrap();
            assert!(10 * between <= 11 * plane, "{side}: {between} for {plane}");
            assert!(100 * one.max(other) <= 57 * graph.total(), "{side}: {one} and {other}");
        }
    }
}
