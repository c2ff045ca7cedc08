//! Weighted gaps with dual functions: what rows have, patch tests, derivatives, momentum, what is covered in part.

use super::mortar::{blocks, check_patches_of_blocks, check_patches_of_plates, plates, shaken};
use super::two_bodies::check_impact;
use contact_dynamics::contact::{BondStrength, ContactConstraint, Contacts, Facet, Mortar, SurfaceSettings};
use contact_dynamics::{Composite, Error, InitialOverclosure, Newmark, PersistencyCorrection, Simulation, verify};
use contact_dynamics_scenes::second_order::{Family, SecondOrderStack};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;
use std::collections::BTreeMap;

const MATERIAL: Material = Material { young: 100.0, poisson: 0.3, density: 1.0 };

/// With a reach of less than the bodies.
fn standard<const D: usize>(stack: &Stack<D>, upper: bool) -> Mortar<f64> {
    stack.mortar(upper).unwrap().with(SurfaceSettings::new().reach(0.3)).unwrap()
}

fn dual<const D: usize>(stack: &Stack<D>, upper: bool) -> Mortar<f64> {
    standard(stack, upper).dual().unwrap()
}

/// The area of a row, and the weights by dof.
type Row = (f64, Vec<(usize, f64)>);

/// By slave node.
type Found = BTreeMap<usize, Row>;

/// All rows where the nodes are moved by u.
fn found(mut contact: Mortar<f64>, u: &[f64]) -> Found {
    let dofs = contact.dofs().to_vec();
    let local: Vec<f64> = dofs.iter().map(|&dof| u[dof]).collect();
    contact.search(0.0, &local, &vec![0.0; local.len()], 0.0).unwrap();
    let contacts = Contacts::of(&contact);
    let row = |row: usize| contacts.row(row).map(|(place, weight)| (dofs[place], weight)).collect();
    (0..contacts.len()).map(|k| (contacts.name(k).0, (contact.area(k), row(k)))).collect()
}

/// The largest weight that a row has at another slave node, over the largest at its own.
fn off_diagonal<const D: usize>(rows: &Found, is_slave: impl Fn(usize) -> bool) -> f64 {
    let of_row = |(&node, (_, row)): (&usize, &Row)| {
        let largest = |own: bool| {
            let of = row.iter().filter(|(dof, _)| is_slave(dof / D) && (dof / D == node) == own);
            of.fold(0.0_f64, |most, (_, weight)| most.max(weight.abs()))
        };
        largest(false) / largest(true)
    };
    rows.iter().map(of_row).fold(0.0, f64::max)
}

#[test]
fn rows_of_covered_nodes_have_of_the_slave_their_own_node() {
    let [below, above] = plates(5, 3);
    let above = above.mapped(|[x, y]| [0.1 + 0.8 * x, y]);
    let stack = Stack::new([below, above], 0.0, |[x, y]| [x - 0.3 * y, y + 0.3 * x]);
    let still = vec![0.0; stack.solid.dofs()];
    let rows = found(dual(&stack, true), &still);
    assert_eq!(rows.len(), 4);
    let error = off_diagonal::<2>(&rows, |node| node >= stack.split);
    assert!(error < 1e-12, "{error:e}");
    let error = off_diagonal::<2>(&found(standard(&stack, true), &still), |node| node >= stack.split);
    assert!(error > 0.2, "{error:e}");
    let [below, above] = blocks([4, 3, 1], [3, 2, 1]);
    let above = above.mapped(|[x, y, z]| [0.1 + 0.8 * x, 0.1 + 0.7 * y, z]);
    let stack = Stack::new([below, above], 0.0, |[x, y, z]| [x + 0.4 * y, y, z + 0.2 * x]);
    let still = vec![0.0; stack.solid.dofs()];
    let rows = found(dual(&stack, true), &still);
    assert_eq!(rows.len(), 12);
    let error = off_diagonal::<3>(&rows, |node| node >= stack.split);
    assert!(error < 1e-12, "{error:e}");
    let error = off_diagonal::<3>(&found(standard(&stack, true), &still), |node| node >= stack.split);
    assert!(error > 0.2, "{error:e}");
}

/// The upper facets of a block cut into triangles.
fn triangles(stack: &Stack<3>) -> Mortar<f64> {
    let [lower, upper] = stack.facets.each_ref().map(|facets| {
        facets.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).map(Facet::from).collect::<Vec<_>>()
    });
    Mortar::new(&stack.solid.nodes, &stack.solid.node_dofs(), upper, lower)
        .unwrap()
        .with(SurfaceSettings::new().reach(0.3))
        .unwrap()
}

#[test]
fn rows_of_triangles_have_of_the_slave_their_own_node() {
    let [below, above] = blocks([4, 3, 1], [3, 2, 1]);
    let above = above.mapped(|[x, y, z]| [0.1 + 0.8 * x + 0.05 * x * y, 0.1 + 0.7 * y, z]);
    let stack = Stack::new([below, above], 0.0, |[x, y, z]| [x + 0.4 * y, y, z + 0.2 * x]);
    let still = vec![0.0; stack.solid.dofs()];
    let rows = found(triangles(&stack).dual().unwrap(), &still);
    assert_eq!(rows.len(), 12);
    let error = off_diagonal::<3>(&rows, |node| node >= stack.split);
    assert!(error < 1e-12, "{error:e}");
}

#[test]
fn weights_add_up_to_those_of_shape_functions() {
    // Covered wholly, by parts at different stages, and by little.
    for shift in [0.0, 0.15, 0.35, 0.8] {
        let [below, above] = blocks([4, 3, 1], [3, 2, 1]);
        let above = above.mapped(|[x, y, z]| [0.1 + shift + 0.8 * x, 0.1 + 0.3 * shift + 0.8 * y, z]);
        let stack = Stack::new([below, above], 0.0, |[x, y, z]| [x, y, z + 0.2 * x]);
        let still = vec![0.0; stack.solid.dofs()];
        // Touching surfaces: the force of the pressure one.
        let force = |rows: &Found| {
            let mut force = vec![0.0; stack.solid.dofs()];
            for (area, row) in rows.values() {
                for &(dof, weight) in row {
                    force[dof] += area * weight;
                }
            }
            force
        };
        for quadrilaterals in [true, false] {
            let (with, without) = match quadrilaterals {
                true => (dual(&stack, true), standard(&stack, true)),
                false => (triangles(&stack).dual().unwrap(), triangles(&stack)),
            };
            let (rows, others) = (found(with, &still), found(without, &still));
            let differs = rows.iter().any(|(node, (area, row))| {
                let (other, weights) = &others[node];
                (area - other).abs() > 1e-3
                    || row.len() < weights.len()
                    || row.iter().zip(weights).any(|(one, other)| (one.1 - other.1).abs() > 1e-3)
            });
            assert_eq!(differs, shift < 0.8);
            for (one, other) in force(&rows).into_iter().zip(force(&others)) {
                assert!((one - other).abs() < 1e-13, "{shift}: {one} {other}");
            }
        }
    }
}

#[test]
fn areas_are_positive_whatever_is_covered() {
    let mut blended = 0;
    let mut check = |rows: &Found, others: &Found| {
        assert_eq!(rows.len(), others.len());
        for (node, (area, _)) in rows {
            let (other, _) = others[node];
            assert!(3.0 * area >= other, "{area} {other}");
            blended += usize::from((area / other - 1.0).abs() > 0.05);
        }
    };
    for step in 0..100 {
        let shift = f64::from(step) / 100.0;
        let [below, above] = plates(1, 2);
        let stack = Stack::new([below, above.moved([shift - 0.5, 0.0])], 0.01, |x| x);
        let still = vec![0.0; stack.solid.dofs()];
        for upper in [true, false] {
            check(&found(dual(&stack, upper), &still), &found(standard(&stack, upper), &still));
        }
        // A corner of the master cuts into the slave, and the slave's looks out.
        let [below, above] = blocks([1, 1, 1], [2, 2, 1]);
        let turned = |[x, y, z]: [f64; 3]| [0.7 * (x - y) + 1.4 * shift, 0.7 * (x + y) - 0.7, z];
        let stack = Stack::new([below, above.mapped(turned)], 0.01, |x| x);
        let still = vec![0.0; stack.solid.dofs()];
        for upper in [true, false] {
            check(&found(dual(&stack, upper), &still), &found(standard(&stack, upper), &still));
        }
        check(&found(triangles(&stack).dual().unwrap(), &still), &found(triangles(&stack), &still));
    }
    assert!(blended > 50, "{blended}");
}

#[test]
fn the_patch_test_in_two_dimensions() {
    check_patches_of_plates(&[(3, 4), (7, 2), (1, 5)], dual);
}

#[test]
fn the_patch_test_in_three_dimensions() {
    check_patches_of_blocks(&[[[2, 3, 1], [4, 1, 1]]], dual);
}

#[test]
fn the_patch_test_on_facets_of_second_order() {
    let plates = [2, 3].map(|cells| Solid::rectangle([1.0; 2], [cells, 1], MATERIAL));
    let slanted = |[x, y]: [f64; 2]| [x, y + 0.35 * x * (2.0 - y) * y];
    let stack = SecondOrderStack::new(plates, Family::Serendipity, 0.0, slanted);
    for above in [true, false] {
        let contact = stack.mortar(above).unwrap().with(SurfaceSettings::new().reach(0.3)).unwrap().dual().unwrap();
        let error = stack.patch(contact).unwrap();
        assert!(error < 1e-12, "{error:e}");
    }
    let stack = SecondOrderStack::new(blocks([2, 2, 1], [1, 2, 1]), Family::Simplex, 0.0, |x| x);
    let error = stack
        .patch(stack.mortar(true).unwrap().with(SurfaceSettings::new().reach(0.3)).unwrap().dual().unwrap())
        .unwrap();
    assert!(error < 1e-12, "{error:e}");
}

#[test]
fn rows_are_the_derivatives_of_gaps() {
    for seed in 1..6 {
        // The slave on the inside of the master, its last facet over the rim by a tenth and by two, and by a lot.
        for shift in [0.0, 0.125, 0.15, 0.35] {
            let [below, above] = plates(5, 3);
            let above = above.mapped(|[x, y]| [0.1 + shift + 0.8 * x, y]);
            let stack = Stack::new([below, above], 0.1, |[x, y]| [x, y + 0.1 * x * (1.0 - x)]);
            let (u, v) = (shaken(stack.solid.dofs(), 0.02, seed), shaken(stack.solid.dofs(), 1.0, seed + 10));
            let error = verify::gap_jacobian(&mut dual(&stack, true), 0.0, &u, &v, 1e-6).unwrap();
            assert!(error.rows >= 2 && error.rows_lost == 0 && error.jacobian < 1e-8, "{shift}: {error:?}");
            let [below, above] = blocks([4, 3, 1], [3, 2, 1]);
            let above = above.mapped(|[x, y, z]| [0.15 + shift + 0.7 * x, 0.15 + 0.5 * shift + 0.7 * y, z]);
            let stack = Stack::new([below, above], 0.1, |x| x);
            let (u, v) = (shaken(stack.solid.dofs(), 0.02, seed), shaken(stack.solid.dofs(), 1.0, seed + 10));
            let error = verify::gap_jacobian(&mut triangles(&stack).dual().unwrap(), 0.0, &u, &v, 1e-6).unwrap();
            assert!(error.rows >= 6 && error.rows_lost == 0 && error.jacobian < 1e-8, "{shift}: {error:?}");
            // (Warped facets, and shape functions that are no polynomials in the plane: quadrature.)
            let error = verify::gap_jacobian(&mut dual(&stack, true), 0.0, &u, &v, 1e-6).unwrap();
            assert!(error.rows >= 6 && error.rows_lost == 0 && error.jacobian < 5e-3, "{shift}: {error:?}");
        }
    }
}

/// The gaps of a search at u.
fn gaps(contact: &mut Mortar<f64>, u: &[f64]) -> Vec<f64> {
    contact.search(0.0, u, &vec![0.0; u.len()], 0.0).unwrap();
    let mut gaps = vec![0.0; Contacts::of(&*contact).len()];
    contact.gaps(0.0, u, &mut gaps).unwrap();
    gaps
}

/// Where facets are parallelograms and stay such, sums over points are integrals of polynomials, and rows their
/// derivatives to rounding: along all affine motions of either body.
#[test]
fn rows_are_the_derivatives_of_gaps_along_affine_motions() {
    // Covered wholly, facets over the rim by parts at all stages of the weights, and by a lot.
    for shift in [0.0, 0.125, 0.15, 0.2, 0.35] {
        let [below, above] = blocks([4, 3, 1], [3, 2, 1]);
        let above = above.mapped(|[x, y, z]| [0.15 + shift + 0.7 * x, 0.15 + 0.5 * shift + 0.7 * y, z]);
        let slanted =
            |[x, y, z]: [f64; 3]| [x + 0.3 * y, y - 0.1 * x, z + if z > 1.05 { 0.1 * x - 0.05 * y } else { 0.04 * y }];
        let stack = Stack::new([below, above], 0.1, slanted);
        for (contact, kind) in [(dual(&stack, true), "dual"), (standard(&stack, true), "standard")] {
            let mut contact = contact;
            let dofs = contact.dofs().to_vec();
            let still = vec![0.0; dofs.len()];
            assert!(gaps(&mut contact, &still).len() >= 6);
            let rows: Vec<Vec<(usize, f64)>> = {
                let contacts = Contacts::of(&contact);
                (0..contacts.len()).map(|row| contacts.row(row).collect()).collect()
            };
            let mut largest = 0.0_f64;
            for (upper, axis, along) in [true, false]
                .into_iter()
                .flat_map(|upper| (0..3).flat_map(move |axis| (0..4).map(move |along| (upper, axis, along))))
            {
                let motion: Vec<f64> = dofs
                    .iter()
                    .map(|&dof| match (dof / 3 >= stack.split) == upper && dof % 3 == axis {
                        true => stack.solid.nodes[dof / 3].get(along).map_or(1.0, |x| *x),
                        false => 0.0,
                    })
                    .collect();
                // (Weights have second derivatives that jump, where a facet is covered wholly or by three quarters.)
                let size = 1e-6;
                let [before, after] =
                    [-size, size].map(|size| gaps(&mut contact, &motion.iter().map(|x| size * x).collect::<Vec<_>>()));
                assert!(before.len() == rows.len() && after.len() == rows.len(), "{shift}");
                for (row, (before, after)) in rows.iter().zip(before.iter().zip(&after)) {
                    let rate = row.iter().map(|&(place, weight)| weight * motion[place]).sum::<f64>();
                    let error = ((after - before) / (2.0 * size) - rate).abs();
                    largest = largest.max(rate.abs());
                    assert!(error < 1e-8, "{kind}, {shift}, {upper} {axis} {along}: {rate} off by {error:e}");
                }
            }
            assert!(largest > 0.5);
        }
    }
}

/// A block below a stamp with a round lower side, which is pressed into it after some time, and held; the block is the
/// slave.
fn stamped(gap: f64, overclosure: InitialOverclosure) -> Result<f64, Error> {
    let below = Solid::rectangle([2.0, 1.0], [20, 5], MATERIAL);
    let above = Solid::rectangle([1.0; 2], [14, 6], MATERIAL);
    let split = below.nodes.len();
    let mut stack = Stack::new([below, above], gap, |x| x);
    for [x, y] in &mut stack.solid.nodes[split..] {
        let from_middle = *x - 0.5;
        *y += (1.0 - (1.0 - from_middle * from_middle).sqrt()) * (2.0 + gap - *y);
        *x += 0.5;
    }
    let time = 1.0 / MATERIAL.wave_speed();
    let (mut system, depth) = (stack.solid.system(), 0.01 + gap);
    for (node, &[_, y]) in stack.solid.nodes.iter().enumerate() {
        if y < 1e-9 {
            system = system.fix(2 * node)?.fix(2 * node + 1)?;
        } else if y > 2.0 + gap - 1e-9 {
            system = system.fix(2 * node)?.drive(2 * node + 1, move |t| {
                let s = (t / (20.0 * time)).min(1.0);
                let speed = 6.0 * s * (1.0 - s) / (20.0 * time);
                [-depth * s * s * (3.0 - 2.0 * s), -depth * speed, 0.0]
            })?;
        }
    }
    let mut run = Simulation::builder(system, Newmark::new(0.5, 1.0)?, time)
        .constraint(stack.mortar(false)?.dual()?)
        .initial_overclosure(overclosure)
        .build()?;
    run.run_until(100.0 * time, &mut ())?;
    Ok(run.state().contacts().forces().iter().sum())
}

#[test]
fn gaps_below_zero_of_surfaces_apart_are_taken_off() {
    // The weighted gap of the node below the stamp is below zero, though nothing touches.
    let gap = 1e-6;
    let refused = stamped(gap, InitialOverclosure::Refused);
    assert!(matches!(refused, Err(Error::InitialViolation { gap, .. }) if -1e-2 < gap && gap < -1e-5), "{refused:?}");
    let time = 10.0 / MATERIAL.wave_speed();
    let taken = stamped(gap, InitialOverclosure::RemovedOver(time)).unwrap();
    // From farther apart nothing is to be taken off, and the end is the same.
    let apart = stamped(3e-3, InitialOverclosure::Refused).unwrap();
    assert!((taken / apart - 1.0).abs() < 2e-3, "{taken} {apart}");
}

#[test]
fn rows_of_second_order_are_the_derivatives_of_gaps() {
    for (seed, shift) in (1..4).flat_map(|seed| [(seed, 0.0), (seed, 0.12), (seed, 0.35)]) {
        let [below, above] = [3, 2].map(|cells| Solid::rectangle([1.0; 2], [cells, 1], MATERIAL));
        let above = above.mapped(|[x, y]| [0.1 + shift + 0.8 * x, y]);
        let bent = |[x, y]: [f64; 2]| [x, y + 0.1 * x * (1.0 - x)];
        let stack = SecondOrderStack::new([below, above], Family::Serendipity, 0.1, bent);
        let (u, v) = (shaken(stack.solid.dofs(), 0.01, seed), shaken(stack.solid.dofs(), 1.0, seed + 10));
        let mut contact = stack.mortar(true).unwrap().with(SurfaceSettings::new().reach(0.3)).unwrap().dual().unwrap();
        let error = verify::gap_jacobian(&mut contact, 0.0, &u, &v, 1e-6).unwrap();
        assert!(error.rows >= 3 && error.rows_lost == 0 && error.jacobian < 1e-8, "{shift}: {error:?}");
    }
}

#[test]
fn rows_do_no_work_on_rigid_motions() {
    for shift in [0.1, 0.3] {
        let [below, above] = blocks([4, 3, 1], [3, 3, 1]);
        // In part beside each other, some facets by a little.
        let stack = Stack::new([below, above.moved([shift, 0.06, 0.0])], 0.1, |x| x);
        let u = shaken(stack.solid.dofs(), 0.03, 3);
        let rows = found(dual(&stack, true), &u);
        assert_eq!(rows.len(), 16);
        let at = |node: usize| -> [f64; 3] { std::array::from_fn(|i| stack.solid.nodes[node][i] + u[3 * node + i]) };
        for axis in 0..3 {
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            for (_, row) in rows.values() {
                let moved: f64 = row.iter().filter(|(dof, _)| dof % 3 == axis).map(|(_, weight)| weight).sum();
                let turned: f64 = row
                    .iter()
                    .map(|&(dof, weight)| match dof % 3 {
                        i if i == j => -weight * at(dof / 3)[k],
                        i if i == k => weight * at(dof / 3)[j],
                        _ => 0.0,
                    })
                    .sum();
                assert!(moved.abs() < 1e-13 && turned.abs() < 1e-13, "{shift}: {moved:e} {turned:e}");
            }
        }
    }
}

#[test]
fn impacts_of_blocks_keep_momentum_and_gain_no_energy() {
    for friction in [0.0, 0.3] {
        let stack = Stack::new(blocks([3, 3, 3], [4, 4, 3]), 0.003, |x| x);
        check_impact(&stack, dual(&stack, true).friction(friction), &format!("dual, {friction}"));
    }
}

#[test]
fn forces_of_an_impact_are_near_those_of_shape_functions() {
    let stack = Stack::new(plates(4, 5), 0.003, |[x, y]| [x, y]);
    let forces = |contact: Mortar<f64>| {
        let mut run = Simulation::builder(stack.solid.system(), Composite, 0.25 / MATERIAL.wave_speed())
            .velocity(stack.velocity_of_upper([0.0, -0.1]))
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        let mut forces = Vec::new();
        while run.time() < 0.5 {
            run.step().unwrap();
            forces.push(run.state().contacts().forces().iter().sum::<f64>());
        }
        forces
    };
    let (found, expected) = (forces(dual(&stack, true)), forces(standard(&stack, true)));
    let largest = expected.iter().copied().fold(0.0, f64::max);
    let miss = found.iter().zip(&expected).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
    let [one, other] = [&found, &expected].map(|forces| forces.iter().sum::<f64>());
    assert!(miss < 1e-3 * largest, "{miss} {largest}");
    assert!((one / other - 1.0).abs() < 1e-3, "{one} {other}");
}

#[test]
fn bonds_are_refused() {
    let stack = Stack::new(plates(2, 3), 0.0, |x| x);
    let glue = || BondStrength::new(10.0, 20.0).unwrap();
    let refused = |result: Result<Mortar<f64>, Error>| matches!(result, Err(Error::Incompatible { .. }));
    assert!(refused(dual(&stack, true).bonded(glue())));
    assert!(refused(standard(&stack, true).bonded(glue()).unwrap().dual()));
}
