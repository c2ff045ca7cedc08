//! Cones and closed surfaces: distances, normals and curvatures against closed forms, and what is refused.
#![allow(clippy::float_cmp)] // unchanged values are meant exactly

use contact_dynamics::Error;
use contact_dynamics::contact::{ClosedSurface, Cone, Cuboid, Obstacle, Side, Sphere};
use contact_dynamics_scenes::obstacles::{self, ball_mesh, box_mesh};
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::vectors::{along, dot};

fn point<const D: usize>(random: &mut Congruential, size: f64) -> [f64; D] {
    std::array::from_fn(|_| size * random.signed())
}

/// The normal is the gradient of the distance and of length one, the curvature its second derivative; the distance
/// changes by no more than the way. How many points are so far from kinks that this was looked at.
fn check_derivatives<const D: usize>(name: &str, body: &dyn Obstacle<f64, D>, random: &mut Congruential) -> usize {
    let mut looked = 0;
    for _ in 0..300 {
        let (x, w) = (point(random, 1.6), point(random, 1.0));
        let (distance, normal) = body.distance(x);
        assert!((dot(normal, normal) - 1.0).abs() < 1e-13, "{name}: {x:?} {normal:?}");
        let other = body.distance(along(x, 0.3, w)).0;
        assert!((other - distance).abs() <= 0.3 * dot(w, w).sqrt() + 1e-13, "{name}: {x:?}");
        let s = 1e-4;
        let [before, after] = [-s, s].map(|s| body.distance(along(x, s, w)));
        // (Where the closest feature changes the second derivative jumps.)
        let curvatures = [-s, 0.0, s].map(|s| body.curvature(along(x, s, w), w));
        let spread = curvatures.iter().map(|c| (c - curvatures[1]).abs()).fold(0.0, f64::max);
        let turned = dot(along(after.1, -1.0, before.1), along(after.1, -1.0, before.1)).sqrt();
        if spread > 0.02 * (1.0 + curvatures[1].abs()) || turned > 0.05 {
            continue;
        }
        looked += 1;
        let slope = (after.0 - before.0) / (2.0 * s);
        let bound = 1e-5 + 10.0 * (s * curvatures[1]).powi(2);
        assert!((slope - dot(normal, w)).abs() < bound, "{name}: {x:?} {slope}");
        let second = (after.0 - 2.0 * distance + before.0) / (s * s);
        let error = (second - curvatures[1]).abs();
        let bound = 2e-3 * (1.0 + curvatures[1].abs()) + 10.0 * s * s * curvatures[1].abs().powi(3);
        assert!(error < bound, "{name}: {x:?} {second} {curvatures:?}");
    }
    looked
}

#[test]
fn normals_and_curvatures_are_the_derivatives_of_the_distance() {
    let mut random = Congruential(21);
    for _ in 0..5 {
        for (name, body) in obstacles::in_space(&mut random) {
            assert!(check_derivatives(name, &*body, &mut random) > 200, "{name}");
        }
        for (name, body) in obstacles::in_plane(&mut random) {
            assert!(check_derivatives(name, &*body, &mut random) > 200, "{name}");
        }
    }
}

/// At the center of a ball, or on the axis of a cylinder, any direction to the surface is right, but it has length one.
#[test]
fn centers_of_round_bodies_have_a_normal() {
    for (side, sign) in [(Side::Outside, -1.0), (Side::Inside, 1.0)] {
        let disc = Sphere::new([0.1, 0.2], 0.5, side).unwrap().distance([0.1, 0.2]);
        let ball = Sphere::new([0.1, 0.2, 0.3], 0.5, side).unwrap().distance([0.1, 0.2, 0.3]);
        assert_eq!([disc.0, ball.0], [0.5 * sign; 2]);
        assert!((dot(disc.1, disc.1) - 1.0).abs() < 1e-15 && (dot(ball.1, ball.1) - 1.0).abs() < 1e-15);
    }
}

/// Closest points of a cone by going around the boundary of its section.
#[test]
fn cones_have_their_distances() {
    let mut random = Congruential(5);
    for (radius, height, rounding) in [(0.7, 1.1, 0.1), (1.0, 0.3, 0.12), (0.2, 1.5, 0.05)] {
        let axis = [2.0 / 7.0, -3.0 / 7.0, 6.0 / 7.0];
        let base = [0.1, -0.2, -0.3];
        let cone = Cone::new(base, along(base, height, axis), radius, rounding).unwrap();
        let slant = f64::hypot(radius, height);
        let left = 1.0 - rounding * (radius + slant) / (radius * height);
        let (tip, rim) = ([0.0, rounding + left * height], [left * radius, rounding]);
        let segment = |p: [f64; 2], a: [f64; 2], b: [f64; 2]| {
            let (way, r) = (along(b, -1.0, a), along(p, -1.0, a));
            let s = (dot(way, r) / dot(way, way)).clamp(0.0, 1.0);
            let off = along(r, -s, way);
            dot(off, off).sqrt()
        };
        for _ in 0..2000 {
            let x = point::<3>(&mut random, 1.5);
            let r = along(x, -1.0, base);
            let z = dot(r, axis);
            let off = along(r, -z, axis);
            let p = [dot(off, off).sqrt(), z];
            let nearest = segment(p, tip, rim).min(segment(p, rim, [0.0, rounding]));
            let inside = z > rounding && p[0] < rim[0] * (tip[1] - z) / (tip[1] - rim[1]);
            let exact = if inside { -nearest } else { nearest } - rounding;
            let (distance, normal) = cone.distance(x);
            assert!((distance - exact).abs() < 1e-14, "{x:?}: {distance} {exact}");
            // Along the normal the distance grows by the way.
            let farther = cone.distance(along(x, 0.2, normal)).0;
            assert!((farther - distance - 0.2).abs() < 1e-13 || inside, "{x:?}");
        }
        // On the axis.
        let (depth, normal) = cone.distance(along(base, 0.5 * height, axis));
        assert!(depth < 0.0 && (dot(normal, normal) - 1.0).abs() < 1e-14);
    }
    // In the plane from which the base is rounded the base is the nearest all the same.
    let blunt = Cone::new([0.0; 3], [0.0, 0.0, 1.0], 1.0, 0.125).unwrap();
    let (distance, normal): (f64, _) = blunt.distance([0.25, 0.0, 0.125]);
    assert!((distance + 0.125).abs() < 1e-15 && (normal[2] + 1.0).abs() < 1e-15, "{distance} {normal:?}");
    // As much rounding as there can be: a ball.
    let ball = Cone::new([0.0; 3], [0.0, 0.0, 4.0], 3.0, 1.5).unwrap();
    let exact = Sphere::new([0.0, 0.0, 1.5], 1.5, Side::Outside).unwrap();
    for _ in 0..100 {
        let x = point(&mut random, 5.0);
        assert!((ball.distance(x).0 - exact.distance(x).0).abs() < 1e-14);
    }
    let refused = |tip, radius, rounding| Cone::new([0.0; 3], tip, radius, rounding).unwrap_err();
    assert!(matches!(refused([0.0; 3], 1.0, 0.1), Error::Parameter { name: "the axis of the cone", .. }));
    assert!(matches!(refused([0.0, 0.0, 4.0], 3.0, 1.51), Error::Parameter { value: 1.51, .. }));
    assert!(matches!(refused([0.0, 0.0, 4.0], -3.0, 0.1), Error::Parameter { .. }));
    assert!(matches!(refused([0.0, 0.0, 4.0], 3.0, 0.0), Error::Parameter { .. }));
    assert!(matches!(refused([0.0, f64::NAN, 4.0], 3.0, 0.1), Error::NotFinite { index: 1, .. }));
}

/// The mesh of a box is the box, outside to the last digits, inside the same.
#[test]
fn a_mesh_of_a_box_is_the_box() {
    let mut random = Congruential(9);
    let (center, half, rounding) = ([0.2, -0.1, 0.3], [0.5, 0.3, 0.7], 0.15);
    let (vertices, triangles) = box_mesh(center, half);
    let mesh = ClosedSurface::new(&vertices, &triangles, rounding).unwrap();
    let exact = Cuboid::new(center, half.map(|half| half + rounding), rounding).unwrap();
    let loose: Vec<_> = triangles.iter().map(|triangle| triangle.map(|node| vertices[node])).collect();
    let merged = ClosedSurface::from_loose_facets(&loose, rounding).unwrap();
    for _ in 0..3000 {
        let (x, w) = (point(&mut random, 1.5), point(&mut random, 1.0));
        let (found, expected) = (mesh.distance(x), exact.distance(x));
        assert!((found.0 - expected.0).abs() < 1e-14, "{x:?}: {found:?} {expected:?}");
        let apart = along(found.1, -1.0, expected.1);
        assert!(dot(apart, apart).sqrt() < 1e-12, "{x:?}: {found:?} {expected:?}");
        assert_eq!(merged.distance(x), found);
        let curvatures = [mesh.curvature(x, w), exact.curvature(x, w)];
        assert!((curvatures[0] - curvatures[1]).abs() < 1e-11 * (1.0 + curvatures[1]), "{x:?}: {curvatures:?}");
    }
    // The same in the plane.
    let rectangle = [[-0.3, 0.4], [0.7, 0.4], [0.7, 0.9], [-0.3, 0.9]];
    let polygon = ClosedSurface::new(&rectangle, &[[0, 1], [1, 2], [2, 3], [3, 0]], rounding).unwrap();
    let exact = Cuboid::new([0.2, 0.65], [0.5 + rounding, 0.25 + rounding], rounding).unwrap();
    for _ in 0..1000 {
        let (x, w) = (point(&mut random, 1.5), point(&mut random, 1.0));
        assert!((polygon.distance(x).0 - exact.distance(x).0).abs() < 1e-14);
        assert!((polygon.curvature(x, w) - exact.curvature(x, w)).abs() < 1e-11 * (1.0 + exact.curvature(x, w)));
    }
}

#[test]
fn a_mesh_of_a_ball_converges_to_the_ball_with_order_two() {
    let (center, rounding) = ([0.1, 0.2, -0.1], 0.05);
    let exact = Sphere::new(center, 0.8, Side::Outside).unwrap();
    let mut errors = Vec::new();
    for halvings in 1..6 {
        let (vertices, triangles) = ball_mesh(center, 0.75, halvings);
        let mesh = ClosedSurface::new(&vertices, &triangles, rounding).unwrap();
        let mut random = Congruential(3);
        let mut worst = 0.0_f64;
        for _ in 0..500 {
            let x = point(&mut random, 1.2);
            worst = worst.max((mesh.distance(x).0 - exact.distance(x).0).abs());
        }
        errors.push(worst);
    }
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!(order > 1.7 && order < 2.4, "{order} of {errors:?}");
    }
    assert!(errors[4] < 2e-3, "{errors:?}");
}

/// Two bars across each other: outside the nearer one counts, and the sign is right in all corners and notches.
#[test]
fn a_body_with_notches_knows_its_inside() {
    // A plus sign, and the prism over it.
    let plus =
        [[1, -3], [1, -1], [3, -1], [3, 1], [1, 1], [1, 3], [-1, 3], [-1, 1], [-3, 1], [-3, -1], [-1, -1], [-1, -3]];
    let plus: Vec<[f64; 2]> = plus.iter().map(|x| x.map(|x| 0.2 * f64::from(x))).collect();
    let sides: Vec<_> = (0..12).map(|k| [k, (k + 1) % 12]).collect();
    let polygon = ClosedSurface::new(&plus, &sides, 0.05).unwrap();
    let bars = [[0.6, 0.2], [0.2, 0.6]];
    let boundary = |x: [f64; 2]| {
        let side = |&[i, j]: &[usize; 2]| {
            let (way, r) = (along(plus[j], -1.0, plus[i]), along(x, -1.0, plus[i]));
            let off = along(r, -(dot(way, r) / dot(way, way)).clamp(0.0, 1.0), way);
            dot(off, off).sqrt()
        };
        let nearest = sides.iter().map(side).fold(f64::INFINITY, f64::min);
        let inside = bars.iter().any(|half| x.iter().zip(half).all(|(x, half)| x.abs() < *half));
        if inside { -nearest } else { nearest }
    };
    // Prism: caps of the middle square and four arms, two triangles each.
    let mut vertices: Vec<[f64; 3]> =
        [-0.5, 0.5].iter().flat_map(|&z| plus.iter().map(move |x| [x[0], x[1], z])).collect();
    let quads = [[10, 1, 4, 7], [11, 0, 1, 10], [1, 2, 3, 4], [4, 5, 6, 7], [7, 8, 9, 10]];
    let mut triangles = Vec::new();
    for [a, b, c, d] in quads {
        triangles.extend([[c, b, a], [d, c, a], [12 + a, 12 + b, 12 + c], [12 + a, 12 + c, 12 + d]]);
    }
    for k in 0..12 {
        let next = (k + 1) % 12;
        triangles.extend([[k, next, 12 + next], [k, 12 + next, 12 + k]]);
    }
    let prism = ClosedSurface::new(&vertices, &triangles, 0.05).unwrap();
    let mut random = Congruential(17);
    for _ in 0..5000 {
        let x = point::<2>(&mut random, 1.0);
        let exact = boundary(x);
        let found = polygon.distance(x).0 + 0.05;
        assert!((found - exact).abs() < 1e-14, "{x:?}: {found} {exact}");
        let z = random.signed();
        let beyond = z.abs() - 0.5;
        let exact = match (exact > 0.0, beyond > 0.0) {
            (true, true) => exact.hypot(beyond),
            (false, false) => exact.max(beyond),
            _ if exact > 0.0 => exact,
            _ => beyond,
        };
        let found = prism.distance([x[0], x[1], z]).0 + 0.05;
        assert!((found - exact).abs() < 1e-14, "{x:?} {z}: {found} {exact}");
    }
    // Far from the origin, and in single precision.
    for vertex in &mut vertices {
        vertex[0] += 1e6;
    }
    let far = ClosedSurface::new(&vertices, &triangles, 0.05).unwrap();
    assert!((far.distance([1e6 + 0.4, 0.3, 0.0]).0 - 0.05).abs() < 1e-9);
    let single: Vec<[f32; 3]> =
        vertices.iter().map(|x| [x[0] - 1e6, x[1], x[2]].map(<f32 as contact_dynamics::Real>::of)).collect();
    let coarse = ClosedSurface::new(&single, &triangles, 0.05).unwrap().distance([0.4_f32, 0.3, 0.0]);
    assert!((coarse.0 - 0.05).abs() < 1e-6 && (coarse.1[1] - 1.0).abs() < 1e-6);
    assert!(prism.distance([f64::NAN, 0.0, 0.0]).0.is_nan());
    assert!(prism.distance([0.0, f64::INFINITY, 0.0]).0.is_nan());
}

#[test]
fn meshes_that_enclose_nothing_are_refused_with_words() {
    let (vertices, triangles) = box_mesh([0.0; 3], [1.0; 3]);
    let refused =
        |vertices: &[[f64; 3]], triangles: &[[usize; 3]]| ClosedSurface::new(vertices, triangles, 0.1).unwrap_err();
    let says = |error: Error, words: &str| assert!(error.to_string().contains(words), "{error}");
    assert!(matches!(refused(&vertices, &[]), Error::Empty { .. }));
    says(refused(&vertices, &triangles[1..]), "the surface ends at one of its sides; close it");
    let reversed: Vec<_> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    says(refused(&vertices, &reversed), "a closed surface around a volume of -");
    let mut one = triangles.clone();
    one[4] = [one[4][0], one[4][2], one[4][1]];
    assert!(matches!(refused(&vertices, &one), Error::InvertedFacet { facet: 4, .. }));
    let twice = [&triangles[..], &triangles[..1]].concat();
    says(refused(&vertices, &twice), "must not branch");
    // Two boxes that share a corner.
    let (other, more) = box_mesh([2.0; 3], [1.0; 3]);
    let mut loose: Vec<_> = triangles.iter().map(|triangle| triangle.map(|node| vertices[node])).collect();
    loose.extend(more.iter().map(|triangle| triangle.map(|node| other[node])));
    says(ClosedSurface::from_loose_facets(&loose, 0.1).unwrap_err(), "touches itself there");
    // Apart they are two bodies.
    let apart: Vec<_> =
        loose.iter().enumerate().map(|(k, x)| x.map(|x| x.map(|x| if k < 12 { x } else { x + 1.0 }))).collect();
    let both = ClosedSurface::from_loose_facets(&apart, 0.1).unwrap();
    assert!(both.distance([0.0; 3]).0 < -1.0 && both.distance([3.0; 3]).0 < -1.0 && both.distance([1.5; 3]).0 > 0.5);
    // A needle.
    let mut flat = vertices.clone();
    flat[triangles[0][1]] = std::array::from_fn(|k| 0.5 * (flat[triangles[0][0]][k] + flat[triangles[0][2]][k]));
    assert!(matches!(refused(&flat, &triangles), Error::InvertedFacet { .. }));
    let mut infinite = vertices.clone();
    infinite[3][1] = f64::INFINITY;
    assert!(matches!(refused(&infinite, &triangles), Error::NotFinite { index: 3, .. }));
    assert!(matches!(refused(&vertices, &[[0, 1, 8]]), Error::Dimension { found: 8, .. }));
    assert!(matches!(ClosedSurface::new(&vertices, &triangles, 0.0), Err(Error::Parameter { .. })));
    let open = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    says(ClosedSurface::new(&open, &[[0, 1], [1, 2]], 0.1).unwrap_err(), "close it");
    says(ClosedSurface::new(&open, &[[1, 0], [2, 1], [0, 2]], 0.1).unwrap_err(), "the other order");
}
