//! Friction while normals turn: forces, slips and impulses are vectors, whatever tangents describe them.

use crate::{GRAVITY, schemes};
use contact_dynamics::contact::NodeToFacet;
use contact_dynamics::{LinearSystem, Simulation, System, TimeIntegrator};
use contact_dynamics_scenes::schemes::correctable;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::diagonal;
use contact_dynamics_scenes::stacks::Stack;

const FRICTION: f64 = 0.3;

/// Orthonormal axes of a scene.
type Axes = [[f64; 3]; 3];

const PLAIN: Axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// x and y exchanged.
const MIRRORED: Axes = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];

/// Axes turned by an odd rotation.
fn turned() -> Axes {
    let ([s, c], [t, d]) = ([0.7_f64.sin(), 0.7_f64.cos()], [1.9_f64.sin(), 1.9_f64.cos()]);
    [[c, s * d, s * t], [-s, c * d, c * t], [0.0, -t, d]]
}

/// The vector with these components along the axes.
fn place(axes: Axes, x: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| (0..3).map(|k| axes[k][i] * x[k]).sum())
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

fn length(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}

/// A mass of 1, node `order[0]`, that slides with speed 1 along x on a driven quadrilateral, the other nodes. Its slope
/// turns from x to y: |n_x| = |n_y| at t = 0.05.
fn slide(axes: Axes, order: [usize; 5], scheme: Box<dyn TimeIntegrator>) -> Simulation<'static, f64> {
    let corners = [[-3.0, -1.0], [3.0, -1.0], [3.0, 1.0], [-3.0, 1.0]];
    let (mut nodes, mut displacement, mut velocity) = ([[0.0; 3]; 5], vec![0.0; 15], vec![0.0; 15]);
    let mut system = LinearSystem::lumped(vec![1.0; 15], diagonal(&[0.0; 15])).unwrap();
    let mass = 3 * order[0]..3 * order[0] + 3;
    velocity[mass.clone()].copy_from_slice(&place(axes, [1.0, 0.0, 1e-3]));
    let weight = place(axes, [0.0, 0.0, -GRAVITY]);
    system = system.load(move |_, f| f[mass.clone()].copy_from_slice(&weight));
    for (&node, &[x, y]) in order[1..].iter().zip(&corners) {
        nodes[node] = place(axes, [x, y, 0.0]);
        for (i, up) in axes[2].into_iter().enumerate() {
            let height = move |t: f64| 1e-3 * ((1.0 - 10.0 * t) * x + 10.0 * t * y);
            let (dof, rate) = (3 * node + i, up * 1e-2 * (y - x));
            (displacement[dof], velocity[dof]) = (up * height(0.0), rate);
            system = system.drive(dof, move |t| [up * height(t), rate, 0.0]).unwrap();
        }
    }
    let dofs: Vec<[usize; 3]> = (0..5).map(|node| [3 * node, 3 * node + 1, 3 * node + 2]).collect();
    let mut facet: [usize; 4] = std::array::from_fn(|k| order[k + 1]);
    if axes == MIRRORED {
        facet.reverse();
    }
    let contact = NodeToFacet::one_pass(&nodes, &dofs, &[order[0]], [facet]).unwrap().friction(FRICTION);
    let builder = Simulation::builder(system, scheme, 2e-3).displacement(displacement).velocity(velocity);
    builder.constraint(contact).build().unwrap()
}

/// Where the tangents of the constraint exchange their places, at t = 0.05, forces and motion are smooth.
#[test]
fn a_mass_slides_on_where_tangents_flip() {
    for listed in correctable() {
        let (name, mut run) = (listed.name(), slide(PLAIN, [0, 1, 2, 3, 4], (listed.make)()));
        for step in 0..50 {
            let momentum = |run: &Simulation<'_, f64>| [0, 1].map(|dof| run.momentum(&unit(dof)).unwrap());
            let before = momentum(&run);
            run.step().unwrap();
            for ((after, before), impulse) in momentum(&run).iter().zip(before).zip(run.impulses_on_dofs()) {
                assert!((after - before - impulse).abs() < 1e-13, "{name} {step}: {after} {before} {impulse}");
            }
            let contact = run.contact_forces().next().unwrap();
            let [slip, friction] = [length(&contact.slip), length(&contact.friction)];
            let power = dot(&contact.friction, &contact.slip);
            assert!((power / (slip * friction) + 1.0).abs() < 1e-12, "{name} {step}: {power}");
            assert!((friction / (FRICTION * contact.force) - 1.0).abs() < 1e-12, "{name} {step}: {friction}");
            // Friction of μ g, but for the slopes of 1e-3.
            let a = &run.state().acceleration()[..3];
            assert!((a[0] + FRICTION * GRAVITY).abs() < 0.01 && a[1].abs() < 0.01, "{name} {step}: {a:?}");
            let mut left = [-a[0], -a[1], -GRAVITY - a[2]];
            contact.forces().filter(|&(dof, _)| dof < 3).for_each(|(dof, force)| left[dof] += force);
            assert!(length(&left) < 1e-3, "{name} {step}: {left:?}");
        }
    }
}

/// One along a dof of node 0.
fn unit(dof: usize) -> Vec<f64> {
    (0..15).map(|other| f64::from(other == dof)).collect()
}

/// Displacements, velocities and accelerations of all nodes along the axes, step by step.
fn history(mut run: Simulation<'static, f64>, axes: Axes, order: &[usize], steps: usize) -> Vec<[Vec<f64>; 3]> {
    let mut step = || {
        run.step().unwrap();
        let state = run.state();
        [state.displacement(), state.velocity(), state.acceleration()].map(|x| {
            let of_node = |&node: &usize| axes.map(|axis| dot(&axis, &x[3 * node..3 * node + 3]));
            order.iter().flat_map(of_node).collect()
        })
    };
    (0..steps).map(|_| step()).collect()
}

/// The largest difference of two histories: of displacements, velocities and accelerations, each in units of the
/// largest one.
fn difference(one: &[[Vec<f64>; 3]], other: &[[Vec<f64>; 3]]) -> f64 {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |most: f64, x| most.max(x.abs()));
    let of = |field: usize| {
        let [one, other] = [one, other].map(|steps| steps.iter().flat_map(move |step| step[field].iter().copied()));
        largest(&mut one.clone().zip(other).map(|(x, y)| x - y)) / largest(&mut { one })
    };
    (0..3).map(of).fold(0.0, f64::max)
}

#[test]
fn slides_do_not_depend_on_axes_and_numbers() {
    for listed in schemes() {
        let of = |axes, order: [usize; 5]| history(slide(axes, order, (listed.make)()), axes, &order, 50);
        let plain = of(PLAIN, [0, 1, 2, 3, 4]);
        for (axes, order) in [(turned(), [3, 0, 4, 1, 2]), (MIRRORED, [0, 2, 1, 4, 3])] {
            let difference = difference(&plain, &of(axes, order));
            assert!(difference < 1e-9, "{}: {difference:e}", listed.name());
        }
    }
}

/// Two free blocks of hexahedra that meet obliquely, 3 elements on 2.
fn blocks(axes: Axes, scheme: Box<dyn TimeIntegrator>) -> (Stack<3>, Simulation<'static, f64>) {
    let material = Material { young: 1e3, poisson: 0.3, density: 1.0 };
    let upper = Solid::block([0.8, 0.8, 1.0], [3, 3, 2], material).moved([0.07, 0.13, 0.0]);
    let stack = Stack::new([Solid::block([1.0; 3], [2; 3], material), upper], 0.0, |x| place(axes, x));
    let contact = stack.nodes_on_facets(1).unwrap().friction(FRICTION);
    let velocity = stack.velocity_of_upper(place(axes, [0.3, 0.2, -1.0]));
    let builder = Simulation::builder(stack.solid.system(), scheme, 1e-3).velocity(velocity);
    let run = builder.constraint(contact).build().unwrap();
    (stack, run)
}

/// Momentum, the cone, and friction against slip at every step. M a = f + Σ forces where the balance holds at the state;
/// by other schemes forces are those of another time in the step.
#[test]
fn blocks_that_rub_keep_to_the_laws() {
    for listed in correctable() {
        let (name, (stack, mut run)) = (listed.name(), blocks(PLAIN, (listed.make)()));
        let (mut system, mass) = (stack.solid.system::<f64>(), stack.solid.lumped_mass::<f64>());
        let at_state = (listed.make)().tableau().stages.iter().all(|stage| stage.balance == stage.recovery);
        let of_upper = |axis: usize| {
            let of = move |dof: usize| f64::from(dof >= 3 * stack.split && dof % 3 == axis);
            (0..mass.len()).map(of).collect::<Vec<_>>()
        };
        let directions = [0, 1, 2].map(of_upper);
        for step in 0..20 {
            let before = directions.each_ref().map(|direction| run.momentum(direction).unwrap());
            run.step().unwrap();
            for (direction, before) in directions.iter().zip(before) {
                let left = run.momentum(direction).unwrap() - before - dot(direction, run.impulses_on_dofs());
                assert!(left.abs() < 1e-14, "{name} {step}: {left:e} of 0.6");
            }
            let state = run.state();
            let mut forces = vec![0.0; mass.len()];
            system.force(state.time(), state.displacement(), state.velocity(), &mut forces).unwrap();
            for contact in run.contact_forces() {
                let bound = FRICTION * contact.force.max(0.0);
                assert!(length(&contact.friction) <= bound + 1e-12, "{name} {step}: {contact:?}");
                assert!(dot(&contact.friction, &contact.slip) <= 1e-14, "{name} {step}: {contact:?}");
                contact.forces().for_each(|(dof, force)| forces[dof] += force);
            }
            let left = (0..mass.len()).map(|dof| (mass[dof] * state.acceleration()[dof] - forces[dof]).abs());
            let left = left.fold(0.0_f64, f64::max);
            assert!(left < if at_state { 1e-12 } else { 0.5 }, "{name} {step}: {left:e} of 12");
        }
    }
}

#[test]
fn blocks_do_not_depend_on_axes() {
    for listed in schemes() {
        let of = |axes| {
            let (stack, run) = blocks(axes, (listed.make)());
            let order: Vec<usize> = (0..stack.solid.nodes.len()).collect();
            history(run, axes, &order, 20)
        };
        let difference = difference(&of(PLAIN), &of(turned()));
        assert!(difference < 1e-9, "{}: {difference:e}", listed.name());
    }
}
