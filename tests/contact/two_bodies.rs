//! Two deformable bodies in contact through node to facet: patch test, impacts of blocks and rings, one pass and two.

use contact_dynamics::contact::{ContactConstraint, ContactLaw, NodeToFacet, SurfaceSettings};
use contact_dynamics::{
    Composite, Corrector, EnergyMomentum, Newmark, PersistencyCorrection, Simulation, StepControl, TimeIntegrator,
    verify,
};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::ironing;
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::schemes::all;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;

const MATERIAL: Material = Material { young: 100.0, poisson: 0.3, density: 1.0 };

/// Facets of the boundary all of whose nodes are `inside`, and their nodes.
fn side<const D: usize>(solid: &Solid<D>, inside: impl Fn(usize, [f64; D]) -> bool) -> (Vec<Vec<usize>>, Vec<usize>) {
    let facets: Vec<_> =
        solid.boundary().into_iter().filter(|f| f.iter().all(|&n| inside(n, solid.nodes[n]))).collect();
    let mut nodes: Vec<usize> = facets.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    (facets, nodes)
}

fn quads(facets: &[Vec<usize>]) -> Vec<[usize; 4]> {
    facets.iter().map(|f| [f[0], f[1], f[2], f[3]]).collect()
}

fn segments(facets: &[Vec<usize>]) -> Vec<[usize; 2]> {
    facets.iter().map(|f| [f[0], f[1]]).collect()
}

/// A block of height 1 on one of height 1, `cells` elements along the sides of each; the second one from z = 1 + gap.
fn blocks(lower: [usize; 3], upper: [usize; 3], gap: f64) -> Stack<3> {
    Stack::new([lower, upper].map(|cells| Solid::block([1.0; 3], cells, MATERIAL)), gap, |x| x)
}

/// Nodes of the upper block on facets of the lower one.
fn nodes_on_facets(stack: &Stack<3>, passes: usize) -> NodeToFacet<f64> {
    stack.nodes_on_facets(passes).unwrap().with(SurfaceSettings::new().reach(0.3)).unwrap()
}

/// Two blocks under uniform pressure, supported so that the exact solution is uniaxial: largest deviation of the
/// displacements from it, relative to the largest of them.
fn patch(lower: [usize; 3], upper: [usize; 3], passes: usize) -> f64 {
    let stack = blocks(lower, upper, 0.0);
    let (solid, pressure) = (&stack.solid, 1.0);
    let mut load = vec![0.0; solid.dofs()];
    for facet in solid.boundary().iter().filter(|f| f.iter().all(|&n| solid.nodes[n][2] > 2.0 - 1e-9)) {
        let [a, b] = [solid.nodes[facet[0]], solid.nodes[facet[2]]];
        let area = ((a[0] - b[0]) * (a[1] - b[1])).abs();
        for &n in facet {
            load[3 * n + 2] -= 0.25 * pressure * area;
        }
    }
    let mut system = solid.system::<f64>().load(move |t, f| {
        f.iter_mut().zip(&load).for_each(|(f, load)| *f = load * (t / 10.0).min(1.0));
    });
    for (node, place) in solid.nodes.iter().enumerate() {
        for axis in (0..3).filter(|&axis| place[axis].abs() < 1e-9) {
            system = system.fix(3 * node + axis).unwrap();
        }
    }
    // A strongly damped scheme: the static solution after a while.
    let mut run = Simulation::builder(system, Newmark::new(0.5, 1.0).unwrap(), 0.1)
        .constraint(nodes_on_facets(&stack, passes))
        .build()
        .unwrap();
    run.run_until(50.0, &mut ()).unwrap();
    let u = run.state().displacement();
    let strain = pressure / MATERIAL.young;
    let exact = |p: [f64; 3]| [0.3 * strain * p[0], 0.3 * strain * p[1], -strain * p[2]];
    let deviations = solid.nodes.iter().enumerate().flat_map(|(n, &p)| {
        let exact = exact(p);
        (0..3).map(move |axis| (u[3 * n + axis] - exact[axis]).abs())
    });
    deviations.fold(0.0, f64::max) / (2.0 * strain)
}

#[test]
fn the_patch_test_and_where_one_pass_fails_it() {
    let (coarse, fine, other) = ([2, 2, 2], [4, 4, 2], [3, 3, 2]);
    // Exact on matching meshes, and where every facet's nodes are met by nodes of the finer surface.
    for passes in [1, 2] {
        assert!(patch(other, other, passes) < 1e-12);
        assert!(patch(coarse, fine, passes) < 1e-12);
    }
    // On others one pass is not: facets between the nodes of the coarser surface sink into it. Two passes are.
    let nodes_between = patch(other, fine, 1);
    assert!(nodes_between < 0.05 && nodes_between > 1e-3, "{nodes_between:e}");
    assert!(patch(fine, coarse, 1) > 0.1);
    assert!(patch(other, fine, 2) < 1e-12);
    assert!(patch(fine, coarse, 2) < 1e-12);
}

/// The same on facets that tilt by roundings, on which both rows of two nodes that face each other differ by 1e-8 to
/// 1e-6: neither contact nor its correction calls these contradictory.
#[test]
fn two_passes_on_matching_meshes_are_exact_though_each_contact_is_there_twice() {
    for cells in [3, 8] {
        let bodies = || [cells; 2].map(|cells| Solid::rectangle([1.0; 2], [cells, 2], MATERIAL));
        for slant in [0.0, 0.35] {
            let stack = Stack::new(bodies(), 0.0, |[x, y]| [x, y + slant * x * (2.0 - y) * y]);
            let miss = stack.patch(stack.nodes_on_facets(2).unwrap()).unwrap();
            assert!(miss < 1e-12, "{cells}, {slant}: {miss:e}");
        }
    }
    for cells in [[3, 3], [5, 4]] {
        let bodies = || [cells; 2].map(|[x, y]| Solid::block([1.0; 3], [x, y, 1], MATERIAL));
        for (slant, skew) in [(0.25, 0.0), (0.0, 0.6)] {
            let stack = Stack::new(bodies(), 0.0, |[x, y, z]| {
                [x + skew * x * (1.0 - x) * (y - 0.5), y, z + slant * (x + 0.5 * y) * (2.0 - z) * z]
            });
            let miss = stack.patch(stack.nodes_on_facets(2).unwrap()).unwrap();
            assert!(miss < 1e-12, "{cells:?}, {slant}, {skew}: {miss:e}");
        }
    }
}

#[test]
fn impacts_of_blocks_keep_momentum_with_one_pass_and_with_two() {
    for (lower, upper, passes) in [([3, 3, 3], [3, 3, 3], 1), ([3, 3, 3], [4, 4, 3], 1), ([3, 3, 3], [4, 4, 3], 2)] {
        let stack = blocks(lower, upper, 0.003);
        check_impact(&stack, nodes_on_facets(&stack, passes), &format!("{passes} passes"));
    }
}

/// The upper block falls on the lower one and slides: momentum is kept, no step gains energy, no gap is negative, and
/// the blocks part.
pub(super) fn check_impact(stack: &Stack<3>, contact: impl ContactConstraint<f64> + 'static, what: &str) {
    let solid = &stack.solid;
    let speed = [0.02, 0.01, -0.1];
    let mut run = Simulation::builder(solid.system(), Composite, 0.25 / MATERIAL.wave_speed())
        .velocity(stack.velocity_of_upper(speed))
        .constraint(contact)
        .corrector(PersistencyCorrection::with_history_projection())
        .build()
        .unwrap();
    let direction =
        |axis: usize| -> Vec<f64> { (0..solid.dofs()).map(|dof| f64::from(u8::from(dof % 3 == axis))).collect() };
    let momentum = |run: &Simulation<'_, f64>| [0, 1, 2].map(|axis| run.momentum(&direction(axis)).unwrap());
    let (start, energy) = (momentum(&run), run.energy().total());
    let (mut before, mut most, mut parted) = (energy, 0, false);
    while run.time() < 1.5 {
        run.step().unwrap();
        for (now, start) in momentum(&run).iter().zip(start) {
            assert!((now - start).abs() < 1e-12, "{what}: {now} {start}");
        }
        let total = run.energy().total();
        assert!(total < before + 2e-3 * energy, "{what}, t = {}: {:e}", run.time(), (total - before) / energy);
        before = total;
        let contacts = run.state().contacts();
        let pressed = contacts.raw_forces().iter().filter(|f| **f > 0.0).count();
        most = most.max(pressed);
        parted = most > 0 && pressed == 0;
        assert!(contacts.gaps().iter().all(|gap| *gap > -1e-6), "{what}: {:?}", contacts.gaps());
    }
    assert!(most >= 9 && parted, "{what}: {most} pressed");
    assert!(before > 0.7 * energy, "{what}: {}", before / energy);
}

/// Two rings side by side that fly at each other: outer radius 40, inner 30, their surfaces 0.5 apart if `offset`, the
/// height of the second one above the first, is zero; E = 1, ρ = 0.001 (in these units the wave crosses the wall in
/// 0.25).
struct Rings {
    solid: Solid<2>,
    /// Number of nodes of the first one.
    split: usize,
    /// Outer surfaces, and the nodes of the second.
    facets: [Vec<[usize; 2]>; 2],
    nodes: Vec<usize>,
}

impl Rings {
    fn new(offset: f64) -> Self {
        let material = Material { young: 1.0, poisson: 0.4, density: 1e-3 };
        let centers = [[0.0, 0.0], [80.5, offset]];
        let ring = |k: usize, angle: f64| Solid::ring([30.0, 40.0], [3, 64], material).rotated(angle).moved(centers[k]);
        let left = ring(0, 0.02);
        let split = left.nodes.len();
        let solid = left.with(ring(1, 0.031));
        let outer = |k: usize| {
            let [x0, y0] = centers[k];
            side(&solid, |n, [x, y]| (n < split) == (k == 0) && ((x - x0).hypot(y - y0) - 40.0).abs() < 1e-9)
        };
        let [(first, _), (second, nodes)] = [outer(0), outer(1)];
        Self { facets: [segments(&first), segments(&second)], nodes, split, solid }
    }

    fn contact(&self) -> NodeToFacet<f64> {
        let Self { solid, nodes, facets, .. } = self;
        NodeToFacet::one_pass(&solid.nodes, &solid.node_dofs(), nodes, facets[0].clone())
            .unwrap()
            .with(SurfaceSettings::new().reach(5.0))
            .unwrap()
    }

    /// In two passes.
    fn both(&self) -> NodeToFacet<f64> {
        let [one, other] = self.facets.clone();
        NodeToFacet::new(&self.solid.nodes, &self.solid.node_dofs(), other, one)
            .unwrap()
            .with(SurfaceSettings::new().reach(5.0))
            .unwrap()
    }

    /// Each at `speed` toward the other.
    fn velocity(&self, speed: f64) -> Vec<f64> {
        let along = |dof: usize| if dof < 2 * self.split { speed } else { -speed };
        (0..self.solid.dofs()).map(|dof| if dof % 2 == 0 { along(dof) } else { 0.0 }).collect()
    }
}

#[test]
fn rings_at_large_strains_collide_in_few_iterations() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 3] =
        [|| Box::new(Composite), || Box::new(Newmark::trapezoidal()), || Box::new(EnergyMomentum)];
    for make in schemes {
        // Head on at a thirtieth of the wave speed; off center and faster, in one pass and in two.
        for (speed, offset, passes) in [(1.0, 0.0, 1), (2.0, 20.0, 1), (2.0, 20.0, 2)] {
            let rings = Rings::new(offset);
            let contact = match passes {
                1 => rings.contact().facing(rings.facets[1].clone()).unwrap(),
                _ => rings.both(),
            };
            let body = Hyperelastic::new(&rings.solid, Law::NeoHookean);
            let mut run = Simulation::builder(body, make(), 0.5)
                .velocity(rings.velocity(speed))
                .constraint(contact)
                .corrector(PersistencyCorrection::with_history_projection())
                .step_control(StepControl::halving(0.5 / 64.0).unwrap())
                .build()
                .unwrap();
            let along: Vec<f64> = (0..rings.solid.dofs()).map(|dof| f64::from(u8::from(dof % 2 == 0))).collect();
            let left: Vec<f64> =
                along.iter().enumerate().map(|(dof, x)| if dof < 2 * rings.split { *x } else { 0.0 }).collect();
            let (energy, momentum) = (run.energy().total(), run.momentum(&left).unwrap());
            let name = format!("{}, {speed}, {offset}, {passes}", make().name());
            let mut most = 0;
            let mut checker = rings.contact().facing(rings.facets[1].clone()).unwrap();
            while run.time() < 90.0 {
                let before = *run.statistics();
                run.step().unwrap();
                let after = *run.statistics();
                if after.refused_steps == before.refused_steps {
                    most = most.max(after.newton_iterations - before.newton_iterations);
                }
                assert!(run.energy().total() < energy * (1.0 + 1e-9), "{name} {}", run.energy().total() / energy);
                let deepest = run.gaps().iter().fold(0.0_f64, |deepest, &gap| deepest.min(gap));
                assert!(deepest > -1e-12 * 40.0, "{name}: {deepest:e}");
                if passes == 1 {
                    // Pressed gaps are closed for good: their rates vanish, by the rows where the step has ended.
                    let state = run.state();
                    checker.search_on(state.time(), state.displacement(), state.velocity(), 0.0).unwrap();
                    let g = checker.jacobian();
                    for row in 0..checker.candidates() {
                        let contacts = state.contacts();
                        let identity = checker.identity(row);
                        let at = contacts.ids().iter().position(|id| (id.feature, id.candidate) == identity);
                        if at.is_some_and(|at| contacts.raw_forces()[at] > 0.0) {
                            let rate = g.product(row, state.velocity());
                            assert!(rate.abs() < 1e-8 * speed, "{name}: {rate:e}");
                        }
                    }
                }
            }
            let refused = run.statistics().refused_steps;
            assert!(most <= 8 && refused < 10, "{name}: {most} iterations, {refused} steps refused");
            assert!(run.momentum(&along).unwrap().abs() < 1e-11 * momentum, "{name}");
            // They part again.
            assert!(run.momentum(&left).unwrap() < 0.0 && run.statistics().contact_changes >= 8, "{name}");
        }
    }
}

#[test]
fn rings_collide_without_gaining_energy() {
    let rings = Rings::new(0.0);
    let (solid, split) = (&rings.solid, rings.split);
    for law in [ContactLaw::Rigid, ContactLaw::Penalty { stiffness: 10.0 }] {
        let contact = rings.contact().facing(rings.facets[1].clone()).unwrap().with_law(law);
        let mut run = Simulation::builder(solid.system(), Composite, 0.05)
            .velocity(rings.velocity(0.3))
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        let energy = run.energy().total();
        let mass = solid.lumped_mass::<f64>();
        let (mut highest, mut contact_time) = (energy, 0.0);
        while run.time() < 120.0 {
            run.step().unwrap();
            highest = f64::max(highest, run.energy().total());
            if run.state().contacts().forces().iter().any(|f| *f > 0.0) {
                contact_time = run.time();
            }
        }
        let v = run.state().velocity();
        let momentum: f64 = mass.iter().zip(v).step_by(2).map(|(m, v)| m * v).sum();
        let (mass_left, left): (f64, f64) = (0..2 * split)
            .step_by(2)
            .map(|dof| (mass[dof], mass[dof] * v[dof]))
            .fold((0.0, 0.0), |sum, x| (sum.0 + x.0, sum.1 + x.1));
        assert!(momentum.abs() < 1e-10 * mass_left, "{momentum:e}");
        // The rings leave each other, ringing: slower than they came.
        let restitution = -left / mass_left / 0.3;
        assert!(contact_time < 110.0 && (0.3..1.0).contains(&restitution), "{law:?}: {contact_time} {restitution}");
        assert!(highest < 1.01 * energy, "{law:?}: {}", highest / energy);
    }
}

#[test]
fn facets_pass_the_check_that_hosts_run_on_their_own_constraints() {
    let stack = blocks([3, 3, 1], [4, 4, 1], 0.02);
    // Both surfaces warped.
    let solid = &stack.solid;
    let u: Vec<f64> = (0..solid.dofs()).map(|dof| 0.01 * (dof as f64 * 1.7).sin()).collect();
    let v: Vec<f64> = (0..solid.dofs()).map(|dof| 0.3 * (dof as f64 * 2.3).cos()).collect();
    let error = verify::gap_jacobian(&mut nodes_on_facets(&stack, 1), 0.0, &u, &v, 1e-6).unwrap();
    assert!(error.rows >= 9 && error.jacobian < 1e-6, "{error:?}");
    assert!(error.acceleration < 1e-3, "{error:?}");
}

/// A soft cube that falls on a soft block by whatever corner or edge, part of it perhaps over the rim.
struct Fall {
    solid: Solid<3>,
    contact: NodeToFacet<f64>,
    velocity: Vec<f64>,
    /// Time in which a wave crosses an element.
    crossing: f64,
}

impl Fall {
    fn new(random: &mut impl FnMut() -> f64, passes: usize, law: ContactLaw) -> Self {
        let material = Material { young: 1.0, ..MATERIAL };
        let axis: [f64; 3] = std::array::from_fn(|_| random() - 0.5);
        let (angle, speed) = (3.0 * random(), 0.02 + 0.2 * random());
        let beside = [0.6 * (random() - 0.5), 0.6 * (random() - 0.5), 0.0];
        let lower = Solid::block([1.5, 1.5, 1.0], [4, 4, 3], material).moved([-0.75, -0.75, -1.0]);
        let split = lower.nodes.len();
        let upper = Solid::block([1.0; 3], [3; 3], material).moved([-0.5; 3]).rotated(axis, angle).lifted(0.05);
        let solid = lower.with(upper.moved(beside));
        let (below, _) = side(&solid, |n, _| n < split);
        let (above, nodes) = side(&solid, |n, _| n >= split);
        let contact = match passes {
            1 => NodeToFacet::one_pass(&solid.nodes, &solid.node_dofs(), &nodes, quads(&below))
                .and_then(|contact| contact.facing(quads(&above))),
            _ => NodeToFacet::new(&solid.nodes, &solid.node_dofs(), quads(&above), quads(&below)),
        };
        let contact = contact.unwrap().with(SurfaceSettings::new().reach(0.2)).unwrap();
        let falls = |dof: usize| dof % 3 == 2 && dof >= 3 * split;
        let velocity = (0..solid.dofs()).map(|dof| if falls(dof) { -speed } else { 0.0 }).collect();
        Self { solid, contact: contact.with_law(law), velocity, crossing: 1.0 / 3.0 / material.wave_speed() }
    }

    /// Runs until t = 6, and says how many steps were refused.
    fn run(self, scheme: Box<dyn TimeIntegrator>, courant: f64, corrected: bool) -> u64 {
        let Self { solid, contact, velocity, crossing } = self;
        let (name, stages) = (scheme.name(), scheme.tableau().stages.len() as u64);
        let h = courant * crossing;
        let corrector: Option<Box<dyn Corrector<f64>>> =
            if corrected { Some(Box::new(PersistencyCorrection::with_history_projection())) } else { None };
        let mut run = Simulation::builder(Hyperelastic::new(&solid, Law::NeoHookean), scheme, h)
            .velocity(velocity)
            .constraint(contact)
            .correctors(corrector)
            .step_control(StepControl::halving(h / 256.0).unwrap())
            .build()
            .unwrap();
        let up: Vec<f64> = (0..solid.dofs()).map(|dof| f64::from(u8::from(dof % 3 == 2))).collect();
        let momentum = run.momentum(&up).unwrap();
        while run.time() < 6.0 {
            let before = *run.statistics();
            run.step().unwrap_or_else(|error| panic!("{name}: {error}"));
            let after = *run.statistics();
            let iterations = after.newton_iterations - before.newton_iterations;
            assert!(after.refused_steps > before.refused_steps || iterations <= 8 * stages, "{name}: {iterations}");
        }
        assert!(run.statistics().contact_changes > 0, "{name}");
        assert!((run.momentum(&up).unwrap() / momentum - 1.0).abs() < 1e-10, "{name}");
        run.statistics().refused_steps
    }
}

#[test]
fn blocks_that_fall_on_blocks_by_their_corners_hardly_lose_a_step() {
    // Edges and corners on faces and over rims: normals jump between facets, within a step too.
    let mut random = xorshift(77);
    let refused: u64 = (0..16)
        .map(|drop| {
            let fall = Fall::new(&mut random, 1 + drop % 2, ContactLaw::Rigid);
            fall.run(Box::new(Composite), 0.5 + random(), true)
        })
        .sum();
    // (A node that would have come in over an edge is one more reason to take smaller steps.)
    assert!(refused <= 14, "{refused}");
}

#[test]
fn every_scheme_lets_blocks_fall() {
    for scheme in all() {
        let law = if scheme.takes_multipliers() { ContactLaw::Rigid } else { ContactLaw::Penalty { stiffness: 1.0 } };
        let courant = if scheme.critical.is_some() { 0.2 } else { 0.8 };
        let refused = Fall::new(&mut xorshift(4), 1, law).run((scheme.make)(), courant, scheme.takes_corrections());
        assert!(refused <= 12, "{}: {refused}", scheme.name());
    }
}

/// Two nodes meet, and each lies on facets of the other: the rows are the same, but not the accelerations along them,
/// because both nodes slide along facets that turn. No force makes both gap accelerations vanish.
#[test]
fn a_stamp_is_drawn_over_nodes_that_meet_its_own() {
    let scene = ironing::scene(60, 40);
    let mut run = ironing::simulation(&scene, Box::new(scene.nodes_on_facets(2).unwrap())).unwrap();
    run.run_until(172.0, &mut ()).unwrap();
    // The stamp is far in, and slides without friction.
    let force = ironing::force_on_block(&scene, &run);
    assert!(force[1] < 0.0 && force[0].abs() < 0.01 * -force[1], "{force:?}");
}
