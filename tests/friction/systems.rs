//! Friction in every kind of run: large strains, consistent mass, driven supports, steps of other sizes.

use super::{GRAVITY, masses, run, schemes};
use contact_dynamics::contact::{ContactLaw, NodesOnObstacle, Plane, Side, Sphere};
use contact_dynamics::{
    Composite, GeneralizedAlpha, LinearRows, LinearSystem, Newmark, Simulation, SimulationBuilder, StepControl,
    TimeIntegrator,
};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::schemes::Listed;
use contact_dynamics_scenes::solids::{Material, Solid};

/// Runs a block of the plane, thrown along a floor and onto it, for a while: all it loses along the floor is μ times
/// what the floor gives.
fn slides(builder: SimulationBuilder<'static, f64>, solid: &Solid<2>, friction: f64, what: &str) {
    let nodes: Vec<_> = (0..solid.nodes.len()).filter(|&node| solid.nodes[node][1] == 0.0).collect();
    let floor = Plane::new([0.0, -0.01], [0.0, 1.0]).unwrap();
    let floor = NodesOnObstacle::new(floor, &solid.nodes, &solid.node_dofs(), &nodes).unwrap().friction(friction);
    let velocity = solid.uniform([3.0, -1.0]);
    let mut run = builder.velocity(velocity).constraint(floor).build().unwrap();
    let along: Vec<_> = (0..solid.dofs()).map(|dof| f64::from(dof % 2 == 0)).collect();
    let start = run.momentum(&along).unwrap();
    let mut impulse = [0.0; 2];
    for _ in 0..100 {
        run.step().unwrap();
        let contacts = run.state().contacts();
        for contact in 0..contacts.ids().len() {
            impulse[0] += contacts.friction_impulses(contact).iter().sum::<f64>();
            impulse[1] += contacts.impulses()[contact];
        }
    }
    assert!(impulse[1] > 0.1, "{what} {impulse:?}");
    let lost = run.momentum(&along).unwrap() - start;
    assert!((lost / impulse[0] - 1.0).abs() < 1e-8, "{what}: {lost} {impulse:?}");
    assert!((impulse[0] / impulse[1] + friction).abs() < 1e-8, "{what}: {impulse:?}");
}

#[test]
fn bodies_at_large_strains_rub() {
    let solid = Solid::rectangle([1.0, 0.5], [4, 2], Material { young: 50.0, poisson: 0.3, density: 1.0 });
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 3] = [
        || Box::new(Newmark::trapezoidal()),
        || Box::new(Composite),
        || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()),
    ];
    for make in schemes {
        let body = Hyperelastic::new(&solid, Law::NeoHookean);
        slides(Simulation::builder(body, make(), 2e-3), &solid, 0.2, &make().name());
    }
}

#[test]
fn a_consistent_mass_rubs() {
    let solid = Solid::rectangle([1.0, 0.5], [4, 2], Material { young: 50.0, poisson: 0.3, density: 1.0 });
    for scheme in schemes().filter(|scheme| scheme.radius.is_some()) {
        let system = LinearSystem::new(solid.consistent_mass(), solid.stiffness()).unwrap();
        slides(Simulation::builder(system, (scheme.make)(), 2e-3), &solid, 0.2, &scheme.name());
    }
}

/// A block on a driven plate does what it does on a belt that moves so.
#[test]
fn a_driven_plate_is_a_belt() {
    let motion = |t: f64| [0.3 * t.sin(), 0.3 * t.cos(), -0.3 * t.sin()];
    for scheme in schemes() {
        let block = || masses(vec![1.0; 2], vec![0.0, -GRAVITY]).unwrap();
        let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(0.02, &[&[(0, 1.0)]]);
        let belt = floor.dragging(move |t| [[motion(t)[1], 0.0], [motion(t)[2], 0.0]]);
        let mut on_belt = run(block(), (scheme.make)(), 0.01, vec![0.0; 2]).constraint(belt).build().unwrap();
        let system = masses(vec![1.0; 4], vec![0.0, -GRAVITY, 0.0, 0.0]).unwrap();
        let system = system.drive(2, motion).unwrap().fix(3).unwrap();
        let pair =
            LinearRows::new().pair_with_friction((ContactLaw::Rigid, 0.02), [2, 3], [0, 1], [0.0, 1.0], 0.0).unwrap();
        let builder = run(system, (scheme.make)(), 0.01, vec![0.0, 0.0, 0.3, 0.0]).constraint(pair);
        let mut on_plate = builder.build().unwrap();
        on_belt.run_until(4.0, &mut ()).unwrap();
        on_plate.run_until(4.0, &mut ()).unwrap();
        let (belt, plate) = (on_belt.state().displacement()[0], on_plate.state().displacement()[0]);
        // (The way of the plate in a step, where that is read, is not h times its velocity in the middle.)
        assert!(belt.abs() > 0.01 && (belt - plate).abs() < 2e-3, "{} {belt} {plate}", scheme.name());
    }
}

/// Steps that change on the way, by hand and by control, end where those of one size do.
#[test]
fn steps_of_any_size() {
    let build = |scheme: Box<dyn TimeIntegrator>, h: f64| {
        let block = masses(vec![1.0; 2], vec![0.0, -GRAVITY]).unwrap();
        let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.05).friction(0.1, &[&[(0, 1.0)]]);
        run(block, scheme, h, vec![1.0, 0.0]).constraint(floor)
    };
    for scheme in schemes().filter(|scheme| scheme.name() != "Moreau–Jean(1)") {
        let mut even = build((scheme.make)(), 0.004).build().unwrap();
        even.run_until(1.6, &mut ()).unwrap();
        let mut uneven = build((scheme.make)(), 0.004).build().unwrap();
        for (k, h) in [0.004, 0.002, 0.0035, 0.001, 0.004].into_iter().enumerate() {
            uneven.set_step_size(h).unwrap();
            uneven.run_until(0.35 * (k + 1) as f64, &mut ()).unwrap();
        }
        let controlled = build((scheme.make)(), 0.004).step_control(StepControl::halving(1e-4).unwrap());
        let mut controlled = controlled.build().unwrap();
        controlled.run_until(1.6, &mut ()).unwrap();
        let [even, uneven, controlled] = [&even, &uneven, &controlled].map(|run| run.state().displacement()[0]);
        assert!(
            (even - uneven).abs() < 0.01 && even.to_bits() == controlled.to_bits(),
            "{} {even} {uneven}",
            scheme.name()
        );
    }
}

/// A ball in a bowl in space, with tangents that turn: it comes to rest below the angle of friction, and stays.
#[test]
fn a_particle_comes_to_rest_in_a_bowl() {
    let around = [0.0, std::f64::consts::FRAC_PI_4, 2.0];
    for (scheme, azimuth) in schemes().filter(Listed::takes_corrections).flat_map(|scheme| around.map(|a| (scheme, a)))
    {
        let particle = masses(vec![1.0; 3], vec![0.0, 0.0, -GRAVITY]).unwrap();
        let bowl = Sphere::new([0.0; 3], 1.0, Side::Inside).unwrap();
        let ((sine, cosine), (y, x)) = (0.7_f64.sin_cos(), azimuth.sin_cos());
        let start = [sine * x, sine * y, -cosine];
        let bowl = NodesOnObstacle::new(bowl, &[start], &[[0, 1, 2]], &[0]).unwrap().friction(0.3);
        let velocity = if azimuth == 0.0 { vec![0.0, 1.5, 0.0] } else { vec![0.0; 3] };
        let mut run = run(particle, (scheme.make)(), 2e-3, velocity).constraint(bowl).build().unwrap();
        run.run_until(3.0, &mut ()).unwrap();
        let (u, v) = (run.state().displacement().to_vec(), run.state().velocity());
        let place: [f64; 3] = std::array::from_fn(|axis| start[axis] + u[axis]);
        let angle = place[0].hypot(place[1]).atan2(-place[2]);
        assert!(angle < 0.3_f64.atan() && v.iter().all(|v| v.abs() < 1e-10), "{} {angle} {v:?}", scheme.name());
        run.run_until(4.0, &mut ()).unwrap();
        let moved = run.state().displacement().iter().zip(&u).map(|(now, before)| (now - before).abs());
        assert!(moved.fold(0.0, f64::max) < 1e-11, "{}", scheme.name());
    }
}
