//! How far a part can fall before it touches what is below it.

use crate::mesh::{Mesh, cross, dot, minus};

/// Onto a plane through the origin.
pub fn above_plane(mesh: &Mesh, normal: [f64; 3]) -> Option<f64> {
    least(mesh.nodes.iter().map(|x| dot(x, &normal) / normal[2]))
}

/// Onto a ball whose top is the origin: of nodes, as contact is.
pub fn above_ball(mesh: &Mesh, radius: f64) -> Option<f64> {
    let height = |x: &[f64; 3]| {
        let square = radius * radius - x[0] * x[0] - x[1] * x[1];
        (square > 0.0).then(|| x[2] + radius - square.sqrt())
    };
    least(mesh.nodes.iter().filter_map(height))
}

/// Onto another part: nodes of either onto facets of the other.
pub fn above_part(mesh: &Mesh, base: &Mesh) -> Option<f64> {
    least(down(mesh, base, 1.0).into_iter().chain(down(base, mesh, -1.0)))
}

/// The least of the distances from nodes of `upper` down (`sign` 1) or up (−1) to facets of `lower`.
fn down(upper: &Mesh, lower: &Mesh, sign: f64) -> Option<f64> {
    let facets = lower.boundary();
    // Facets cut into triangles, those that look toward the nodes.
    let triangles = facets.iter().flat_map(|f| (2..f.len()).map(|k| [f[0], f[k - 1], f[k]].map(|n| lower.nodes[n])));
    let triangles: Vec<_> = triangles.filter(|[a, b, c]| sign * cross(minus(*b, *a), minus(*c, *a))[2] > 0.0).collect();
    let mut nodes: Vec<usize> = upper.boundary().concat();
    nodes.sort_unstable();
    nodes.dedup();
    let gap = |node: usize| {
        let x = upper.nodes[node];
        least(triangles.iter().filter_map(|triangle| height_over(triangle, x)).map(|height| sign * height))
    };
    least(nodes.into_iter().filter_map(gap))
}

/// The height of a point over a triangle, if it is above or below it.
fn height_over([a, b, c]: &[[f64; 3]; 3], x: [f64; 3]) -> Option<f64> {
    let flat = |p: [f64; 3], q: [f64; 3]| (p[0] - x[0]) * (q[1] - x[1]) - (p[1] - x[1]) * (q[0] - x[0]);
    let [u, v, w] = [flat(*b, *c), flat(*c, *a), flat(*a, *b)];
    let area = u + v + w;
    let inside = [u, v, w].iter().all(|part| part / area >= 0.0);
    inside.then(|| x[2] - (u * a[2] + v * b[2] + w * c[2]) / area)
}

fn least(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    values.into_iter().reduce(f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Element, Shape};

    /// A unit cube of one element with its lower corner at `at`.
    fn cube(at: [f64; 3]) -> Mesh {
        let corner =
            |k: usize| [f64::from(u8::from(matches!(k % 4, 1 | 2))), f64::from(u8::from(k % 4 > 1)), (k / 4) as f64];
        let nodes = (0..8).map(corner).map(|x| [0, 1, 2].map(|i| x[i] + at[i])).collect();
        let corners = [0, 1, 2, 3, 4, 5, 6, 7];
        Mesh { nodes, elements: vec![Element { shape: Shape::Hexahedron, corners, tag: 1 }] }
    }

    #[test]
    fn clearances_are_those_of_the_shapes() {
        let block = cube([-0.5, -0.5, 0.3]);
        assert_eq!(above_plane(&block, [0.0, 0.0, 1.0]), Some(0.3));
        // A slope of 45°, downhill along x: the corner uphill comes first.
        let s = 0.5_f64.sqrt();
        assert!((above_plane(&block, [s, 0.0, s]).unwrap() - (0.3 - 0.5)).abs() < 1e-15);
        // A ball of radius 1: corners at a distance of √½ from the axis.
        assert!((above_ball(&block, 1.0).unwrap() - (1.3 - 0.5_f64.sqrt())).abs() < 1e-15);
        assert_eq!(above_ball(&block, 0.7), None);
        // A cube on a cube, beside it, and across its edge.
        let base = cube([0.0, 0.0, -1.5]);
        assert!((above_part(&block, &base).unwrap() - 0.8).abs() < 1e-15);
        assert_eq!(above_part(&cube([1.01, 0.0, 0.0]), &base), None);
        let mut small = cube([0.2, 0.2, 0.0]);
        small.nodes.iter_mut().for_each(|x| *x = x.map(|x| 0.3 * x));
        assert!((above_part(&small, &base).unwrap() - 0.5).abs() < 1e-15);
        assert!((above_part(&base, &small).unwrap() + 0.3 + 1.5).abs() < 1e-15);
    }
}
