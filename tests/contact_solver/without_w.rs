//! Contact without the Delassus operator: the same motion and forces as with it, in every kind of problem that it
//! serves, beside a factor and beside conjugate gradients, and an error where it does not end.

use contact_dynamics::contact::{ContactConstraint, ContactLaw, NodesOnObstacle, Obstacle, Plane, Side, Sphere};
use contact_dynamics::contact_solver::Assembly;
use contact_dynamics::corrector::WorkBalance;
use contact_dynamics::mass::{self, Redistribution};
use contact_dynamics::{
    ActiveSet, Automatic, CdLagrange, Composite, ConjugateGradients, ContactStatus, Error, GeneralizedAlpha,
    LinearRows, LinearSolver, LinearSystem, PersistencyCorrection, Real, Simulation, State, System, TimeIntegrator,
};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

type Scheme = fn() -> Box<dyn TimeIntegrator>;
const SCHEMES: [Scheme; 2] = [|| Box::new(GeneralizedAlpha::default()), || Box::new(Composite)];

/// Runs a scene of elements of a size with W and without it, at a Courant number of 1, and compares all states. Returns
/// how many contacts closed at most, and slid.
fn compare<S: System<f64> + 'static>(
    what: &str,
    (size, steps): (f64, usize),
    velocity: &[f64],
    system: impl Fn() -> S,
    contact: impl Fn() -> Box<dyn ContactConstraint<f64>>,
) -> [usize; 2] {
    let mut most = [0; 2];
    for scheme in SCHEMES {
        let solvers: [(Assembly, Box<dyn LinearSolver<f64>>); 3] = [
            (Assembly::Always, Box::new(Automatic)),
            (Assembly::Never, Box::new(Automatic)),
            (Assembly::Automatic, Box::new(ConjugateGradients::default().tolerance(1e-13).unwrap())),
        ];
        let [mut with_w, mut without, mut iterates] = solvers.map(|(assembly, linear_solver)| {
            Simulation::builder(system(), scheme(), size / MATERIAL.wave_speed())
                .velocity(velocity.to_vec())
                .constraint(contact())
                .contact_solver(ActiveSet::default().with_assembly(assembly))
                .corrector(PersistencyCorrection::with_history_projection())
                .linear_solver(linear_solver)
                .build()
                .unwrap()
        });
        for step in 0..steps {
            with_w.step().unwrap();
            let one = with_w.state();
            for (run, how) in [(&mut without, "factor"), (&mut iterates, "iteration")] {
                let name = format!("{what}, {}, step {step}, {how}", scheme().name());
                run.step().unwrap_or_else(|error| panic!("{name}: {error}"));
                let other = run.state();
                near(&name, one.displacement(), other.displacement(), 1e-8);
                near(&name, one.velocity(), other.velocity(), 1e-8);
                // Rows that turn are linearized until forces agree to 1e-7.
                near(&name, one.contacts().forces(), other.contacts().forces(), 1e-7);
            }
            count(one, &mut most);
        }
        let [one, other, third] = [&with_w, &without, &iterates].map(|run| *run.statistics());
        assert!(one.contact_products == 0 && one.contact_iterations > 0, "{what}: {one:?}");
        assert!(other.contact_products > 0 && other.contact_iterations == 0, "{what}: {other:?}");
        assert!(third.contact_products > 0 && third.contact_iterations == 0, "{what}: {third:?}");
    }
    most
}

/// Raises the most contacts that were closed, and that slid, to those of a state.
fn count(state: &State<f64>, most: &mut [usize; 2]) {
    let contacts = state.contacts();
    let is_sliding = |&contact: &usize| contacts.status(contact) == ContactStatus::Sliding;
    most[0] = most[0].max(contacts.closed().iter().filter(|closed| **closed).count());
    most[1] = most[1].max((0..contacts.closed().len()).filter(is_sliding).count());
}

/// Vectors that differ by a share of the largest entry at most.
fn near(what: &str, one: &[f64], other: &[f64], share: f64) {
    let size = one.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    for (k, (x, y)) in one.iter().zip(other).enumerate() {
        assert!((x - y).abs() <= share * size, "{what}, entry {k}: {x:e} and {y:e} of {size:e}");
    }
}

/// The size of the elements.
const SIZE: f64 = 0.2;

fn block() -> Solid<3> {
    Solid::block([1.0, 1.0, 0.4], [5, 5, 2], MATERIAL)
}

/// The lower side of the block on an obstacle.
fn on(
    solid: &Solid<3>,
    obstacle: impl Obstacle<f64, 3> + 'static,
    law: ContactLaw,
    friction: f64,
) -> Box<dyn ContactConstraint<f64>> {
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0).collect();
    let nodes = NodesOnObstacle::new(obstacle, &solid.nodes, &solid.node_dofs(), &bottom).unwrap();
    Box::new(nodes.with_law(law).friction(friction))
}

#[test]
fn a_block_on_a_sphere_sticks_and_slides() {
    let solid = block();
    let velocity = solid.uniform([0.1, 0.04, -0.1]);
    for (friction, slides) in [(0.0, false), (0.2, true), (2.0, false)] {
        let sphere = || Sphere::new([0.5, 0.5, -4.0], 3.98, Side::Outside).unwrap();
        let contact = || on(&solid, sphere(), ContactLaw::Rigid, friction);
        let [closed, slid] = compare(&format!("sphere, {friction}"), (SIZE, 12), &velocity, || solid.system(), contact);
        assert!(closed > 8, "{closed}");
        assert!(!slides || slid > 3, "{slid}");
    }
}

#[test]
fn compliant_and_nonlinear_laws_and_a_consistent_mass() {
    let solid = block();
    let velocity = solid.uniform([0.03, 0.0, -0.1]);
    let plane = || Plane::new([0.0, 0.0, -0.01], [0.1, 0.0, 1.0]).unwrap();
    for law in [ContactLaw::Penalty { stiffness: 0.1 }, ContactLaw::Rigid] {
        let system = || LinearSystem::new(solid.consistent_mass(), solid.stiffness()).unwrap();
        let contact = || on(&solid, plane(), law, 0.0);
        let [closed, _] = compare(&format!("plane, {law:?}"), (SIZE, 10), &velocity, system, contact);
        assert!(closed > 8, "{closed}");
    }
}

#[test]
fn blocks_of_other_meshes_stick_and_slide() {
    let bodies = [4, 5].map(|n| Solid::block([1.0; 3], [n, n, 2], MATERIAL));
    let stack = Stack::new(bodies, 0.002, |x| x);
    let velocity = stack.velocity_of_upper([0.05, 0.02, -0.1]);
    for (friction, slides) in [(0.0, false), (0.2, true), (2.0, false)] {
        let contact =
            || -> Box<dyn ContactConstraint<f64>> { Box::new(stack.mortar(true).unwrap().friction(friction)) };
        let [closed, slid] =
            compare(&format!("mortar, {friction}"), (SIZE, 12), &velocity, || stack.solid.system(), contact);
        assert!(closed > 8, "{closed}");
        assert!(!slides || slid > 3, "{slid}");
    }
    let contact = || -> Box<dyn ContactConstraint<f64>> { Box::new(stack.nodes_on_facets(1).unwrap()) };
    compare("nodes on facets", (SIZE, 12), &velocity, || stack.solid.system(), contact);
}

/// Runs a scene whose `light` nodes have no mass by an explicit scheme, with W and without it, and compares all states.
/// Returns how many contacts closed at most, and slid.
fn compare_massless(
    what: &str,
    (solid, light): (&Solid<3>, &[usize]),
    velocity: &[f64],
    contact: impl Fn() -> Box<dyn ContactConstraint<f64>>,
) -> [usize; 2] {
    let massless: Vec<usize> = light.iter().flat_map(|&node| solid.node_dofs()[node]).collect();
    let groups: Vec<usize> = (0..solid.dofs()).map(|dof| dof % 3).collect();
    let mass = mass::redistribute(&solid.lumped_mass(), &massless, &groups, Redistribution::Uniform).unwrap();
    let [mut with_w, mut without] = [Assembly::Always, Assembly::Never].map(|assembly| {
        let system = LinearSystem::lumped(mass.clone(), solid.stiffness()).unwrap();
        Simulation::builder(system, CdLagrange, 0.3 * SIZE / MATERIAL.wave_speed())
            .velocity(velocity.to_vec())
            .constraint(contact())
            .contact_solver(ActiveSet::default().with_assembly(assembly))
            .corrector(WorkBalance)
            .build()
            .unwrap()
    });
    let mut most = [0; 2];
    for step in 0..40 {
        with_w.step().unwrap();
        without.step().unwrap();
        let (one, other) = (with_w.state(), without.state());
        let name = format!("{what}, step {step}");
        near(&name, one.displacement(), other.displacement(), 1e-8);
        near(&name, one.contacts().forces(), other.contacts().forces(), 1e-6);
        count(one, &mut most);
    }
    let [one, other] = [&with_w, &without].map(|run| *run.statistics());
    assert!(one.contact_products == 0 && one.contact_iterations > 0, "{what}: {one:?}");
    assert!(other.contact_products > 0 && other.contact_iterations == 0, "{what}: {other:?}");
    most
}

#[test]
fn dofs_without_mass_in_explicit_steps() {
    let solid = block();
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0).collect();
    // Contact acts on all dofs without mass, or on half of them.
    let layers: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] < 0.3).collect();
    let sphere = || Sphere::new([0.5, 0.5, -4.0], 3.98, Side::Outside).unwrap();
    for (light, friction, slides) in [(&bottom, 0.0, false), (&bottom, 0.2, true), (&layers, 0.0, false)] {
        let contact = || on(&solid, sphere(), ContactLaw::Rigid, friction);
        let what = format!("sphere, {} nodes, {friction}", light.len());
        let [closed, slid] = compare_massless(&what, (&solid, light), &solid.uniform([0.1, 0.04, -0.1]), contact);
        assert!(closed > 8 && (!slides || slid > 3), "{what}: {closed} {slid}");
    }
    // The other side of the contact has a mass.
    let bodies = [4, 5].map(|n| Solid::block([1.0; 3], [n, n, 2], MATERIAL));
    let stack = Stack::new(bodies, 0.002, |x| x);
    let side: Vec<usize> =
        (stack.split..stack.solid.nodes.len()).filter(|&node| stack.solid.nodes[node][2] < 1.1).collect();
    let contact = || -> Box<dyn ContactConstraint<f64>> { Box::new(stack.mortar(true).unwrap()) };
    let velocity = stack.velocity_of_upper([0.05, 0.02, -0.1]);
    let [closed, _] = compare_massless("mortar", (&stack.solid, &side), &velocity, contact);
    assert!(closed > 8, "{closed}");
}

#[test]
fn in_the_plane() {
    let bodies = [5, 6].map(|n| Solid::rectangle([1.0; 2], [n, 4], MATERIAL));
    let stack = Stack::new(bodies, 0.002, |x| x);
    let velocity = stack.velocity_of_upper([0.05, -0.1]);
    let contact = || -> Box<dyn ContactConstraint<f64>> { Box::new(stack.mortar(true).unwrap().friction(0.2)) };
    let [closed, slid] = compare("plane", (SIZE, 12), &velocity, || stack.solid.system(), contact);
    assert!(closed > 4 && slid > 1, "{closed} {slid}");
}

#[test]
fn iterations_of_a_nonlinear_system() {
    let solid = block();
    let velocity = solid.uniform([0.02, 0.0, -0.1]);
    let system = || Hyperelastic::new(&solid, Law::StVenantKirchhoff);
    let contact = || on(&solid, Sphere::new([0.5, 0.5, -4.0], 3.98, Side::Outside).unwrap(), ContactLaw::Rigid, 0.3);
    let [closed, _] = compare("hyperelastic", (SIZE, 10), &velocity, system, contact);
    assert!(closed > 8, "{closed}");
}

#[test]
fn in_single_precision() {
    let solid = block();
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0).collect();
    let nodes: Vec<[f32; 3]> = solid.nodes.iter().map(|node| node.map(f32::of)).collect();
    for friction in [0.0, 0.3] {
        let [with_w, without] = [Assembly::Always, Assembly::Never].map(|assembly| {
            let sphere = Sphere::<f32, 3>::new([0.5, 0.5, -4.0], 3.98, Side::Outside).unwrap();
            let contact = NodesOnObstacle::new(sphere, &nodes, &solid.node_dofs(), &bottom).unwrap();
            let mut run =
                Simulation::builder(solid.system::<f32>(), GeneralizedAlpha::default(), SIZE / MATERIAL.wave_speed())
                    .velocity(solid.uniform([0.1, 0.04, -0.1]))
                    .constraint(contact.friction(friction))
                    .contact_solver(ActiveSet::default().with_assembly(assembly))
                    .build()
                    .unwrap();
            for _ in 0..4 {
                run.step().unwrap();
            }
            run
        });
        assert!(without.statistics().contact_products > 0 && without.statistics().contact_iterations == 0);
        let [one, other] =
            [&with_w, &without].map(|run| run.state().velocity().iter().map(|&v| f64::from(v)).collect::<Vec<_>>());
        near("single precision", &one, &other, 1e-3);
    }
}

/// A body under a weight of 0.01 a mass.
fn heavy(solid: &Solid<3>) -> LinearSystem<'static, f64> {
    let of_dof = |(dof, m): (usize, f64)| if dof % 3 == 2 { -0.01 * m } else { 0.0 };
    let weight: Vec<f64> = (0..).zip(solid.lumped_mass::<f64>()).map(of_dof).collect();
    solid.system::<f64>().load(move |_, f| f.copy_from_slice(&weight))
}

/// At a Courant number of 9 products keep directions out of a coarse space. The weight alone moves the free body as its
/// translations do, which that space solves without an iteration.
#[test]
fn long_steps_of_a_heavy_body() {
    let size = 0.125;
    let solid = Solid::block([1.0, 1.0, 0.75], [8, 8, 6], MATERIAL);
    let floor = Sphere::new([0.5, 0.5, -9.0], 8.99, Side::Outside).unwrap();
    for friction in [0.0, 0.3] {
        let contact = || on(&solid, floor, ContactLaw::Rigid, friction);
        let [closed, _] =
            compare(&format!("long, {friction}"), (9.0 * size, 6), &vec![0.0; solid.dofs()], || heavy(&solid), contact);
        assert!(closed > 20, "{closed}");
    }
}

/// Hundreds of rows of a mortar: also the jumps are removed without a dense S.
#[test]
fn jumps_of_hundreds_of_rows() {
    let bodies = [10, 11].map(|n| Solid::block([1.0; 3], [n, n, 1], MATERIAL));
    let stack = Stack::new(bodies, 0.0, |x| x);
    let velocity = stack.velocity_of_upper([0.05, 0.02, -0.1]);
    for friction in [0.0, 0.3] {
        let contact =
            || -> Box<dyn ContactConstraint<f64>> { Box::new(stack.mortar(true).unwrap().friction(friction)) };
        let [closed, _] =
            compare(&format!("mortar, {friction}"), (0.1, 3), &velocity, || stack.solid.system(), contact);
        assert!(closed > 100, "{closed}");
    }
}

/// Newton's method factorizes in every iteration, and W takes a solve for each of 289 rows after each: products with
/// the tangent are chosen.
#[test]
fn responses_that_cannot_be_kept_count_as_work() {
    let solid = Solid::block([1.6, 1.6, 0.3], [16, 16, 3], MATERIAL);
    let bottom: Vec<usize> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0).collect();
    let floor = Plane::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap();
    let body = Hyperelastic::new(&solid, Law::NeoHookean).gravity([0.0, 0.0, -0.05]);
    let mut run = Simulation::builder(body, GeneralizedAlpha::default(), 0.1 / MATERIAL.wave_speed())
        .constraint(NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &bottom).unwrap())
        .build()
        .unwrap();
    run.step().unwrap();
    assert!(run.state().contacts().closed().iter().all(|&closed| closed));
    let statistics = run.statistics();
    assert!(statistics.contact_products > 0 && statistics.contact_iterations == 0, "{statistics:?}");
}

/// Rows that turn have W formed anew with every linearization, long steps or not: products with the coarse space are
/// chosen beside a factor too.
#[test]
fn long_steps_choose_products() {
    let solid = Solid::block([1.6, 1.6, 0.3], [16, 16, 3], MATERIAL);
    let hollow = Sphere::new([0.8, 0.8, 2000.0], 2000.0005, Side::Inside).unwrap();
    let mut run = Simulation::builder(heavy(&solid), GeneralizedAlpha::default(), 9.0 * 0.1 / MATERIAL.wave_speed())
        .constraint(on(&solid, hollow, ContactLaw::Rigid, 0.0))
        .build()
        .unwrap();
    let mut pressed = 0;
    for _ in 0..8 {
        let before = *run.statistics();
        run.step().unwrap();
        let after = run.statistics();
        if run.state().contacts().closed().iter().all(|&closed| closed) {
            pressed += 1;
            assert!(after.contact_products > before.contact_products + 10, "{before:?} {after:?}");
            assert_eq!(after.contact_iterations, before.contact_iterations);
        }
    }
    assert!(pressed > 0);
}

/// Two equations that contradict each other have no solution, and the error names what is left of them.
#[test]
fn what_cannot_be_closed_is_refused() {
    let solid = block();
    let rows = || LinearRows::new().equality(&[(2, 1.0)], 0.0).equality(&[(2, 1.0)], -0.1);
    let mut run = Simulation::builder(solid.system::<f64>(), GeneralizedAlpha::default(), 1.0)
        .constraint(rows())
        .contact_solver(ActiveSet::default().with_assembly(Assembly::Never))
        .build();
    let error = match &mut run {
        Ok(run) => run.step().unwrap_err(),
        Err(_) => return,
    };
    let refused = matches!(error, Error::LinearNotConverged { residual, .. } if residual > 1e-3);
    assert!(refused, "{error}");
}
