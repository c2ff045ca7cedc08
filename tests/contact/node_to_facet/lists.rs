//! Candidates and kept lists, one pass and two, runs in which candidates change, and what is refused.

use super::{Cells, Mesh, gaps, grid, imbalance, rows};
use contact_dynamics::contact::{Candidates, ContactLaw, Facet, NodeToFacet, SurfaceSettings};
use contact_dynamics::{Composite, ContactConstraint, Error, LinearSystem, PersistencyCorrection, Simulation};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::sparse::{matrix, spring};

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
        let mut kept = mesh.contact(&nodes, 0.4).with(SurfaceSettings::new().skin(0.2)).unwrap();
        // A skin that is never used up: every node looks at every facet.
        let mut all = mesh.contact(&nodes, 0.4).with(SurfaceSettings::new().skin(1e6)).unwrap();
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
    let mut search = |times: usize| {
        for _ in 0..times {
            for u in &mut u {
                *u += 0.001 * random.signed();
            }
            changes += usize::from(contact.search(0.0, &u, &u, 0.0).unwrap() == Candidates::Changed);
            found.clear();
            contact.contacts(&mut found);
            candidates += found.len();
        }
    };
    // (Memory for the candidates, in two lists that swap.)
    search(10);
    let counted = allocation_counter::measure(|| search(50));
    assert!(candidates > 1000 && changes == 60 && contact.rebuilds() == 1);
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
        NodeToFacet::new(&mesh.coordinates, &dofs, own, facets)
            .unwrap()
            .with(SurfaceSettings::new().reach(0.6))
            .unwrap()
    };
    let mut one = make(&upper_facets, &lower_facets);
    let mut two = make(&lower_facets, &upper_facets);
    let u = random.vector(mesh.size(), 0.05);
    let (mut a, b) = (gaps(&mut one, &u), gaps(&mut two, &u));
    let count = |pass: usize| a.iter().filter(|row| row.0.1 == pass).count();
    assert!(count(0) > 20 && count(1) > 12, "{} {}", count(0), count(1));
    assert!(a.iter().any(|row| row.1 < 0.0) && a.iter().any(|row| row.1 > 0.0));
    for row in &mut a {
        row.0.1 ^= 1;
    }
    a.sort_by_key(|row| (row.0.1 % 2, row.0.0));
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

/// Said of two passes, it leaves the first one.
#[test]
fn facing_makes_one_pass() {
    let mut mesh = Mesh::<2>::default();
    mesh.nodes([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]);
    mesh.facets.extend((0..3).map(|k| Facet::from([k + 1, k])));
    let above = mesh.nodes([[0.5, 0.1], [2.5, 0.1]]);
    let own = || [Facet::from([above[0], above[1]])];
    let u = vec![0.0; mesh.size()];
    assert_eq!(gaps(&mut mesh.both(own(), 0.5), &u).len(), 4);
    let mut one = mesh.both(own(), 0.5).facing(own()).unwrap();
    let rows = gaps(&mut one, &u);
    assert!(rows.len() == 2 && rows.iter().all(|row| (row.1 - 0.1).abs() < 1e-15), "{rows:?}");
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
            .with(SurfaceSettings::new().reach(0.5))
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
        NodeToFacet::one_pass(&flat, &dofs, nodes, facets.iter().copied())?
            .with(SurfaceSettings::new().reach(reach))
            .map(|_| ())
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
    assert!(matches!(contact.with(SurfaceSettings::new().skin(0.0)), Err(Error::Parameter { .. })));
    let shared = NodeToFacet::new(&flat, &dofs, [[3, 4, 2]], [[0, 1, 2]]);
    assert!(matches!(shared, Err(Error::Incompatible { .. })));
}

/// A node flies obliquely onto two segments of elastically joined masses: it is stopped there, slides on over the
/// vertex, and momentum is kept in both directions.
#[test]
fn a_run_with_candidates_that_change() {
    let coordinates = [[2.0, 0.0], [1.0, 0.05], [0.0, 0.0], [0.4, 0.2]];
    let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
    let contact = NodeToFacet::one_pass(&coordinates, &dofs, &[3], [[0, 1], [1, 2]])
        .unwrap()
        .with(SurfaceSettings::new().reach(0.1))
        .unwrap();
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
