//! Rigid obstacles of all shapes and motions, and closed meshes of simple bodies.

use crate::random::Congruential;
use crate::vectors::cross;
use contact_dynamics::contact::{
    Capsule, ClosedSurface, Cone, Cuboid, Cylinder, Obstacle, Plane, RigidMotion, Side, Sphere,
};

/// Vertices and triangles of a mesh.
pub type Mesh = (Vec<[f64; 3]>, Vec<[usize; 3]>);

/// A box by its center and half of its sides: twelve triangles.
pub fn box_mesh(center: [f64; 3], half: [f64; 3]) -> Mesh {
    let corner = |k: usize| std::array::from_fn(|i| center[i] + if k >> i & 1 == 1 { half[i] } else { -half[i] });
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    ((0..8).map(corner).collect(), triangles)
}

/// A ball: an octahedron whose triangles are halved so many times, 8 · 4ⁿ of them, with all vertices on the sphere.
pub fn ball_mesh(center: [f64; 3], radius: f64, halvings: usize) -> Mesh {
    let mut vertices: Vec<[f64; 3]> =
        vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    let around = (0..4).map(|k| (k, (k + 1) % 4));
    let mut triangles: Vec<[usize; 3]> = around.flat_map(|(i, j)| [[i, j, 4], [j, i, 5]]).collect();
    for _ in 0..halvings {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |i: usize, j: usize| {
            *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                let sum: [f64; 3] = std::array::from_fn(|k| vertices[i][k] + vertices[j][k]);
                let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
                vertices.push(sum.map(|x| x / length));
                vertices.len() - 1
            })
        };
        let split = |[a, b, c]: [usize; 3]| {
            let [d, e, f] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        };
        triangles = triangles.into_iter().flat_map(split).collect();
    }
    let place = |x: [f64; 3]| std::array::from_fn(|k| center[k] + radius * x[k]);
    (vertices.into_iter().map(place).collect(), triangles)
}

/// A shape with its name.
pub type Named<const D: usize> = (&'static str, Box<dyn Obstacle<f64, D>>);

/// One of each shape in space, about as large as one, about the origin, with sizes that are drawn.
pub fn in_space(random: &mut Congruential) -> Vec<Named<3>> {
    in_space_of_size(1.0, random)
}

/// The same about as large as `size`.
pub fn in_space_of_size(size: f64, random: &mut Congruential) -> Vec<Named<3>> {
    let mut point = |share: f64| std::array::from_fn::<f64, 3, _>(|_| size * share * random.signed());
    let [center, other, axis] = [point(0.1), point(0.6), point(1.0)];
    let mut length = |low: f64, high: f64| size * random.within(low, high);
    let radius = length(0.4, 0.8);
    let half = [length(0.3, 0.8), length(0.3, 0.8), length(0.3, 0.8)];
    let rounding = length(0.05, 0.2);
    let mut shapes: Vec<Named<3>> = vec![
        ("plane", Box::new(Plane::new(center, axis).unwrap())),
        ("capsule", Box::new(Capsule::new([center, other], 0.6 * radius).unwrap())),
        ("cuboid", Box::new(Cuboid::new(center, half, rounding).unwrap())),
        ("cone", Box::new(Cone::new(center, axis.map(|x| 2.0 * x), radius, 0.1 * rounding).unwrap())),
    ];
    let sides = [(Side::Outside, "sphere", "cylinder"), (Side::Inside, "hollow sphere", "hollow cylinder")];
    for (side, sphere, cylinder) in sides {
        shapes.push((sphere, Box::new(Sphere::new(center, radius, side).unwrap())));
        shapes.push((cylinder, Box::new(Cylinder::new(center, axis, radius, side).unwrap())));
    }
    let (vertices, triangles) = box_mesh(center, half);
    shapes.push(("mesh of a box", Box::new(ClosedSurface::new(&vertices, &triangles, rounding).unwrap())));
    let (vertices, triangles) = ball_mesh(center, radius, 2);
    shapes.push(("mesh of a ball", Box::new(ClosedSurface::new(&vertices, &triangles, rounding).unwrap())));
    shapes
}

/// The same in the plane.
pub fn in_plane(random: &mut Congruential) -> Vec<Named<2>> {
    in_plane_of_size(1.0, random)
}

/// The same about as large as `size`.
pub fn in_plane_of_size(size: f64, random: &mut Congruential) -> Vec<Named<2>> {
    let mut point = |share: f64| std::array::from_fn::<f64, 2, _>(|_| size * share * random.signed());
    let [center, other, normal] = [point(0.1), point(0.6), point(1.0)];
    let mut length = |low: f64, high: f64| size * random.within(low, high);
    let (radius, rounding) = (length(0.4, 0.8), length(0.05, 0.2));
    let half = [length(0.3, 0.8), length(0.3, 0.8)];
    let mut shapes: Vec<Named<2>> = vec![
        ("line", Box::new(Plane::new(center, normal).unwrap())),
        ("capsule", Box::new(Capsule::new([center, other], 0.6 * radius).unwrap())),
        ("rectangle", Box::new(Cuboid::new(center, half, rounding).unwrap())),
    ];
    for (side, name) in [(Side::Outside, "disc"), (Side::Inside, "hollow disc")] {
        shapes.push((name, Box::new(Sphere::new(center, radius, side).unwrap())));
    }
    // A star of five rays: with notches.
    let corner = |k: usize| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / 10.0).sin_cos();
        let length = if k.is_multiple_of(2) { 1.4 * radius } else { 0.6 * radius };
        [center[0] + length * cos, center[1] + length * sin]
    };
    let star: Vec<_> = (0..10).map(corner).collect();
    let sides: Vec<_> = (0..10).map(|k| [k, (k + 1) % 10]).collect();
    shapes.push(("star", Box::new(ClosedSurface::new(&star, &sides, rounding).unwrap())));
    shapes
}

/// A tumbling body: its axis, x, turns about z faster and faster while it turns about its axis, and it is carried
/// along. Neither ω nor ω̇ keeps its direction.
pub fn tumbling(t: f64) -> RigidMotion<f64, 3> {
    let ([precession, rate, growth], [spin, own]) = ([0.4 * t + 0.3 * t * t, 0.4 + 0.6 * t, 0.6], [0.9 * t, 0.9]);
    let ((s, c), (sin, cos)) = (precession.sin_cos(), spin.sin_cos());
    let rotation = [[c, -s * cos, s * sin], [s, c * cos, -c * sin], [0.0, sin, cos]];
    let (about, axis) = ([0.0, 0.0, rate], [c, s, 0.0].map(|x| own * x));
    let turning = cross(about, axis);
    let velocity = std::array::from_fn(|k| about[k] + axis[k]);
    let acceleration = std::array::from_fn(|k| [0.0, 0.0, growth][k] + turning[k]);
    RigidMotion::rotation([0.2, -0.1, 0.3], rotation, velocity, acceleration).translated([
        [0.1 * t, 0.2 * t * t, 0.05],
        [0.1, 0.4 * t, 0.0],
        [0.0, 0.4, 0.0],
    ])
}

/// The same in the plane.
pub fn wheeling(t: f64) -> RigidMotion<f64, 2> {
    RigidMotion::about_point([0.3, -0.2], [0.7 * t - 0.4 * t * t, 0.7 - 0.8 * t, -0.8]).translated([
        [0.1 * t, 0.2 * t * t],
        [0.1, 0.4 * t],
        [0.0, 0.4],
    ])
}
