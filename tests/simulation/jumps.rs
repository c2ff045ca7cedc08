//! What follows for all bodies from contacts that close or open: nothing if rounding alone has closed or opened them.

use contact_dynamics::{ContactLaw, LinearRows, LinearSystem, Simulation, TimeIntegrator};
use contact_dynamics_scenes::schemes::correctable;
use contact_dynamics_scenes::sparse::matrix;

const H: f64 = 0.1;

/// A mass on a spring, and beside it one that is free, with a rigid wall at −0.1.
fn run(make: fn() -> Box<dyn TimeIntegrator>, start: (f64, f64)) -> Simulation<'static, f64> {
    run_by((ContactLaw::Rigid, 0.0), make, start)
}

/// The same with a wall of another law, and a spring at the second mass.
fn run_by(
    (law, spring): (ContactLaw, f64),
    make: fn() -> Box<dyn TimeIntegrator>,
    (place, speed): (f64, f64),
) -> Simulation<'static, f64> {
    let system = LinearSystem::lumped(vec![1.0, 1.0], matrix(2, [(0, 0, 4.0), (1, 1, spring)])).unwrap();
    let wall = LinearRows::new().row(law, &[(1, 1.0)], 0.1);
    Simulation::builder(system, make(), H)
        .displacement(vec![0.3, place])
        .velocity(vec![0.2, speed])
        .constraint(wall)
        .build()
        .unwrap()
}

/// Steps of both runs, the size changed in the middle; in how many a contact of the first closed or opened, and the
/// largest difference of the mass on the spring.
fn beside(mut one: Simulation<'static, f64>, mut other: Simulation<'static, f64>) -> (u64, f64) {
    let mut largest = 0.0_f64;
    for step in 0..12 {
        if step == 4 {
            one.set_step_size(0.7 * H).unwrap();
            other.set_step_size(0.7 * H).unwrap();
        }
        one.step().unwrap();
        other.step().unwrap();
        let [x, y] = [&one, &other].map(|run| {
            let state = run.state();
            [state.displacement()[0], state.velocity()[0], state.acceleration()[0]]
        });
        largest = x.iter().zip(y).fold(largest, |most, (x, y)| most.max((x - y).abs()));
    }
    (one.statistics().contact_changes, largest)
}

/// A mass that comes to the wall with 1e-14 of the other's speed closes a contact there by rounding. The other one, on
/// its spring, knows nothing of it: not in what a state shows of its acceleration, and not in the past of a new step.
#[test]
fn contacts_that_rounding_closes_change_no_other_body() {
    let (mut closed, mut shown) = (0, 0);
    for listed in correctable() {
        let make = listed.make;
        // At rest far from the wall, and beside it.
        let far = (1.0, 0.0);
        for (gap, speed) in [(4e-15, -1e-14), (2e-14, -2e-14), (0.0, 1e-14), (1e-15, 3e-15)] {
            let (changes, largest) = beside(run(make, (-0.1 + gap, speed)), run(make, far));
            assert!(largest < 1e-11, "{}, {gap:e}, {speed:e}: {largest:e}", make().name());
            closed += changes;
        }
        // (A true impact is one: states show the accelerations of the scheme.)
        shown += usize::from(beside(run(make, (-0.09, -0.3)), run(make, far)).1 > 1e-6);
    }
    assert!(closed > 20 && shown > 5, "{closed} {shown}");
}

/// Nor does it know of one that leaves a spring which it had touched by rounding.
#[test]
fn springs_that_rounding_presses_change_no_other_body() {
    let mut opened = 0;
    for listed in correctable() {
        let make = listed.make;
        for law in [ContactLaw::Penalty { stiffness: 10.0 }, ContactLaw::PowerLaw { stiffness: 10.0, exponent: 2.0 }] {
            let start = ((-0.1_f64).next_down(), 0.3);
            let (changes, largest) = beside(run_by((law, 2.0), make, start), run_by((law, 2.0), make, (3.0, 0.0)));
            assert!(largest < 1e-11, "{}, {law:?}: {largest:e}", make().name());
            opened += changes;
        }
    }
    assert!(opened > 20, "{opened}");
}
