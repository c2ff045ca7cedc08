//! Large motion: the stiff elastic pendulum, thrown and spinning bodies that bounce, and what schemes conserve of them.

use contact_dynamics::contact::{Side, Sphere};
use contact_dynamics::{
    Bathe, Bdf2, Composite, EnergyMomentum, GeneralizedAlpha, Newmark, NodesOnObstacle, PersistencyCorrection,
    Simulation, StepControl, TimeIntegrator,
};
use contact_dynamics_scenes::hyperelastic::{Hyperelastic, Law};
use contact_dynamics_scenes::large::{MATERIAL, Scene, Swing, Throw};
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::solids::{Material, Solid};

type Make = fn() -> Box<dyn TimeIntegrator>;

const SCHEMES: [Make; 6] = [
    || Box::new(Composite),
    || Box::new(Newmark::trapezoidal()),
    || Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()),
    || Box::new(Bathe::default()),
    || Box::new(Bdf2),
    || Box::new(EnergyMomentum),
];

#[test]
fn the_pendulum_is_where_it_should_be_to_the_order_of_the_scheme() {
    for make in SCHEMES {
        let errors = [0.004, 0.002].map(|h| Swing::run(make(), 1e4, h, 2.0).unwrap().errors);
        for (coarse, fine) in errors[0].iter().zip(&errors[1]) {
            let order = (coarse / fine).log2();
            assert!((order - 2.0).abs() < 0.1, "{}: order {order}, error {fine:e}", make().name());
        }
        assert_eq!(errors[1].len(), 2);
    }
}

#[test]
fn the_stiff_pendulum_swings_as_the_soft_one_does() {
    // The extension is never resolved (577 rad/s); schemes that damp it keep their order in the swing.
    let damped: [Make; 3] = [|| Box::new(Composite), || Box::new(Bathe::default()), || Box::new(EnergyMomentum)];
    for make in damped {
        let errors = [0.02, 0.01].map(|h| Swing::run(make(), 1e7, h, 1.0).unwrap().errors[0]);
        let order = (errors[0] / errors[1]).log2();
        assert!((order - 2.0).abs() < 0.25, "{}: {errors:?}", make().name());
    }
}

#[test]
fn energy_and_angular_momentum_stay_for_a_hundred_thousand_steps() {
    // Some 400 turns of the rigid pendulum.
    for axial in [1e4, 1e7, 1e10] {
        let swing = Swing::run(Box::new(EnergyMomentum), axial, 0.01, 1000.0).unwrap();
        assert!(swing.failure.is_none(), "{axial}: {:?}", swing.failure);
        assert!(swing.energy < 1e-6 && swing.angular < 1e-8, "{axial}: {:e} {:e}", swing.energy, swing.angular);
    }
    // Twice and four times the step: the tangent of the path is definite where that of its mean is not.
    for h in [0.02, 0.04] {
        let swing = Swing::run(Box::new(EnergyMomentum), 1e10, h, 20.0).unwrap();
        assert!(swing.failure.is_none() && swing.iterations < 6.0, "{swing:?}");
    }
}

#[test]
fn the_trapezoidal_rule_breaks_down_where_others_go_on() {
    let trapezoidal = Swing::run(Box::new(Newmark::trapezoidal()), 1e10, 0.01, 10.0).unwrap();
    let (t, reason) = trapezoidal.failure.unwrap();
    assert!(t < 5.0 && reason.contains("positive definite"), "{t}: {reason}");
    for make in [SCHEMES[0], SCHEMES[3], SCHEMES[4], SCHEMES[5]] {
        let swing = Swing::run(make(), 1e10, 0.01, 10.0).unwrap();
        assert!(swing.failure.is_none() && swing.energy < 0.01, "{}: {swing:?}", make().name());
    }
}

#[test]
fn a_bouncing_block_takes_few_iterations() {
    for make in [SCHEMES[0], SCHEMES[1], SCHEMES[2], SCHEMES[3], SCHEMES[4]] {
        for (angle, speed) in [(0.3, 0.3), (0.0, 0.2), (0.7, 0.1)] {
            let throw = Throw { angle, speed, ..Throw::default() };
            let flights = [throw.square().fly(make(), 30.0), Throw { cells: 4, ..throw }.cube().fly(make(), 10.0)];
            for flight in flights {
                let flight = flight.unwrap();
                let name = format!("{} at {angle}, {speed}", make().name());
                assert!(flight.most[0] <= 4 && flight.most[1] <= 8, "{name}: {:?}", flight.most);
                assert!(flight.changes > 4 && flight.refused == 0, "{name}");
                assert!(flight.momentum < 1e-12, "{name}: {:e}", flight.momentum);
                assert!(flight.penetration < 1e-14, "{name}: {:e}", flight.penetration);
                assert!(flight.energy_end < 1.0, "{name}: {}", flight.energy_end);
            }
        }
    }
}

#[test]
fn rings_and_masts_bounce_too() {
    for make in SCHEMES {
        let throw = Throw { cells: 2, ..Throw::default() };
        let flights = [
            throw.ring().fly(make(), 20.0).unwrap(),
            Throw { cells: 1, ..throw }.hoop().fly(make(), 10.0).unwrap(),
            Throw { height: 0.5, speed: 0.1, ..throw }.mast().fly(make(), 20.0).unwrap(),
        ];
        for (which, flight) in flights.into_iter().enumerate() {
            let name = format!("{}, {which}", make().name());
            assert!(flight.changes > 20, "{name}: {} changes", flight.changes);
            // What a scheme conserves contains h a: under a load a change of the step shifts it.
            assert!(flight.momentum < 1e-11 || flight.refused > 0, "{name}: {:e}", flight.momentum);
            assert!(flight.penetration < 1e-13, "{name}: {:e}", flight.penetration);
            assert!(flight.energy_end < 1.0 && flight.energy_end > 0.2, "{name}: {}", flight.energy_end);
        }
    }
}

/// A slender bar, spinning, that comes to the wall.
fn spinning_bar() -> Scene<Hyperelastic<2>, 2> {
    let law = Law::StVenantKirchhoff;
    Throw { cells: 2, law, gravity: 0.0, height: 1.0, slide: 0.0, speed: 0.05, spin: 0.1, ..Throw::default() }.bar()
}

#[test]
fn a_spinning_bar_keeps_energy_and_angular_momentum_until_it_hits_and_loses_energy_there() {
    let flight = spinning_bar().fly(Box::new(EnergyMomentum), 60.0).unwrap();
    assert!(flight.angular < 1e-10, "{:e}", flight.angular);
    assert!(flight.energy_most < 1.0 + 1e-10 && flight.energy_end < 0.95, "{flight:?}");
    assert!(flight.momentum < 1e-12 && flight.changes >= 4, "{flight:?}");
    // Other schemes err in both, the less the smaller the step.
    for make in [SCHEMES[0], SCHEMES[1], SCHEMES[3]] {
        let coarse = spinning_bar().fly(make(), 8.0).unwrap();
        let fine = Scene { h: 0.5 * spinning_bar().h, ..spinning_bar() }.fly(make(), 8.0).unwrap();
        let ratio = coarse.angular / fine.angular;
        assert!(coarse.angular > 1e-7 && ratio > 3.0, "{}: {ratio}", make().name());
    }
}

#[test]
fn two_hundred_random_drops_end_without_failure_or_gain() {
    let mut random = xorshift(0x5eed);
    let dissipative: [Make; 4] = [
        || Box::new(Composite),
        || Box::new(Bathe::default()),
        || Box::new(GeneralizedAlpha::chung_hulbert(0.5).unwrap()),
        || Box::new(Bdf2),
    ];
    for drop in 0..200 {
        let throw = Throw {
            cells: 3 + drop % 3,
            angle: std::f64::consts::TAU * random(),
            slide: 0.4 * random() - 0.2,
            speed: 0.02 + 0.3 * random(),
            spin: 1.2 * random() - 0.6,
            height: 0.1 * random(),
            // Courant numbers 0.2 … 3.
            courant: 0.2 * 15.0_f64.powf(random()),
            ..Throw::default()
        };
        let make = dissipative[drop % 4];
        let flight = match drop % 10 {
            9 => Throw { cells: 2, ..throw }.cube().fly(make(), 20.0),
            _ => throw.square().fly(make(), 30.0),
        };
        let flight = flight.unwrap_or_else(|error| panic!("{drop}, {throw:?}: {error}"));
        assert!(flight.energy_end < 1.0 + 1e-9, "{drop}, {throw:?}: {}", flight.energy_end);
        assert!(flight.penetration < 1e-13 && flight.changes > 0, "{drop}, {throw:?}: {flight:?}");
    }
}

#[test]
fn the_conserving_scheme_gains_no_energy_in_any_drop() {
    let mut random = xorshift(0xd1ce);
    for drop in 0..40 {
        let throw = Throw {
            cells: 3,
            angle: std::f64::consts::TAU * random(),
            speed: 0.02 + 0.2 * random(),
            spin: 1.2 * random() - 0.6,
            courant: 0.3 + random(),
            ..Throw::default()
        };
        let flight = throw.square().fly(Box::new(EnergyMomentum), 30.0).unwrap();
        // Not even on the way: between impacts the energy stays.
        assert!(flight.energy_most < 1.0 + 1e-9, "{drop}, {throw:?}: {:e}", flight.energy_most - 1.0);
    }
}

#[test]
fn a_soft_block_in_a_bowl_converges_quadratically_and_meets_the_surface() {
    let solid = Solid::rectangle([1.0; 2], [4, 4], MATERIAL).moved([-0.5, -0.9]);
    let body = Hyperelastic::new(&solid, Law::NeoHookean).gravity([0.3, -0.5]);
    let bowl = Sphere::new([0.0, 0.0], 1.1, Side::Inside).unwrap();
    let nodes = solid.surface_nodes();
    let contact = NodesOnObstacle::new(bowl, &solid.nodes, &body.particles.node_dofs(), &nodes).unwrap();
    let mut run = Simulation::builder(body, Composite, 0.1)
        .constraint(contact)
        .corrector(PersistencyCorrection::with_history_projection())
        .step_control(StepControl::halving(1e-3).unwrap())
        .build()
        .unwrap();
    let (mut quadratic, mut pressed) = (0, 0);
    for _ in 0..300 {
        run.step().unwrap();
        let state = run.state();
        for &node in &nodes {
            let u = &state.displacement()[2 * node..2 * node + 2];
            let distance = (solid.nodes[node][0] + u[0]).hypot(solid.nodes[node][1] + u[1]);
            assert!(distance < 1.1 + 1e-10, "node {node} is {:e} inside", distance - 1.1);
        }
        let forces = state.contacts().raw_forces();
        pressed = pressed.max(forces.iter().filter(|&&force| force > 0.0).count());
        // From the second iteration on the active set stands still: residuals square.
        let residuals: Vec<f64> = run.convergence().iter().map(|it| it.residual).collect();
        for pair in residuals.windows(2).filter(|pair| pair[0] < 1e-3 && forces.iter().any(|&force| force > 0.0)) {
            quadratic += 1;
            assert!(pair[1] < 1e3 * pair[0] * pair[0] + 1e-12, "{residuals:?}");
        }
        assert!(residuals.len() <= 6, "{residuals:?}");
    }
    assert!(pressed >= 3 && quadratic > 200, "{pressed} pressed, {quadratic} pairs");
}

/// Displacements over the side and contact forces over E times it, of a square that falls on a floor; lengths are
/// `length` times, E `stiffness` times, densities `density` times those of the default throw, and all slides at `slide`
/// wave speeds.
fn fall(scheme: Box<dyn TimeIntegrator>, [length, stiffness, density]: [f64; 3], slide: f64) -> Vec<f64> {
    let material =
        Material { young: stiffness * MATERIAL.young, density: density * MATERIAL.density, poisson: MATERIAL.poisson };
    let speed = material.wave_speed() / MATERIAL.wave_speed();
    let throw = Throw::default();
    let solid = Solid::rectangle([length; 2], [4; 2], material).moved([-0.5 * length; 2]).rotated(throw.angle);
    let body =
        Hyperelastic::new(&solid.lifted(0.3 * length), Law::NeoHookean).gravity([0.0, -0.02 * speed * speed / length]);
    let center = body.particles.center(&vec![0.0; body.particles.dofs()]);
    let linear = [slide * material.wave_speed(), -throw.speed * speed];
    let velocity = body.particles.rigid_velocity(linear, throw.spin * speed / length, center);
    let h = 0.2 * length / speed;
    let scene = Scene { nodes: (0..body.particles.nodes.len()).collect(), body, velocity, floor: None, h };
    let mut run = scene.builder(scheme).unwrap().build().unwrap();
    let mut seen = Vec::new();
    for _ in 0..60 {
        run.step().unwrap();
        let drift = linear[0] * run.time();
        let u = run.state().displacement().iter().enumerate();
        seen.extend(u.map(|(dof, u)| (u - if dof % 2 == 0 { drift } else { 0.0 }) / length));
        seen.push(run.state().contacts().forces().iter().sum::<f64>() / (stiffness * length));
    }
    seen
}

#[test]
fn results_depend_neither_on_units_nor_on_a_common_velocity() {
    for make in SCHEMES {
        let reference = fall(make(), [1.0; 3], 0.0);
        assert!(reference.iter().all(|x| x.is_finite()));
        // mm, t, s with steel; inch, pound-force; and a slide at three times the wave speed.
        for (units, slide) in [([1e3, 2.1e5, 7.85e-9], 0.0), ([39.37, 1.45e-4, 9.357e-8], 0.0), ([1.0; 3], 3.0)] {
            let other = fall(make(), units, slide);
            let worst = reference.iter().zip(&other).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-8, "{}, {units:?}, {slide}: {worst:e}", make().name());
        }
    }
}
