//! Ties: constant tractions and linear displacements pass exactly, surfaces that do not fit turn freely, what is
//! refused.

use contact_dynamics::contact::{Candidates, ContactConstraint, Surface, Tie};
use contact_dynamics::{EnergyMomentum, Error, Newmark, Real, Simulation, verify};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;

const MATERIAL: Material = Material { young: 100.0, poisson: 0.3, density: 1.0 };

fn tied<const D: usize>(stack: &Stack<D>, upper: bool) -> Tie<f64> {
    stack.tie(upper).unwrap()
}

fn largest(x: impl IntoIterator<Item = f64>) -> f64 {
    x.into_iter().fold(0.0, |most: f64, x| most.max(x.abs()))
}

/// Rows pass any linear displacement, and hand on any constant traction as it is.
fn check_patch<const D: usize>(stack: &Stack<D>, upper: bool) {
    let worst = patch_error(stack, upper);
    assert!(worst < 1e-14, "{worst:e}");
}

/// The largest gap of a linear displacement, and force besides that of a constant traction, both of size one.
fn patch_error<const D: usize>(stack: &Stack<D>, upper: bool) -> f64 {
    let mut tie = tied(stack, upper);
    let nodes = &stack.solid.nodes;
    let mut random = xorshift(5);
    let gradient: Vec<f64> = (0..D * D).map(|_| random() - 0.5).collect();
    let linear =
        |x: &[f64; D]| -> [f64; D] { std::array::from_fn(|i| (0..D).map(|j| gradient[D * i + j] * x[j]).sum()) };
    let u: Vec<f64> = nodes.iter().flat_map(linear).collect();
    tie.search_on(0.0, &u, &vec![0.0; u.len()], 0.0).unwrap();
    let contacts = tie.found();
    let mut gaps = vec![1.0; contacts.len()];
    tie.gap(0.0, &u, &mut gaps);
    let mut worst = largest(gaps);

    let traction: [f64; D] = std::array::from_fn(|_| random() - 0.5);
    let mut forces = vec![0.0; stack.solid.dofs()];
    for row in 0..contacts.len() {
        let lambda = traction[row % D] * tie.area(row / D);
        contacts.row(row).for_each(|(place, weight)| forces[tie.dofs()[place]] += weight * lambda);
    }
    for (facets, sign) in stack.surfaces().iter().zip([1.0, -1.0]) {
        let surface = Surface::new(nodes, facets.clone()).unwrap();
        let sign = if upper { sign } else { -sign };
        for (&node, area) in surface.nodes().iter().zip(surface.areas(nodes).unwrap()) {
            for axis in 0..D {
                let error = forces[D * node + axis] - sign * traction[axis] * area;
                worst = worst.max(error.abs());
            }
        }
    }
    worst
}

#[test]
fn linear_displacements_and_constant_tractions_pass() {
    for (lower, upper) in [(3, 3), (3, 4), (7, 2), (1, 5)] {
        for slope in [0.0, 0.35] {
            let bodies = [lower, upper].map(|cells| Solid::rectangle([1.0; 2], [cells, 2], MATERIAL));
            let stack = Stack::new(bodies, 0.0, |[x, y]| [x, y + slope * x * (2.0 - y) * y]);
            for above in [true, false] {
                check_patch(&stack, above);
            }
        }
    }
    for (lower, upper) in [([3, 3, 1], [2, 2, 1]), ([2, 3, 1], [4, 1, 1])] {
        let bodies = || [lower, upper].map(|cells| Solid::block([1.0; 3], cells, MATERIAL));
        for slope in [0.0, 0.25] {
            let stack = Stack::new(bodies(), 0.0, |[x, y, z]| [x, y, z + slope * (x + 0.5 * y) * (2.0 - z) * z]);
            for above in [true, false] {
                check_patch(&stack, above);
            }
        }
    }
}

/// Rows that turn have changed where what is tied has moved, and only there.
#[test]
fn rows_at_the_same_place_are_the_same() {
    let bodies = [3, 4].map(|cells| Solid::rectangle([1.0; 2], [cells, 2], MATERIAL));
    let stack = Stack::new(bodies, 0.02, |x| x);
    let mut tie = tied(&stack, true).reach(0.05).unwrap();
    let turned = |angle: f64| -> Vec<f64> {
        let (sin, cos) = angle.sin_cos();
        stack.solid.nodes.iter().flat_map(|&[x, y]| [cos * x - sin * y - x, sin * x + cos * y - y]).collect()
    };
    for angle in [0.0, 0.1, 1.0] {
        let u = turned(angle);
        let moved = tie.follow_on(0.0, &u).unwrap();
        assert!(angle == 0.0 || moved == Candidates::Changed, "{angle}");
        assert_eq!(tie.follow_on(0.0, &u).unwrap(), Candidates::Unchanged, "{angle}");
    }
}

/// A side that rises from another one is tied up to its reach, and no further.
#[test]
fn what_is_beyond_the_reach_is_not_tied() {
    let coordinates = [[0.0, 0.0], [1.0, 0.4], [1.5, 0.0], [-0.5, 0.0]];
    let dofs = [[0, 1], [2, 3], [4, 5], [6, 7]];
    let covered = |reach: f64| {
        let tie = Tie::new(&coordinates, &dofs, [[0, 1]], [[2, 3]]).unwrap().reach(reach).unwrap();
        (0..tie.nodes().len()).map(|place| tie.area(place)).sum::<f64>()
    };
    // (Points of integration are in or out.)
    let length = 1.0_f64.hypot(0.4);
    assert!((covered(10.0) / length - 1.0).abs() < 1e-12);
    let half = covered(0.2) / length;
    assert!(half > 0.25 && half < 0.75, "{half}");
}

#[test]
fn two_tied_blocks_are_compressed_as_one() {
    let bodies = [3, 4].map(|cells| Solid::rectangle([1.0; 2], [cells, 2], MATERIAL));
    let stack = Stack::new(bodies, 0.0, |[x, y]| [x, y + 0.35 * x * (2.0 - y) * y]);
    let error = stack.patch(tied(&stack, true)).unwrap();
    assert!(error < 1e-12, "{error:e}");
}

fn tied_rings() -> (Solid<2>, Tie<f64>) {
    let rings = Stack::rings(MATERIAL);
    let tie = tied(&rings, true);
    (rings.solid, tie)
}

#[test]
fn surfaces_that_do_not_fit_turn_freely() {
    let (rings, mut tie) = tied_rings();
    for angle in [0.1_f64, 1.0, 3.0] {
        let (sine, cosine) = angle.sin_cos();
        let turned = |&[x, y]: &[f64; 2]| [cosine * x - sine * y - x + 7.0, sine * x + cosine * y - y];
        let u: Vec<f64> = rings.nodes.iter().flat_map(turned).collect();
        tie.search_on(0.0, &u, &vec![0.0; u.len()], 0.0).unwrap();
        let contacts = tie.found();
        assert_eq!(contacts.len(), 2 * 17);
        let mut gaps = vec![1.0; contacts.len()];
        tie.gap(0.0, &u, &mut gaps);
        assert!(largest(gaps) < 1e-14);
        // Forces keep momentum and angular momentum.
        let places: Vec<[f64; 2]> =
            rings.nodes.iter().zip(rings.nodes.iter().map(turned)).map(|(x, u)| [x[0] + u[0], x[1] + u[1]]).collect();
        for row in 0..contacts.len() {
            let mut sums = [0.0; 3];
            for (place, weight) in contacts.row(row) {
                let dof = tie.dofs()[place];
                let [x, y] = places[dof / 2];
                sums[dof % 2] += weight;
                sums[2] += if dof % 2 == 0 { -(y * weight) } else { x * weight };
            }
            assert!(largest(sums) < 1e-13, "row {row}: {sums:?}");
        }
    }
}

#[test]
fn rows_that_turn_are_the_derivatives_of_gaps() {
    let (rings, mut tie) = tied_rings();
    let mut random = xorshift(3);
    let count = rings.dofs();
    let mut shaken = |size: f64| (0..count).map(|_| size * (random() - 0.5)).collect::<Vec<_>>();
    let (u, v) = (shaken(0.1), shaken(1.0));
    let error = verify::gap_jacobian(&mut tie, 0.0, &u, &v, 1e-5).unwrap();
    assert!(error.rows == 34 && error.jacobian < 1e-8 && error.acceleration < 1e-4, "{error:?}");
    assert!(rings.nodes.len() > 34);
    // Bilinear facets in space.
    let bodies = [[2, 3, 1], [3, 2, 1]].map(|cells| Solid::block([1.0; 3], cells, MATERIAL));
    let dome = |[x, y, z]: [f64; 3]| [x, y, z + 0.2 * (x * (1.0 - x) + y * y) * z * (2.0 - z)];
    let stack = Stack::new(bodies, 0.0, dome);
    let mut tie = tied(&stack, true);
    let mut random = xorshift(4);
    let count = stack.solid.dofs();
    let mut shaken = |size: f64| (0..count).map(|_| size * (random() - 0.5)).collect::<Vec<_>>();
    let (u, v) = (shaken(0.1), shaken(1.0));
    let error = verify::gap_jacobian(&mut tie, 0.0, &u, &v, 1e-5).unwrap();
    assert!(error.rows == 36 && error.jacobian < 1e-8 && error.acceleration < 1e-4, "{error:?}");
}

#[test]
fn tied_rings_that_spin_keep_their_angular_momentum() {
    // As a body without ties does by this scheme: up to its second order.
    let drift = |h: f64| {
        let (rings, tie) = tied_rings();
        let spin = 2.0;
        let velocity: Vec<f64> = rings.nodes.iter().flat_map(|[x, y]| [-spin * y, spin * x]).collect();
        let system = Hyperelastic::new(&rings, Law::NeoHookean);
        let particles = system.particles.clone();
        let mut run =
            Simulation::builder(system, EnergyMomentum, h).velocity(velocity).constraint(tie).build().unwrap();
        let start = particles.angular_momentum(run.state().displacement(), run.state().velocity());
        run.run_until(2.0, &mut ()).unwrap();
        assert!(largest(run.gaps().iter().copied()) < 1e-12);
        // It has turned by more than half a turn.
        assert!(largest(run.state().displacement().iter().copied()) > 2.5);
        particles.angular_momentum(run.state().displacement(), run.state().velocity()) / start - 1.0
    };
    let drifts = [0.04, 0.02].map(drift);
    assert!(drifts[1].abs() < 3e-4 && (drifts[0] / drifts[1]).log2() > 1.7, "{drifts:?}");
}

#[test]
fn parts_that_do_not_meet_are_not_tied() {
    // The upper segment hangs over on the right: its right node has nothing below it.
    let coordinates = [[2.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.0, 0.05], [2.0, 0.05], [4.0, 0.05]];
    let dofs: Vec<[usize; 2]> = (0..6).map(|node| [2 * node, 2 * node + 1]).collect();
    let slave = || [[3, 4], [4, 5]];
    let tie = Tie::<f64>::new(&coordinates, &dofs, slave(), [[0, 1], [1, 2]]).unwrap();
    assert_eq!(tie.nodes(), [3, 4]);
    assert!((tie.area(0) - 1.0).abs() < 1e-14 && (tie.area(1) - 1.0).abs() < 1e-14);
    // Farther away than the reach: an error that says what to do.
    let mut none = Tie::new(&coordinates, &dofs, slave(), [[0, 1], [1, 2]]).unwrap().reach(0.04).unwrap();
    assert!(none.nodes().is_empty());
    let error = none.search(0.0, &[], &[], 0.0).unwrap_err();
    assert!(matches!(error, Error::Empty { .. }) && error.to_string().contains("reach of the tie"), "{error}");
    assert!(matches!(none.reach(f64::NAN), Err(Error::Parameter { .. })));
    let shared = Tie::new(&coordinates, &dofs, [[3, 0]], [[0, 1]]).unwrap_err();
    assert!(matches!(shared, Error::Incompatible { .. }));
}

/// The displacement, in units, of the end of two tied bars that are pulled.
fn pulled<T: Real>(unit: f64) -> f64 {
    let bodies = [3, 2].map(|cells| Solid::rectangle([1.0; 2], [cells, 2], MATERIAL));
    let stack = Stack::new(bodies, 0.0, |x| x);
    let scaled = |x: f64| T::of(unit * x);
    let nodes: Vec<[T; 2]> = stack.solid.nodes.iter().map(|x| x.map(scaled)).collect();
    let [lower, upper] = stack.surfaces();
    let tie = Tie::new(&nodes, &stack.solid.node_dofs(), upper, lower).unwrap();
    let mut system = stack.solid.system::<T>();
    for (node, [_, y]) in stack.solid.nodes.iter().enumerate() {
        if *y < 1e-9 {
            system = system.fix(2 * node).unwrap().fix(2 * node + 1).unwrap();
        }
    }
    let load: Vec<T> = stack.solid.nodes.iter().flat_map(|[_, y]| [T::zero(), scaled(f64::from(*y > 1.9))]).collect();
    let system = system.load(move |_, f| f.copy_from_slice(&load));
    let mut run = Simulation::builder(system, Newmark::trapezoidal(), 0.02).constraint(tie).build().unwrap();
    run.run_until(0.5, &mut ()).unwrap();
    assert!(run.gaps().iter().all(|gap| gap.value().abs() < 1e-5 * unit));
    run.state().displacement()[2 * (stack.solid.nodes.len() - 1) + 1].value() / unit
}

#[test]
fn ties_depend_neither_on_units_nor_on_the_scalar() {
    let expected = pulled::<f64>(1.0);
    assert!(expected > 0.01);
    for unit in [1e-6, 1e6] {
        assert!((pulled::<f64>(unit) / expected - 1.0).abs() < 1e-12);
    }
    assert!((pulled::<f32>(1.0) / expected - 1.0).abs() < 1e-4);
}

#[test]
fn the_patch_test_on_skewed_quadrilaterals() {
    // Nodes of the interface are moved within it by a share of an element.
    for skew in [0.05, 0.1, 0.2, 0.3] {
        for seed in 0..10 {
            for (lower, upper) in [([3, 3, 1], [2, 2, 1]), ([2, 3, 1], [4, 1, 1]), ([3, 4, 1], [4, 5, 1])] {
                let bodies = [lower, upper].map(|cells| {
                    let phase = f64::from(seed) + 50.0 * cells[0] as f64;
                    let moved = |x: f64, y: f64, n: usize| {
                        let inside = x > 1e-9 && x < 1.0 - 1e-9;
                        if inside { skew * (91.0 * x + 57.0 * y + phase).sin() / n as f64 } else { 0.0 }
                    };
                    let block = Solid::block([1.0; 3], cells, MATERIAL);
                    block.mapped(|[x, y, z]| [x + moved(x, y, cells[0]), y + moved(y, x, cells[1]), z])
                });
                let stack = Stack::new(bodies, 0.0, |x| x);
                for above in [true, false] {
                    let worst = patch_error(&stack, above);
                    assert!(worst < 1e-12, "{skew} {seed} {lower:?} {upper:?} {above}: {worst:e}");
                }
            }
        }
    }
}
