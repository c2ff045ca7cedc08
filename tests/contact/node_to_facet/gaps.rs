//! Gaps against brute force and differences: rows, signs, continuity, rims.

use super::{Cells, Mesh, box_of_quadrilaterals, gaps, grid, imbalance, polygon, rows, single_gap};
use contact_dynamics::contact::{Facet, NodeToFacet, SurfaceSettings};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::random::Congruential;

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
        // (In a dent two facets may be as near, and the others stand beside the one or the other.)
        let distances = |rows: Vec<((usize, usize), f64)>| rows.into_iter().filter(|(name, _)| name.1 == 0);
        for (one, other) in distances(here).zip(distances(gaps(&mut contact, &moved))) {
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
        let mut found = gaps(&mut contact, &vec![0.0; mesh.size()]);
        // (What else there is in dents is no distance.)
        found.retain(|(name, _)| name.1 == 0);
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
fn nodes_in_a_dent_have_a_row_for_each_side() {
    // Two segments that rise from (1, 0), or fall, and a node above.
    let contact = |rise: f64, node: [f64; 2]| {
        let coordinates = [[2.0, rise], [1.0, 0.0], [0.0, rise], node];
        let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
        NodeToFacet::one_pass(&coordinates, &dofs, &[3], [[0, 1], [1, 2]]).unwrap()
    };
    let zero = [0.0; 8];
    let heights = |x: f64, y: f64| [y - 0.5 * (x - 1.0), y + 0.5 * (x - 1.0)].map(|height| height / 1.25_f64.sqrt());
    let mut dent = contact(0.5, [1.05, 0.1]);
    let [right, left] = heights(1.05, 0.1);
    let found = gaps(&mut dent, &zero);
    assert_eq!(found.iter().map(|(name, _)| *name).collect::<Vec<_>>(), [(3, 0), (3, 4)]);
    assert!((found[0].1 - right).abs() < 1e-15 && (found[1].1 - left).abs() < 1e-15, "{found:?}");
    // Over the bottom, and into it: each row stays on its side.
    for [x, y] in [[0.9, 0.2], [0.9, 0.0], [1.0, 0.0], [1.0, -0.1]] {
        let mut u = zero;
        (u[6], u[7]) = (x - 1.05, y - 0.1);
        dent.follow_on(0.0, &u).unwrap();
        let mut now = [0.0; 2];
        dent.gap(0.0, &u, &mut now);
        assert_eq!((dent.facet(0), dent.facet(1)), (0, 1));
        assert!(now.iter().zip(heights(x, y)).all(|(gap, height)| (gap - height).abs() < 1e-15), "{x} {y}: {now:?}");
    }
    // Up one side and over its end, the shorter one: its row goes on, for the node has not left the other side.
    let coordinates = [[2.0, 0.5], [1.0, 0.0], [0.8, 0.1], [1.0, 0.02]];
    let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
    let mut short = NodeToFacet::one_pass(&coordinates, &dofs, &[3], [[0, 1], [1, 2]])
        .unwrap()
        .with(SurfaceSettings::new().reach(1.0))
        .unwrap();
    assert_eq!(gaps(&mut short, &zero).len(), 2);
    for s in [0.1, 0.3, 0.5] {
        let mut u = zero;
        (u[6], u[7]) = (-s, 0.5 * s - 0.02);
        short.follow_on(0.0, &u).unwrap();
        let mut now = [0.0; 2];
        short.gap(0.0, &u, &mut now);
        assert!(now[0] > 0.0 && now[1].abs() < 1e-15, "{s}: {now:?}");
    }
    // At the bottom neither is nearer: the first facet has the first row.
    for x in [1.0 - 1e-12, 1.0 + 1e-12] {
        let found = gaps(&mut contact(0.5, [x, 0.0]), &zero);
        assert_eq!(found.iter().map(|(name, _)| *name).collect::<Vec<_>>(), [(3, 0), (3, 4)]);
    }
    // None over a ridge, in a flat dent, or far from the bottom.
    for (rise, node) in [(-0.5, [1.05, 0.1]), (0.01, [1.05, 0.1]), (0.5, [1.8, 0.45])] {
        assert_eq!(gaps(&mut contact(rise, node), &zero).len(), 1, "{rise} {node:?}");
    }
}

/// On a side that two facets share the normal is between theirs where the node is, also of warped ones.
#[test]
fn the_normal_on_a_side_is_that_of_the_place() {
    for s in [0.1, 0.3, 0.5, 0.8] {
        let mut mesh = Mesh::<3>::default();
        mesh.nodes([[0.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, -0.1]]);
        mesh.nodes([[1.0, 1.0, -0.9]]);
        mesh.facets.extend([[0, 1, 3, 2], [2, 3, 5, 4]].map(Facet::from));
        let node = mesh.nodes([[s, 0.0, 0.0]])[0];
        let mut contact = mesh.contact(&[node], 0.5);
        let u = vec![0.0; mesh.size()];
        assert!(gaps(&mut contact, &u).iter().all(|row| row.1.abs() < 1e-15));
        // The slope of the warped one there; the other one is level.
        let slope = 0.1 + 0.8 * s;
        let length = f64::hypot(1.0, slope);
        let sum = [0.0, slope / length, 1.0 + 1.0 / length];
        let size = f64::hypot(sum[1], sum[2]);
        let g = rows(&contact);
        for (dof, weight) in g.row(0).filter(|&(dof, _)| dof / 3 == node) {
            assert!((weight - sum[dof % 3] / size).abs() < 1e-12, "{s}: {weight} of {sum:?}");
        }
    }
}
