//! Rows that follow the motion within a step, and nodes that leave the surface.

use super::{Cells, Mesh, box_of_quadrilaterals, gaps, grid, polygon, rows};
use contact_dynamics::contact::{Candidates, ContactId, Facet, NodeToFacet};
use contact_dynamics::{ContactConstraint, Error};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::random::Congruential;
use proptest::prelude::*;

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
    let fresh_names: Vec<_> = expected.iter().map(|row| row.0).collect();
    let g = rows(fresh);
    let mut count = [0, 0];
    for (row, name) in names.iter().enumerate() {
        let Some(place) = expected.iter().position(|other| other.0 == *name) else { continue };
        // (Rows of a dent stay on their facets until the next search.)
        let in_dent = |names: &[(usize, usize)]| names.iter().filter(|other| other.0 == name.0).count() > 1;
        if in_dent(&names) || in_dent(&fresh_names) {
            count[0] += usize::from(name.1 < 2);
            continue;
        }
        assert_eq!(found[row], expected[place].1, "{name:?}");
        assert_eq!(contact.facet(row), fresh.facet(place), "{name:?}");
        assert!(after.row(row).eq(g.row(place)), "{name:?}");
        assert_eq!(contact.magnitude(row), fresh.magnitude(place));
        count = [count[0] + 1, count[1] + usize::from(contact.facet(row) != facets[row])];
    }
    // The next search sees the rows that were followed.
    let same = names == fresh_names && after == g;
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
    let to = shaken(&u, &mut random, 0.12);
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
