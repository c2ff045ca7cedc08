//! Elastic bodies with friction: on an incline, and on each other.

use super::GRAVITY;
use contact_dynamics::contact::{Contacts, NodeToFacet, NodesOnObstacle, Plane, SurfaceSettings};
use contact_dynamics::{
    Bathe, Composite, ContactConstraint, ContactStatus, GeneralizedAlpha, LinearSystem, Newmark, Preset, Simulation,
    TimeIntegrator, mass,
};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;

const MATERIAL: Material = Material { young: 1e6, poisson: 0.3, density: 1.0 };

/// A body under gravity along a slope (the last axis points off it).
fn loaded<const D: usize>(solid: &Solid<D>, slope: f64) -> LinearSystem<'static, f64> {
    let mass = solid.lumped_mass::<f64>();
    let (sine, cosine) = slope.sin_cos();
    solid.system().load(move |_, f| {
        for (dof, (f, m)) in f.iter_mut().zip(&mass).enumerate() {
            *f = m
                * GRAVITY
                * if dof % D == 0 {
                    sine
                } else if dof % D == D - 1 {
                    -cosine
                } else {
                    0.0
                };
        }
    })
}

/// A block of elements on a slope, with steps by a scheme that damps what the sudden weight excites.
fn block(slope: f64, friction: f64, h: f64) -> (Solid<2>, Simulation<'static, f64>) {
    let solid = Solid::rectangle([1.0, 0.5], [4, 2], MATERIAL);
    let nodes: Vec<_> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][1] == 0.0).collect();
    let floor =
        NodesOnObstacle::new(Plane::new([0.0; 2], [0.0, 1.0]).unwrap(), &solid.nodes, &solid.node_dofs(), &nodes)
            .unwrap()
            .friction(friction);
    let scheme = GeneralizedAlpha::chung_hulbert(0.5).unwrap();
    let run = Simulation::builder(loaded(&solid, slope), scheme, h).constraint(floor).build().unwrap();
    (solid, run)
}

#[test]
fn a_block_of_elements_slides_as_one_mass() {
    let (slope, friction) = (0.5_f64, 0.3);
    let (solid, mut run) = block(slope, friction, 2e-3);
    let along: Vec<_> = (0..solid.dofs()).map(|dof| f64::from(dof % 2 == 0)).collect();
    let mass: f64 = solid.lumped_mass::<f64>().iter().sum::<f64>() / 2.0;
    run.run_until(0.5, &mut ()).unwrap();
    let [t, p] = [run.state().time(), run.momentum(&along).unwrap()];
    run.run_until(2.0, &mut ()).unwrap();
    let found = (run.momentum(&along).unwrap() - p) / (mass * (run.state().time() - t));
    let expected = GRAVITY * (slope.sin() - friction * slope.cos());
    assert!((found / expected - 1.0).abs() < 1e-4, "{}", found / expected - 1.0);
}

/// Below the angle of friction it settles on its elasticity, and then not one bit moves.
#[test]
fn a_block_of_elements_stays() {
    let (_, mut run) = block(0.2, 0.5, 1e-2);
    run.run_until(20.0, &mut ()).unwrap();
    let before = run.state().displacement().to_vec();
    for _ in 0..10_000 {
        run.step().unwrap();
    }
    let size = before.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
    for (now, before) in run.state().displacement().iter().zip(&before) {
        // (Gaps are computed from coordinates of size one.)
        assert!((now - before).abs() <= 1e-15, "{:e} of {size:e}", now - before);
    }
    assert!((0..5).all(|contact| run.state().contacts().status(contact) != ContactStatus::Sliding));
}

/// A body on another one, as one solid, with the contact between them and the nodes at the bottom.
fn stacked(lower: Solid<2>, upper: Solid<2>, friction: f64) -> (Solid<2>, NodeToFacet<f64>, Vec<usize>) {
    let (split, height) = (lower.nodes.len(), 0.5);
    let solid = lower.with(upper);
    let facets = |inside: &dyn Fn(usize, [f64; 2]) -> bool| -> Vec<[usize; 2]> {
        let all = solid.boundary().into_iter().filter(|side| side.iter().all(|&n| inside(n, solid.nodes[n])));
        all.map(|side| [side[0], side[1]]).collect()
    };
    let below = facets(&|n, [_, y]| n < split && y > height - 1e-3);
    let above = facets(&|n, [_, y]| n >= split && y < height + 1e-3);
    let contact = NodeToFacet::new(&solid.nodes, &solid.node_dofs(), above, below).unwrap().friction(friction);
    let bottom = (0..split).filter(|&n| solid.nodes[n][1] == 0.0).collect();
    (solid, contact, bottom)
}

/// A block on a block on a slope: below the friction angle neither moves once they have settled.
#[test]
fn two_blocks_on_a_slope_stay() {
    let material = Material { young: 1e5, ..MATERIAL };
    let lower = Solid::rectangle([2.0, 0.5], [6, 2], material);
    let upper = Solid::rectangle([1.0, 0.5], [5, 2], material).moved([0.45, 0.5]);
    let (solid, contact, bottom) = stacked(lower, upper, 0.5);
    let floor = Plane::new([0.0; 2], [0.0, 1.0]).unwrap();
    let mut run = Simulation::builder(loaded(&solid, 0.2), GeneralizedAlpha::chung_hulbert(0.5).unwrap(), 1e-2)
        .constraint(NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom).unwrap().friction(0.5))
        .constraint(contact)
        .build()
        .unwrap();
    run.run_until(30.0, &mut ()).unwrap();
    let before = run.state().displacement().to_vec();
    for _ in 0..10_000 {
        run.step().unwrap();
    }
    let moves = run.state().displacement().iter().zip(&before).map(|(now, then)| (now - then).abs());
    let most = moves.fold(0.0_f64, f64::max);
    // (Coordinates of size one.)
    assert!(most < 2e-15, "{most:e}");
    let contacts = run.state().contacts();
    assert!((0..contacts.ids().len()).all(|contact| contacts.status(contact) != ContactStatus::Sliding));
}

/// A block thrown along another one that lies on ice: they take and give the same momentum, to rounding, and end with
/// one velocity.
#[test]
fn two_bodies_rub_without_losing_momentum() {
    let lower = Solid::rectangle([4.0, 0.5], [12, 2], MATERIAL);
    let split = lower.nodes.len();
    let (solid, contact, bottom) =
        stacked(lower, Solid::rectangle([1.0, 0.5], [5, 2], MATERIAL).moved([0.5, 0.5]), 0.4);
    let ice = Plane::new([0.0; 2], [0.0, 1.0]).unwrap();
    let velocity = (0..solid.dofs()).map(|dof| if dof % 2 == 0 && dof >= 2 * split { 2.0 } else { 0.0 }).collect();
    let scheme = GeneralizedAlpha::chung_hulbert(0.8).unwrap();
    let mut run = Simulation::builder(loaded(&solid, 0.0), scheme, 1e-3)
        .velocity(velocity)
        .constraint(NodesOnObstacle::new(ice, &solid.nodes, &solid.node_dofs(), &bottom).unwrap())
        .constraint(contact)
        .energy_balance()
        .build()
        .unwrap();
    let along: Vec<_> = (0..solid.dofs()).map(|dof| f64::from(dof % 2 == 0)).collect();
    let start = run.momentum(&along).unwrap();
    for _ in 0..1000 {
        run.step().unwrap();
        let now = run.momentum(&along).unwrap();
        // (Rows of K sum to zero but for rounding, and the bodies travel.)
        assert!((now / start - 1.0).abs() < 1e-9, "{} {:e}", run.state().time(), now / start - 1.0);
    }
    // Masses 2 and ½: the relative velocity 2 falls by μ g (1 + ½/2) a time, so it is gone at t = .4.
    let v = run.state().velocity();
    let mean = |nodes: std::ops::Range<usize>| nodes.clone().map(|n| v[2 * n]).sum::<f64>() / nodes.len() as f64;
    let [one, other] = [mean(0..split), mean(split..solid.nodes.len())];
    assert!((one - 0.4).abs() < 0.01 && (other - 0.4).abs() < 0.01, "{one} {other}");
    let works = run.energy().works.unwrap();
    assert!((works.friction / -0.8 - 1.0).abs() < 0.05, "{works:?}");
}

/// A run whose contacts are found after its start has the work of their friction in its books.
#[test]
fn friction_of_contacts_that_are_found_later_is_booked() {
    let lower = Solid::rectangle([4.0, 0.5], [12, 2], MATERIAL);
    let split = lower.nodes.len();
    let upper = Solid::rectangle([1.0, 0.5], [5, 2], MATERIAL).moved([0.5, 0.5 + 8e-4]);
    let (solid, contact, bottom) = stacked(lower, upper, 0.4);
    let speed = |dof: usize| if dof.is_multiple_of(2) { 0.2 } else { -0.05 };
    let mut system = solid.system::<f64>();
    for &node in &bottom {
        system = system.fix(2 * node).unwrap().fix(2 * node + 1).unwrap();
    }
    let mut run = Simulation::builder(system, GeneralizedAlpha::chung_hulbert(0.8).unwrap(), 1e-3)
        .velocity((0..solid.dofs()).map(|dof| if dof >= 2 * split { speed(dof) } else { 0.0 }).collect())
        .constraint(contact.with(SurfaceSettings::new().reach(1e-4)).unwrap())
        .energy_balance()
        .build()
        .unwrap();
    assert!(run.state().contacts().ids().is_empty());
    let along: Vec<_> = (0..solid.dofs()).map(|dof| f64::from(dof % 2 == 0)).collect();
    let (start, pushed) = (run.energy().total(), run.momentum(&along).unwrap());
    run.run_until(0.1, &mut ()).unwrap();
    // What it loses along the other one friction takes, by the mean velocity; the rest is in waves.
    let slowed = (run.momentum(&along).unwrap() - pushed).abs();
    let work = -run.energy().works.unwrap().friction;
    assert!(slowed > 0.05 * pushed && work > 0.01 * start, "{slowed:e} of {pushed:e}, {work:e} of {start:e}");
    assert!(work > 0.5 * 0.2 * slowed && work < 1.1 * 0.2 * slowed, "{work:e} for {:e}", 0.2 * slowed);
}

/// A block thrown straight on another one, of meshes that do not fit, and askew: what slips is all rounding at some
/// contacts, for normals turn by rounding. Contact settles at once all the same.
#[test]
fn contact_of_blocks_thrown_on_one_another_settles() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 4] = [
        || Box::new(Composite),
        || Box::new(Newmark::trapezoidal()),
        || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()),
        || Box::new(Bathe::default()),
    ];
    let (speed, h) = (0.1, 2e-4);
    for (k, scheme) in schemes.iter().enumerate() {
        for contact in 0..4 {
            let material = Material { young: [1e3, 1e5][(k + contact) % 2], ..MATERIAL };
            let block = |size: f64, cells: usize| Solid::block([size, size, 1.0], [cells, cells, 2], material);
            let blocks = [block(1.0, 4), block(0.7, 6).moved([0.15, 0.15, 0.0])];
            let stack = Stack::new(blocks, 1.37 * speed * h, |x| x);
            let constraints: Vec<Box<dyn ContactConstraint<f64>>> = match contact {
                0 => vec![Box::new(stack.mortar(true).unwrap().dual().unwrap().friction(0.3))],
                1 => vec![Box::new(stack.nodes_on_facets(1).unwrap().friction(0.3))],
                2 => vec![Box::new(stack.nodes_on_facets(2).unwrap().friction(0.3))],
                _ => stack.bodies(true).unwrap().friction(0.3).constraints().unwrap(),
            };
            let stages = scheme().tableau().stages.len() as u64;
            let along = [0.0, 0.2 * speed][k % 2];
            let mut run = Simulation::builder(stack.solid.system(), scheme(), h)
                .velocity(stack.velocity_of_upper([along, 0.3 * along, -speed]))
                .constraints(constraints)
                .build()
                .unwrap();
            for step in 0..3 {
                let before = run.statistics().contact_solves;
                run.step().unwrap_or_else(|error| panic!("{}, {contact}, step {step}: {error}", scheme().name()));
                let solves = run.statistics().contact_solves - before;
                // (Nodes on an edge of facets may alternate between their normals for up to 18; 48 are the limit.)
                assert!(solves <= 24 * stages, "{}, {contact}, step {step}: {solves}", scheme().name());
            }
            assert!(run.state().contacts().raw_forces().iter().any(|&force| force > 0.0));
        }
    }
}

/// Two bodies that turn together do not slip on each other.
#[test]
fn turning_together_is_no_slip() {
    let solid = Solid::block([1.0; 3], [2, 2, 1], MATERIAL)
        .with(Solid::block([0.6, 0.6, 1.0], [1, 1, 1], MATERIAL).moved([0.13, 0.21, 1.0]));
    let axis = [0.3, -0.5, 0.8];
    let turned = solid.clone().rotated(axis, 0.7);
    let quads = |inside: &dyn Fn(usize, [f64; 3]) -> bool| -> Vec<[usize; 4]> {
        let all = solid.boundary().into_iter().filter(|side| side.iter().all(|&n| inside(n, solid.nodes[n])));
        all.map(|side| [side[0], side[1], side[2], side[3]]).collect()
    };
    let below = quads(&|n, [_, _, z]| n < 18 && z > 0.999);
    let above = quads(&|n, [_, _, z]| n >= 18 && z < 1.001);
    let mut contact = NodeToFacet::new(&solid.nodes, &solid.node_dofs(), above, below).unwrap().friction(0.3);
    // Displaced by a finite rotation, moving with ω × x.
    let (mut u, mut v) = (vec![0.0; solid.dofs()], vec![0.0; solid.dofs()]);
    for (node, (x, start)) in turned.nodes.iter().zip(&solid.nodes).enumerate() {
        let w = [axis[1] * x[2] - axis[2] * x[1], axis[2] * x[0] - axis[0] * x[2], axis[0] * x[1] - axis[1] * x[0]];
        for k in 0..3 {
            (u[3 * node + k], v[3 * node + k]) = (x[k] - start[k], w[k]);
        }
    }
    let dofs = contact.dofs().to_vec();
    let [u, v] = [u, v].map(|x| dofs.iter().map(|&dof| x[dof]).collect::<Vec<_>>());
    contact.search(0.0, &u, &v, 0.0).unwrap();
    let contacts = Contacts::of(&contact);
    assert!(contacts.len() >= 4);
    for row in 0..contacts.len() {
        let normal = contacts.normal(row).unwrap();
        assert_eq!(contacts.tangents(row).len(), 2);
        for tangent in contacts.tangents(row) {
            let slip: f64 = tangent.iter().map(|&(place, weight)| weight * v[place]).sum();
            assert!(slip.abs() < 1e-12, "{slip}");
            // The first three entries are the direction on the node: across the normal, and of length one.
            let direction: Vec<_> = tangent.iter().take(3).map(|(_, weight)| *weight).collect();
            let along: f64 = direction.iter().zip(normal).map(|(a, b)| a * b).sum();
            let length: f64 = direction.iter().map(|a| a * a).sum();
            assert!(along.abs() < 1e-12 && (length - 1.0).abs() < 1e-12);
        }
    }
}

/// A preset takes the mass off all directions of the contact nodes, and they rub as the others.
#[test]
fn presets_rub() {
    let solid = Solid::rectangle([1.0, 0.5], [8, 4], MATERIAL);
    let nodes: Vec<_> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][1] == 0.0).collect();
    let contact: Vec<_> = nodes.iter().flat_map(|&node| [2 * node, 2 * node + 1]).collect();
    let groups: Vec<_> = (0..solid.dofs()).map(|dof| dof % 2).collect();
    for preset in [Preset::smooth(), Preset::conservative(), Preset::explicit()] {
        let (k, m) = (solid.stiffness(), solid.consistent_mass());
        let h = 5e-5;
        let courant = mass::courant(mass_of(&m), k.as_ref(), h).unwrap()[0].min(1.0);
        let m = preset.mass(m.as_ref(), k.symbolic(), &contact, &groups, courant).unwrap();
        let wall = NodesOnObstacle::new(
            Plane::new([0.0, -0.01], [0.0, 1.0]).unwrap(),
            &solid.nodes,
            &solid.node_dofs(),
            &nodes,
        )
        .unwrap()
        .friction(0.2);
        let velocity = (0..solid.dofs()).map(|dof| if dof % 2 == 0 { 40.0 } else { -10.0 }).collect();
        let mut run = Simulation::builder(LinearSystem::new(m, k).unwrap(), preset.integrator(), h)
            .velocity(velocity)
            .constraint(wall)
            .correctors(preset.correctors())
            .build()
            .unwrap();
        let mut impulse = [0.0; 2];
        while run.state().time() < 5e-3 {
            run.step().unwrap();
            for contact in 0..nodes.len() {
                impulse[0] += run.state().contacts().friction_impulses(contact)[0];
                impulse[1] += run.state().contacts().impulses()[contact];
            }
        }
        // It slides all along: friction takes μ times what the wall gives.
        assert!((impulse[0] / impulse[1] + 0.2).abs() < 1e-9, "{preset:?} {impulse:?}");
        let along: Vec<_> = (0..solid.dofs()).map(|dof| f64::from(dof % 2 == 0)).collect();
        let left = run.momentum(&along).unwrap() - 0.5 * 40.0;
        assert!((left / impulse[0] - 1.0).abs() < 1e-9, "{preset:?} {left} {impulse:?}");
        assert!(!run.state().contacts().closed().contains(&true));
    }
}

fn mass_of(m: &contact_dynamics::faer::sparse::SparseColMat<usize, f64>) -> contact_dynamics::Mass<'_, f64> {
    contact_dynamics::Mass::Consistent(m.as_ref())
}
