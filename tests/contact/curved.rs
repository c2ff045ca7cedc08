//! Motion along curved gaps without friction: energy, place and work of contact to the order of the scheme, raw and
//! corrected.

use contact_dynamics::contact::{GapFunction, NodesOnObstacle, Side, Sphere};
use contact_dynamics::tableau::ContactLevel;
use contact_dynamics::{
    Corrector, EnergyMomentum, Error, LinearSystem, Newmark, PersistencyCorrection, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::curved::{Drift, SCENES, Scene};
use contact_dynamics_scenes::schemes::{self, Listed};
use contact_dynamics_scenes::sparse::matrix;

type Correctors = Vec<Box<dyn Corrector<f64>>>;

fn corrected() -> Correctors {
    vec![Box::new(PersistencyCorrection::with_history_projection())]
}

/// Schemes that impose contact on displacements, with what corrects them.
fn runs() -> impl Iterator<Item = (Listed, fn() -> Correctors)> {
    let on_positions = |listed: &Listed| {
        let stages = (listed.make)().tableau().stages;
        stages.iter().all(|stage| matches!(stage.contact, ContactLevel::Position { .. }))
    };
    let listed = schemes::all().into_iter().filter(move |listed| listed.takes_multipliers() && on_positions(listed));
    listed.flat_map(|listed| {
        let corrected: fn() -> Correctors = corrected;
        let corrected = listed.takes_corrections().then_some((listed, corrected));
        [Some((listed, (|| Vec::new()) as fn() -> Correctors)), corrected].into_iter().flatten()
    })
}

/// Falls by the order of the scheme over a factor of four in h, or is small beside the errors of its kind.
fn falls(name: &str, order: u32, small: f64, [coarse, fine]: [f64; 2], failures: &mut Vec<String>) {
    let observed = (coarse / fine).log(4.0);
    if fine > small && observed < f64::from(order) - 0.35 {
        failures.push(format!("{name}: {coarse:.1e} {fine:.1e}, order {observed:.2}"));
    }
}

#[test]
fn energy_place_and_work_converge_with_the_order_of_the_scheme() {
    let mut failures = Vec::new();
    for scene in SCENES {
        for (listed, correctors) in runs() {
            let [coarse, fine] = [0.02, 0.005].map(|h| scene.run((listed.make)(), correctors(), h).unwrap());
            let name = format!("{scene:?}, {}, {} correctors", listed.name(), correctors().len());
            let pick = |what: fn(&Drift) -> f64| [what(&coarse).abs(), what(&fine).abs()];
            falls(&format!("{name}, energy"), listed.order, 1e-9, pick(|drift| drift.energy), &mut failures);
            falls(&format!("{name}, place"), listed.order, 2e-6, pick(|drift| drift.place), &mut failures);
            falls(&format!("{name}, work"), listed.order, 5e-6, pick(|drift| drift.work), &mut failures);
            // Contact does no work on a fixed surface: what the scheme loses is its own.
            if listed.order == 2 && (fine.work.abs() > 2e-4 || fine.remainder.abs() > 1e-3) {
                failures.push(format!("{name}: work {:.1e}, remainder {:.1e}", fine.work, fine.remainder));
            }
            // (The forward increments of explicit schemes close the gap of the next state: the first is that of the
            // start.)
            if listed.takes_corrections() && fine.gap > 1e-12 {
                failures.push(format!("{name}: gap {:.1e}", fine.gap));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn schemes_that_conserve_energy_conserve_it_on_curves() {
    for scene in SCENES {
        let drift = scene.run(EnergyMomentum, Vec::new(), 0.01).unwrap();
        assert!(drift.energy < 1e-11, "{scene:?}: {drift:?}");
    }
    for scene in [Scene::Circle, Scene::Rod] {
        for h in [0.02, 0.01] {
            let drift = scene.run(Newmark::trapezoidal(), corrected(), h).unwrap();
            assert!(drift.energy < 1e-11, "{scene:?}: {drift:?}");
            let raw = scene.run(Newmark::trapezoidal(), Vec::new(), h).unwrap();
            assert!(raw.energy < 1e-8, "{scene:?}: {raw:?}");
        }
    }
}

/// In `f32` rows stand still where its rounding is met, after as few linearizations.
#[test]
fn single_precision_follows_to_its_own_rounding() {
    let bowl = Sphere::new([0.0_f32, 0.0], 1.0, Side::Inside).unwrap();
    let none = matrix::<f32>(2, [(0, 0, 0.0)]);
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] =
        [|| Box::new(Newmark::trapezoidal()), || Box::new(EnergyMomentum)];
    for make in schemes {
        let system = LinearSystem::lumped(vec![1.0_f32; 2], none.clone()).unwrap();
        let contact = NodesOnObstacle::new(bowl, &[[0.0, -1.0]], &[[0, 1]], &[0]).unwrap();
        let mut run = Simulation::builder(system, make(), 0.01)
            .velocity(vec![1.0, 0.0])
            .constraint(contact)
            .corrector(PersistencyCorrection::new())
            .build()
            .unwrap();
        run.run_until(3.0, &mut ()).unwrap();
        assert!((run.energy().total() - 0.5).abs() < 1e-3, "{}: {}", make().name(), run.energy().total());
        let counts = *run.statistics();
        assert!(counts.contact_solves <= 8 * counts.steps, "{}: {counts:?}", make().name());
    }
}

/// Two beads in bowls or on hills y = κ x²/2, pressed down: the places along the curves move by the factor
/// q = −β h² P κ/m from one linearization to the next. Gaps are met, and what is not balanced by M a and the load is a
/// force along the normals of the curves. Steps too large for the linearizations to converge are refused.
#[test]
fn rows_that_turn_with_their_forces_converge_or_are_refused() {
    let factors = [[0.3, 0.1], [0.6, 0.2], [-0.5, 0.4], [0.99, 0.5], [-1.5, -0.5]];
    for [first, second] in factors {
        let curvature = [first, second].map(|q| -4.0 * q);
        let curve = |curvature: f64| {
            move |_: f64, x: &[f64], v: &[f64], gradient: &mut [f64]| {
                gradient.copy_from_slice(&[-curvature * x[0], 1.0]);
                [x[1] - 0.5 * curvature * x[0] * x[0], 0.0, -curvature * v[0] * v[0]]
            }
        };
        let load = [0.02, -1.0, 0.01, -1.0];
        let system = LinearSystem::lumped(vec![1.0; 4], matrix(4, [(0, 0, 0.0)])).unwrap();
        let system = system.load(move |_, f| f.copy_from_slice(&load));
        let beads = GapFunction::new(&[0, 1], curve(curvature[0])).and(&[2, 3], curve(curvature[1]));
        let mut run = Simulation::builder(system, Newmark::trapezoidal(), 1.0).constraint(beads).build().unwrap();
        if f64::abs(first) > 0.9 {
            let error = run.step().unwrap_err();
            assert!(matches!(error, Error::ContactUnsettled { .. }) && error.is_recoverable(), "{first}: {error}");
            continue;
        }
        run.step().unwrap_or_else(|error| panic!("{first} {second}: {error}"));
        let state = run.state();
        let (u, a) = (state.displacement(), state.acceleration());
        for (bead, curvature) in curvature.into_iter().enumerate() {
            let [x, y] = [u[2 * bead], u[2 * bead + 1]];
            let slope = curvature * x;
            assert!((y - 0.5 * slope * x).abs() < 1e-10, "{first} {second}: gap {:e}", y - 0.5 * slope * x);
            let force = [0, 1].map(|axis| a[2 * bead + axis] - load[2 * bead + axis]);
            let along = force[0] + slope * force[1];
            assert!(force[1] > 0.1 && along.abs() < 1e-5, "{first} {second}: {force:?}, {along:e} along the curve");
        }
    }
}
