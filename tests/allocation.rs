//! A steady step allocates nothing, in contact or not. Memory is found when contacts press or open in greater number
//! than ever before, or on other dofs: every scene has had such contacts before its steps are counted. Alone in its
//! binary: the counter is global.

use contact_dynamics::contact::{
    ClosedSurface, ContactLaw, NodeToFacet, Obstacle, Plane, RigidMotion, Side, Sphere, Surface, SurfaceSettings,
};
use contact_dynamics::corrector::{
    ContactImplicit, ContactStabilized, LaursenLove, NonsmoothSplitting, Release, TaylorPapadopoulos, ZeroAcceleration,
};
use contact_dynamics::partitioned::{Assembly, Coupling};
use contact_dynamics::reduction::{ModalPropagation, Reduction};
use contact_dynamics::{
    ByBody, Composite, ConjugateGradients, Corrector, EnergyMomentum, GeneralizedAlpha, Gssss, LinearRows,
    LinearSolver, LinearSystem, Lu, Newmark, Newton, NodesOnObstacle, PersistencyCorrection, Simulation,
    TimeIntegrator,
};
use contact_dynamics_scenes::bed::Bed;
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::large::MATERIAL;
use contact_dynamics_scenes::masses::{Takers, Treatment};
use contact_dynamics_scenes::obstacles::ball_mesh;
use contact_dynamics_scenes::schemes::{Listed, all};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{matrix, spring};
use contact_dynamics_scenes::stacks::Stack;
use contact_dynamics_scenes::{Bars, MassKind};
use std::collections::HashSet;

#[test]
fn steps_do_not_allocate() {
    bars();
    explicit_massless();
    correctors();
    consistent_masses();
    solids();
    large_motion();
    bodies_apart();
    iterations();
    long_steps();
    assemblies();
    modes_propagated();
    rotors();
    friction();
    weighted_gaps();
    ties();
    a_surface_against_itself();
}

/// A bar on a rough bed that comes to rest, and a block that is thrown along a rough floor: no memory is
/// allocated once all contacts have pressed, stuck and slid.
fn friction() {
    let bed = Bed::new(30);
    for scheme in all().into_iter().filter(Listed::takes_multipliers) {
        let correction = PersistencyCorrection::with_history_projection();
        let correctors: Vec<Box<dyn Corrector<f64>>> =
            if scheme.takes_corrections() { vec![Box::new(correction)] } else { Vec::new() };
        let mut run = bed.run((scheme.make)(), correctors, 0.5).unwrap();
        (0..100).for_each(|_| run.step().unwrap());
        assert_steps_allocate_nothing(&mut run, 300, 0, &format!("friction, {}", scheme.name()));
    }
    let solid = Solid::block([1.0; 3], [3; 3], Material { young: 1e3, poisson: 0.3, density: 1.0 });
    let nodes: Vec<usize> = (0..solid.nodes.len()).filter(|&n| solid.nodes[n][2] == 0.0).collect();
    let floor = Plane::new([0.0; 3], [0.1, 0.0, 1.0]).unwrap();
    let floor = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &nodes).unwrap().friction(0.3);
    let mass = solid.lumped_mass::<f64>();
    let system = solid.system().load(move |_, f| {
        f.iter_mut().zip(&mass).skip(2).step_by(3).for_each(|(f, m)| *f = -10.0 * m);
    });
    let mut run = Simulation::builder(system, Composite, 5e-3)
        .displacement(solid.uniform([0.0, 0.0, 0.05]))
        .velocity(solid.uniform([1.0, 0.5, -1.0]))
        .constraint(floor)
        .build()
        .unwrap();
    (0..260).for_each(|_| run.step().unwrap());
    assert_steps_allocate_nothing(&mut run, 300, 8, "friction of a block");
}

/// A block just above another one that stands on the ground, and their system under gravity.
fn falling_blocks() -> (Stack<2>, LinearSystem<'static, f64>) {
    let material = Material { young: 1e3, poisson: 0.3, density: 1.0 };
    let bodies = [3, 4].map(|cells| Solid::rectangle([1.0; 2], [cells, 2], material));
    let stack = Stack::new(bodies, 1e-3, |x| x);
    let mass = stack.solid.lumped_mass::<f64>();
    let mut system = stack.solid.system().load(move |_, f| {
        f.iter_mut().zip(&mass).skip(1).step_by(2).for_each(|(f, m)| *f = -10.0 * m);
    });
    for node in (0..stack.solid.nodes.len()).filter(|&node| stack.solid.nodes[node][1] == 0.0) {
        system = system.fix(2 * node).unwrap().fix(2 * node + 1).unwrap();
    }
    (stack, system)
}

/// A block that bounces on another one, weighted gaps with friction: rows are integrated again all the time.
fn weighted_gaps() {
    let (stack, system) = falling_blocks();
    let contact = stack.mortar(true).unwrap().friction(0.3);
    let mut run = Simulation::builder(system, Composite, 2e-3).constraint(contact).build().unwrap();
    (0..600).for_each(|_| run.step().unwrap());
    assert_steps_allocate_nothing(&mut run, 300, 5, "weighted gaps");
}

/// Two rings that spin, tied on a circle where their facets do not fit: rows turn all the time.
fn ties() {
    let material = Material { young: 1e3, poisson: 0.3, density: 1.0 };
    let stack = Stack::rings(material);
    let (rings, tie) = (&stack.solid, stack.tie(true).unwrap());
    let velocity = rings.nodes.iter().flat_map(|[x, y]| [-y, *x]).collect();
    let system = Hyperelastic::new(rings, Law::NeoHookean);
    let mut run = Simulation::builder(system, EnergyMomentum, 5e-3).velocity(velocity).constraint(tie).build().unwrap();
    for _ in 0..5 {
        run.step().unwrap();
    }
    assert_steps_allocate_nothing(&mut run, 50, 0, "ties that turn");
}

/// Two blocks given as one surface, that bounce on each other.
fn a_surface_against_itself() {
    let (stack, system) = falling_blocks();
    let surface = Surface::of_cells(&stack.solid.nodes, &stack.solid.elements).unwrap();
    let contact = NodeToFacet::of_itself(&stack.solid.nodes, &stack.solid.node_dofs(), &surface).unwrap();
    // (Lists that are never built again.)
    let contact = contact.with(SurfaceSettings::new().skin(3.0)).unwrap();
    let mut run = Simulation::builder(system, Composite, 2e-3).constraint(contact).build().unwrap();
    // (Until all nine rows have pressed at once, and opened.)
    (0..500).for_each(|_| run.step().unwrap());
    assert_steps_allocate_nothing(&mut run, 300, 5, "a surface against itself");
}

/// A load that drives bars together again after each impact.
fn driven(bars: &Bars) -> impl FnMut(f64, &mut [f64]) + Send + 'static {
    let (mass, second) = (bars.lumped_mass::<f64>(), bars.contact_dofs()[1]);
    move |_, f| (0..mass.len()).for_each(|dof| f[dof] = if dof < second { mass[dof] } else { -mass[dof] })
}

/// Takes steps until the contact has closed and opened twice, and some more: memory for it is found there.
fn warm_up(run: &mut Simulation<'_, f64>) {
    while run.statistics().contact_changes < 4 {
        run.step().unwrap();
    }
    (0..50).for_each(|_| run.step().unwrap());
}

/// Takes so many steps of a run in which contacts change at least so often.
fn assert_steps_allocate_nothing(run: &mut Simulation<'_, f64>, steps: usize, at_least: u64, what: &str) {
    let before = run.statistics().contact_changes;
    let counted = allocation_counter::measure(|| {
        for _ in 0..steps {
            run.step().unwrap();
        }
    });
    let changes = run.statistics().contact_changes - before;
    assert!(changes >= at_least, "{what}: {changes} changes of contact");
    assert_eq!(counted.count_total, 0, "{what}");
}

/// A chain of gyroscopic pairs that hits a stop: solves by LU in contact and away, and factorizations of it.
fn rotors() {
    let n = 40;
    let matrix = |entries: Vec<(usize, usize, f64)>| matrix(n, entries);
    let held = (0..n).map(|i| (i, i, 3.0));
    let springs = (2..n).flat_map(|i| spring(i, i - 2, 9.0));
    let stiffness = matrix(held.chain(springs).collect());
    let gyroscopic = matrix((0..n / 2).flat_map(|i| [(2 * i, 2 * i + 1, 2.0), (2 * i + 1, 2 * i, -2.0)]).collect());
    let mut factor = Lu.analyze(stiffness.symbolic(), &[]).unwrap();
    factor.factorize(stiffness.as_ref()).unwrap();
    let mut x = vec![1.0; n];
    let counted = allocation_counter::measure(|| {
        factor.factorize(stiffness.as_ref()).unwrap();
        factor.solve(&mut x).unwrap();
    });
    assert_eq!(counted.count_total, 0, "LU of a chain");

    let stops =
        (0..n).step_by(3).fold(LinearRows::new(), |rows, dof| rows.unilateral(&[(dof, 1.0), (n - 1, 0.1)], 0.01));
    let mut run = Simulation::builder(
        LinearSystem::lumped(vec![1.0; n], stiffness).unwrap().damping(gyroscopic).unwrap(),
        Newmark::trapezoidal(),
        0.05,
    )
    .velocity((0..n).map(|i| (i as f64).sin()).collect())
    .linear_solver(Lu)
    .constraint(stops)
    .corrector(PersistencyCorrection::with_history_projection())
    .build()
    .unwrap();
    (0..400).for_each(|_| run.step().unwrap());
    assert_steps_allocate_nothing(&mut run, 200, 21, "rotors by LU");
}

/// Blocks at large strains that bounce: Newton's method, factorizations, rows that follow a curved floor.
fn large_motion() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 3] = [
        || Box::new(Composite),
        || Box::new(EnergyMomentum),
        || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()),
    ];
    for make in schemes {
        for newton in [Newton::full().line_search(), Newton::modified()] {
            let solid = Solid::block([1.0; 3], [3; 3], MATERIAL).rotated([1.0, 1.0, 0.0], 0.4).lifted(0.05);
            let body = Hyperelastic::new(&solid, Law::NeoHookean).gravity([0.0, 0.0, -0.05]);
            let ball = Sphere::new([0.3, 0.2, -3.0], 3.0, Side::Outside).unwrap();
            let dofs = solid.node_dofs();
            let contact = NodesOnObstacle::new(ball, &solid.nodes, &dofs, &solid.surface_nodes()).unwrap();
            let mut run = Simulation::builder(body, make(), 0.05)
                .velocity(solid.uniform([0.0, 0.0, -0.1]))
                .constraint(contact)
                .corrector(PersistencyCorrection::with_history_projection())
                .newton(newton)
                .build()
                .unwrap();
            (0..220).for_each(|_| run.step().unwrap());
            assert_steps_allocate_nothing(&mut run, 200, 4, &format!("{}, {newton:?}", make().name()));
        }
    }
}

/// A block that a ball rolls over: candidates come and go, normals turn, a supernodal factor. A step allocates only for
/// more candidates than ever before, for more of them pressed, or for others than before.
fn solids() {
    let center = [-0.2, 0.5, 1.5];
    // (The last one is a mesh that turns.)
    for (law, turns) in
        [(ContactLaw::Rigid, false), (ContactLaw::hertz(1.0, 1.0), false), (ContactLaw::hertz(1.0, 1.0), true)]
    {
        let block = Solid::block([1.0; 3], [6; 3], Material { young: 100.0, poisson: 0.3, density: 1.0 });
        let top: Vec<usize> = block.surface_nodes().into_iter().filter(|&n| block.nodes[n][2] > 0.99).collect();
        let ball = Sphere::new(center, 0.52, Side::Outside).unwrap();
        let (vertices, triangles) = ball_mesh(center, 0.47, 3);
        let mesh = ClosedSurface::new(&vertices, &triangles, 0.05).unwrap();
        let ball: Box<dyn Obstacle<f64, 3>> = if turns { Box::new(mesh) } else { Box::new(ball) };
        let contact = NodesOnObstacle::new(ball, &block.nodes, &block.node_dofs(), &top)
            .unwrap()
            .with_law(law)
            .reach(0.3)
            .unwrap();
        let way = |t: f64| [[t, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0; 3]];
        let contact = match turns {
            true => contact.turning(move |t| {
                RigidMotion::about_axis(center, [0.0, 1.0, 0.0], [2.0 * t, 2.0, 0.0]).translated(way(t))
            }),
            false => contact.moving(way),
        };
        let mut run = Simulation::builder(block.system(), Composite, 5e-3)
            .constraint(contact)
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        for _ in 0..20 {
            run.step().unwrap();
        }
        let (mut most, mut pressed, mut unexplained, mut known) = (0, 0, 0, HashSet::new());
        for _ in 0..200 {
            let counted = allocation_counter::measure(|| run.step().unwrap());
            let contacts = run.state().contacts();
            let closed = contacts.ids().iter().zip(contacts.closed()).filter(|(_, closed)| **closed);
            let closed: Vec<usize> = closed.map(|(id, _)| id.feature).collect();
            let others = closed.iter().filter(|&&node| known.insert(node)).count();
            let record = run.gaps().len() > most || closed.len() > pressed || others > 0;
            unexplained += u64::from(counted.count_total > 0 && !record);
            (most, pressed) = (most.max(run.gaps().len()), pressed.max(closed.len()));
        }
        let changes = run.statistics().contact_changes;
        assert!(changes >= 8 && most > 10, "{changes} changes, {most} candidates");
        // (Lists that swap each grow at a step of their own.)
        assert!(unexplained <= 4, "{law:?}: {unexplained}");
    }
}

fn bars() {
    for scheme in all().into_iter().filter(Listed::takes_multipliers) {
        for mass in [MassKind::Lumped, MassKind::Consistent] {
            let bars = Bars::paper(50).delayed(0.3, 1e-3).with_mass(mass);
            let correction = PersistencyCorrection::with_history_projection();
            let correction: Option<Box<dyn Corrector<f64>>> =
                if scheme.takes_corrections() { Some(Box::new(correction)) } else { None };
            // Damped, which explicit schemes with lagging forces bear at this step.
            let system = bars.system::<f64>().rayleigh(0.0, 1e-5).unwrap().load(driven(&bars));
            let mut run = Simulation::builder(system, (scheme.make)(), 1e-3)
                .velocity(bars.velocities())
                .constraint(bars.contact())
                .correctors(correction)
                .energy_balance()
                .build()
                .unwrap();
            warm_up(&mut run);
            assert_steps_allocate_nothing(&mut run, 700, 2, &format!("{}, {mass:?}", scheme.name()));
        }
    }
}

/// Explicit bars with contact nodes without mass, which follow statically.
fn explicit_massless() {
    for scheme in all().into_iter().filter(|scheme| ["CD-Lagrange", "Noh–Bathe(0.5400)"].contains(&&*scheme.name())) {
        let bars = Bars::paper(50).delayed(0.3, 1e-3);
        let tableau = (scheme.make)().tableau();
        let mass = Treatment::Redistributed(Takers::Tapered).mass(&bars.body(), &tableau, 0.5).unwrap();
        let mut run = Simulation::builder(bars.system_with(mass).load(driven(&bars)), (scheme.make)(), 1e-3)
            .velocity(bars.velocities())
            .constraint(bars.contact())
            .uncorrected()
            .energy_balance()
            .build()
            .unwrap();
        warm_up(&mut run);
        assert_steps_allocate_nothing(&mut run, 700, 2, &scheme.name());
    }
}

type Make = fn() -> Option<Box<dyn Corrector<f64>>>;

/// Bars by every corrector, and with contact nodes without mass.
fn correctors() {
    let make: [(&str, Make); 9] = [
        ("nonsmooth splitting", || Some(Box::new(NonsmoothSplitting))),
        ("contact-implicit", || Some(Box::new(ContactImplicit))),
        ("contact-stabilized", || Some(Box::new(ContactStabilized::new()))),
        ("contact-stabilized, closed", || Some(Box::new(ContactStabilized::improved()))),
        ("Laursen-Love", || Some(Box::new(LaursenLove))),
        ("Taylor-Papadopoulos", || Some(Box::new(TaylorPapadopoulos::new(1e-3).unwrap()))),
        ("release", || Some(Box::new(Release))),
        ("a = 0", || Some(Box::new(ZeroAcceleration))),
        ("massless", || None),
    ];
    for (name, corrector) in make {
        for mass in [MassKind::Lumped, MassKind::Consistent] {
            let bars = Bars::paper(50).delayed(0.3, 1e-3).with_mass(mass);
            let (mut system, mut first) = (bars.system::<f64>(), None);
            let mut integrator: Box<dyn TimeIntegrator> = Box::new(Newmark::trapezoidal());
            match name {
                "Laursen-Love" => integrator = Box::new(Gssss::new(1.0, 1.0, 1.0).unwrap()),
                "release" => first = Some(Box::new(PersistencyCorrection::new()) as Box<dyn Corrector<f64>>),
                "massless" => {
                    let contact = bars.contact_dofs();
                    let masses = bars.lumped_mass::<f64>().into_iter().enumerate();
                    let masses = masses.map(|(dof, m)| if contact.contains(&dof) { 0.0 } else { m }).collect();
                    system = LinearSystem::lumped(masses, bars.stiffness()).unwrap();
                }
                _ => {}
            }
            let mut run = Simulation::builder(system.load(driven(&bars)), integrator, 1e-3)
                .velocity(bars.velocities())
                .constraint(bars.contact())
                .correctors(first)
                .correctors(corrector())
                .build()
                .unwrap();
            warm_up(&mut run);
            assert_steps_allocate_nothing(&mut run, 700, 2, &format!("{name}, {mass:?}"));
        }
    }
}

/// A block with a consistent mass that bounces: it allocates only until all contacts have pressed and opened.
fn consistent_masses() {
    let solid = Solid::block([1.0; 3], [5; 3], Material { young: 1e3, poisson: 0.3, density: 1.0 });
    let mass = solid.lumped_mass::<f64>();
    let system = LinearSystem::new(solid.consistent_mass(), solid.stiffness()).unwrap().load(move |_, f| {
        f.iter_mut().zip(&mass).skip(2).step_by(3).for_each(|(f, m)| *f = -10.0 * m);
    });
    let bottom = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][2] == 0.0);
    let mut run = Simulation::builder(system, Composite, 5e-3)
        .constraint(bottom.fold(LinearRows::new(), |rows, node| rows.unilateral(&[(3 * node + 2, 1.0)], 0.05)))
        .build()
        .unwrap();
    (0..300).for_each(|_| run.step().unwrap());
    assert_steps_allocate_nothing(&mut run, 300, 72, "a consistent mass");
}

/// Two blocks, each with a factor of its own, one of them with a fixed dof amid its others.
fn bodies_apart() {
    let material = Material { young: 100.0, poisson: 0.3, density: 1.0 };
    let lower = Solid::rectangle([1.0; 2], [8; 2], material);
    let split = lower.nodes.len();
    let solid = lower.with(Solid::rectangle([1.0; 2], [8; 2], material).moved([0.0, 1.0]));
    let rows = (0..9).fold(LinearRows::new(), |rows, k| {
        rows.unilateral(&[(2 * (split - 9 + k) + 1, -1.0), (2 * (split + k) + 1, 1.0)], 1e-3 * k as f64)
    });
    let downward = |dof: usize| if dof % 2 == 1 && dof >= 2 * split { -0.1 } else { 0.0 };
    let mut run = Simulation::builder(solid.system().fix(40).unwrap(), Composite, 5e-3)
        .velocity((0..solid.dofs()).map(downward).collect())
        .constraint(rows)
        .corrector(PersistencyCorrection::with_history_projection())
        .linear_solver(ByBody::default())
        .build()
        .unwrap();
    (0..50).for_each(|_| run.step().unwrap());
    assert_steps_allocate_nothing(&mut run, 300, 4, "bodies apart");
}

/// A block dropped on its edge: conjugate gradients, contact by products. Memory is found as more nodes press.
fn iterations() {
    let block = Solid::block([1.0; 3], [4; 3], Material { young: 100.0, poisson: 0.3, density: 1.0 });
    let bottom: Vec<usize> = block.surface_nodes().into_iter().filter(|&n| block.nodes[n][2] < 0.01).collect();
    let floor = Plane::new([0.0, 0.0, -0.02], [0.2, 0.0, 1.0]).unwrap();
    let contact = NodesOnObstacle::new(floor, &block.nodes, &block.node_dofs(), &bottom).unwrap();
    let mut run = Simulation::builder(block.system(), Composite, 0.01)
        .velocity(block.uniform([0.0, 0.0, -1.0]))
        .constraint(contact)
        .corrector(PersistencyCorrection::with_history_projection())
        .linear_solver(ConjugateGradients::default())
        .build()
        .unwrap();
    let pressed = |run: &Simulation<'_, f64>| run.state().contacts().closed().iter().filter(|closed| **closed).count();
    while pressed(&run) < bottom.len() {
        run.step().unwrap();
    }
    (0..12).for_each(|_| run.step().unwrap());
    assert_steps_allocate_nothing(&mut run, 100, 4, "conjugate gradients");
}

/// A heavy block at large strains on a floor, in steps of Courant number 20: a coarse space for every tangent.
fn long_steps() {
    let block = Solid::block([1.0, 1.0, 0.75], [8, 8, 6], MATERIAL);
    let bottom: Vec<usize> = (0..block.nodes.len()).filter(|&n| block.nodes[n][2] < 0.01).collect();
    let floor = Plane::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap();
    let contact = NodesOnObstacle::new(floor, &block.nodes, &block.node_dofs(), &bottom).unwrap();
    let weight = 1e-3 * MATERIAL.young / MATERIAL.density;
    let body = Hyperelastic::new(&block, Law::NeoHookean).gravity([0.0, 0.0, -weight]);
    let mut run = Simulation::builder(body, GeneralizedAlpha::default(), 20.0 * 0.125 / MATERIAL.wave_speed())
        .constraint(contact)
        .linear_solver(ConjugateGradients::default())
        .build()
        .unwrap();
    (0..4).for_each(|_| run.step().unwrap());
    let before = *run.statistics();
    assert_steps_allocate_nothing(&mut run, 10, 0, "long steps");
    let after = run.statistics();
    assert!(after.contact_products > before.contact_products && after.newton_iterations > before.newton_iterations);
}

/// Three bodies whose rows close one by one, and are held one by one, as a body softens, for the second time.
fn assemblies() {
    let n = 6_usize;
    let flexibility = |size: f64| -> Vec<f64> {
        (0..n * n)
            .map(|k| (if k / n == k % n { size } else { 0.0 }) + 1.0 / (1 + (k / n).abs_diff(k % n)) as f64)
            .collect()
    };
    let (stiff, soft) = (flexibility(2.0), flexibility(5.0));
    let row = |i: usize| Coupling::unilateral(&[(0, i, -1.0), (1, i, 0.5), (2, (i + 1) % n, 0.5)]);
    let rows: Vec<_> = (0..n).map(row).collect();
    let mut assembly = Assembly::new(&[&stiff, &stiff, &stiff], &rows).unwrap();
    let (mut free, still, mut held) = (vec![0.0; n], vec![0.0; n], vec![false; n]);
    let mut close_one_by_one = || {
        for closed in 0..=n {
            for row in 0..n {
                (free[row], held[row]) = (if row < closed { 1.0 } else { -9.0 }, row >= closed);
            }
            assembly.set_flexibility(1, if closed % 2 == 0 { &stiff } else { &soft }).unwrap();
            let found = assembly.solve(&[&free, &still, &still], &still).unwrap();
            assert_eq!(found.closed().iter().filter(|closed| **closed).count(), closed);
            assembly.hold(&[&free, &still, &still], &still, &held).unwrap();
        }
    };
    close_one_by_one();
    assert_eq!(allocation_counter::measure(close_one_by_one).count_total, 0);
}

/// Two chains of springs and masses, reduced, that meet and part, and are driven together again.
fn modes_propagated() {
    let n = 60;
    let springs: Vec<_> = (1..n).flat_map(|i| spring(i - 1, i, 1.0)).collect();
    let masses: Vec<_> = (0..n).map(|i| (i, i, 1.0)).collect();
    let [mass, stiffness] = [masses, springs].map(|entries| matrix(n, entries));
    let body = Reduction::new(mass.as_ref(), stiffness.as_ref(), &[0]).modes(20).unwrap();
    let second = body.dofs() + body.contact_dofs().start;
    let velocity = [body.velocity(&vec![-0.01; n]).unwrap(), vec![0.0; body.dofs()]].concat();
    let row = LinearRows::new().unilateral(&[(body.contact_dofs().start, 1.0), (second, -1.0)], 0.05);
    let pushed = body.contact_dofs().start;
    let mut run = ModalPropagation::builder(&[&body, &body], 1.0)
        .velocity(velocity)
        .load(move |_, f| f[pushed] = -0.01)
        .constraint(row)
        .build()
        .unwrap();
    let mut go = |steps: usize| {
        let mut pressed = 0;
        for _ in 0..steps {
            run.step().unwrap();
            pressed += usize::from(run.forces()[0] > 0.0);
        }
        assert!(pressed > 50 && pressed < steps - 50, "{pressed}");
    };
    go(300);
    assert_eq!(allocation_counter::measure(|| go(300)).count_total, 0);
}
