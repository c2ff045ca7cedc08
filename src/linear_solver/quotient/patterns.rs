//! Patterns for the tests of elimination orders.

use faer::sparse::SymbolicSparseColMat;

/// The pattern with these pairs, both triangles.
pub(in crate::linear_solver) fn pattern(n: usize, pairs: &[(usize, usize)]) -> SymbolicSparseColMat<usize> {
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

pub(in crate::linear_solver) fn chain(n: usize) -> Vec<(usize, usize)> {
    (1..n).map(|i| (i - 1, i)).collect()
}

pub(in crate::linear_solver) fn clique(from: usize, to: usize) -> Vec<(usize, usize)> {
    (from..to).flat_map(|i| (from..i).map(move |j| (j, i))).collect()
}

/// A cube of nodes, each with 27 neighbors including itself and three dofs.
pub(in crate::linear_solver) fn cube(side: usize) -> (usize, Vec<(usize, usize)>) {
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

/// Pairs by a linear congruential generator (Knuth's MMIX); the package has the tests of this file, but no crate for
/// random numbers.
pub(in crate::linear_solver) fn strewn(n: usize, pairs: usize, mut state: u64) -> Vec<(usize, usize)> {
    let mut dof = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(state >> 33).unwrap() % n
    };
    (0..pairs).map(|_| (dof(), dof())).collect()
}

/// A frame of beams: a sequence of nodes, in which each fifth has one dof (a hinge) and the others three. Every
/// seventh is tied to its predecessor by its first dof only.
pub(in crate::linear_solver) fn frame(nodes: usize) -> (usize, Vec<(usize, usize)>) {
    let mut pairs = Vec::new();
    let (mut n, mut before) = (0, 0..0);
    for node in 0..nodes {
        let dofs = n..n + if node % 5 == 4 { 1 } else { 3 };
        n = dofs.end;
        pairs.extend(clique(dofs.start, dofs.end));
        let tied = if node % 7 == 6 { 1 } else { 3 };
        let ties = before.clone().take(tied).flat_map(|i| dofs.clone().take(tied).map(move |j| (i, j)));
        pairs.extend(ties);
        before = dofs;
    }
    (n, pairs)
}
