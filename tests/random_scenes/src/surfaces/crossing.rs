//! Whether facets of a scene have gone through each other: edges through triangles, in the plane sides through sides.

use contact_dynamics::contact::Facet;
use contact_dynamics_scenes::vectors::{along, cross, dot, minus, norm};

/// Two facets without a common node that cross, if there are any, after their nodes have been moved by `depth` against
/// the mean of the normals around them.
pub(super) fn crossing<const D: usize>(facets: &[Facet], positions: &[[f64; D]], depth: f64) -> Option<[usize; 2]> {
    let places: Vec<[f64; 3]> =
        positions.iter().map(|x| std::array::from_fn(|axis| x.get(axis).copied().unwrap_or(0.0))).collect();
    let mut outward = vec![[0.0; 3]; places.len()];
    for facet in facets {
        let normal = scaled(normal(facet, &places), 1.0);
        facet.nodes().iter().for_each(|&node| outward[node] = along(outward[node], 1.0, normal));
    }
    let pulled: Vec<_> = places.iter().zip(&outward).map(|(&x, &n)| along(x, 1.0, scaled(n, -depth))).collect();
    let touch = |one: &Facet, other: &Facet| one.nodes().iter().any(|node| other.nodes().contains(node));
    for (one, facet) in facets.iter().enumerate() {
        for (other, against) in facets.iter().enumerate().filter(|(_, against)| !touch(facet, against)) {
            if meets(facet, against, &pulled, D) {
                return Some([one, other]);
            }
        }
    }
    None
}

/// Whether a side of the first facet goes through the second one.
fn meets(facet: &Facet, against: &Facet, at: &[[f64; 3]], space: usize) -> bool {
    let (nodes, others) = (facet.nodes(), against.nodes());
    let mut sides = (0..nodes.len()).map(|k| [nodes[k], nodes[(k + 1) % nodes.len()]].map(|node| at[node]));
    if space == 2 {
        let [c, d] = [at[others[0]], at[others[1]]];
        let turn = |x: [f64; 3], y: [f64; 3], z: [f64; 3]| cross(minus(y, x), minus(z, x))[2];
        return sides.any(|[a, b]| turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0);
    }
    sides.any(|[p, q]| {
        (1..others.len() - 1).any(|k| {
            let [a, b, c] = [others[0], others[k], others[k + 1]].map(|node| at[node]);
            let volume = |x, y, z, w| dot(minus(y, x), cross(minus(z, x), minus(w, x)));
            let turns = [volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)];
            volume(p, a, b, c) * volume(q, a, b, c) < 0.0
                && (turns.iter().all(|turn| *turn > 0.0) || turns.iter().all(|turn| *turn < 0.0))
        })
    })
}

/// The outward normal of a facet, from its diagonals; in the plane bodies lie on the left.
fn normal(facet: &Facet, at: &[[f64; 3]]) -> [f64; 3] {
    match *facet.nodes() {
        [a, b] => cross(minus(at[b], at[a]), [0.0, 0.0, 1.0]),
        [a, b, c] => cross(minus(at[b], at[a]), minus(at[c], at[a])),
        [a, b, c, d] => cross(minus(at[c], at[a]), minus(at[d], at[b])),
        _ => [0.0; 3],
    }
}

/// A vector of this length in the direction of another one.
fn scaled(x: [f64; 3], length: f64) -> [f64; 3] {
    let share = length / norm(x);
    if share.is_finite() { x.map(|x| share * x) } else { [0.0; 3] }
}
