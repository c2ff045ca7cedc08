//! Facets of second order: patch tests, derivatives, momentum, curved surfaces, ties.

use super::mortar::{blocks, shaken};
use contact_dynamics::contact::{ContactConstraint, Contacts, Facet, Mortar, Surface, SurfaceSettings, Tie};
use contact_dynamics::{Composite, Simulation, verify};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::second_order::{Family, SecondOrderStack, linear};
use contact_dynamics_scenes::solids::{Material, Solid};

const MATERIAL: Material = Material { young: 100.0, poisson: 0.3, density: 1.0 };
const FAMILIES: [Family; 3] = [Family::Simplex, Family::Serendipity, Family::Lagrange];

fn plates(lower: usize, upper: usize) -> [Solid<2>; 2] {
    [lower, upper].map(|cells| Solid::rectangle([1.0; 2], [cells, 1], MATERIAL))
}

/// With a reach of less than the bodies.
fn mortar<const D: usize>(stack: &SecondOrderStack<D>, upper: bool) -> Mortar<f64> {
    stack.mortar(upper).unwrap().with(SurfaceSettings::new().reach(0.3)).unwrap()
}

#[test]
fn the_patch_test_in_two_dimensions() {
    for (lower, upper) in [(2, 2), (2, 3), (5, 2)] {
        for (family, slope) in FAMILIES.into_iter().flat_map(|family| [(family, 0.0), (family, 0.35)]) {
            let map = |[x, y]: [f64; 2]| [x, y + slope * x * (2.0 - y) * y];
            let stack = SecondOrderStack::new(plates(lower, upper), family, 0.0, map);
            for above in [true, false] {
                let error = stack.patch(mortar(&stack, above)).unwrap();
                assert!(error < 1e-12, "{family:?}, {lower} on {upper}, slope {slope}: {error:e}");
            }
        }
    }
    // What it takes: as linear facets they miss it.
    let stack = SecondOrderStack::new(plates(2, 3), Family::Lagrange, 0.0, |x| x);
    let error = stack.patch(stack.mortar_of_first_order(true).unwrap()).unwrap();
    assert!(error > 1e-3, "{error:e}");
}

#[test]
fn the_patch_test_in_three_dimensions() {
    for (family, slope) in FAMILIES.into_iter().flat_map(|family| [(family, 0.0), (family, 0.25)]) {
        let map = |[x, y, z]: [f64; 3]| [x, y, z + slope * (x + 0.5 * y) * (2.0 - z) * z];
        let stack = SecondOrderStack::new(blocks([2, 2, 1], [1, 2, 1]), family, 0.0, map);
        for above in [true, false] {
            let error = stack.patch(mortar(&stack, above)).unwrap();
            assert!(error < 1e-12, "{family:?}, slope {slope}: {error:e}");
        }
    }
}

/// Nodes that are not in the middle of their sides: pressure is constant up to the size of elements. With 27 nodes and
/// the upper body as the slave, rows carry forces so uneven that they alternate, while the bodies come to rest.
#[test]
fn skewed_sides_of_second_order_pass_the_patch_test_nearly() {
    let skew = |[x, y, z]: [f64; 3]| [x + 0.6 * x * (1.0 - x) * (y - 0.5), y, z];
    for family in FAMILIES {
        let stack = SecondOrderStack::new(blocks([2, 2, 1], [1, 2, 1]), family, 0.0, skew);
        for above in [true, false] {
            let error = stack.patch(mortar(&stack, above)).unwrap();
            assert!(error < 5e-3, "{family:?}, slave above: {above}: {error:e}");
        }
    }
}

#[test]
fn rows_are_the_derivatives_of_gaps() {
    for (seed, shift) in (1..4).flat_map(|seed| [(seed, 0.0), (seed, 0.35)]) {
        let bent = |[x, y]: [f64; 2]| [x, y + 0.1 * x * (1.0 - x)];
        let [below, above] = plates(3, 2);
        let above = above.mapped(|[x, y]| [0.1 + shift + 0.8 * x, y]);
        for family in FAMILIES {
            let stack = SecondOrderStack::new([below.clone(), above.clone()], family, 0.1, bent);
            let (u, v) = (shaken(stack.solid.dofs(), 0.01, seed), shaken(stack.solid.dofs(), 1.0, seed + 10));
            let error = verify::gap_jacobian(&mut mortar(&stack, true), 0.0, &u, &v, 1e-6).unwrap();
            assert!(error.rows >= 3 && error.rows_lost == 0 && error.jacobian < 1e-8, "{family:?} {error:?}");
        }
        let dome = |[x, y, z]: [f64; 3]| [x, y, z + 0.1 * (x * (1.0 - x) + y * y)];
        for (family, least) in FAMILIES.into_iter().zip([1e-8, 1e-4, 1e-4]) {
            let [below, above] = blocks([2, 2, 1], [2, 1, 1]);
            let above = above.mapped(|[x, y, z]| [0.15 + shift + 0.7 * x, 0.15 + 0.5 * shift + 0.7 * y, z]);
            let stack = SecondOrderStack::new([below, above], family, 0.1, dome);
            let (u, v) = (shaken(stack.solid.dofs(), 0.01, seed), shaken(stack.solid.dofs(), 1.0, seed + 10));
            let error = verify::gap_jacobian(&mut mortar(&stack, true), 0.0, &u, &v, 1e-6).unwrap();
            // (Where facets are quadrilaterals shape functions are no polynomials in the plane: quadrature.)
            assert!(error.rows >= 6 && error.rows_lost == 0 && error.jacobian < least, "{family:?} {error:?}");
        }
    }
}

/// The largest rate of a gap in a rigid motion about the origin or along an axis, where nodes are at x + u.
fn rates_of_rigid_motions<const D: usize>(
    contact: &mut impl ContactConstraint<f64>,
    nodes: &[[f64; D]],
    u: &[f64],
) -> f64 {
    let dofs = contact.dofs().to_vec();
    let local: Vec<f64> = dofs.iter().map(|&dof| u[dof]).collect();
    contact.search(0.0, &local, &vec![0.0; local.len()], 0.0).unwrap();
    let contacts = Contacts::of(&*contact);
    assert!(contacts.len() > 2);
    let at = |node: usize| -> [f64; D] { std::array::from_fn(|i| nodes[node][i] + u[D * node + i]) };
    let turning = (0..D).flat_map(|i| (0..i).map(move |j| (i, j)));
    let turned = |dof: usize, (i, j): (usize, usize)| -> f64 {
        let x = at(dof / D);
        match dof % D {
            k if k == i => -x[j],
            k if k == j => x[i],
            _ => 0.0,
        }
    };
    let mut largest = 0.0_f64;
    for row in 0..contacts.len() {
        let mut along = |velocity: &dyn Fn(usize) -> f64| {
            let rate: f64 = contacts.row(row).map(|(place, weight)| weight * velocity(dofs[place])).sum();
            largest = largest.max(rate.abs());
        };
        (0..D).for_each(|axis| along(&|dof| f64::from(u8::from(dof % D == axis))));
        turning.clone().for_each(|axes| along(&|dof| turned(dof, axes)));
    }
    largest
}

#[test]
fn rows_do_no_work_on_rigid_motions() {
    for family in FAMILIES {
        let [below, above] = blocks([2, 2, 1], [2, 1, 1]);
        // In part beside each other.
        let stack = SecondOrderStack::new([below, above.moved([0.3, 0.2, 0.0])], family, 0.1, |x| x);
        let u = shaken(stack.solid.dofs(), 0.02, 3);
        let rate = rates_of_rigid_motions(&mut mortar(&stack, true), &stack.solid.nodes, &u);
        assert!(rate < 1e-13, "{family:?}: {rate:e}");
        let [below, above] = plates(3, 2);
        let stack = SecondOrderStack::new([below, above.moved([0.3, 0.0])], family, 0.1, |x| x);
        let u = shaken(stack.solid.dofs(), 0.02, 3);
        let rate = rates_of_rigid_motions(&mut mortar(&stack, true), &stack.solid.nodes, &u);
        assert!(rate < 1e-13, "{family:?}: {rate:e}");
    }
}

/// Segments of three nodes along an arc of radius 1 from the origin, and the same as linear ones.
fn arc(cells: usize, outside: bool, first: usize) -> (Vec<[f64; 2]>, Vec<Facet>) {
    let angle = |k: usize| 0.4 + 2.3 * k as f64 / (2 * cells) as f64;
    let nodes = (0..=2 * cells).map(|k| [angle(k).cos(), angle(k).sin()]).collect();
    let segment = |k: usize| {
        let [a, middle, b] = [2 * k, 2 * k + 1, 2 * k + 2].map(|node| node + first);
        Facet::of_quadratic_segment(if outside { [b, a, middle] } else { [a, b, middle] })
    };
    (nodes, (0..cells).flat_map(segment).collect())
}

#[test]
fn gaps_of_arcs_that_meet_vanish_with_a_higher_order() {
    // Two arcs upon each other whose segments do not match.
    let gap = |cells: usize, of_second_order: bool| {
        let (mut nodes, mut slave) = arc(2 * cells, true, 0);
        let (others, mut master) = arc(3 * cells, false, nodes.len());
        nodes.extend(others);
        if !of_second_order {
            slave.iter_mut().chain(&mut master).for_each(|facet| *facet = linear(facet));
        }
        let dofs: Vec<[usize; 2]> = (0..nodes.len()).map(|node| [2 * node, 2 * node + 1]).collect();
        let mut contact = Mortar::new(&nodes, &dofs, slave, master).unwrap();
        let still = vec![0.0; contact.dofs().len()];
        contact.search(0.0, &still, &still, 0.0).unwrap();
        let mut gaps = vec![0.0; Contacts::of(&contact).len()];
        contact.gaps(0.0, &still, &mut gaps).unwrap();
        assert_eq!(gaps.len(), 4 * cells + 1);
        gaps.iter().fold(0.0, |most: f64, gap: &f64| most.max(gap.abs()))
    };
    for (of_second_order, least) in [(false, 1.9), (true, 3.8)] {
        let [coarse, fine] = [gap(2, of_second_order), gap(8, of_second_order)];
        assert!((coarse / fine).log(4.0) > least, "{of_second_order}: {coarse:e} {fine:e}");
    }
    assert!(gap(2, true) < 0.03 * gap(2, false));
}

#[test]
fn impacts_keep_momentum_and_gain_no_energy() {
    for family in FAMILIES {
        let stack = SecondOrderStack::new(plates(2, 3), family, 0.003, |x| x);
        let (stiffness, mass) = stack.solid.matrices();
        let system = contact_dynamics::LinearSystem::lumped(mass.clone(), stiffness).unwrap();
        let v: Vec<f64> = (0..stack.solid.dofs())
            .map(|dof| if dof >= 2 * stack.split && dof % 2 == 1 { -0.5 } else { 0.0 })
            .collect();
        let momentum =
            |v: &[f64], axis: usize| -> f64 { v.iter().zip(&mass).skip(axis).step_by(2).map(|(v, m)| v * m).sum() };
        let expected = momentum(&v, 1);
        let mut run =
            Simulation::builder(system, Composite, 0.002).velocity(v).constraint(mortar(&stack, true)).build().unwrap();
        let energy = run.energy().total();
        let mut pressed = 0;
        while run.time() < 0.4 {
            run.step().unwrap();
            pressed += usize::from(run.state().contacts().forces().iter().any(|&force| force > 0.0));
            assert!(run.energy().total() < energy * (1.0 + 1e-9), "{family:?}: {}", run.energy().total() / energy);
            let found = [0, 1].map(|axis| momentum(run.state().velocity(), axis));
            assert!((found[1] / expected - 1.0).abs() < 1e-11 && found[0].abs() < 1e-11 * expected.abs());
        }
        assert!(pressed > 10, "{family:?}: {pressed}");
    }
}

#[test]
fn ties_pass_linear_displacements_and_constant_tractions() {
    for family in FAMILIES {
        for (slope, above) in [(0.0, true), (0.35, false)] {
            let map = |[x, y]: [f64; 2]| [x, y + slope * x * (2.0 - y) * y];
            check_tie(&SecondOrderStack::new(plates(2, 3), family, 0.0, map), above);
            let map = |[x, y, z]: [f64; 3]| [x, y, z + slope * (x + 0.5 * y) * (2.0 - z) * z];
            check_tie(&SecondOrderStack::new(blocks([2, 2, 1], [1, 2, 1]), family, 0.0, map), above);
        }
        let stack = SecondOrderStack::new(plates(2, 3), family, 0.0, |x| x);
        let error = stack.patch(stack.tie(true).unwrap()).unwrap();
        assert!(error < 1e-12, "{family:?}: {error:e}");
    }
}

fn check_tie<const D: usize>(stack: &SecondOrderStack<D>, above: bool) {
    let mut tie: Tie<f64> = stack.tie(above).unwrap();
    let mut random = xorshift(5);
    let gradient: Vec<f64> = (0..D * D).map(|_| random() - 0.5).collect();
    let linear =
        |x: &[f64; D]| -> [f64; D] { std::array::from_fn(|i| (0..D).map(|j| gradient[D * i + j] * x[j]).sum()) };
    let u: Vec<f64> = stack.solid.nodes.iter().flat_map(linear).collect();
    tie.search_on(0.0, &u, &vec![0.0; u.len()], 0.0).unwrap();
    let contacts = tie.found();
    let mut gaps = vec![1.0; contacts.len()];
    tie.gap(0.0, &u, &mut gaps);
    assert!(gaps.iter().all(|gap: &f64| gap.abs() < 1e-14));
    // A constant pressure: forces are those of ∫ N n dA.
    let pressure = 0.7;
    let mut normal = [0.0; D];
    let areas = stack.areas();
    let upper = areas.iter().enumerate().filter(|&(dof, _)| (dof >= D * stack.split) == above);
    upper.for_each(|(dof, area)| normal[dof % D] += area);
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut forces = vec![0.0; areas.len()];
    for row in 0..contacts.len() {
        let lambda = pressure * normal[row % D] / length * tie.area(row / D);
        contacts.row(row).for_each(|(place, weight)| forces[tie.dofs()[place]] += weight * lambda);
    }
    // (Positive on the master: along the normal of the slave there, against it on the slave.)
    let error = forces.iter().zip(&areas).map(|(force, area)| (force + pressure * area).abs()).fold(0.0, f64::max);
    assert!(error < 1e-14, "{error:e}");
}

#[test]
fn a_part_alone_is_moved_by_all_nodes_of_its_facet() {
    let nodes = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 0.1], [2.0, 0.1]];
    let dofs: Vec<[usize; 2]> = (0..5).map(|node| [2 * node, 2 * node + 1]).collect();
    let [half, _] = Facet::of_quadratic_segment([2, 0, 1]);
    let contact = Mortar::<f64>::new(&nodes, &dofs, [[3, 4]], [half]).unwrap();
    assert!([0, 1, 2].iter().all(|node| contact.dofs().contains(&(2 * node))));
    assert_eq!(Surface::new(&nodes, [half]).unwrap().nodes(), [1, 2]);
}

/// On both sides of an interface.
fn check_pressures<const D: usize>(stack: &SecondOrderStack<D>, pressure: f64) {
    let nodes = &stack.solid.nodes;
    let (areas, dofs) = (stack.areas(), stack.solid.node_dofs());
    let forces: Vec<[f64; D]> = dofs.iter().map(|dofs| dofs.map(|dof| -pressure * areas[dof])).collect();
    for facets in &stack.facets {
        let surface = Surface::new(nodes, facets.clone()).unwrap();
        for (found, shear) in
            surface.pressures(nodes, &forces).unwrap().iter().zip(surface.shears(nodes, &forces).unwrap())
        {
            assert!(
                (found / pressure - 1.0).abs() < 1e-12 && shear.iter().all(|x| x.abs() < 1e-12),
                "{found} {shear:?}"
            );
        }
    }
}

#[test]
fn pressures_are_those_of_the_forces_of_second_order() {
    for family in FAMILIES {
        check_pressures(&SecondOrderStack::new(plates(2, 3), family, 0.0, |x| x), 0.7);
        check_pressures(&SecondOrderStack::new(plates(2, 3), family, 0.0, |[x, y]| [x, y + 0.3 * x]), 0.7);
        check_pressures(&SecondOrderStack::new(blocks([2, 2, 1], [1, 2, 1]), family, 0.0, |x| x), 0.7);
    }
}

/// A slave whose three nodes are on the parabola 4 s x (1 − x), 0.1 above a line, and a line that is 0.1 above such a
/// parabola, or below: the gaps are the means of what is between, with the linear functions of the nodes. (Normals of
/// the parts lean by 2 s.)
#[test]
fn gaps_are_the_means_between_facets_of_both_orders() {
    let s = 1e-4;
    let gaps = |nodes: &[[f64; 2]], slave: Vec<Facet>, master: Vec<Facet>| {
        let dofs: Vec<[usize; 2]> = (0..nodes.len()).map(|node| [2 * node, 2 * node + 1]).collect();
        let mut contact = Mortar::<f64>::new(nodes, &dofs, slave, master).unwrap();
        let still = vec![0.0; contact.dofs().len()];
        contact.search(0.0, &still, &still, 0.0).unwrap();
        let contacts = Contacts::of(&contact);
        let mut gaps = vec![0.0; contacts.len()];
        contact.gaps(0.0, &still, &mut gaps).unwrap();
        (0..contacts.len()).map(|row| (contacts.name(row).0, gaps[row])).collect::<Vec<_>>()
    };
    // Facets of the upper body run to the right, those of the lower one to the left.
    let nodes = [[0.0, 0.1], [0.5, 0.1 + s], [1.0, 0.1], [2.0, 0.0], [-1.0, 0.0]];
    let found = gaps(&nodes, Facet::of_quadratic_segment([0, 2, 1]).into(), vec![Facet::from([3, 4])]);
    assert_eq!(found.len(), 3);
    for (node, gap) in found {
        let mean = [s / 2.0, s * 5.0 / 6.0, s / 2.0][node];
        assert!((gap - 0.1 - mean).abs() < 10.0 * s * s, "{node}: {gap}");
    }
    let nodes = [[0.0, 0.1], [1.0, 0.1], [1.0, 0.0], [0.5, -s], [0.0, 0.0]];
    let found = gaps(&nodes, vec![Facet::from([0, 1])], Facet::of_quadratic_segment([2, 4, 3]).into());
    assert_eq!(found.len(), 2);
    for (node, gap) in found {
        assert!((gap - 0.1 - s * 2.0 / 3.0).abs() < 10.0 * s * s, "{node}: {gap}");
    }
}

/// Where linear facets follow upon such of second order: L/6, 4L/6, L/6 of a pressure go to the nodes of one of these,
/// and half of it to either node of the others.
#[test]
fn a_pressure_is_the_same_on_facets_of_both_orders() {
    let nodes = [[0.0_f64, 0.0], [0.6, 0.0], [1.2, 0.0], [1.7, 0.0], [2.0, 0.0]];
    let pressure = 0.7_f64;
    // Outward is down: facets run to the right.
    let quadratic = Facet::of_quadratic_segment([0, 2, 1]);
    let surface = Surface::new(&nodes, quadratic.into_iter().chain([[2, 3], [3, 4]].map(Facet::from))).unwrap();
    let up = [1.2 / 6.0, 1.2 * 4.0 / 6.0, 1.2 / 6.0 + 0.25, 0.25 + 0.15, 0.15].map(|length| [0.0, pressure * length]);
    let normals = surface.normals(&nodes).unwrap();
    assert!(normals.iter().all(|[x, y]| x.abs() < 1e-15 && (y + 1.0).abs() < 1e-15), "{normals:?}");
    for found in surface.pressures(&nodes, &up).unwrap() {
        assert!((found / pressure - 1.0).abs() < 1e-13, "{found}");
    }
    for [x, y] in surface.shears(&nodes, &up).unwrap() {
        assert!(x.abs() + y.abs() < 1e-13);
    }
}

#[test]
fn ties_of_curved_surfaces_turn_freely() {
    let dome = |[x, y, z]: [f64; 3]| [x, y, z + 0.2 * (x * (1.0 - x) + y * y) * z * (2.0 - z)];
    for family in FAMILIES {
        let stack = SecondOrderStack::new(blocks([2, 2, 1], [1, 2, 1]), family, 0.0, dome);
        let mut tie = stack.tie(true).unwrap();
        let (u, v) = (shaken(stack.solid.dofs(), 0.02, 4), shaken(stack.solid.dofs(), 0.5, 5));
        let rate = rates_of_rigid_motions(&mut tie, &stack.solid.nodes, &u);
        assert!(rate < 1e-13, "{family:?}: {rate:e}");
        let error = verify::gap_jacobian(&mut tie, 0.0, &u, &v, 1e-5).unwrap();
        assert!(error.rows > 30 && error.jacobian < 1e-8 && error.acceleration < 1e-4, "{family:?}: {error:?}");
    }
}
