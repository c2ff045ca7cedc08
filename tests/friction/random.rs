//! Scenes by chance: masses on springs fly at rough floors and at each other, in the plane and in space.

use contact_dynamics::contact::ContactLaw;
use contact_dynamics::corrector::{Corrector, NonsmoothSplitting};
use contact_dynamics::tableau::StartUp;
use contact_dynamics::{
    Bdf2, Composite, GeneralizedAlpha, LinearRows, LinearSystem, Newmark, PersistencyCorrection, Simulation,
    SimulationBuilder, TimeIntegrator,
};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::sparse::matrix;

/// A scene: `D` dofs a node, springs from each node to the next one or two, a floor below all, pairs that meet.
fn scene<const D: usize>(seed: u64, scheme: Box<dyn TimeIntegrator>) -> (SimulationBuilder<'static, f64>, Vec<f64>) {
    let mut random = xorshift(seed);
    let mut next = move |low: f64, high: f64| low + (high - low) * random();
    let nodes = 2 + usize::try_from(seed % 5).unwrap();
    let dof = |node: usize, axis: usize| D * node + axis;
    let mut entries: Vec<_> = (0..D * nodes).map(|i| (i, i, 0.0)).collect();
    for node in 1..nodes {
        for axis in 0..D {
            let k = 10.0_f64.powf(next(0.0, 4.0));
            let (i, j) = (dof(node - 1, axis), dof(node, axis));
            entries.extend([(i, i, k), (j, j, k), (i, j, -k), (j, i, -k)]);
        }
    }
    let mass: Vec<_> = (0..nodes).flat_map(|_| [10.0_f64.powf(next(-1.0, 1.0)); D]).collect();
    let velocity = (0..D * nodes).map(|i| if i % D == D - 1 { next(-2.0, 0.2) } else { next(-2.0, 2.0) }).collect();
    let (mut floor, mut frictions) = (LinearRows::new(), Vec::new());
    for node in 0..nodes {
        let friction = next(0.0, 1.2);
        let tangents: Vec<_> = (0..D - 1).map(|axis| [(dof(node, axis), 1.0)]).collect();
        let tangents: Vec<_> = tangents.iter().map(|tangent| &tangent[..]).collect();
        floor = floor.unilateral(&[(dof(node, D - 1), 1.0)], next(0.0, 0.1)).friction(friction, &tangents);
        frictions.push(friction);
    }
    // Nodes that meet along a slanted normal.
    for node in 2..nodes {
        let normal: [f64; D] = std::array::from_fn(|_| next(-1.0, 1.0));
        let places = |node| std::array::from_fn(|axis| dof(node, axis));
        let friction = next(0.0, 0.8);
        floor = floor
            .pair_with_friction((ContactLaw::Rigid, friction), places(node - 2), places(node), normal, next(0.01, 0.1))
            .unwrap();
        frictions.push(friction);
    }
    let h = 10.0_f64.powf(next(-3.0, -1.7));
    let system = LinearSystem::lumped(mass, matrix(D * nodes, entries)).unwrap();
    (Simulation::builder(system, scheme, h).velocity(velocity).constraint(floor).unchecked_stability(), frictions)
}

/// What a scheme does in many scenes: the largest growth of the energy over that at the start.
fn largest_growth(make: fn() -> Box<dyn TimeIntegrator>, seeds: std::ops::Range<u64>) -> f64 {
    growth_with(make, || Box::new(PersistencyCorrection::with_history_projection()), seeds)
}

/// The same with another correction.
fn growth_with(
    make: fn() -> Box<dyn TimeIntegrator>,
    correct: fn() -> Box<dyn Corrector<f64>>,
    seeds: std::ops::Range<u64>,
) -> f64 {
    let mut growth = 0.0_f64;
    for seed in seeds {
        let scene = if seed % 2 == 0 { scene::<2> } else { scene::<3> };
        let (builder, frictions) = scene(seed, make());
        // (Steps by the trapezoidal rule at the start could gain as that does.)
        let mut run = builder.start_up(StartUp::Taylor).corrector(correct()).build().unwrap();
        let start = run.energy().total();
        for _ in 0..300 {
            run.step().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
            let contacts = run.state().contacts();
            for (contact, friction) in frictions.iter().enumerate() {
                let size = contacts.friction_forces(contact).iter().fold(0.0_f64, |size, f| size.hypot(*f));
                let bound = friction * contacts.forces()[contact].max(0.0);
                let force = contacts.forces()[contact].abs() + contacts.raw_forces()[contact];
                assert!(size <= bound * (1.0 + 1e-9) + 1e-9 * force, "seed {seed}: {size} {bound}");
                // What slides has friction against it.
                let slip = contacts.slip(contact);
                let power: f64 = contacts.friction_forces(contact).iter().zip(slip).map(|(f, v)| f * v).sum();
                assert!(power <= 1e-9 * (size + force), "seed {seed}: {power}");
            }
            let g = run.energy().total() / start - 1.0;
            if g > 1e-12 && g > growth {
                println!("SEED {seed} step {} {g:e}", run.time());
            }
            growth = growth.max(g);
        }
    }
    growth
}

/// No scene fails, friction is in its cone and takes energy; schemes that dissipate never have more than they began
/// with. (Two tests, for two cores.)
#[test]
fn scenes_by_chance_of_generalized_alpha() {
    assert!(largest_growth(|| Box::new(GeneralizedAlpha::chung_hulbert(0.5).unwrap()), 1..3000) < 1e-12);
}

#[test]
fn scenes_by_chance_of_bdf2() {
    assert!(largest_growth(|| Box::new(Bdf2), 1..3000) < 1e-12);
}

#[test]
fn scenes_by_chance_of_nonsmooth_generalized_alpha() {
    let make: [fn() -> Box<dyn TimeIntegrator>; 2] =
        [|| Box::new(GeneralizedAlpha::chung_hulbert(0.5).unwrap()), || Box::new(Newmark::trapezoidal())];
    for make in make {
        assert!(growth_with(make, || Box::new(NonsmoothSplitting), 1..1000) < 1e-12);
    }
}

#[test]
fn scenes_by_chance_of_schemes_that_conserve() {
    // Where a graze ends in the step in which it began the trapezoidal rule gets back what friction has taken of the
    // velocities, not what of the displacements. The composite scheme gains as much without friction.
    assert!(largest_growth(|| Box::new(Newmark::trapezoidal()), 1..300) < 0.01);
    assert!(largest_growth(|| Box::new(Composite), 1..300) < 0.03);
}

/// The numbering of nodes and contacts does not matter beyond rounding, nor does a velocity that all have in common
/// with the floor.
#[test]
fn order_and_frame_do_not_matter() {
    let go = |order: [usize; 2], frame: f64| {
        let place = |node: usize| 2 * order[node];
        let mut entries = vec![(0, 0, 0.0), (1, 1, 0.0), (2, 2, 0.0), (3, 3, 0.0)];
        let (i, j) = (place(0), place(1));
        entries.extend([(i, i, 50.0), (j, j, 50.0), (i, j, -50.0), (j, i, -50.0)]);
        let (mut mass, mut velocity) = (vec![0.0; 4], vec![0.0; 4]);
        for (node, m, v) in [(0, 1.0, [1.0, -1.0]), (1, 3.0, [-0.5, 0.0])] {
            mass[place(node)..place(node) + 2].fill(m);
            (velocity[place(node)], velocity[place(node) + 1]) = (v[0] + frame, v[1]);
        }
        let floor = (0..2).fold(LinearRows::new(), |rows, k| {
            let node = usize::from(k != order[0]);
            rows.unilateral(&[(place(node) + 1, 1.0)], [0.05, 0.0][node])
                .friction([0.3, 0.2][node], &[&[(place(node), 1.0)]])
                .dragging(move |_| [[frame, 0.0], [0.0; 2]])
        });
        let loads = [place(0) + 1, place(1) + 1];
        let system = LinearSystem::lumped(mass, matrix(4, entries)).unwrap();
        let system = system.load(move |_, f| loads.iter().for_each(|&dof| f[dof] = -10.0));
        let mut run = Simulation::builder(system, Box::new(Newmark::trapezoidal()) as Box<dyn TimeIntegrator>, 0.01)
            .velocity(velocity)
            .constraint(floor)
            .build()
            .unwrap();
        run.run_until(2.0, &mut ()).unwrap();
        let u = run.state().displacement();
        [u[place(0)] - 2.0 * frame, u[place(1)] - 2.0 * frame, u[place(0) + 1]]
    };
    let expected = go([0, 1], 0.0);
    assert!(expected[0].abs() > 0.01);
    for (order, frame) in [([1, 0], 0.0), ([0, 1], 8.0), ([1, 0], -100.0)] {
        for (found, expected) in go(order, frame).into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-11 * (1.0 + frame.abs()), "{order:?} {frame} {found} {expected}");
        }
    }
}
