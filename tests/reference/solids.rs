//! Solids in two and three dimensions on rigid obstacles: drops of a block, solvers side by side, several contact
//! zones, a soft disc.

use contact_dynamics::contact::{Plane, Side, Sphere};
use contact_dynamics::contact_solver::{GaussSeidel, Pivoting};
use contact_dynamics::{
    Automatic, Composite, ContactLaw, LinearSolver, Newmark, NodesOnObstacle, PersistencyCorrection, Simulation,
    TimeIntegrator,
};
use contact_dynamics_scenes::drops::{Drop, DropFigures, LANDINGS, Landing};
use contact_dynamics_scenes::hosts::Uncondensed;
use contact_dynamics_scenes::solids::{Material, Solid};

const SOFT: Material = Material { young: 50.0, poisson: 0.25, density: 1.0 };

fn gravity<const D: usize>(solid: &Solid<D>, g: f64) -> impl FnMut(f64, &mut [f64]) + Send + 'static {
    let mass = solid.lumped_mass::<f64>();
    move |_, f| {
        f.iter_mut().zip(&mass).enumerate().for_each(|(i, (f, m))| *f = if i % D == D - 1 { -g * m } else { 0.0 });
    }
}

#[test]
fn blocks_land_flat_on_an_edge_and_on_a_corner() {
    for landing in LANDINGS {
        let figures = Drop { cells: 4, landing, courant: 1.0 }.run().unwrap();
        let DropFigures { iterations, steady_iterations, energy, momentum, penetration, pressed, .. } = figures;
        assert!(iterations <= 5 && steady_iterations <= 1, "{landing:?}: {iterations}, {steady_iterations} iterations");
        assert!(momentum < 1e-11 && penetration < 1e-15, "{landing:?}: {momentum:e} {penetration:e}");
        assert!(energy > 0.6 && energy < 1.0, "{landing:?}: {energy}");
        let expected = match landing {
            Landing::Flat => 25,
            Landing::Edge => 5,
            Landing::Corner => 1,
        };
        assert!(pressed >= expected, "{landing:?}: {pressed} pressed");
        assert!(figures.largest_force > 0.05 && figures.duration < 7.0, "{landing:?}: {figures:?}");
    }
    // The flat one is nearly a bar: the force of one, and a bar's time of contact.
    let flat = Drop { cells: 8, landing: Landing::Flat, courant: 1.0 }.run().unwrap();
    assert!((flat.largest_force - 1.0).abs() < 0.1, "{}", flat.largest_force);
    assert!((0.9..1.5).contains(&flat.duration), "{}", flat.duration);
}

#[test]
fn all_contact_solvers_land_the_block_alike() {
    for landing in LANDINGS {
        let drop = Drop { cells: 4, landing, courant: 2.0 };
        let exact = drop.run().unwrap();
        let pivoting = drop.run_with(Pivoting::default()).unwrap();
        let difference = (exact.largest_force / pivoting.largest_force - 1.0).abs();
        assert!(difference < 1e-10, "{landing:?}, pivoting: {difference:e}");
        let sweeps = drop.run_with(GaussSeidel::default()).unwrap();
        let difference = (exact.largest_force / sweeps.largest_force - 1.0).abs();
        assert!(difference < 1e-8, "{landing:?}, Gauss-Seidel: {difference:e}");
    }
}

/// A block squeezed between floor, a tilted wall and a ball above: three zones, normals along and across the axes.
fn squeezed(solver: impl LinearSolver<f64> + 'static) -> Simulation<'static, f64> {
    let solid = Solid::block([1.0, 0.8, 1.2], [4, 3, 5], SOFT);
    let near = |inside: fn([f64; 3]) -> bool| -> Vec<usize> {
        solid.surface_nodes().into_iter().filter(|&n| inside(solid.nodes[n])).collect()
    };
    let floor = Plane::new([0.0, 0.0, -0.01], [0.0, 0.0, 1.0]).unwrap();
    let wall = Plane::new([1.05, 0.0, 0.0], [-1.0, 0.1, 0.2]).unwrap();
    let ball = Sphere::new([0.5, 0.4, 2.75], 1.5, Side::Outside).unwrap();
    let dofs = solid.node_dofs();
    Simulation::builder(solid.system(), Composite, 0.01)
        .velocity(solid.uniform([0.5, 0.1, -0.7]))
        .constraint(NodesOnObstacle::new(floor, &solid.nodes, &dofs, &near(|p| p[2] < 0.01)).unwrap())
        .constraint(NodesOnObstacle::new(wall, &solid.nodes, &dofs, &near(|p| p[0] > 0.99)).unwrap())
        .constraint(
            NodesOnObstacle::new(ball, &solid.nodes, &dofs, &near(|p| p[2] > 1.19))
                .unwrap()
                .moving(|t| [[0.0, 0.0, -0.4 * t], [0.0, 0.0, -0.4], [0.0; 3]]),
        )
        .corrector(PersistencyCorrection::with_history_projection())
        .linear_solver(solver)
        .build()
        .unwrap()
}

#[test]
fn several_zones_and_solvers_that_cannot_condense() {
    let (mut condensed, mut plain) = (squeezed(Automatic), squeezed(Uncondensed::new(Automatic)));
    let mut most = [0; 3];
    while condensed.time() < 1.0 {
        condensed.step().unwrap();
        plain.step().unwrap();
        let (a, b) = (condensed.state(), plain.state());
        let worst = a.displacement().iter().zip(b.displacement()).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(worst < 1e-9, "t = {}: {worst:e}", condensed.time());
        let contacts = a.contacts();
        for (zone, most) in most.iter_mut().enumerate() {
            let pressed = contacts.ids().iter().zip(contacts.raw_forces());
            *most = pressed.filter(|(id, f)| id.constraint == zone && **f > 0.0).count().max(*most);
        }
        // What presses does not penetrate: on planes to rounding, on the ball to the curvature of one step.
        for (id, gap) in contacts.ids().iter().zip(contacts.gaps()) {
            assert!(*gap > if id.constraint == 2 { -2e-4 } else { -1e-13 }, "{id}: {gap:e}");
        }
    }
    assert!(most.iter().all(|most| *most >= 4), "{most:?}");
    assert_eq!(condensed.statistics().factorizations, 1, "moving contact does not factorize");
}

#[test]
fn bodies_that_leave_the_reach_fly_on() {
    // Bounced off by a spring and out of reach: no force may be left behind, whatever the linear solver.
    let block = Solid::block([1.0; 3], [2; 3], SOFT).lifted(0.01);
    let bottom: Vec<usize> = block.surface_nodes().into_iter().filter(|&n| block.nodes[n][2] < 0.02).collect();
    let solvers: [Box<dyn LinearSolver<f64>>; 2] = [Box::new(Automatic), Box::new(Uncondensed::new(Automatic))];
    for solver in solvers {
        let floor = Plane::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap();
        let contact = NodesOnObstacle::new(floor, &block.nodes, &block.node_dofs(), &bottom)
            .unwrap()
            .with_law(ContactLaw::Penalty { stiffness: 100.0 })
            .reach(0.02)
            .unwrap();
        let mut run = Simulation::builder(block.system(), Composite, 0.002)
            .velocity(block.uniform([0.0, 0.0, -1.0]))
            .constraint(contact)
            .linear_solver(solver)
            .build()
            .unwrap();
        let up: Vec<f64> = (0..block.dofs()).map(|dof| f64::from(u8::from(dof % 3 == 2))).collect();
        let (mut pressed, mut free) = (false, None);
        while run.time() < 2.0 {
            run.step().unwrap();
            pressed |= run.state().contacts().forces().iter().any(|f| *f > 0.0);
            if pressed && run.gaps().is_empty() {
                let momentum = run.momentum(&up).unwrap();
                let at_first = *free.get_or_insert(momentum);
                assert!((momentum - at_first).abs() < 1e-12, "{momentum} {at_first}");
            }
        }
        assert!(free.is_some_and(|momentum| momentum > 0.5), "{free:?}");
    }
}

#[test]
fn a_soft_disc_bounces_without_gaining_energy_or_a_checkered_pressure() {
    // The disc of the GetFEM example: R = 20, λ = μ = 20, ρ = 1, body force 0.1, 5 above the floor.
    let disc = Solid::disc(20.0, 24, SOFT).lifted(5.0);
    let (h, g) = (0.05, 0.1);
    let floor = Plane::new([0.0, 0.0], [0.0, 1.0]).unwrap();
    let lower = disc.surface_nodes().into_iter().filter(|&n| disc.nodes[n][1] < 15.0);
    let nodes: Vec<usize> = lower.collect();
    // Length of the surface that belongs to a node.
    let mut share = vec![0.0; disc.nodes.len()];
    for side in disc.boundary() {
        let [a, b] = [disc.nodes[side[0]], disc.nodes[side[1]]];
        let length = (a[0] - b[0]).hypot(a[1] - b[1]);
        for &n in &side {
            share[n] += 0.5 * length;
        }
    }
    let schemes: [Box<dyn TimeIntegrator>; 2] = [Box::new(Composite), Box::new(Newmark::trapezoidal())];
    for scheme in schemes {
        let (name, mass) = (scheme.name(), disc.lumped_mass::<f64>());
        let mut run = Simulation::builder(disc.system().load(gravity(&disc, g)), scheme, h)
            .constraint(NodesOnObstacle::new(floor, &disc.nodes, &disc.node_dofs(), &nodes).unwrap())
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        let total = |run: &mut Simulation<'_, f64>| {
            let height: f64 =
                mass.iter().zip(run.state().displacement()).skip(1).step_by(2).map(|(m, u)| m * g * u).sum();
            run.energy().total() + height
        };
        let start = total(&mut run);
        let scale = 5.0 * g * mass.iter().step_by(2).sum::<f64>();
        let (mut highest, mut before) = (start, start);
        let mut pressures: Vec<f64> = Vec::new();
        let mut largest = 0.0;
        while run.time() < 40.0 {
            run.step().unwrap();
            let energy = total(&mut run);
            assert!(energy <= before + 1e-3 * scale, "{name}, t = {}: {:e}", run.time(), (energy - before) / scale);
            (highest, before) = (f64::max(highest, energy), energy);
            let contacts = run.state().contacts();
            let force: f64 = contacts.forces().iter().sum();
            if force > largest {
                largest = force;
                let pressed = contacts.ids().iter().zip(contacts.forces()).filter(|(_, f)| **f > 0.0);
                pressures = pressed.map(|(id, f)| f / share[id.feature]).collect();
            }
        }
        assert!(highest - start < 0.01 * scale, "{name}");
        pressures.sort_by(f64::total_cmp);
        let ratio = pressures[pressures.len() - 1] / pressures[pressures.len() / 2];
        assert!(pressures.len() >= 5 && ratio < 1.3, "{name}: {ratio}, {pressures:?}");
    }
}
