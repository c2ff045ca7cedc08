//! Contact of nodes with facets: gaps against brute force and differences, sides, rims, kept lists, balance of forces.
#![cfg(feature = "search")]
#![allow(clippy::float_cmp)] // unchanged values are meant exactly

use contact_dynamics::contact::{Candidates, ContactId, ContactJacobian, ContactLaw, Facet, GapRates, NodeToFacet};
use contact_dynamics::{Composite, ContactConstraint, Error, LinearSystem, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::sparse::{matrix, spring};
use proptest::prelude::*;

/// Nodes with dofs in their order, and facets.
#[derive(Clone, Debug, Default)]
struct Mesh<const D: usize> {
    coordinates: Vec<[f64; D]>,
    facets: Vec<Facet>,
}

impl<const D: usize> Mesh<D> {
    fn dofs(&self) -> Vec<[usize; D]> {
        (0..self.coordinates.len()).map(|node| std::array::from_fn(|i| D * node + i)).collect()
    }

    fn size(&self) -> usize {
        D * self.coordinates.len()
    }

    /// Appends nodes and returns their numbers.
    fn nodes(&mut self, coordinates: impl IntoIterator<Item = [f64; D]>) -> Vec<usize> {
        let start = self.coordinates.len();
        self.coordinates.extend(coordinates);
        (start..self.coordinates.len()).collect()
    }

    fn contact(&self, nodes: &[usize], reach: f64) -> NodeToFacet<f64> {
        let facets = self.facets.iter().copied();
        NodeToFacet::one_pass(&self.coordinates, &self.dofs(), nodes, facets).unwrap().reach(reach).unwrap()
    }

    /// In two passes.
    fn both(&self, own: impl IntoIterator<Item = Facet>, reach: f64) -> NodeToFacet<f64> {
        let facets = self.facets.iter().copied();
        NodeToFacet::new(&self.coordinates, &self.dofs(), own, facets).unwrap().reach(reach).unwrap()
    }

    fn positions(&self, u: &[f64]) -> Vec<[f64; D]> {
        let node = |(node, x): (usize, &[f64; D])| std::array::from_fn(|i| x[i] + u[D * node + i]);
        self.coordinates.iter().enumerate().map(node).collect()
    }
}

/// What a grid is made of.
#[derive(Clone, Copy, PartialEq)]
enum Cells {
    Quadrilaterals,
    Triangles,
    Mixed,
}

/// A grid over [0, n]² at the height z(x, y), normals upward.
fn grid(n: usize, cells: Cells, z: impl Fn(f64, f64) -> f64) -> Mesh<3> {
    let mut mesh = Mesh::default();
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (i as f64, j as f64);
            mesh.coordinates.push([x, y, z(x, y)]);
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
            if cells == Cells::Quadrilaterals || (cells == Cells::Mixed && (i + j) % 2 == 0) {
                mesh.facets.push([a, b, c, d].into());
            } else {
                mesh.facets.extend([Facet::from([a, b, c]), [a, c, d].into()]);
            }
        }
    }
    mesh
}

/// The surface of a cube [−1, 1]³ of quadrilaterals with displaced corners: warped and closed.
fn box_of_quadrilaterals(random: &mut Congruential, warp: f64) -> Mesh<3> {
    let mut mesh = Mesh::default();
    mesh.nodes(
        (0..8).map(|k| std::array::from_fn(|i| if k >> i & 1 == 0 { -1.0 } else { 1.0 } + warp * random.signed())),
    );
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    mesh.facets.extend(sides.map(Facet::from));
    mesh
}

/// A regular polygon, counter-clockwise.
fn polygon(corners: usize) -> Mesh<2> {
    let mut mesh = Mesh::default();
    mesh.nodes((0..corners).map(|k| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / corners as f64).sin_cos();
        [cos, sin]
    }));
    mesh.facets.extend((0..corners).map(|k| Facet::from([k, (k + 1) % corners])));
    mesh
}

/// Gaps by identity of the row, after a search.
fn gaps(contact: &mut NodeToFacet<f64>, u: &[f64]) -> Vec<((usize, usize), f64)> {
    contact.search_on(0.0, u, u, 0.0).unwrap();
    let mut gaps = vec![0.0; contact.candidates()];
    contact.gap(0.0, u, &mut gaps);
    (0..gaps.len()).map(|row| contact.identity(row)).zip(gaps).collect()
}

fn rows(contact: &NodeToFacet<f64>) -> ContactJacobian<f64> {
    contact.jacobian()
}

/// The only gap there is.
fn single_gap(contact: &mut NodeToFacet<f64>, u: &[f64]) -> Option<f64> {
    let found = gaps(contact, u);
    assert!(found.len() <= 1);
    found.first().map(|&(_, gap)| gap)
}

/// Force of every row, and its moment about the origin, relative to the row's size.
fn imbalance<const D: usize>(contact: &NodeToFacet<f64>, positions: &[[f64; D]]) -> f64 {
    let (g, mut worst) = (rows(contact), 0.0_f64);
    for row in 0..g.rows() {
        let (mut force, mut moment, mut scale) = ([0.0; 3], [0.0; 3], 1.0_f64);
        for (dof, weight) in g.row(row) {
            let x: [f64; 3] = std::array::from_fn(|i| positions[dof / D].get(i).copied().unwrap_or(0.0));
            scale = x.iter().fold(scale, |scale, x| scale.max(x.abs()));
            let (i, mut f) = (dof % D, [0.0; 3]);
            f[i] = weight;
            force[i] += weight;
            for (k, moment) in moment.iter_mut().enumerate() {
                let (l, m) = ((k + 1) % 3, (k + 2) % 3);
                *moment += x[l] * f[m] - x[m] * f[l];
            }
        }
        worst = force.iter().fold(worst, |worst, f| worst.max(f.abs()));
        worst = moment.iter().fold(worst, |worst, m| worst.max(m.abs() / scale));
    }
    worst
}

fn check_derivative<const D: usize>(mesh: &Mesh<D>, nodes: &[usize], random: &mut Congruential) {
    let (step, reach) = (1e-6, 0.8);
    let mut contact = mesh.contact(nodes, reach);
    let u = random.vector(mesh.size(), 0.05);
    contact.search_on(0.0, &u, &u, 0.0).unwrap();
    let g = rows(&contact);
    assert!(g.rows() * 2 > nodes.len(), "{} rows", g.rows());
    let facets: Vec<_> = (0..g.rows()).map(|row| contact.facet(row)).collect();
    let here = gaps(&mut contact, &u);
    let direction = random.vector(mesh.size(), 1.0);
    let mut at = |c: f64| {
        let moved: Vec<_> = u.iter().zip(&direction).map(|(u, d)| u + c * step * d).collect();
        let found = gaps(&mut contact, &moved);
        let facets: Vec<_> = (0..found.len()).map(|row| contact.facet(row)).collect();
        (found, facets)
    };
    let [(ahead, facets_ahead), (behind, facets_behind)] = [at(1.0), at(-1.0)];
    let mut compared = 0;
    for (row, &(identity, _)) in here.iter().enumerate() {
        let value = |found: &[((usize, usize), f64)], on: &[usize]| {
            let place = found.iter().position(|&(other, _)| other == identity)?;
            (on[place] == facets[row]).then_some(found[place].1)
        };
        if let (Some(ahead), Some(behind)) = (value(&ahead, &facets_ahead), value(&behind, &facets_behind)) {
            let difference = (ahead - behind) / (2.0 * step);
            let derivative = g.product(row, &direction);
            assert!((difference - derivative).abs() < 1e-6, "row {row}: {difference} and {derivative}");
            compared += 1;
        }
    }
    assert!(compared * 10 >= here.len() * 9, "{compared} of {}", here.len());
}

#[test]
fn rows_are_derivatives_of_the_gap() {
    let mut random = Congruential(1);
    for cells in [Cells::Quadrilaterals, Cells::Triangles, Cells::Mixed] {
        // Flat, then curved; facets move as well.
        for height in [0.0, 0.3] {
            let mut mesh = grid(4, cells, |x, y| height * (x * 1.3).sin() * (y * 0.9).cos());
            let nodes: Vec<_> = (0..60)
                .map(|_| [2.0 + 1.9 * random.signed(), 2.0 + 1.9 * random.signed(), 0.5 * random.signed()])
                .collect();
            let nodes = mesh.nodes(nodes);
            check_derivative(&mesh, &nodes, &mut random);
        }
    }
    let mut mesh = polygon(9);
    let nodes: Vec<_> =
        (0..60).map(|_| [random.signed(), random.signed()]).map(|x: [f64; 2]| x.map(|x| 1.1 * x)).collect();
    let nodes = mesh.nodes(nodes);
    check_derivative(&mesh, &nodes, &mut random);
}

#[test]
fn translations_leave_gaps_and_rows_balance() {
    let mut random = Congruential(2);
    for cells in [Cells::Quadrilaterals, Cells::Triangles, Cells::Mixed] {
        let mut mesh = grid(5, cells, |x, y| 0.2 * (x * 1.7).sin() + 0.1 * (y * y * 0.3).cos());
        let cloud: Vec<_> = (0..200)
            .map(|_| [2.5 + 2.6 * random.signed(), 2.5 + 2.6 * random.signed(), 0.8 * random.signed()])
            .collect();
        let nodes = mesh.nodes(cloud);
        let mut contact = mesh.contact(&nodes, 0.7);
        let u = random.vector(mesh.size(), 0.1);
        let here = gaps(&mut contact, &u);
        assert!(here.len() > 100);
        assert!(here.iter().any(|&(_, gap)| gap < -0.2) && here.iter().any(|&(_, gap)| gap > 0.2));
        let imbalance = imbalance(&contact, &mesh.positions(&u));
        assert!(imbalance < 1e-14, "{imbalance:e}");
        let translation: Vec<f64> = (0..mesh.size()).map(|dof| [0.3, -0.7, 0.4][dof % 3]).collect();
        let g = rows(&contact);
        for row in 0..g.rows() {
            assert!(g.product(row, &translation).abs() < 1e-14);
        }
        let moved: Vec<_> = u.iter().zip(&translation).map(|(u, c)| u + c).collect();
        for (one, other) in here.iter().zip(gaps(&mut contact, &moved)) {
            assert!(one.0 == other.0 && (one.1 - other.1).abs() < 1e-13, "{one:?} {other:?}");
        }
    }
}

/// Distance from the nearest of many points of the bilinear facets, refined around the nearest.
fn sampled_distance(mesh: &Mesh<3>, p: [f64; 3]) -> f64 {
    const SAMPLES: usize = 40;
    let mut least = f64::INFINITY;
    for facet in &mesh.facets {
        let corners: Vec<_> = facet.nodes().iter().map(|&node| mesh.coordinates[node]).collect();
        let distance = |x: f64, y: f64| {
            let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), x * y, (1.0 - x) * y];
            let component = |i: usize| corners.iter().zip(weights).map(|(c, w)| w * c[i]).sum::<f64>() - p[i];
            component(0).hypot(component(1)).hypot(component(2))
        };
        let (mut center, mut width) = ([0.5, 0.5], 0.5);
        for _ in 0..6 {
            let mut best = (f64::INFINITY, center);
            for i in 0..=SAMPLES {
                for j in 0..=SAMPLES {
                    let at = |c: f64, k: usize| (c + width * (2.0 * k as f64 / SAMPLES as f64 - 1.0)).clamp(0.0, 1.0);
                    let (x, y) = (at(center[0], i), at(center[1], j));
                    if distance(x, y) < best.0 {
                        best = (distance(x, y), [x, y]);
                    }
                }
            }
            (center, width) = (best.1, width * 0.15);
            least = least.min(best.0);
        }
    }
    least
}

#[test]
fn closest_points_of_warped_quadrilaterals_are_those_of_brute_force() {
    let mut random = Congruential(3);
    for warp in [0.0, 0.2, 0.35] {
        let mut mesh = box_of_quadrilaterals(&mut random, warp);
        let cloud: Vec<[f64; 3]> = (0..40).map(|_| std::array::from_fn(|_| 1.8 * random.signed())).collect();
        let shell = mesh.clone();
        let nodes = mesh.nodes(cloud);
        let mut contact = mesh.contact(&nodes, 3.0);
        let u = vec![0.0; mesh.size()];
        let found = gaps(&mut contact, &u);
        assert_eq!(found.len(), nodes.len());
        for ((node, _), gap) in found {
            let x = mesh.coordinates[node];
            let sampled = sampled_distance(&shell, x);
            assert!((gap.abs() - sampled).abs() < 1e-6, "warp {warp}, {x:?}: {gap} and {sampled}");
            let farthest = x.iter().fold(0.0_f64, |far, x| far.max(x.abs()));
            if farthest > 1.0 + warp || farthest < 1.0 - warp {
                assert_eq!(gap > 0.0, farthest > 1.0, "warp {warp}, {x:?}: {gap}");
            }
        }
    }
}

/// The surface of an octahedron, its triangles halved in both directions, with corners at random distances from the
/// origin.
fn star(random: &mut Congruential) -> Mesh<3> {
    let mut mesh = Mesh::<3>::default();
    let mut node = |x: [f64; 3]| match mesh.coordinates.iter().position(|y| *y == x) {
        Some(node) => node,
        None => mesh.nodes([x])[0],
    };
    let mut facets = Vec::new();
    for signs in 0..8 {
        let sign = |i: usize| if signs >> i & 1 == 0 { 1.0 } else { -1.0 };
        let [mut a, b, mut c] = [[sign(0), 0.0, 0.0], [0.0, sign(1), 0.0], [0.0, 0.0, sign(2)]];
        if sign(0) * sign(1) * sign(2) < 0.0 {
            std::mem::swap(&mut a, &mut c);
        }
        let middle = |x: [f64; 3], y: [f64; 3]| std::array::from_fn(|i| 0.5 * (x[i] + y[i]));
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        for corners in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            facets.push(Facet::from(corners.map(&mut node)));
        }
    }
    mesh.facets = facets;
    for x in &mut mesh.coordinates {
        let stretch = (1.0 + 0.6 * random.signed()) / x[0].hypot(x[1]).hypot(x[2]);
        *x = x.map(|x| stretch * x);
    }
    mesh
}

/// Whether a point is inside of a star-shaped body: on the near side of the facet that its ray from the origin meets.
fn is_inside(mesh: &Mesh<3>, p: [f64; 3]) -> bool {
    let determinant = |x: [f64; 3], y: [f64; 3], z: [f64; 3]| {
        x[0] * (y[1] * z[2] - y[2] * z[1]) + x[1] * (y[2] * z[0] - y[0] * z[2]) + x[2] * (y[0] * z[1] - y[1] * z[0])
    };
    mesh.facets.iter().any(|facet| {
        let [a, b, c] = std::array::from_fn(|k| mesh.coordinates[facet.nodes()[k]]);
        let volume = determinant(a, b, c);
        let shares = [determinant(p, b, c), determinant(a, p, c), determinant(a, b, p)].map(|share| share / volume);
        assert!(volume > 0.0);
        shares.iter().all(|&share| share >= 0.0) && shares.iter().sum::<f64>() < 1.0
    })
}

#[test]
fn signs_on_jagged_bodies_are_right() {
    let mut random = Congruential(6);
    let (mut inside, mut outside) = (0, 0);
    for _ in 0..30 {
        let mut mesh = star(&mut random);
        let shell = mesh.clone();
        let cloud: Vec<[f64; 3]> = (0..100).map(|_| std::array::from_fn(|_| 1.1 * random.signed())).collect();
        let nodes = mesh.nodes(cloud);
        let mut contact = mesh.contact(&nodes, 4.0);
        let found = gaps(&mut contact, &vec![0.0; mesh.size()]);
        assert_eq!(found.len(), nodes.len());
        for ((node, _), gap) in found {
            let expected = is_inside(&shell, mesh.coordinates[node]);
            assert_eq!(gap < 0.0, expected, "{:?}: {gap}", mesh.coordinates[node]);
            *(if expected { &mut inside } else { &mut outside }) += 1;
        }
        let imbalance = imbalance(&contact, &mesh.coordinates);
        assert!(imbalance < 1e-14, "{imbalance:e}");
    }
    assert!(inside > 500 && outside > 500);
}

/// The signed distance changes by no more than the node moves: along any path, over any side or vertex.
fn check_continuity<const D: usize>(mesh: &Mesh<D>, path: &[[f64; D]], samples: usize) -> [f64; 2] {
    let mut mesh = mesh.clone();
    let node = mesh.nodes([path[0]]);
    let mut contact = mesh.contact(&node, 0.5);
    let mut u = vec![0.0; mesh.size()];
    let (mut last, mut extremes): (Option<f64>, _) = (None, [f64::INFINITY, f64::NEG_INFINITY]);
    for piece in path.windows(2) {
        let length = (0..D).map(|i| (piece[1][i] - piece[0][i]).powi(2)).sum::<f64>().sqrt();
        for k in 0..=samples {
            for i in 0..D {
                let x = piece[0][i] + (piece[1][i] - piece[0][i]) * k as f64 / samples as f64;
                u[D * node[0] + i] = x - path[0][i];
            }
            let gap = single_gap(&mut contact, &u).expect("the node never leaves the surface");
            if let Some(last) = last {
                assert!((gap - last).abs() <= length / samples as f64 * (1.0 + 1e-9) + 1e-7, "{last} to {gap}");
            }
            last = Some(gap);
            extremes = [extremes[0].min(gap), extremes[1].max(gap)];
        }
    }
    extremes
}

#[test]
fn gaps_are_continuous_over_sides_and_vertices() {
    // A roof and a valley of two quadrilaterals, of four triangles, and of two segments.
    for slope in [-1.5, -0.4, -1e-4, 1e-4, 0.4, 1.5] {
        let fold = |x: f64| slope * (x - 2.0_f64).abs();
        for cells in [Cells::Quadrilaterals, Cells::Triangles] {
            let mesh = grid(4, cells, |x, _| fold(x));
            for offset in [-0.15, 0.0, 1e-9, 0.15] {
                let at = |x: f64, y: f64| [x, y, fold(x) + offset];
                let path = [at(1.0, 1.2), at(2.0, 1.8), at(3.0, 2.3), at(2.0, 2.0), at(1.0, 2.0)];
                let [least, most] = check_continuity(&mesh, &path, 157);
                assert!(least >= offset.min(0.0) - 1e-12 && most <= offset.max(0.0) + 1e-12, "{least} {most}");
                // Straight through the fold, from one side to the other.
                let path = [[1.6, 1.5, fold(1.6)], [2.4, 1.6, fold(2.4)]];
                check_continuity(&mesh, &path, 400);
                // Up through a vertex, slightly off it.
                let path = [[2.0 + 1e-9, 2.0, -0.2], [2.0, 2.0 - 1e-9, 0.2]];
                let [least, most] = check_continuity(&mesh, &path, 400);
                assert!(least < -0.1 && most > 0.1, "{least} {most}");
            }
        }
        let mut mesh = Mesh::<2>::default();
        let nodes = mesh.nodes([4.0, 3.0, 2.0, 1.0, 0.0].map(|x| [x, fold(x)]));
        mesh.facets.extend(nodes.windows(2).map(|pair| Facet::from([pair[0], pair[1]])));
        for offset in [-0.15, 0.0, 0.15] {
            check_continuity(&mesh, &[[1.0, fold(1.0) + offset], [2.0, offset], [3.0, fold(3.0) + offset]], 211);
        }
    }
    // A pyramid: four triangles around its top.
    let pyramid = grid(2, Cells::Mixed, |x, y| 1.0 - (x - 1.0).abs().max((y - 1.0).abs()));
    for height in [0.95, 1.0, 1.05] {
        check_continuity(&pyramid, &[[0.8, 0.9, height], [1.3, 1.15, height], [1.0, 0.8, height]], 400);
    }
}

#[test]
fn normals_at_a_side_do_not_flip() {
    let mut mesh = grid(2, Cells::Quadrilaterals, |x, _| -(x - 1.0).abs());
    let node = mesh.nodes([[1.0, 0.5, 0.0]]);
    let mut contact = mesh.contact(&node, 0.5);
    let mut normals = Vec::new();
    for k in 0..20 {
        let mut u = vec![0.0; mesh.size()];
        u[3 * node[0]] = 1e-12 * f64::from(k - 10);
        u[3 * node[0] + 2] = -1e-12 * f64::from(k % 3);
        contact.search_on(0.0, &u, &u, 0.0).unwrap();
        let g = rows(&contact);
        let normal: Vec<_> = g.row(0).filter(|(dof, _)| dof / 3 == node[0]).collect();
        normals.push(normal);
    }
    for normal in normals {
        let upward = normal.iter().find(|(dof, _)| dof % 3 == 2).unwrap().1;
        let across = normal.iter().find(|(dof, _)| dof % 3 == 0).map_or(0.0, |entry| entry.1);
        assert!((upward - 1.0).abs() < 1e-14 && across.abs() < 1e-14, "{normal:?}");
    }
}

#[test]
fn beyond_the_rim_there_is_no_row() {
    for cells in [Cells::Quadrilaterals, Cells::Triangles] {
        let mut mesh = grid(3, cells, |_, _| 0.0);
        let node = mesh.nodes([[1.5, 1.5, 0.1]]);
        // The reach is beyond the next side of the facet, too.
        let mut contact = mesh.contact(&node, 2.0);
        let mut at = |x: f64, y: f64, z: f64| {
            let mut u = vec![0.0; mesh.size()];
            u[3 * node[0]..].copy_from_slice(&[x - 1.5, y - 1.5, z - 0.1]);
            single_gap(&mut contact, &u)
        };
        for z in [0.1, -0.2] {
            for (x, y) in
                [(0.0, 0.0), (3.0, 1.5), (1.2, 3.0), (3.0, 3.0), (-5e-4, 1.5), (3.0 + 5e-4, 3.0), (1.0, -5e-4)]
            {
                let gap = at(x, y, z).expect("on the rim");
                assert!((gap - z).abs() < 1e-12, "{x} {y}: {gap}");
            }
            for (x, y) in [(-0.01, 1.5), (3.01, 1.0), (3.01, 3.01), (1.0, 3.2), (1.5, -0.3), (4.2, 2.0), (-0.01, 3.0)] {
                assert_eq!(at(x, y, z), None, "{x} {y}");
            }
        }
    }
    let mut mesh = Mesh::<2>::default();
    let nodes = mesh.nodes([[2.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.5, 0.1]]);
    mesh.facets.extend([Facet::from([0, 1]), [1, 2].into()]);
    let mut contact = mesh.contact(&nodes[3..], 1.5);
    for (x, expected) in [(-0.4, None), (-5e-4, Some(0.1)), (0.0, Some(0.1)), (1.0, Some(0.1)), (2.1, None)] {
        let gap = single_gap(&mut contact, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, x - 0.5, 0.0]);
        assert_eq!(gap.is_some(), expected.is_some(), "{x}");
        assert!(gap.zip(expected).is_none_or(|(gap, expected)| (gap - expected).abs() < 1e-15));
    }
}

#[test]
fn kept_lists_find_what_all_facets_give() {
    let mut random = Congruential(4);
    for cells in [Cells::Quadrilaterals, Cells::Mixed] {
        let mut mesh = grid(8, cells, |x, y| 0.3 * (x + 0.5 * y).sin());
        let surface = mesh.coordinates.len();
        let cloud: Vec<_> = (0..150)
            .map(|_| [4.0 + 4.0 * random.signed(), 4.0 + 4.0 * random.signed(), 0.6 * random.signed()])
            .collect();
        let nodes = mesh.nodes(cloud);
        let mut kept = mesh.contact(&nodes, 0.4).skin(0.2).unwrap();
        // A skin that is never used up: every node looks at every facet.
        let mut all = mesh.contact(&nodes, 0.4).skin(1e6).unwrap();
        let velocity = random.vector(mesh.size(), 0.03);
        let mut u = vec![0.0; mesh.size()];
        let mut changes = 0;
        for step in 0..60 {
            for (dof, (u, v)) in u.iter_mut().zip(&velocity).enumerate() {
                // The cloud drifts over the surface, and both fly.
                let drift = if dof / 3 >= surface && dof % 3 == 0 { 0.02 } else { 0.0 };
                *u += 0.3 * v + drift + 0.5;
            }
            let found = kept.search_on(0.0, &u, &u, 0.0).unwrap();
            assert_eq!(found, all.search_on(0.0, &u, &u, 0.0).unwrap());
            changes += usize::from(found == Candidates::Changed);
            assert_eq!(rows(&kept), rows(&all), "step {step}");
            let mut fresh = mesh.contact(&nodes, 0.4);
            assert_eq!(gaps(&mut kept, &u), gaps(&mut fresh, &u));
            assert!((0..kept.candidates()).all(|row| kept.facet(row) == all.facet(row)));
            assert!(kept.candidates() > 30);
        }
        assert_eq!(changes, 60);
        assert_eq!(all.rebuilds(), 1);
        assert!((4..30).contains(&kept.rebuilds()), "{}", kept.rebuilds());
    }
}

#[test]
fn far_bodies_have_no_candidates_and_flying_bodies_keep_their_lists() {
    let mut mesh = grid(3, Cells::Quadrilaterals, |_, _| 0.0);
    let surface = mesh.size();
    let nodes = mesh.nodes([[1.2, 1.3, 5.0], [1.7, 2.3, 5.0]]);
    let mut contact = mesh.contact(&nodes, 0.5);
    let mut u = vec![0.0; mesh.size()];
    assert_eq!(contact.search_on(0.0, &u, &u, 0.0).unwrap(), Candidates::Unchanged);
    assert_eq!((contact.candidates(), contact.rebuilds()), (0, 0));
    u[surface + 2] = -4.6;
    u[surface + 5] = -4.4;
    assert_eq!(contact.search_on(0.0, &u, &u, 0.0).unwrap(), Candidates::Changed);
    assert_eq!(contact.candidates(), 1);
    assert_eq!(contact.search_on(0.0, &u, &u, 0.0).unwrap(), Candidates::Unchanged);
    for _ in 0..100 {
        for u in &mut u {
            *u += 0.25;
        }
        assert_eq!(gaps(&mut contact, &u).len(), 1);
    }
    assert_eq!(contact.rebuilds(), 1);
    u[surface..].fill(9.0);
    assert_eq!(contact.search_on(0.0, &u, &u, 0.0).unwrap(), Candidates::Changed);
    assert_eq!(contact.candidates(), 0);
    assert_eq!(contact.search_on(0.0, &u, &u, 0.0).unwrap(), Candidates::Unchanged);
}

#[test]
fn searches_between_rebuilds_do_not_allocate() {
    let mut random = Congruential(7);
    let mut mesh = grid(6, Cells::Mixed, |x, y| 0.2 * (x * y).sin());
    let cloud: Vec<_> =
        (0..60).map(|_| [3.0 + 3.0 * random.signed(), 3.0 + 3.0 * random.signed(), 0.3 * random.signed()]).collect();
    let nodes = mesh.nodes(cloud);
    let mut contact = mesh.contact(&nodes, 0.4);
    let mut u = vec![0.0; contact.dofs().len()];
    contact.search(0.0, &u, &u, 0.0).unwrap();
    let (mut candidates, mut changes, mut found) = (0, 0, contact.found());
    // (Room for those that come.)
    found = [(); 2].iter().fold(found, |mut found, ()| {
        contact.contacts(&mut found);
        found
    });
    let counted = allocation_counter::measure(|| {
        for _ in 0..50 {
            for u in &mut u {
                *u += 0.001 * random.signed();
            }
            changes += usize::from(contact.search(0.0, &u, &u, 0.0).unwrap() == Candidates::Changed);
            found.clear();
            contact.contacts(&mut found);
            candidates += found.len();
        }
    });
    assert!(candidates > 1000 && changes == 50 && contact.rebuilds() == 1);
    assert_eq!(counted.count_total, 0);
}

#[test]
fn two_passes_treat_both_surfaces_alike() {
    let mut random = Congruential(5);
    // Two wavy surfaces that face each other; the upper one looks down.
    let mut mesh = grid(5, Cells::Mixed, |x, y| 0.1 * (2.0 * x).sin() * y.cos());
    let lower_facets = std::mem::take(&mut mesh.facets);
    let other = grid(4, Cells::Quadrilaterals, |x, y| 0.15 + 0.1 * x.cos() * (1.5 * y).sin());
    let upper = mesh.nodes(other.coordinates.iter().map(|x| [0.45 + x[0], 0.37 + x[1], x[2]]));
    let turned = |facet: &Facet| match *facet.nodes() {
        [a, b, c, d] => Facet::from([d, c, b, a].map(|node| upper[node])),
        _ => unreachable!(),
    };
    let upper_facets: Vec<_> = other.facets.iter().map(turned).collect();
    let dofs = mesh.dofs();
    let make = |own: &[Facet], facets: &[Facet]| {
        let [own, facets] = [own, facets].map(|facets| facets.iter().copied());
        NodeToFacet::new(&mesh.coordinates, &dofs, own, facets).unwrap().reach(0.6).unwrap()
    };
    let mut one = make(&upper_facets, &lower_facets);
    let mut two = make(&lower_facets, &upper_facets);
    let u = random.vector(mesh.size(), 0.05);
    let (mut a, b) = (gaps(&mut one, &u), gaps(&mut two, &u));
    let count = |pass: usize| a.iter().filter(|row| row.0.1 == pass).count();
    assert!(count(0) > 20 && count(1) > 12, "{} {}", count(0), count(1));
    assert!(a.iter().any(|row| row.1 < 0.0) && a.iter().any(|row| row.1 > 0.0));
    for row in &mut a {
        row.0.1 = 1 - row.0.1;
    }
    a.sort_by_key(|row| (row.0.1, row.0.0));
    assert_eq!(a, b);
    assert_eq!(one.dofs().len(), mesh.size());
    assert!(imbalance(&one, &mesh.positions(&u)) < 1e-14);
}

#[test]
fn pressure_on_matching_meshes_is_passed_on() {
    let (n, height) = (4, 0.0);
    for cells in [Cells::Quadrilaterals, Cells::Triangles] {
        let mut mesh = grid(n, cells, |_, _| height);
        let lower = mesh.coordinates.clone();
        let upper = mesh.nodes(lower.clone());
        let turned = mesh.facets.iter().map(|facet| {
            let nodes: Vec<_> = facet.nodes().iter().rev().map(|&node| upper[node]).collect();
            match nodes[..] {
                [a, b, c] => Facet::from([a, b, c]),
                _ => Facet::from([nodes[0], nodes[1], nodes[2], nodes[3]]),
            }
        });
        // Nodes stand on each other, so that the second pass adds nothing.
        let mut contact = mesh.both(turned.collect::<Vec<_>>(), 0.2);
        let u = vec![0.0; mesh.size()];
        let found = gaps(&mut contact, &u);
        assert_eq!(
            found.iter().map(|row| row.0).collect::<Vec<_>>(),
            upper.iter().map(|&node| (node, 0)).collect::<Vec<_>>()
        );
        assert!(found.iter().all(|row| row.1 == 0.0));
        assert!(imbalance(&contact, &mesh.positions(&u)) < 1e-14);
        // A pressure of one on the upper surface: its nodal forces are the multipliers.
        let edge = |k: usize| if k == 0 || k == n { 0.5 } else { 1.0 };
        let g = rows(&contact);
        let mut force = vec![0.0; mesh.size()];
        for (row, ((node, _), _)) in found.iter().enumerate() {
            let k = node - lower.len();
            let area = edge(k % (n + 1)) * edge(k / (n + 1));
            g.row(row).for_each(|(dof, weight)| force[dof] += weight * area);
        }
        for (k, node) in upper.iter().enumerate() {
            assert_eq!(force[3 * k..3 * k + 3], [0.0, 0.0, -force[3 * node + 2]]);
        }
        assert!((force[2..3 * lower.len()].iter().sum::<f64>() + (n * n) as f64).abs() < 1e-13);
    }
}

#[test]
fn a_run_may_start_with_touching_surfaces() {
    let mut random = Congruential(8);
    // A tilted plane, and nodes on it: coordinates carry rounding of either sign.
    let mut mesh = grid(4, Cells::Mixed, |_, _| 0.0);
    let tilt = |[x, y, _]: [f64; 3]| [0.6 * x - 0.3 * y + 7.0, 0.7 * y, 0.8 * x + 0.1 * y - 3.0];
    for x in &mut mesh.coordinates {
        *x = tilt(*x);
    }
    let touching: Vec<_> =
        (0..50).map(|_| tilt([2.0 + 1.9 * random.signed(), 2.0 + 1.9 * random.signed(), 0.0])).collect();
    let nodes = mesh.nodes(touching);
    let mut contact = mesh.contact(&nodes, 0.3);
    let found = gaps(&mut contact, &vec![0.0; mesh.size()]);
    assert_eq!(found.len(), 50);
    assert!(found.iter().all(|row| row.1.abs() < 1e-14), "{found:?}");
    // A run may start there, and rests.
    let masses = vec![1.0; mesh.size()];
    let stiffness = matrix(mesh.size(), []);
    let system = LinearSystem::lumped(masses, stiffness).unwrap();
    let mut run = Simulation::builder(system, Composite, 1e-3).constraint(contact).build().unwrap();
    run.step().unwrap();
    assert!(run.gaps().len() == 50 && run.gaps().iter().all(|gap| gap.abs() < 1e-14));
}

#[test]
fn facing_keeps_nodes_from_the_far_side_of_a_thin_body() {
    // A plate 0.2 thick; a block above it with one facet that looks down, 0.15 deep in the plate.
    let mut mesh = Mesh::<2>::default();
    mesh.nodes([[0.0, -0.2], [3.0, -0.2], [3.0, 0.0], [0.0, 0.0]]);
    mesh.facets.extend((0..4).map(|k| Facet::from([k, (k + 1) % 4])));
    let nodes = mesh.nodes([[1.0, -0.15], [2.0, -0.15]]);
    let u = vec![0.0; mesh.size()];
    let mut blind = mesh.contact(&nodes, 0.5);
    assert!(gaps(&mut blind, &u).iter().all(|row| (row.1 + 0.05).abs() < 1e-15));
    let mut facing = mesh.contact(&nodes, 0.5).facing([[nodes[0], nodes[1]]]).unwrap();
    assert!(gaps(&mut facing, &u).iter().all(|row| (row.1 + 0.15).abs() < 1e-15));
    assert_eq!(facing.candidates(), 2);
    assert_eq!(facing.facet(0), 2);
    // Deeper than the reach.
    let mut short = mesh.contact(&nodes, 0.1).facing([[nodes[0], nodes[1]]]).unwrap();
    assert!(gaps(&mut short, &u).is_empty());
}

#[test]
fn the_parts_of_the_interface() {
    let mut mesh = grid(2, Cells::Quadrilaterals, |_, _| 0.0);
    let nodes = mesh.nodes([[0.9, 0.6, 0.1], [5.0, 5.0, 0.1]]);
    // Dofs that are not in the order of nodes.
    let dofs: Vec<[usize; 3]> = mesh.dofs().iter().map(|dofs| dofs.map(|dof| 100 - dof)).collect();
    let make = || {
        NodeToFacet::one_pass(&mesh.coordinates, &dofs, &nodes, mesh.facets.iter().copied())
            .unwrap()
            .reach(0.5)
            .unwrap()
    };
    let mut contact: Box<dyn ContactConstraint<f64>> = Box::new(make().with_law(ContactLaw::Equality));
    let mut named = contact.dofs().to_vec();
    named.sort_unstable();
    assert_eq!(named, (100 - 32..=100).collect::<Vec<_>>());
    assert!(matches!(contact.search(0.0, &[0.0; 4], &[0.0; 4], 0.0), Err(Error::Dimension { found: 4, .. })));
    let mut u = vec![0.0; 101];
    u[80] = f64::NAN;
    assert!(matches!(contact.search_on(0.0, &u, &u, 0.0), Err(Error::NotFinite { index: 80, .. })));
    u[80] = 0.0;
    contact.search_on(0.0, &u, &u, 0.0).unwrap();
    assert_eq!((contact.candidates(), contact.law(0), contact.identity(0)), (1, ContactLaw::Equality, (nodes[0], 0)));
    // Slides to the next facet under the same name.
    let (facet, mut contact) = (0, make());
    contact.search_on(0.0, &u, &u, 0.0).unwrap();
    assert_eq!(contact.facet(0), facet);
    u[dofs[nodes[0]][0]] = 0.3;
    contact.search_on(0.0, &u, &u, 0.0).unwrap();
    assert_eq!((contact.identity(0), contact.facet(0)), ((nodes[0], 0), facet + 1));
    // Affine between searches.
    let mut gap = [0.0];
    u[dofs[nodes[0]][2]] = -0.4;
    contact.gap(0.0, &u, &mut gap);
    assert!((gap[0] + 0.3).abs() < 1e-15);
}

#[test]
fn single_precision_keeps_the_signs() {
    let coordinates = [[2.0_f32, 0.0], [1.0, 0.3], [0.0, 0.0], [0.4, 0.5], [1.0, 0.299_99]];
    let dofs = [[0, 1], [2, 3], [4, 5], [6, 7], [8, 9]];
    let mut contact = NodeToFacet::one_pass(&coordinates, &dofs, &[3, 4], [[0, 1], [1, 2]]).unwrap();
    contact.search_on(0.0, &[0.0; 10], &[0.0; 10], 0.0).unwrap();
    let mut gaps = [0.0_f32; 2];
    contact.gap(0.0, &[0.0; 10], &mut gaps);
    assert!((gaps[0] - 0.364_0).abs() < 1e-3 && gaps[1] < 0.0 && gaps[1] > -2e-5, "{gaps:?}");
    let g = contact.jacobian();
    assert!(g.row(1).any(|(dof, weight)| dof == 9 && (weight - 1.0).abs() < 1e-6));
}

#[test]
fn wrong_input_is_refused() {
    let flat = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 0.1], [2.0, 0.0, 0.0]];
    let dofs: Vec<[usize; 3]> = (0..6).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let make = |nodes: &[usize], facets: &[Facet], reach: f64| {
        NodeToFacet::one_pass(&flat, &dofs, nodes, facets.iter().copied())?.reach(reach).map(|_| ())
    };
    let triangle = Facet::from([0, 1, 2]);
    make(&[4], &[triangle], 1.0).unwrap();
    for reach in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(make(&[4], &[triangle], reach), Err(Error::Parameter { .. })));
    }
    assert!(matches!(make(&[], &[triangle], 1.0), Err(Error::Empty { .. })));
    assert!(matches!(make(&[4], &[], 1.0), Err(Error::Empty { .. })));
    assert!(matches!(make(&[6], &[triangle], 1.0), Err(Error::Dimension { found: 6, .. })));
    assert!(matches!(make(&[4], &[[0, 1, 9].into()], 1.0), Err(Error::Dimension { found: 9, .. })));
    assert!(matches!(make(&[4], &[[0, 1].into()], 1.0), Err(Error::Dimension { found: 2, .. })));
    let incompatible = [
        (vec![4, 4], vec![triangle]),
        (vec![2], vec![triangle]),
        (vec![4], vec![[0, 1, 5].into()]),
        (vec![4], vec![[0, 1, 1].into()]),
        (vec![4], vec![[0, 2, 1, 3].into()]),
        // Turned, and branched.
        (vec![4], vec![triangle, [0, 2, 3].into(), [0, 3, 2].into()]),
        (vec![4], vec![triangle, [0, 3, 2].into()]),
        (vec![3], vec![triangle, [1, 0, 4].into(), [1, 0, 5].into()]),
    ];
    for (nodes, facets) in incompatible {
        let refused = make(&nodes, &facets, 1.0);
        assert!(matches!(refused, Err(Error::Incompatible { .. } | Error::InvertedFacet { .. })), "{facets:?}");
    }
    let mut infinite = flat;
    infinite[2][1] = f64::INFINITY;
    let refused = NodeToFacet::one_pass(&infinite, &dofs, &[4], [[0, 1, 2]]);
    assert!(matches!(refused, Err(Error::NotFinite { index: 2, .. })));
    let refused = NodeToFacet::one_pass(&flat, &dofs[1..], &[4], [[0, 1, 2]]);
    assert!(matches!(refused, Err(Error::Dimension { expected: 6, found: 5, .. })));
    let refused = NodeToFacet::one_pass(&[[0.0], [1.0]], &[[0], [1]], &[1], [[0, 0]]);
    assert!(matches!(refused, Err(Error::Dimension { found: 1, .. })));
    let contact = NodeToFacet::one_pass(&flat, &dofs, &[4], [[0, 1, 2]]).unwrap();
    assert!(matches!(contact.skin(0.0), Err(Error::Parameter { .. })));
    let shared = NodeToFacet::new(&flat, &dofs, [[3, 4, 2]], [[0, 1, 2]]);
    assert!(matches!(shared, Err(Error::Incompatible { .. })));
}

/// A node flies obliquely onto two segments of elastically joined masses: it is stopped there, slides on over the
/// vertex, and momentum is kept in both directions.
#[test]
fn a_run_with_candidates_that_change() {
    let coordinates = [[2.0, 0.0], [1.0, 0.05], [0.0, 0.0], [0.4, 0.2]];
    let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
    let contact = NodeToFacet::one_pass(&coordinates, &dofs, &[3], [[0, 1], [1, 2]]).unwrap().reach(0.1).unwrap();
    let ties = [(0, 2), (1, 3), (2, 4), (3, 5), (0, 4), (1, 5)];
    let stiffness = matrix(8, ties.into_iter().flat_map(|(i, j)| spring(i, j, 50.0)));
    let mass = vec![2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 1.0, 1.0];
    let start = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0];
    let system = LinearSystem::lumped(mass, stiffness).unwrap();
    let mut run = Simulation::builder(system, Composite, 2e-3)
        .velocity(start.to_vec())
        .constraint(contact)
        .corrector(PersistencyCorrection::with_history_projection())
        .build()
        .unwrap();
    let momentum = |run: &Simulation<'_, f64>, i: usize| {
        let direction: Vec<f64> = (0..8).map(|dof| f64::from(u8::from(dof % 2 == i))).collect();
        run.momentum(&direction).unwrap()
    };
    let before = [momentum(&run, 0), momentum(&run, 1)];
    let (mut closed, mut deepest) = (0, 0.0_f64);
    for _ in 0..600 {
        run.step().unwrap();
        deepest = run.gaps().iter().fold(deepest, |deepest, &gap| deepest.min(gap));
        closed += usize::from(run.gaps().iter().any(|gap| gap.abs() < 1e-10));
    }
    for (i, before) in before.into_iter().enumerate() {
        assert!((momentum(&run, i) - before).abs() < 1e-12, "{} {before}", momentum(&run, i));
    }
    assert!(closed > 10, "{closed} steps in contact");
    assert!(deepest > -1e-4, "{deepest}");
}

/// Displacements that differ from others by up to `size`.
fn shaken(u: &[f64], random: &mut Congruential, size: f64) -> Vec<f64> {
    u.iter().map(|u| u + size * random.signed()).collect()
}

fn gaps_now(contact: &mut NodeToFacet<f64>, u: &[f64]) -> Vec<f64> {
    let mut gaps = vec![f64::NAN; contact.candidates()];
    contact.gap(0.0, u, &mut gaps);
    gaps
}

/// Follows to some displacements and compares with a search there; returns the rows compared and those on other facets
/// than before.
fn check_follow(contact: &mut NodeToFacet<f64>, fresh: &mut NodeToFacet<f64>, from: &[f64], to: &[f64]) -> [usize; 2] {
    contact.search_on(0.0, from, from, 0.0).unwrap();
    let names: Vec<_> = (0..contact.candidates()).map(|row| contact.identity(row)).collect();
    let facets: Vec<_> = (0..names.len()).map(|row| contact.facet(row)).collect();
    let before = rows(contact);
    let moved = contact.follow_on(0.0, to).unwrap();
    let after = rows(contact);
    assert_eq!(moved == Candidates::Changed, before != after);
    assert_eq!(names, (0..contact.candidates()).map(|row| contact.identity(row)).collect::<Vec<_>>());
    // Nothing is left to follow.
    let found = gaps_now(contact, to);
    assert_eq!(contact.follow_on(0.0, to).unwrap(), Candidates::Unchanged);
    assert_eq!(found, gaps_now(contact, to));

    let expected = gaps(fresh, to);
    let g = rows(fresh);
    let mut count = [0, 0];
    for (row, name) in names.iter().enumerate() {
        let Some(place) = expected.iter().position(|other| other.0 == *name) else { continue };
        assert_eq!(found[row], expected[place].1, "{name:?}");
        assert_eq!(contact.facet(row), fresh.facet(place), "{name:?}");
        assert!(after.row(row).eq(g.row(place)), "{name:?}");
        assert_eq!(contact.magnitude(row), fresh.magnitude(place));
        count = [count[0] + 1, count[1] + usize::from(contact.facet(row) != facets[row])];
    }
    // The next search sees the rows that were followed.
    let same = names.len() == expected.len() && count[0] == names.len();
    assert_eq!(contact.search_on(0.0, to, to, 0.0).unwrap() == Candidates::Unchanged, same);
    assert_eq!(rows(contact), g);
    count
}

#[test]
fn followed_rows_are_those_of_a_search() {
    let mut random = Congruential(11);
    for cells in [Cells::Quadrilaterals, Cells::Triangles, Cells::Mixed] {
        let mut mesh = grid(6, cells, |x, y| 0.3 * (x * 1.3).sin() * (y * 0.9).cos());
        let cloud: Vec<_> = (0..100)
            .map(|_| [3.0 + 2.0 * random.signed(), 3.0 + 2.0 * random.signed(), 0.6 * random.signed()])
            .collect();
        let nodes = mesh.nodes(cloud);
        let (mut contact, mut fresh) = (mesh.contact(&nodes, 1.0), mesh.contact(&nodes, 1.0));
        let u = random.vector(mesh.size(), 0.05);
        let to = shaken(&u, &mut random, 0.15);
        let [compared, crossed] = check_follow(&mut contact, &mut fresh, &u, &to);
        assert!(compared > 90 && crossed > 10, "{compared} {crossed}");
    }
}

#[test]
fn both_passes_are_followed() {
    let mut random = Congruential(12);
    let mut mesh = grid(5, Cells::Mixed, |x, y| 0.1 * (2.0 * x).sin() * y.cos());
    let other = grid(3, Cells::Quadrilaterals, |x, y| 0.15 + 0.1 * x.cos() * (1.5 * y).sin());
    let upper = mesh.nodes(other.coordinates.iter().map(|x| [0.95 + x[0], 0.87 + x[1], x[2]]));
    let turned: Vec<_> = other
        .facets
        .iter()
        .map(|facet| std::array::from_fn::<_, 4, _>(|k| upper[facet.nodes()[3 - k]]))
        .map(Facet::from)
        .collect();
    let make = || mesh.both(turned.iter().copied(), 0.6);
    let (mut contact, mut fresh) = (make(), make());
    let u = random.vector(mesh.size(), 0.03);
    let to = shaken(&u, &mut random, 0.05);
    let [compared, crossed] = check_follow(&mut contact, &mut fresh, &u, &to);
    assert!(compared > 20 && crossed > 0, "{compared} {crossed}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    /// On closed bodies no node is lost, however it moves: through the body, over sides and vertices.
    #[test]
    fn any_motion_on_a_closed_body_is_followed(seed in any::<u64>(), start in 0.0..0.2_f64, motion in 0.0..0.6_f64) {
        let mut random = Congruential(seed);
        let mut mesh = box_of_quadrilaterals(&mut random, 0.2);
        let cloud: Vec<[f64; 3]> = (0..20).map(|_| std::array::from_fn(|_| 1.5 * random.signed())).collect();
        let nodes = mesh.nodes(cloud);
        let u = random.vector(mesh.size(), start);
        // Facets stay convex.
        let mut to = shaken(&u, &mut random, motion.min(0.2));
        for u in &mut to[24..] {
            *u += motion * random.signed();
        }
        let [compared, _] = check_follow(&mut mesh.contact(&nodes, 4.0), &mut mesh.contact(&nodes, 4.0), &u, &to);
        prop_assert_eq!(compared, 20);

        let mut mesh = polygon(7);
        let cloud: Vec<[f64; 2]> = (0..20).map(|_| [1.5 * random.signed(), 1.5 * random.signed()]).collect();
        let nodes = mesh.nodes(cloud);
        let u = random.vector(mesh.size(), start);
        let to = shaken(&u, &mut random, motion.min(0.3));
        let [compared, _] = check_follow(&mut mesh.contact(&nodes, 4.0), &mut mesh.contact(&nodes, 4.0), &u, &to);
        prop_assert_eq!(compared, 20);
    }
}

#[test]
fn nodes_stand_on_the_vertices_they_are_followed_to() {
    for slope in [-0.5, 0.5] {
        let mut mesh = grid(2, Cells::Mixed, |x, y| slope * ((x - 1.0).abs() + (y - 1.0).abs()));
        let nodes = mesh.nodes([[0.8, 0.7, 0.1], [1.3, 0.6, -0.1]]);
        let (mut contact, mut fresh) = (mesh.contact(&nodes, 1.0), mesh.contact(&nodes, 1.0));
        let u = vec![0.0; mesh.size()];
        for place in [[1.0, 1.0, 0.0], [1.0, 1.0, 0.2], [1.0, 1.0, -0.2], [1.0 + 1e-12, 1.0, 1e-12], [1.0, 0.5, 0.0]] {
            let mut to = u.clone();
            for &node in &nodes {
                (0..3).for_each(|i| to[3 * node + i] = place[i] - mesh.coordinates[node][i]);
            }
            let [compared, _] = check_follow(&mut contact, &mut fresh, &u, &to);
            assert_eq!(compared, 2);
        }
    }
}

fn lost(result: contact_dynamics::Result<Candidates>) -> Option<ContactId> {
    match result {
        Ok(_) => None,
        Err(error) => {
            assert!(error.is_recoverable());
            match error {
                Error::ContactLost { t, contact } => {
                    assert_eq!(t, 0.5);
                    Some(contact)
                }
                other => panic!("{other}"),
            }
        }
    }
}

#[test]
fn nodes_that_leave_the_surface_are_lost_if_they_press() {
    for cells in [Cells::Quadrilaterals, Cells::Triangles] {
        let mut mesh = grid(3, cells, |_, _| 0.0);
        let nodes = mesh.nodes([[1.4, 1.6, 0.0], [2.9, 1.5, 0.1]]);
        let node = nodes[1];
        let mut contact = mesh.contact(&nodes, 0.5);
        let start = vec![0.0; mesh.size()];
        contact.search_on(0.0, &start, &start, 0.0).unwrap();
        let to = |x: f64, z: f64| {
            let mut u = start.clone();
            u[3 * node] = x - 2.9;
            u[3 * node + 2] = z - 0.1;
            u
        };
        let before = rows(&contact);
        // Over the rim: the step ends on the facet that goes on, on its plane.
        for (x, z) in [(3.0005, -0.02), (3.1, -0.02), (3.2, 0.0), (3.2, 0.3)] {
            let u = to(x, z);
            assert_eq!(lost(contact.follow_on(0.5, &u)), None);
            assert!((gaps_now(&mut contact, &u)[1] - z).abs() < 1e-14);
            let g = rows(&contact);
            assert!(g.row(1).filter(|(dof, _)| dof / 3 == node).eq([(3 * node + 2, 1.0)]));
            assert!((g.row(1).map(|entry| entry.1).sum::<f64>()).abs() < 1e-15);
        }
        // Farther, pressed: refused, and the rows are those of before.
        let g = rows(&contact);
        let name = ContactId { constraint: 0, feature: node, candidate: 0 };
        for (x, z) in [(3.4, -0.02), (3.4, 0.0), (3.4, 0.004), (2.9, -9.0)] {
            assert_eq!(lost(contact.follow_on(0.5, &to(x, z))), Some(name));
            assert_eq!(rows(&contact), g);
        }
        // Farther, open: nothing is there to press on.
        let u = to(3.4, 0.05);
        assert_eq!(lost(contact.follow_on(0.5, &u)), None);
        assert!((gaps_now(&mut contact, &u)[1] - 0.05).abs() < 1e-14);
        // Out of reach, but within what the lists know; and beyond that.
        assert_eq!(lost(contact.follow_on(0.5, &to(2.9, 0.7))), None);
        assert_eq!(lost(contact.follow_on(0.5, &to(2.9, 1.2))), Some(name));
        // The search begins anew.
        lost(contact.follow_on(0.5, &to(3.4, -0.02))).unwrap();
        assert_eq!(contact.search_on(0.6, &to(3.4, -0.02), &start, 0.0).unwrap(), Candidates::Changed);
        assert_eq!(contact.candidates(), 1);
        lost(contact.follow_on(0.5, &to(2.9, 0.2)));
        assert_eq!(contact.search_on(0.6, &start, &start, 0.0).unwrap(), Candidates::Changed);
        assert_eq!((contact.candidates(), rows(&contact)), (2, before));
        assert_eq!(contact.search_on(0.6, &start, &start, 0.0).unwrap(), Candidates::Unchanged);
    }
}

#[test]
fn nodes_that_turn_away_are_lost_if_they_press() {
    // A floor, and a segment above it that looks down, until it is turned around its first node.
    let mut mesh = Mesh::<2>::default();
    mesh.nodes([[3.0, 0.0], [0.0, 0.0]]);
    mesh.facets.push([0, 1].into());
    let nodes = mesh.nodes([[1.0, 0.0], [1.5, 0.0]]);
    let mut contact = mesh.contact(&nodes[..1], 0.5).facing([[nodes[0], nodes[1]]]).unwrap();
    let turn = |degrees: f64, height: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        vec![0.0, 0.0, 0.0, 0.0, 0.0, height, 0.5 * cos - 0.5, 0.5 * sin + height]
    };
    let start = turn(0.0, 0.0);
    contact.search_on(0.0, &start, &start, 0.0).unwrap();
    // The normals of the two are 180° apart at the start.
    for (degrees, height, known) in
        [(100.0, 0.0, true), (135.0, 0.0, true), (142.0, 0.0, false), (180.0, -0.1, false), (180.0, 0.2, true)]
    {
        let u = turn(degrees, height);
        let feature = lost(contact.follow_on(0.5, &u)).map(|contact| contact.feature);
        assert_eq!(feature, (!known).then_some(nodes[0]), "{degrees} {height}");
        if known {
            assert!((gaps_now(&mut contact, &u)[0] - height).abs() < 1e-15);
        }
    }
}

#[test]
fn trial_states_that_are_no_numbers_are_gaps_that_are_none() {
    let mut mesh = grid(2, Cells::Quadrilaterals, |_, _| 0.0);
    let nodes = mesh.nodes([[0.5, 0.5, 0.1], [1.5, 1.5, 0.1]]);
    let mut contact = mesh.contact(&nodes, 0.5);
    let mut u = vec![0.0; mesh.size()];
    contact.search_on(0.0, &u, &u, 0.0).unwrap();
    let g = rows(&contact);
    u[3 * nodes[0] + 2] = f64::NAN;
    assert_eq!(contact.follow_on(0.0, &u).unwrap(), Candidates::Unchanged);
    let gaps = gaps_now(&mut contact, &u);
    assert!(gaps[0].is_nan() && gaps[1] == 0.1 && rows(&contact) == g);
    assert!(matches!(contact.follow(0.0, &u[..5]), Err(Error::Dimension { found: 5, .. })));
}

fn accelerations(contact: &mut NodeToFacet<f64>, u: &[f64], v: &[f64]) -> Vec<f64> {
    let mut rates = vec![GapRates { rate: f64::NAN, acceleration: f64::NAN }; contact.candidates()];
    contact.rates_on(0.0, u, v, &mut rates);
    assert!(rates.iter().all(|rates| rates.rate == 0.0));
    rates.iter().map(|rates| rates.acceleration).collect()
}

#[test]
fn following_and_rates_do_not_allocate() {
    let mut random = Congruential(13);
    let mut mesh = grid(6, Cells::Mixed, |x, y| 0.2 * (x * y).sin());
    let cloud: Vec<_> =
        (0..60).map(|_| [3.0 + 2.5 * random.signed(), 3.0 + 2.5 * random.signed(), 0.3 * random.signed()]).collect();
    let nodes = mesh.nodes(cloud);
    let mut contact = mesh.contact(&nodes, 0.4);
    let mut u = vec![0.0; contact.dofs().len()];
    contact.search(0.0, &u, &u, 0.0).unwrap();
    let mut rates = vec![GapRates::default(); contact.candidates()];
    let counted = allocation_counter::measure(|| {
        for _ in 0..20 {
            for u in &mut u {
                *u += 0.001 * random.signed();
            }
            assert_eq!(contact.follow(0.0, &u).unwrap(), Candidates::Changed);
            contact.rates(0.0, &u, &u, &mut rates).unwrap();
        }
    });
    assert!(rates.len() > 30);
    assert_eq!(counted.count_total, 0);
}

/// Compares rates with differences of gaps that are searched for along u + s v; returns how many rows were compared,
/// and how many of them on a side or a vertex.
fn check_acceleration<const D: usize>(mesh: &Mesh<D>, nodes: &[usize], random: &mut Congruential) -> [usize; 2] {
    let step = 2e-3;
    let mut contact = mesh.contact(nodes, 0.8);
    let u = random.vector(mesh.size(), 0.05);
    let v = random.vector(mesh.size(), 1.0);
    let found = gaps(&mut contact, &u);
    let g = rows(&contact);
    let facets: Vec<_> = (0..g.rows()).map(|row| contact.facet(row)).collect();
    let computed = accelerations(&mut contact, &u, &v);
    let places = [-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0];
    let mut along = vec![[None; 7]; g.rows()];
    let mut slopes = vec![[f64::NAN; 7]; g.rows()];
    for (k, place) in places.into_iter().enumerate() {
        let moved: Vec<_> = u.iter().zip(&v).map(|(u, v)| u + place * step * v).collect();
        let there = gaps(&mut contact, &moved);
        let g = rows(&contact);
        for (row, &(name, _)) in found.iter().enumerate() {
            let place = there.iter().position(|other| other.0 == name);
            along[row][k] = place.map(|place| there[place].1);
            slopes[row][k] = place.map_or(f64::NAN, |place| g.product(place, &v));
        }
    }
    let mut compared = [0, 0];
    for (row, &computed) in computed.iter().enumerate() {
        let Some(y) = along[row].into_iter().collect::<Option<Vec<_>>>() else { continue };
        let d = |k: usize| y[3 + k] + y[3 - k] - 2.0 * y[3];
        let difference = (1.5 * d(1) - 0.15 * d(2) + d(3) / 90.0) / (step * step);
        // Where the gap is smooth, both ways of writing the derivative agree.
        let m = &slopes[row];
        let slope = (0.75 * (m[4] - m[2]) - 0.15 * (m[5] - m[1]) + (m[6] - m[0]) / 60.0) / step;
        let scale = 1.0 + difference.abs();
        if (slope - difference).abs() > 1e-6 * scale || found[row].1.abs() < 0.05 {
            continue;
        }
        assert!((computed - difference).abs() < 2e-6 * scale, "row {row}: {computed} and {difference}, {slope}");
        let on_border = g.row(row).count() < D * (1 + mesh.facets[facets[row]].nodes().len());
        compared = [compared[0] + 1, compared[1] + usize::from(on_border)];
    }
    compared
}

#[test]
fn rates_are_the_second_derivatives_of_gaps() {
    let mut random = Congruential(14);
    for cells in [Cells::Quadrilaterals, Cells::Triangles, Cells::Mixed] {
        for height in [0.0, 0.4] {
            let mut mesh = grid(4, cells, |x, y| height * (x * 1.9).sin() * (y * 1.4).cos());
            let cloud: Vec<_> = (0..150)
                .map(|_| [2.0 + 1.9 * random.signed(), 2.0 + 1.9 * random.signed(), 0.7 * random.signed()])
                .collect();
            let nodes = mesh.nodes(cloud);
            let [compared, around] = check_acceleration(&mesh, &nodes, &mut random);
            assert!(compared > 60, "{compared}");
            assert!(height == 0.0 || around > 2, "{around}");
        }
    }
    let mut mesh = polygon(6);
    let cloud: Vec<[f64; 2]> = (0..100).map(|_| [1.3 * random.signed(), 1.3 * random.signed()]).collect();
    let nodes = mesh.nodes(cloud);
    let [compared, around] = check_acceleration(&mesh, &nodes, &mut random);
    assert!(compared > 40 && around > 5, "{compared} {around}");
}

#[test]
fn bodies_that_turn_together_have_no_gap_acceleration() {
    let mut random = Congruential(15);
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    for touching in [false, true] {
        let mut mesh = grid(4, Cells::Mixed, |x, y| if touching { 0.0 } else { 0.4 * (x * 1.9).sin() * y.cos() });
        let cloud: Vec<_> = (0..100)
            .map(|k| {
                let z = if touching { 0.0 } else { 0.5 * random.signed() };
                // Some on sides and vertices.
                let round = |x: f64| if k % 3 == 0 { x.round() } else { x };
                [round(2.0 + 1.9 * random.signed()), 2.0 + 1.9 * random.signed(), z]
            })
            .collect();
        let nodes = mesh.nodes(cloud);
        let mut contact = mesh.contact(&nodes, 0.6);
        let u = vec![0.0; mesh.size()];
        contact.search_on(0.0, &u, &u, 0.0).unwrap();
        let omega = [0.7, -1.1, 0.4];
        let (mut v, mut a) = (Vec::new(), Vec::new());
        for &x in &mesh.coordinates {
            v.extend(cross(omega, x));
            a.extend(cross(omega, cross(omega, x)));
        }
        let g = rows(&contact);
        assert!(g.rows() > 60);
        for (row, acceleration) in accelerations(&mut contact, &u, &v).into_iter().enumerate() {
            let total = g.product(row, &a) + acceleration;
            assert!(total.abs() < 1e-12, "{total:e}");
            assert!(!touching || acceleration.abs() < 1e-12, "{acceleration:e}");
        }
    }
}

/// A bead on a rod that turns with constant speed slides outward, r = r₀ cosh ω t, and presses with 2 m ω ṙ.
#[test]
fn a_bead_on_a_turning_rod_is_pushed_by_it() {
    let omega = 1.5_f64;
    let run = |h: f64| {
        // The rod from (4, 0) to the origin, its free side upward; it turns upward and carries the bead along.
        let coordinates = [[4.0, 0.0], [0.0, 0.0], [0.5, 0.0]];
        let dofs = [[0, 1], [2, 3], [4, 5]];
        let contact = NodeToFacet::one_pass(&coordinates, &dofs, &[2], [[0, 1]]).unwrap();
        let stiffness = matrix(6, (0..6).map(|i| (i, i, 0.0)));
        let end = move |axis: usize| {
            move |t: f64| {
                let (sin, cos) = (omega * t).sin_cos();
                let [x, v, a] = [[4.0 * cos - 4.0, 4.0 * sin], [-4.0 * sin, 4.0 * cos], [-4.0 * cos, -4.0 * sin]];
                [x[axis], omega * v[axis], omega * omega * a[axis]]
            }
        };
        let system = LinearSystem::lumped(vec![1.0; 6], stiffness).unwrap();
        let system = system.fix(2).unwrap().fix(3).unwrap().drive(0, end(0)).unwrap().drive(1, end(1)).unwrap();
        let mut run = Simulation::builder(system, Composite, h)
            .velocity(vec![0.0, 4.0 * omega, 0.0, 0.0, 0.0, 0.5 * omega])
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        let mut worst = 0.0_f64;
        while run.time() < 1.0 {
            run.step().unwrap();
            let angle = omega * run.time();
            let coriolis = 2.0 * omega * omega * 0.5 * angle.sinh();
            if run.time() > 0.2 {
                let state = run.state();
                let across = state.acceleration()[5] * angle.cos() - state.acceleration()[4] * angle.sin();
                worst = worst.max((across / coriolis - 1.0).abs());
            }
        }
        worst
    };
    let errors = [run(4e-3), run(1e-3)];
    assert!(errors[0] < 0.05 && errors[1] < 0.3 * errors[0], "{errors:?}");
}
