//! Weighted gaps: patch tests, derivatives, momentum, impacts, what is covered in part, what is refused.

use super::two_bodies::check_impact;
use contact_dynamics::contact::{
    BodyContact, Candidates, ContactConstraint, ContactLaw, Contacts, Mortar, Stride, SurfaceSettings,
};
use contact_dynamics::{Composite, Error, Real, Simulation, StepControl, verify};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;

const MATERIAL: Material = Material { young: 100.0, poisson: 0.3, density: 1.0 };

/// With a reach of less than the bodies.
fn mortar<const D: usize>(stack: &Stack<D>, upper: bool) -> Mortar<f64> {
    stack.mortar(upper).unwrap().with(SurfaceSettings::new().reach(0.3)).unwrap()
}

/// Blocks of hexahedra, one to lie upon the other.
pub(crate) fn blocks(lower: [usize; 3], upper: [usize; 3]) -> [Solid<3>; 2] {
    [lower, upper].map(|cells| Solid::block([1.0; 3], cells, MATERIAL))
}

/// The same in two dimensions.
pub(crate) fn plates(lower: usize, upper: usize) -> [Solid<2>; 2] {
    [lower, upper].map(|cells| Solid::rectangle([1.0; 2], [cells, 2], MATERIAL))
}

/// The patch test on flat and slanted plates of so many elements, below and above.
pub(crate) fn check_patches_of_plates(cells: &[(usize, usize)], contact: fn(&Stack<2>, bool) -> Mortar<f64>) {
    for &(lower, upper) in cells {
        for slope in [0.0, 0.35] {
            let stack = Stack::new(plates(lower, upper), 0.0, |[x, y]| [x, y + slope * x * (2.0 - y) * y]);
            for from_above in [true, false] {
                let error = stack.patch(contact(&stack, from_above)).unwrap();
                assert!(error < 1e-12, "{lower} on {upper}, slope {slope}: {error:e}");
            }
        }
    }
}

/// The same on blocks.
pub(crate) fn check_patches_of_blocks(cells: &[[[usize; 3]; 2]], contact: fn(&Stack<3>, bool) -> Mortar<f64>) {
    for &[lower, upper] in cells {
        for slope in [0.0, 0.25] {
            let map = |[x, y, z]: [f64; 3]| [x, y, z + slope * (x + 0.5 * y) * (2.0 - z) * z];
            let stack = Stack::new(blocks(lower, upper), 0.0, map);
            for from_above in [true, false] {
                let error = stack.patch(contact(&stack, from_above)).unwrap();
                assert!(error < 1e-12, "{lower:?} on {upper:?}, slope {slope}: {error:e}");
            }
        }
    }
}

#[test]
fn the_patch_test_in_two_dimensions() {
    check_patches_of_plates(&[(3, 3), (3, 4), (7, 2), (1, 5)], mortar);
}

#[test]
fn the_patch_test_in_three_dimensions() {
    check_patches_of_blocks(&[[[3, 3, 1], [2, 2, 1]], [[2, 3, 1], [4, 1, 1]]], mortar);
}

/// The same on blocks whose facets are no parallelograms.
fn check_patches_of_skewed_blocks(contact: fn(&Stack<3>, bool) -> Mortar<f64>) {
    // (Where only x is moved the facets in the middle are parallelograms.)
    let cases = [
        ([[3, 3, 1], [2, 2, 1]], 0.0, 0.2),
        ([[2, 3, 1], [4, 1, 1]], 0.25, 0.2),
        ([[3, 3, 1], [2, 2, 1]], 0.0, 0.0),
        ([[5, 4, 1], [3, 7, 1]], 0.0, 0.0),
    ];
    for ([lower, upper], slope, along) in cases {
        let skewed = |[x, y, z]: [f64; 3]| [x + 0.6 * x * (1.0 - x) * (y - 0.5), y + along * x * y * (1.0 - y), z];
        let slanted = |[x, y, z]: [f64; 3]| [x, y, z + slope * (x + 0.5 * y) * (2.0 - z) * z];
        let stack = Stack::new(blocks(lower, upper), 0.0, |x| slanted(skewed(x)));
        for from_above in [true, false] {
            let error = stack.patch(contact(&stack, from_above)).unwrap();
            assert!(error < 1e-12, "{lower:?} on {upper:?}, slope {slope}, {along}: {error:e}");
        }
    }
}

#[test]
fn the_patch_test_on_skewed_quadrilaterals() {
    check_patches_of_skewed_blocks(mortar);
}

/// All displacements of a constraint, at random within `size`.
pub(crate) fn shaken(dofs: usize, size: f64, seed: u64) -> Vec<f64> {
    let mut random = xorshift(seed);
    (0..dofs).map(|_| size * (2.0 * random() - 1.0)).collect()
}

#[test]
fn rows_are_the_derivatives_of_gaps() {
    for seed in 1..6 {
        // The slave on the inside of the master, and beyond its rim.
        for shift in [0.0, 0.35] {
            let [below, above] = plates(5, 3);
            let above = above.mapped(|[x, y]| [0.1 + shift + 0.8 * x, y]);
            let stack = Stack::new([below, above], 0.1, |x| x);
            let (u, v) = (shaken(stack.solid.dofs(), 0.02, seed), shaken(stack.solid.dofs(), 1.0, seed + 10));
            let error = verify::gap_jacobian(&mut mortar(&stack, true), 0.0, &u, &v, 1e-6).unwrap();
            // (One may be beyond.)
            assert!(error.rows >= 3 && error.rows_lost == 0 && error.jacobian < 1e-8, "{error:?}");

            let [below, above] = blocks([4, 3, 1], [2, 2, 1]);
            let above = above.mapped(|[x, y, z]| [0.15 + shift + 0.7 * x, 0.15 + 0.5 * shift + 0.7 * y, z]);
            let stack = Stack::new([below, above], 0.1, |x| x);
            let (u, v) = (shaken(stack.solid.dofs(), 0.02, seed), shaken(stack.solid.dofs(), 1.0, seed + 10));
            let error = verify::gap_jacobian(&mut mortar(&stack, true), 0.0, &u, &v, 1e-6).unwrap();
            // (Warped facets, and shape functions that are no polynomials in the plane: quadrature.)
            assert!(error.rows >= 6 && error.rows_lost == 0 && error.jacobian < 1e-3, "{error:?}");
        }
    }
}

/// G times the velocities of a rigid motion.
fn along_rigid_motion<const D: usize>(contacts: &Contacts<f64>, dofs: &[usize], motion: &[f64]) -> f64 {
    let rate = |row: usize| contacts.row(row).map(|(place, weight)| weight * motion[dofs[place]]).sum::<f64>().abs();
    (0..contacts.len()).map(rate).fold(0.0, f64::max)
}

#[test]
fn rows_do_no_work_on_rigid_motions() {
    let [below, above] = blocks([4, 3, 1], [3, 3, 1]);
    // In part beside each other.
    let stack = Stack::new([below, above.moved([0.3, 0.2, 0.0])], 0.1, |x| x);
    let mut contact = mortar(&stack, true);
    let dofs = contact.dofs().to_vec();
    let u = shaken(stack.solid.dofs(), 0.03, 3);
    let local: Vec<f64> = dofs.iter().map(|&dof| u[dof]).collect();
    contact.search(0.0, &local, &vec![0.0; local.len()], 0.0).unwrap();
    let contacts = Contacts::of(&contact);
    assert_eq!(contacts.len(), 16);
    for axis in 0..3 {
        let translation = stack.solid.uniform::<f64>(std::array::from_fn(|i| f64::from(u8::from(i == axis))));
        assert!(along_rigid_motion::<3>(&contacts, &dofs, &translation) < 1e-13);
        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
        let rotation = stack.solid.nodes.iter().enumerate().flat_map(|(node, x)| {
            let at: [f64; 3] = std::array::from_fn(|i| x[i] + u[3 * node + i]);
            let mut velocity = [0.0; 3];
            (velocity[j], velocity[k]) = (-at[k], at[j]);
            velocity
        });
        assert!(along_rigid_motion::<3>(&contacts, &dofs, &rotation.collect::<Vec<_>>()) < 1e-13);
    }
}

#[test]
fn slip_is_that_of_the_surfaces() {
    let [below, above] = blocks([4, 3, 1], [3, 3, 1]);
    let stack = Stack::new([below, above.moved([0.3, 0.2, 0.0])], 0.0, |x| x);
    let mut contact = mortar(&stack, true).friction(0.2);
    let dofs = contact.dofs().to_vec();
    contact.search(0.0, &vec![0.0; dofs.len()], &vec![0.0; dofs.len()], 0.0).unwrap();
    let contacts = Contacts::of(&contact);
    // The upper block slides, then both move together.
    for (velocity, moves, slip) in [([0.3, -0.4, 7.0], 3 * stack.split, 0.5), ([0.3, -0.4, 7.0], 0, 0.0)] {
        let v = |dof: usize| if dof >= moves { velocity[dof % 3] } else { 0.0 };
        for row in 0..contacts.len() {
            let along = |tangent: &Vec<(usize, f64)>| tangent.iter().map(|&(k, w)| w * v(dofs[k])).sum::<f64>();
            let found: f64 = contacts.tangents(row).iter().map(|tangent| along(tangent).powi(2)).sum::<f64>().sqrt();
            assert!((found - slip).abs() < 1e-13, "{found} {slip}");
        }
    }
    assert_eq!((contacts.len(), contacts.friction(3)), (16, 0.2));
}

#[test]
fn impacts_of_blocks_keep_momentum_and_gain_no_energy() {
    let (coarse, fine) = ([3, 3, 3], [4, 4, 3]);
    for (lower, upper, friction) in [(coarse, fine, 0.0), (fine, coarse, 0.0), (coarse, fine, 0.3)] {
        let stack = Stack::new(blocks(lower, upper), 0.003, |x| x);
        check_impact(&stack, mortar(&stack, true).friction(friction), &format!("{lower:?}, {upper:?}, {friction}"));
    }
}

/// Gaps by node.
fn gaps<const D: usize>(stack: &Stack<D>, upper: bool, reach: f64) -> Vec<(usize, f64)> {
    let mut contact = stack.weighted(upper, reach).unwrap();
    let still = vec![0.0; contact.dofs().len()];
    contact.search(0.0, &still, &still, 0.0).unwrap();
    let contacts = Contacts::of(&*contact);
    let mut gaps = vec![0.0; contacts.len()];
    contact.gaps(0.0, &still, &mut gaps).unwrap();
    gaps.iter().enumerate().map(|(row, &gap)| (contacts.name(row).0, gap)).collect()
}

/// A body turned about the origin by three angles.
fn turned(body: Solid<3>, angles: [f64; 3]) -> Solid<3> {
    (0..3).fold(body, |body, axis| {
        let ((s, c), (j, k)) = (angles[axis].sin_cos(), ((axis + 1) % 3, (axis + 2) % 3));
        body.mapped(|x| {
            let mut y = x;
            (y[j], y[k]) = (c * x[j] - s * x[k], s * x[j] + c * x[k]);
            y
        })
    })
}

/// Two bodies as they are, but that the second is moved along a direction until a plane across it is between them with
/// so much room.
fn apart<const D: usize>(one: Solid<D>, other: Solid<D>, direction: [f64; D], room: f64) -> Stack<D> {
    let height = |x: &[f64; D]| -> f64 { x.iter().zip(direction).map(|(x, d)| x * d).sum() };
    let top = one.nodes.iter().map(height).fold(f64::NEG_INFINITY, f64::max);
    let bottom = other.nodes.iter().map(height).fold(f64::INFINITY, f64::min);
    let other = other.mapped(|x| std::array::from_fn(|i| x[i] + (top + room - bottom) * direction[i]));
    Stack::of_whole_surfaces([one, other])
}

#[test]
fn bodies_apart_are_not_inside_of_each_other() {
    let mut random = xorshift(41);
    let mut found = 0;
    for number in 0..600 {
        let mut signed = |size: f64| size * (2.0 * random() - 1.0);
        let mut direction: [f64; 3] = std::array::from_fn(|_| signed(1.0));
        let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
        direction = direction.map(|x| x / length);
        let aside = std::array::from_fn(|_| signed(0.6));
        let angles = [0, 1].map(|_| std::array::from_fn(|_| signed(3.2)));
        let (reach, room) = (0.2 + signed(0.1) + 0.3 * (number % 4) as f64, 1e-9 + 0.05 + signed(0.05));
        // Blocks, plates and wedges.
        let bodies = [number % 3, number / 3 % 3].map(|kind| {
            let block = Solid::block([1.0; 3], [[1; 3], [2; 3], [3; 3]][number / 9 % 3], MATERIAL).moved([-0.5; 3]);
            match kind {
                0 => block,
                1 => block.mapped(|[x, y, z]| [x, y, 0.05 * z]),
                _ => block.mapped(|[x, y, z]| [x, y, z * (0.25 + 0.45 * x)]),
            }
        });
        let [one, other] = bodies;
        let stack = apart(turned(one, angles[0]), turned(other, angles[1]).moved(aside), direction, room);
        for upper in [true, false] {
            let gaps = gaps(&stack, upper, reach);
            assert!(gaps.iter().all(|(_, gap)| *gap > 0.0), "{number}, {upper}: {gaps:?}");
            found += gaps.len();
        }
        // In the plane the same.
        let flat = [0, 1].map(|_| Solid::rectangle([1.0, 0.1 + random()], [3, 2], MATERIAL).moved([-0.5; 2]));
        let [one, other] = flat.map(|body| body.rotated(7.0 * random()));
        let (s, c) = (7.0 * random()).sin_cos();
        let stack = apart(one, other.moved([random() - 0.5, random() - 0.5]), [c, s], room);
        for upper in [true, false] {
            let gaps = gaps(&stack, upper, reach);
            assert!(gaps.iter().all(|(_, gap)| *gap > 0.0), "{number}, {upper}: {gaps:?}");
            found += gaps.len();
        }
    }
    // (Sides that face each other have rows.)
    assert!(found > 1000, "{found}");
}

#[test]
fn bodies_in_each_other_keep_their_rows() {
    let plate = |thickness: f64, cells: usize| {
        Solid::block([1.0, 1.0, thickness], [cells, cells, 1], MATERIAL).moved([0.0, 0.0, 1.0])
    };
    let wedge = Solid::block([1.0; 3], [4; 3], MATERIAL).mapped(|[x, y, z]| [x, y, 1.0 + z * (0.02 + 0.4 * x)]);
    let block = Solid::block([1.0; 3], [3, 3, 2], MATERIAL);
    let thin = block.clone().mapped(|[x, y, z]| [x, y, 1.0 - 0.03 * (1.0 - z)]);
    for (lower, upper) in [(&block, plate(0.02, 4)), (&thin, plate(0.02, 4)), (&block, wedge.clone()), (&thin, wedge)] {
        for depth in [0.0, 1e-6, 0.005, 0.02] {
            let whole = Stack::of_whole_surfaces([lower.clone(), upper.clone().moved([0.1, 0.15, -depth])]);
            // The sides that face each other alone: nothing is known to be behind them.
            let mut facing = Stack { solid: whole.solid.clone(), split: whole.split, facets: whole.facets.clone() };
            for (facets, height) in facing.facets.iter_mut().zip([1.0, 1.0 - depth]) {
                let is_there = |&node: &usize| (whole.solid.nodes[node][2] - height).abs() < 1e-12;
                facets.retain(|facet| facet.iter().all(is_there));
            }
            for reach in [0.05, 0.3, 1.0] {
                for from_above in [true, false] {
                    let (all, expected) = (gaps(&whole, from_above, reach), gaps(&facing, from_above, reach));
                    assert!(expected.len() >= 9);
                    for (node, gap) in expected {
                        assert!((gap + depth).abs() < 1e-12, "{node}: {gap} {depth}");
                        let found = all.iter().find(|(other, _)| *other == node);
                        assert!(
                            found.is_some_and(|(_, found)| (found - gap).abs() < 1e-12),
                            "{depth}, {reach}, {from_above}, {node}: {gap} {found:?}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn what_is_covered_in_part_has_gaps_of_full_size() {
    // A corner of the upper block hangs over the lower one by a sliver.
    for overhang in [0.5, 0.9, 0.9995, 0.999_99] {
        let [below, above] = plates(4, 1);
        let stack = Stack::new([below, above.moved([overhang, 0.0])], 0.05, |x| x);
        let mut contact = mortar(&stack, true);
        let still = vec![0.0; contact.dofs().len()];
        contact.search(0.0, &still, &still, 0.0).unwrap();
        let mut gaps = vec![0.0; Contacts::of(&contact).len()];
        contact.gaps(0.0, &still, &mut gaps).unwrap();
        // (The node at the far end of the segment has no row for a sliver at the near end.)
        assert_eq!(gaps.len(), if overhang < 0.99 { 2 } else { 1 });
        assert!(gaps.iter().all(|gap| (gap - 0.05).abs() < 1e-12), "{gaps:?}");
        let covered: f64 = (0..gaps.len()).map(|row| contact.area(row)).sum();
        assert!((covered / (1.0 - overhang) - 1.0).abs() < 1e-3, "{covered}");
    }
}

#[test]
fn a_block_slides_off_the_edge_of_another() {
    let material = Material { young: 1e4, ..MATERIAL };
    let below = Solid::rectangle([1.0; 2], [4, 2], material);
    let above = Solid::rectangle([0.6, 1.0], [3, 3], material).moved([0.3, 0.0]);
    for upper in [true, false] {
        let stack = Stack::new([below.clone(), above.clone()], 0.0, |x| x);
        let mass = stack.solid.lumped_mass::<f64>();
        let heavy = mass.clone();
        let mut system = stack.solid.system::<f64>().load(move |_, f| {
            f.iter_mut().zip(&mass).skip(1).step_by(2).for_each(|(f, m)| *f = -m);
        });
        for node in (0..stack.split).filter(|&node| stack.solid.nodes[node][1] < 0.75) {
            system = system.fix(2 * node).unwrap().fix(2 * node + 1).unwrap();
        }
        let v = (0..stack.solid.dofs()).map(|dof| if dof >= 2 * stack.split && dof % 2 == 0 { 1.0 } else { 0.0 });
        let mut run = Simulation::builder(system, Composite, 2e-3)
            .velocity(v.collect())
            .constraint(mortar(&stack, upper))
            .step_control(StepControl::halving(1e-5).unwrap())
            .build()
            .unwrap();
        let last = 2 * (stack.solid.nodes.len() - 1);
        let (energy, weight) = (run.energy().total(), 0.6);
        let mut forces = Vec::new();
        while run.time() < 0.9 {
            run.step().unwrap();
            let sunk =
                run.state().displacement().iter().zip(&heavy).skip(1).step_by(2).map(|(u, m)| m * u).sum::<f64>();
            let total = run.energy().total() + sunk;
            assert!(total < energy + 1e-4 * weight, "t = {}: {total} {energy}", run.time());
            forces.push(run.state().contacts().forces().iter().sum::<f64>());
        }
        // First it is borne, then it tips and falls.
        let mean = forces[..100].iter().sum::<f64>() / 100.0;
        assert!((mean / weight - 1.0).abs() < 0.1 && forces[forces.len() - 1] == 0.0, "{mean}");
        assert!(run.state().displacement()[last] > 0.7, "{}", run.state().displacement()[last]);
    }
}

#[test]
fn a_step_into_the_other_surface_is_refused_and_mended() {
    let build = |speed: f64| {
        let [below, above] = plates(3, 4);
        // It is clear of the floor by more than its size, and turned.
        let stack = Stack::new([below, above.rotated(0.1)], 2.0, |x| x);
        let v = (0..stack.solid.dofs()).map(|dof| if dof >= 2 * stack.split && dof % 2 == 1 { -speed } else { 0.0 });
        let facets = |lower: bool| {
            let inside = |facet: &[usize]| facet.iter().all(|&n| (n < stack.split) == lower);
            stack.solid.boundary().iter().filter(|facet| inside(facet)).map(|facet| Stack::<2>::facet(facet)).collect()
        };
        let (slave, master): (Vec<_>, Vec<_>) = (facets(false), facets(true));
        let contact = BodyContact::new(&stack.solid.nodes, &stack.solid.node_dofs(), slave, master).unwrap();
        let weighted = contact.constraints().unwrap().remove(0);
        Simulation::builder(stack.solid.system::<f64>(), Composite, 0.05).velocity(v.collect()).constraints([weighted])
    };
    let mut run = build(100.0).build().unwrap();
    let failed = (0..10).find_map(|_| run.step().err());
    assert!(matches!(failed, Some(Error::PassedThrough { .. } | Error::ContactLost { .. })), "{failed:?}");
    let control = StepControl::halving(1e-4).unwrap();
    let mut run = build(5.0).step_control(control).build().unwrap();
    run.run_until(1.0, &mut ()).unwrap();
    // It came back.
    let up: f64 = run.state().velocity().iter().skip(1).step_by(2).sum();
    assert!(up > -1e3, "{up}");
}

/// What is wrong with a step in which the upper body goes by a way, all rows with these flags at its start and its end.
fn look(contact: &mut Mortar<f64>, stack: &Stack<2>, t: [f64; 2], way: [f64; 2], closed: [bool; 2]) -> Option<String> {
    let dofs = contact.dofs().to_vec();
    let (start, h) = (vec![0.0; dofs.len()], t[1] - t[0]);
    let end: Vec<f64> = dofs.iter().map(|&dof| if dof >= 2 * stack.split { way[dof % 2] } else { 0.0 }).collect();
    let velocity: Vec<f64> = end.iter().map(|u| u / h).collect();
    contact.search(t[0], &start, &velocity, h).unwrap();
    let flags = closed.map(|closed| vec![closed; Contacts::of(&*contact).len()]);
    match contact.inspect(&Stride::new(t, [&start, &end], &velocity, [&flags[0], &flags[1]])) {
        Ok(()) => None,
        Err(Error::PassedThrough { what, way: found, .. }) => {
            assert!((found / way[0].hypot(way[1]) - 1.0).abs() < 1e-12);
            Some(what.to_owned())
        }
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn steps_into_the_other_surface_are_told_from_steps_up_to_it_in_any_unit() {
    for unit in [1e-3, 1.0, 1e3] {
        let stack = |gap: f64| Stack::new(plates(3, 4), gap, |x| x.map(|x| unit * x));
        let of = |stack: &Stack<2>| stack.mortar(true).unwrap().with(SurfaceSettings::new().reach(0.3 * unit)).unwrap();
        let looked = |gap: f64, way: [f64; 2], closed: [bool; 2]| {
            let stack = stack(gap);
            look(&mut of(&stack), &stack, [0.0, 1.0], way.map(|x| unit * x), closed)
        };
        let is = |found: Option<String>, words: &str| found.is_some_and(|what| what.contains(words));
        let (open, stops) = ([false; 2], [false, true]);
        // Up to the other surface, and in by less than a tenth of the way; by more, to the far side, far beyond it.
        assert_eq!(looked(0.2, [0.0, -0.2], open), None);
        assert_eq!(looked(0.2, [0.0, -0.21], open), None);
        for down in [0.3, 1.0, 9.0] {
            let found = looked(0.2, [0.0, -down], open);
            assert!(is(found.clone(), "went into"), "{unit} {down}: {found:?}");
        }
        assert!(is(looked(0.2, [0.0, -40.0], open), "too fast"));
        // Beside it, and away from it.
        assert_eq!(looked(0.2, [2.0, -0.1], open), None);
        assert_eq!(looked(0.01, [0.0, 5.0], open), None);
        // What was inside goes as it may.
        assert_eq!(looked(-0.1, [0.0, -0.05], open), None);
        assert_eq!(looked(-0.1, [0.0, 0.05], open), None);
        // Stopped at the surface, or above it.
        for (down, right) in [(0.2, true), (0.19, true), (0.21, true), (0.16, false), (0.1, false)] {
            let found = looked(0.2, [0.0, -down], stops);
            assert!(if right { found.is_none() } else { is(found, "away from the surface") }, "{unit} {down}");
        }
        // What was closed stays as it is, whatever its way.
        assert_eq!(looked(0.2, [0.0, -0.1], [true; 2]), None);
        // A spring is to be compressed.
        let soft = stack(0.2);
        let mut contact = of(&soft).with_law(ContactLaw::Penalty { stiffness: 1.0 });
        assert_eq!(look(&mut contact, &soft, [0.0, 1.0], [0.0, -0.3 * unit], open), None);
        // Coatings that grow during the second one of two steps are in the way of that one alone.
        let offsets = vec![0.1 * unit; soft.solid.nodes.len()];
        let mut contact =
            of(&soft).with(SurfaceSettings::new().offsets(&offsets).ramp([1.0, 2.0], [0.0, 1.0])).unwrap();
        let way = [0.0, -0.15 * unit];
        assert_eq!(look(&mut contact, &soft, [0.0, 1.0], way, open), None);
        assert!(is(look(&mut contact, &soft, [1.0, 2.0], way, open), "went into"));
        assert!(is(look(&mut contact, &soft, [2.0, 3.0], way, open), "went into"));
    }
}

/// Whichever surface is the finer one, a quarter of its facets is how far what presses may go beyond the rim.
#[test]
fn what_presses_is_lost_beyond_the_rim_as_soon_as_it_is_a_quarter_of_the_finer_facets_away() {
    for (lower, upper, shared, slide, gap, lost) in [
        (1, 8, 0.05, 0.06, 0.0, true),
        (8, 1, 0.05, 0.06, 0.0, true),
        (1, 8, 0.01, 0.02, 0.0, false),
        (8, 1, 0.01, 0.02, 0.0, false),
        // What is open may go where it will.
        (1, 8, 0.05, 0.06, 0.05, false),
        (8, 1, 0.05, 0.06, 0.05, false),
    ] {
        let [below, above] = plates(lower, upper);
        let stack = Stack::new([below, above.moved([1.0 - shared, 0.0])], gap, |x| x);
        let mut contact = mortar(&stack, true);
        let dofs = contact.dofs().to_vec();
        let still = vec![0.0; dofs.len()];
        contact.search(0.0, &still, &still, 0.0).unwrap();
        let before = Contacts::of(&contact).len();
        assert!(before >= 1);
        let slid: Vec<f64> =
            dofs.iter().map(|&dof| if dof >= 2 * stack.split && dof % 2 == 0 { slide } else { 0.0 }).collect();
        match contact.follow(0.0, &slid) {
            Ok(_) => assert!(!lost && Contacts::of(&contact).len() == before, "{lower} {upper} {slide}"),
            Err(Error::ContactLost { .. }) => assert!(lost, "{lower} {upper} {slide}"),
            Err(other) => panic!("{other}"),
        }
    }
}

/// Name, gap, and (dof, weight) pairs of a row.
type Found = ((usize, usize), f64, Vec<(usize, f64)>);

/// All rows after a search.
fn found(contact: &mut Mortar<f64>, u: &[f64]) -> Vec<Found> {
    let dofs = contact.dofs().to_vec();
    let local: Vec<f64> = dofs.iter().map(|&dof| u[dof]).collect();
    contact.search(0.0, &local, &vec![0.0; local.len()], 0.0).unwrap();
    let contacts = Contacts::of(&*contact);
    let mut gaps = vec![0.0; contacts.len()];
    contact.gaps(0.0, &local, &mut gaps).unwrap();
    let row = |row: usize| {
        let mut row: Vec<_> = contacts.row(row).map(|(place, weight)| (dofs[place], weight)).collect();
        row.sort_unstable_by_key(|&(dof, _)| dof);
        row
    };
    gaps.iter().enumerate().map(|(k, &gap)| (contacts.name(k), gap, row(k))).collect()
}

/// A search looks as far as the bodies move in the step, whichever of them does.
#[test]
fn a_search_looks_ahead() {
    let stack = Stack::new(plates(3, 4), 0.5, |x| x);
    for (moves, (ahead, rows)) in [0, 1].into_iter().flat_map(|moves| [(0.1, 0), (0.3, 5)].map(|case| (moves, case))) {
        let mut contact = stack.mortar(true).unwrap().with(SurfaceSettings::new().reach(0.3)).unwrap();
        let dofs = contact.dofs().to_vec();
        let toward = [1.0, -1.0][moves];
        let is_moving = |dof: usize| dof % 2 == 1 && usize::from(dof >= 2 * stack.split) == moves;
        let velocity: Vec<f64> = dofs.iter().map(|&dof| if is_moving(dof) { toward } else { 0.0 }).collect();
        contact.search(0.0, &vec![0.0; dofs.len()], &velocity, ahead).unwrap();
        assert_eq!(Contacts::of(&contact).len(), rows, "body {moves}, {ahead}");
    }
}

/// Surfaces are outside of their facets by offsets, and are found as far apart as the reach.
#[test]
fn the_reach_is_that_of_surfaces_with_thickness() {
    let stack = Stack::new(plates(3, 4), 0.5, |x| x);
    let offsets = vec![0.15; stack.solid.nodes.len()];
    let still = vec![0.0; stack.solid.dofs()];
    for (reach, rows) in [(0.19, 0), (0.21, 5)] {
        let mut contact =
            stack.mortar(true).unwrap().with(SurfaceSettings::new().reach(reach).offsets(&offsets)).unwrap();
        let found = found(&mut contact, &still);
        assert_eq!(found.len(), rows, "{reach}: {found:?}");
        assert!(found.iter().all(|(_, gap, _)| (gap - 0.2).abs() < 1e-13), "{found:?}");
    }
}

#[test]
fn rows_depend_neither_on_units_nor_on_the_order_of_facets() {
    let bodies = || {
        let [below, above] = blocks([3, 2, 1], [2, 2, 1]);
        [below, above.moved([0.2, 0.1, 0.0])]
    };
    let stack = Stack::new(bodies(), 0.1, |x| x);
    let u = shaken(stack.solid.dofs(), 0.03, 5);
    let rows = found(&mut mortar(&stack, true), &u);
    assert!(rows.len() == 9 && rows.iter().all(|(_, gap, _)| (gap - 0.1).abs() < 0.06));

    // In a unit that is 2⁻²⁰ as long: the same bits.
    let unit = f64::from(1 << 20);
    let scaled = Stack::new(bodies(), 0.1, |x| x.map(|x| unit * x));
    let larger: Vec<f64> = u.iter().map(|u| unit * u).collect();
    let in_units =
        found(&mut scaled.mortar(true).unwrap().with(SurfaceSettings::new().reach(0.3 * unit)).unwrap(), &larger);
    for ((name, gap, row), (other, large, same)) in rows.iter().zip(&in_units) {
        assert_eq!((name, (unit * gap).to_bits(), row), (other, large.to_bits(), same));
    }

    let [mut lower, mut upper] = stack.surfaces();
    lower.reverse();
    upper.rotate_left(2);
    let Solid { nodes, .. } = &stack.solid;
    let mut turned = Mortar::new(nodes, &stack.solid.node_dofs(), upper, lower)
        .unwrap()
        .with(SurfaceSettings::new().reach(0.3))
        .unwrap();
    for ((name, gap, row), (other, again, same)) in rows.iter().zip(found(&mut turned, &u)) {
        assert!(*name == other && (gap - again).abs() < 1e-15 && row.len() == same.len(), "{name:?}");
        assert!(row.iter().zip(same).all(|((dof, x), (other, y))| *dof == other && (x - y).abs() < 1e-14));
    }
}

#[test]
fn lists_of_pairs_do_not_change_a_result() {
    // Back and forth over the other body, searching from lists that are old and from new ones.
    let [below, above] = plates(6, 4);
    let stack = Stack::new([below, above], 0.02, |x| x);
    let mut kept = mortar(&stack, true).with(SurfaceSettings::new().skin(0.4)).unwrap();
    for step in 0..40 {
        let along = 0.5 * (0.3 * f64::from(step)).sin();
        let shift = |dof: usize| if dof >= 2 * stack.split && dof.is_multiple_of(2) { along } else { 0.0 };
        let u: Vec<f64> = (0..stack.solid.dofs()).map(shift).collect();
        assert_eq!(found(&mut kept, &u), found(&mut mortar(&stack, true), &u), "{step}");
    }
}

/// Displacements after an impact, in either precision.
fn impact<T: Real>(stack: &Stack<2>) -> Vec<f64> {
    let Solid { nodes, .. } = &stack.solid;
    let nodes: Vec<[T; 2]> = nodes.iter().map(|x| x.map(T::of)).collect();
    let [lower, upper] = stack.surfaces();
    let contact = Mortar::new(&nodes, &stack.solid.node_dofs(), upper, lower).unwrap();
    let speed = |dof: usize| if dof >= 2 * stack.split && dof % 2 == 1 { -0.5 } else { 0.0 };
    let mut run = Simulation::builder(stack.solid.system::<T>(), Composite, 0.005)
        .velocity((0..stack.solid.dofs()).map(|dof| T::of(speed(dof))).collect())
        .constraint(contact)
        .build()
        .unwrap();
    run.run_until(0.2, &mut ()).unwrap();
    assert!(run.state().contacts().forces().iter().any(|force| *force > T::zero()));
    run.state().displacement().iter().map(|u| u.value()).collect()
}

#[test]
fn two_precisions_agree() {
    let [below, above] = plates(3, 4);
    let stack = Stack::new([below, above], 0.01, |x| x);
    let (double, single) = (impact::<f64>(&stack), impact::<f32>(&stack));
    let scale = double.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    for (one, other) in double.iter().zip(&single) {
        assert!((one - other).abs() < 1e-4 * scale, "{one} {other}");
    }
}

#[test]
fn what_cannot_be_a_surface_is_refused() {
    let coordinates = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
    let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
    let build = |slave: &[[usize; 2]], master: &[[usize; 2]]| {
        Mortar::new(&coordinates, &dofs, slave.iter().copied(), master.iter().copied()).unwrap_err()
    };
    assert!(matches!(build(&[], &[[1, 0]]), Error::Empty { .. }));
    assert!(matches!(build(&[[0, 1]], &[[1, 2]]), Error::Incompatible { .. }));
    assert!(matches!(build(&[[0, 0]], &[[2, 3]]), Error::InvertedFacet { .. }));
    assert!(matches!(build(&[[0, 4]], &[[2, 3]]), Error::Dimension { .. }));
    let contact = Mortar::new(&coordinates, &dofs, [[2, 3]], [[1, 0]]).unwrap();
    assert!(matches!(contact.with(SurfaceSettings::new().reach(-1.0)), Err(Error::Parameter { .. })));
}

#[test]
fn surfaces_with_corners_are_refused_in_favor_of_body_contact() {
    let whole = |bodies: [Solid<2>; 2]| Stack::of_whole_surfaces(bodies);
    let floor = || Solid::rectangle([3.0, 1.0], [3, 1], MATERIAL).moved([-1.0, -1.0]);
    let square = whole([floor(), Solid::rectangle([1.0; 2], [2; 2], MATERIAL)]);
    for upper in [true, false] {
        let error = square.mortar(upper).unwrap_err();
        assert!(matches!(error, Error::Incompatible { .. }) && error.to_string().contains("BodyContact"), "{error}");
        assert!(square.bodies(upper).is_ok());
        assert!(square.tie(upper).is_ok());
    }
    let cubes = [0.0, 1.1].map(|z| Solid::block([1.0; 3], [2; 3], MATERIAL).moved([0.0, 0.0, z]));
    assert!(matches!(Stack::of_whole_surfaces(cubes).mortar(true), Err(Error::Incompatible { .. })));
    // One ring in another, coarse ones at many angles: a hexagon is accepted, a pentagon is not.
    for turn in 0..20 {
        let ring = |inner: f64, around: usize| {
            Solid::ring([inner, inner + 0.4], [1, around], MATERIAL).rotated(0.37 * f64::from(turn))
        };
        for around in [6, 7, 12] {
            let rings = whole([ring(1e3, around), ring(2e3, around)]);
            assert!(rings.mortar(true).is_ok(), "{around}");
            let nodes: Vec<[f32; 2]> = rings.solid.nodes.iter().map(|x| x.map(f32::of)).collect();
            let [inner, outer] = rings.surfaces();
            assert!(Mortar::new(&nodes, &rings.solid.node_dofs(), inner, outer).is_ok(), "{around}");
        }
        assert!(whole([ring(0.5, 5), ring(1.0, 12)]).mortar(true).is_err());
    }
    // The rims of open sides are no corners, and reentrant corners are no convex ones.
    let sides = Stack::new([floor().moved([0.0, 1.0]), Solid::rectangle([1.0; 2], [2; 2], MATERIAL)], 0.1, |x| x);
    assert!(sides.mortar(true).is_ok());
    let coordinates = [[0.0, 1.0], [0.0, 0.0], [1.0, 0.0], [0.9, 0.1], [0.1, 0.1], [0.1, 0.9]];
    let dofs: [[usize; 2]; 6] = std::array::from_fn(|node| [2 * node, 2 * node + 1]);
    let (dent, corner) = ([[2, 1], [1, 0]], [[5, 4], [4, 3]]);
    assert!(Mortar::new(&coordinates, &dofs, [[3, 5]], dent).is_ok());
    assert!(matches!(Mortar::new(&coordinates, &dofs, corner, dent), Err(Error::Incompatible { .. })));
}

#[test]
fn normals_point_to_where_gaps_open() {
    for from_above in [true, false] {
        let along = if from_above { 1.0 } else { -1.0 };
        let plates = Stack::new(plates(3, 4), 0.01, |x| x);
        let blocks = Stack::new(blocks([3, 3, 1], [2, 2, 1]), 0.01, |x| x);
        let normals = |contact: &mut Mortar<f64>, dofs: usize| {
            contact.search(0.0, &vec![0.0; dofs], &vec![0.0; dofs], 0.0).unwrap();
            let contacts = Contacts::of(contact);
            (0..contacts.len()).map(|row| contacts.normal(row).unwrap()).collect::<Vec<_>>()
        };
        let mut in_plane = mortar(&plates, from_above);
        let mut in_space = mortar(&blocks, from_above);
        let dofs = [&in_plane, &in_space].map(|contact| contact.dofs().len());
        for (found, axis) in [(normals(&mut in_plane, dofs[0]), 1), (normals(&mut in_space, dofs[1]), 2)] {
            assert!(found.len() >= 4, "{}", found.len());
            for normal in found {
                let rest: f64 = (0..3).filter(|k| *k != axis).map(|k| normal[k].abs()).sum();
                assert!((normal[axis] - along).abs() < 1e-12 && rest < 1e-12, "{from_above}: {normal:?}");
            }
        }
    }
}

/// Where nothing has moved nothing has changed: what was formed of the rows is kept.
#[test]
fn a_second_search_at_the_same_place_changes_nothing() {
    let stack = Stack::new(plates(3, 4), 0.01, |x| x);
    let mut contact = mortar(&stack, true);
    let mut u = vec![0.0; stack.solid.dofs()];
    let v = vec![0.0; u.len()];
    contact.search_on(0.0, &u, &v, 0.0).unwrap();
    assert_eq!(contact.search_on(0.0, &u, &v, 0.0).unwrap(), Candidates::Unchanged);
    for (node, place) in stack.solid.nodes.iter().enumerate().filter(|(_, place)| place[1] > 1.005) {
        u[2 * node + 1] = 0.01 * place[0];
    }
    assert_eq!(contact.search_on(0.0, &u, &v, 0.0).unwrap(), Candidates::Changed);
    assert_eq!(contact.search_on(0.0, &u, &v, 0.0).unwrap(), Candidates::Unchanged);
}
