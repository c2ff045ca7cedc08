//! Searches that keep lists: whatever came before, a search finds what a constraint finds that is new.
#![cfg(feature = "mesh-contact")]

use super::mortar::shaken;
use contact_dynamics::contact::{ContactConstraint, Contacts, GapRates, Mortar, NodeToFacet, Surface, SurfaceSettings};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

type Made = Box<dyn ContactConstraint<f64>>;

/// What a constraint has found: names, rows, tangents, normals and gaps, to the bit.
fn found(contact: &mut Made, (t, u, v): (f64, &[f64], &[f64])) -> Vec<(usize, u64)> {
    let contacts = Contacts::of(&*contact);
    let mut gaps = vec![0.0; contacts.len()];
    contact.gaps(t, u, &mut gaps).unwrap();
    let mut rates = vec![GapRates::default(); contacts.len()];
    contact.rates(t, u, v, &mut rates).unwrap();
    let mut found = Vec::new();
    for (row, (gap, rate)) in gaps.iter().zip(&rates).enumerate() {
        let (feature, candidate) = contacts.name(row);
        let numbers = contacts.normal(row).into_iter().flatten().chain([*gap, rate.rate, rate.acceleration]);
        found.extend([(feature, 0), (candidate, 1)]);
        found.extend(numbers.map(|x| (row, x.to_bits())));
        let rows = std::iter::once(contacts.row(row).collect()).chain(contacts.tangents(row));
        found.extend(rows.flatten().map(|(place, weight)| (place, weight.to_bits())));
    }
    found
}

/// A wavy slab of 6 × 5 facets and one of 7 × 4 over the half of it.
fn stack() -> Stack<3> {
    let below = Solid::block([6.0, 5.0, 1.0], [6, 5, 1], MATERIAL);
    let above = Solid::block([4.0, 4.0, 1.0], [7, 4, 1], MATERIAL).mapped(|[x, y, z]| [x + 0.3, y + 0.6, z]);
    Stack::new([below, above], 0.05, |[x, y, z]| [x, y, z + 0.2 * (0.9 * x + 0.4 * y).sin()])
}

/// States that follow each other, with velocities and how far to look ahead: displacements of the upper body, how much
/// all nodes are shaken, the speed of the upper body.
const STATES: [([f64; 3], f64, f64); 14] = [
    ([0.0; 3], 0.0, 0.0),
    ([0.01, 0.0, 0.0], 0.01, 0.1),
    // Two states in turn, far from each other.
    ([1.6, -0.4, 0.0], 0.01, 0.1),
    ([0.0; 3], 0.01, 0.1),
    ([1.6, -0.4, 0.0], 0.01, 0.1),
    ([0.0; 3], 0.01, 0.1),
    // A little each time, more than lists hold in the sum.
    ([0.2, 0.1, 0.02], 0.02, 0.0),
    ([0.4, 0.2, 0.04], 0.02, 0.0),
    ([0.6, 0.3, 0.06], 0.02, 0.0),
    ([0.8, 0.4, 0.03], 0.02, 0.0),
    // Fast, and out of reach but for the speed.
    ([0.8, 0.4, 0.0], 0.02, -30.0),
    ([0.8, 0.4, 3.0], 0.02, -30.0),
    ([0.8, 0.4, 3.0], 0.02, 0.0),
    ([0.8, 0.4, 0.0], 0.02, 0.0),
];

/// Takes a constraint through all states, and compares what it finds with a new one at each.
fn compare(name: &str, stack: &Stack<3>, make: &dyn Fn() -> Made) {
    let mut kept = make();
    let dofs = kept.dofs().to_vec();
    let above = |dof: usize| dof / 3 >= stack.split;
    let mut rows = 0;
    for (step, &(way, size, speed)) in STATES.iter().enumerate() {
        let (shaken, t) = (shaken(stack.solid.dofs(), size, step as u64 / 2 + 1), 0.1 * step as f64);
        let of = |way: [f64; 3]| {
            let moved = |&dof: &usize| shaken[dof] + if above(dof) { way[dof % 3] } else { 0.0 };
            dofs.iter().map(moved).collect::<Vec<f64>>()
        };
        let u = of(way);
        let velocity = |&dof: &usize| if above(dof) && dof % 3 == 2 { speed } else { 0.0 };
        let v: Vec<f64> = dofs.iter().map(velocity).collect();
        let mut new = make();
        kept.search(t, &u, &v, 0.1).unwrap();
        new.search(t, &u, &v, 0.1).unwrap();
        let expected = found(&mut new, (t, &u, &v));
        assert_eq!(found(&mut kept, (t, &u, &v)), expected, "{name}, state {step}");
        // Once more, where nothing has moved.
        kept.search(t, &u, &v, 0.1).unwrap();
        assert_eq!(found(&mut kept, (t, &u, &v)), expected, "{name}, state {step} again");
        rows += Contacts::of(&*new).len();
        // What a step may do before it fails: rows followed to somewhere else, a state that is no number, a search
        // there that is refused.
        let trial = of([way[0] + 0.07, way[1], way[2] - 0.02]);
        let _ = kept.follow(t + 0.1, &trial);
        if step % 3 > 0 {
            let mut broken = trial;
            let last = broken.len() - 1 - 3 * step;
            broken[last] = f64::NAN;
            let _ = kept.follow(t + 0.1, &broken);
            assert!(kept.search(t + 0.1, &broken, &v, 0.1).is_err(), "{name}");
        }
        if step % 3 == 2 {
            // The step that failed is taken again.
            kept.search(t, &u, &v, 0.1).unwrap();
            assert_eq!(found(&mut kept, (t, &u, &v)), expected, "{name}, state {step} after a failure");
        }
    }
    assert!(rows > 100, "{name}: {rows}");
}

#[test]
fn a_search_finds_what_a_new_one_finds() {
    let stack = stack();
    let (nodes, dofs) = (&stack.solid.nodes, stack.solid.node_dofs());
    let offsets: Vec<f64> = (0..nodes.len()).map(|node| 0.01 + 0.01 * (node as f64).sin()).collect();
    let [lower, upper] = stack.surfaces();
    let both = || NodeToFacet::new(nodes, &dofs, upper.clone(), lower.clone()).unwrap().friction(0.2);
    let whole = Surface::of_cells(nodes, &stack.solid.elements).unwrap();
    let makes: [(&str, &dyn Fn() -> Made); 7] = [
        ("one pass", &|| Box::new(stack.nodes_on_facets(1).unwrap())),
        ("two passes", &|| Box::new(both())),
        ("a thin skin", &|| Box::new(both().with(SurfaceSettings::new().skin(0.05)).unwrap())),
        ("offsets", &|| {
            Box::new(both().with(SurfaceSettings::new().offsets(&offsets).ramp([0.0, 1.0], [0.5, 2.0])).unwrap())
        }),
        ("of itself", &|| Box::new(NodeToFacet::of_itself(nodes, &dofs, &whole).unwrap())),
        ("mortar", &|| Box::new(stack.mortar(true).unwrap().friction(0.2))),
        ("dual, with offsets", &|| {
            let contact = Mortar::new(nodes, &dofs, upper.clone(), lower.clone()).unwrap().dual().unwrap();
            Box::new(contact.with(SurfaceSettings::new().offsets(&offsets).ramp([0.0, 1.0], [0.5, 2.0])).unwrap())
        }),
    ];
    for (name, make) in makes {
        compare(name, &stack, make);
    }
}
