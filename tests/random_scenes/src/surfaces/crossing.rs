//! Whether facets of a scene have gone through each other: edges through triangles, in the plane sides through sides.

use contact_dynamics::contact::Facet;
use contact_dynamics_scenes::vectors::{along, cross, dot, minus, norm};

/// The share of the size of two facets, squared in the plane and cubed in space, below which a turn is rounding.
const ROUNDING: f64 = 1e-12;

/// Two facets without a common node that cross, if there are any, after the surface has been pulled into its body by
/// `depth`, as [`NonPenetration`](contact_dynamics::contact::NonPenetration) pulls it: nodes move against the mean of
/// the normals around them, and facets by the depth.
pub(super) fn crossing<const D: usize>(facets: &[Facet], positions: &[[f64; D]], depth: f64) -> Option<[usize; 2]> {
    let places: Vec<[f64; 3]> =
        positions.iter().map(|x| std::array::from_fn(|axis| x.get(axis).copied().unwrap_or(0.0))).collect();
    let mut outward = vec![[0.0; 3]; places.len()];
    let mut slopes = vec![1.0_f64; places.len()];
    let normals: Vec<_> = facets.iter().map(|facet| scaled(normal(facet, &places), 1.0)).collect();
    let around =
        || facets.iter().zip(&normals).flat_map(|(facet, n)| facet.nodes().iter().map(move |&node| (node, *n)));
    around().for_each(|(node, normal)| outward[node] = along(outward[node], 1.0, normal));
    around().for_each(|(node, normal)| slopes[node] = slopes[node].min(dot(scaled(outward[node], 1.0), normal)));
    let ways = outward.iter().zip(&slopes).map(|(&outward, slope)| scaled(outward, -depth / slope.max(0.5)));
    let pulled: Vec<_> = places.iter().zip(ways).map(|(&x, way)| along(x, 1.0, way)).collect();
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
    let from = at[nodes[0]];
    let size = nodes.iter().chain(others).fold(0.0_f64, |most, &node| most.max(norm(minus(at[node], from))));
    // For facets in one plane every turn is rounding.
    let sign = |turn: f64| if turn.abs() <= ROUNDING * size.powi(space as i32) { 0.0 } else { turn.signum() };
    if space == 2 {
        let [c, d] = [at[others[0]], at[others[1]]];
        let turn = |x: [f64; 3], y: [f64; 3], z: [f64; 3]| sign(cross(minus(y, x), minus(z, x))[2]);
        return sides.any(|[a, b]| turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0);
    }
    sides.any(|[p, q]| {
        (1..others.len() - 1).any(|k| {
            let [a, b, c] = [others[0], others[k], others[k + 1]].map(|node| at[node]);
            let turn = |x, y, z, w| sign(dot(minus(y, x), cross(minus(z, x), minus(w, x))));
            let turns = turn(p, q, a, b) + turn(p, q, b, c) + turn(p, q, c, a);
            turn(p, a, b, c) * turn(q, a, b, c) < 0.0 && turns.abs() > 2.5
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
