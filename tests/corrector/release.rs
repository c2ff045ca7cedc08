//! What `Release` gives back: whatever the scheme, the phase of the impact, and the motion of the observer.

use contact_dynamics::contact::{ContactLaw, GapOffset, NodesOnObstacle, Plane};
use contact_dynamics::contact_solver::Pivoting;
use contact_dynamics::corrector::Release;
use contact_dynamics::{
    Gssss, LinearRows, LinearSystem, PersistencyCorrection, Simulation, SimulationBuilder, TimeIntegrator,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::schemes::{Listed, correctable};
use contact_dynamics_scenes::sparse::{matrix, spring};

type Make = fn() -> Box<dyn TimeIntegrator>;

/// The implicit ones of second order (the energy of explicit ones is another, and the first order damps what is given
/// back) and whether they conserve energy.
fn schemes() -> impl Iterator<Item = (Make, bool)> {
    let conserves = |listed: &Listed| listed.published.is_some_and(|[_, damping]| damping == 0.0);
    let implicit = correctable().filter(|listed| listed.radius.is_some() && listed.order == 2);
    let midpoint: Make = || Box::new(Gssss::new(1.0, 1.0, 1.0).unwrap());
    implicit.map(move |listed| (listed.make, conserves(&listed))).chain([(midpoint, true)])
}

#[derive(Clone, Copy, PartialEq)]
enum With {
    Nothing,
    Release,
}

fn corrected(builder: SimulationBuilder<'_, f64>, with: With) -> SimulationBuilder<'_, f64> {
    let builder = builder.uncorrected().corrector(PersistencyCorrection::with_history_projection());
    match with {
        With::Nothing => builder,
        With::Release => builder.corrector(Release),
    }
}

/// Energy at the end over that at the start, and the most that corrections had taken.
fn bounce(make: Make, n: u32, phase: f64, with: With) -> [f64; 2] {
    let h = 0.05 / f64::from(n);
    let bars = Bars::paper(n as usize).delayed(phase, h);
    let builder = Simulation::builder(bars.system::<f64>(), make(), h).velocity(bars.velocities());
    let mut run = corrected(builder.constraint(bars.contact()), with).build().unwrap();
    let (start, mut taken) = (run.energy().total(), 0.0_f64);
    while run.time() < 0.45 {
        run.step().unwrap();
        taken = taken.max(run.state().contacts().dissipated()[0]);
    }
    assert_eq!(run.statistics().contact_changes, 2);
    [run.energy().total() / start, taken / start]
}

#[test]
fn runs_end_with_the_energy_that_release_gives_back() {
    for (make, conserves) in schemes() {
        for (n, every) in [(20, 1), (50, 1), (100, 3)] {
            for phase in (0..10).step_by(every).map(|i| 0.05 + 0.1 * f64::from(i)) {
                let [without, taken] = bounce(make, n, phase, With::Nothing);
                let [found, _] = bounce(make, n, phase, With::Release);
                let case = format!("{}, n = {n}, phase {phase}: {found} after {without}, taken {taken}", make().name());
                // No energy is made, and what numerical damping leaves of it is gain. (What is given back adds to waves
                // that the scheme may damp the more.)
                assert!(found <= 1.0 + 1e-9, "{case}");
                assert!(found >= without - 1e-3 * taken, "{case}");
                // Without numerical damping all of it is there at the end.
                if conserves {
                    assert!((found - without - taken).abs() < 0.06 * taken + 1e-9, "{case}");
                }
            }
        }
    }
}

/// A wall beside a chain of masses, in four forms: as a gap that changes, as an obstacle that moves, as a support that
/// is driven, or as another chain.
#[derive(Clone, Copy, Debug)]
enum Wall {
    Offset,
    Obstacle,
    Support,
    Chain,
}

/// Velocities at the end, seen by an observer that moves as all does, and what corrections had taken.
fn observed(make: Make, wall: Wall, speed: f64) -> Vec<f64> {
    const N: usize = 12;
    let second = if matches!(wall, Wall::Chain) { N } else { 1 };
    let springs = (0..N - 1).chain(N..N + second - 1).flat_map(|i| spring(i, i + 1, 900.0));
    let k = matrix(N + second, (0..N + second).map(|i| (i, i, 0.0)).chain(springs));
    let mut system = LinearSystem::lumped(vec![0.1; N + second], k).unwrap();
    let mut velocity = vec![speed - 1.0; N];
    velocity.resize(N + second, speed);
    if matches!(wall, Wall::Support) {
        system = system.drive(N, move |t| [speed * t, speed, 0.0]).unwrap();
    }
    let builder = Simulation::builder(system, make(), 2e-3).velocity(velocity);
    let builder = match wall {
        Wall::Offset => {
            let offset = GapOffset::moving(move |t| [0.1013 - speed * t, -speed, 0.0]);
            builder.constraint(LinearRows::new().unilateral(&[(0, 1.0)], offset))
        }
        Wall::Obstacle => {
            let plane = Plane::new([0.0], [1.0]).unwrap();
            let nodes = NodesOnObstacle::new(plane, &[[0.1013]], &[[0]], &[0]).unwrap();
            builder.constraint(nodes.moving(move |t| [[speed * t], [speed], [0.0]]))
        }
        Wall::Support | Wall::Chain => builder.constraint(LinearRows::new().unilateral(&[(0, 1.0), (N, -1.0)], 0.1013)),
    };
    let mut run = corrected(builder, With::Release).build().unwrap();
    let mut taken = 0.0_f64;
    while run.time() < 1.0 {
        run.step().unwrap();
        taken = taken.max(run.state().contacts().dissipated()[0]);
    }
    assert!(taken > 0.0 && !run.state().contacts().closed()[0], "{wall:?}: {taken}");
    run.state().velocity()[..N].iter().map(|v| v - speed).chain([taken]).collect()
}

#[test]
fn release_does_not_depend_on_a_velocity_common_to_all() {
    for make in correctable().map(|listed| listed.make) {
        for wall in [Wall::Offset, Wall::Obstacle, Wall::Support, Wall::Chain] {
            let still = observed(make, wall, 0.0);
            for speed in [1.0, -30.0, 1e4] {
                let moving = observed(make, wall, speed);
                for (x, y) in moving.iter().zip(&still) {
                    let bound = 1e-11 * speed.abs();
                    assert!((x - y).abs() < bound, "{}, {wall:?}, {speed}: {:e}", make().name(), x - y);
                }
            }
        }
    }
}

/// A mass that hits another one as this hits a wall: both contacts open together, and share a mass. Whichever is named
/// first, the bodies get the same back.
#[test]
fn contacts_that_open_together_have_no_order() {
    let mut together = 0;
    for (make, _) in schemes() {
        let end = |swapped: bool| {
            let k = matrix(2, [(0, 0, 4.6), (1, 1, 4.6)]);
            let rows = [(vec![(0, -1.0), (1, 1.0)], 0.0), (vec![(0, 1.0)], 2e-7)];
            let named = if swapped { [&rows[1], &rows[0]] } else { [&rows[0], &rows[1]] };
            let contact = named.iter().fold(LinearRows::new(), |contact, (row, gap)| contact.unilateral(row, *gap));
            let system = LinearSystem::lumped(vec![1.0, 0.4], k).unwrap();
            let builder = Simulation::builder(system, make(), 0.05).velocity(vec![0.0, -1e-5]).constraint(contact);
            let mut run = corrected(builder, With::Release).build().unwrap();
            let mut both = false;
            for _ in 0..24 {
                let before = run.state().contacts().closed().to_vec();
                run.step().unwrap();
                both |= before == [true; 2] && run.state().contacts().closed() == [false; 2];
            }
            (run.state().velocity().to_vec(), both)
        };
        let ([(one, both), (other, _)], name) = ([end(false), end(true)], make().name());
        let same = one.iter().zip(&other).all(|(x, y)| (x - y).abs() < 1e-9 * 1e-5);
        assert!(same, "{name}: {one:?} {other:?}");
        together += usize::from(both);
    }
    assert!(together > 10, "they open together in {together} runs");
}

/// A damped mass that stops at a wall is not driven back: whichever way its gap is rounded, and in whatever part of a
/// step it comes, from the start or later.
#[test]
fn a_damped_mass_stays_where_it_has_stopped() {
    for (make, _) in schemes() {
        for (damping, i) in [0.0, 0.03, 0.3, 3.0].into_iter().flat_map(|damping| (0..40).map(move |i| (damping, i))) {
            let (mass, gap, speed) = (0.92 + 0.1 * f64::from(i), 0.0137 * f64::from(i), 1.4e-4 * 1.7_f64.powi(i % 9));
            let system = LinearSystem::lumped(vec![mass], matrix(1, [(0, 0, 0.0)])).unwrap();
            let wall = LinearRows::new().unilateral(&[(0, 1.0)], gap * speed);
            let builder = Simulation::builder(system.rayleigh(damping, 0.0).unwrap(), make(), 0.052);
            let mut run = corrected(builder.velocity(vec![-speed]).constraint(wall), With::Release).build().unwrap();
            for _ in 0..60 {
                run.step().unwrap();
            }
            let v = run.state().velocity()[0];
            assert!(v < 1e-9 * speed, "{}, damping {damping}, gap {gap}: {v:e} of {speed:e}", make().name());
        }
    }
}

/// One contact written twice, with another factor: which of both rows presses is the solver's choice, and neither opens
/// as long as the other one does. What the impact took is given back once, when both open.
#[test]
fn a_contact_that_is_written_twice_is_one() {
    let mut opened = 0;
    for (make, _) in schemes() {
        for (law, gap) in [ContactLaw::Rigid, ContactLaw::PersistencySwitch].into_iter().zip([0.013, 0.0179]) {
            let mut end = |factors: &[f64]| {
                let k = [spring(0, 1, 5.0), spring(1, 2, 4.0), spring(2, 3, 6.0)].concat();
                let system = LinearSystem::lumped(vec![1.0, 1.7, 0.6, 1.2], matrix(4, k)).unwrap();
                let rows =
                    factors.iter().fold(LinearRows::new(), |rows, &factor| rows.row(law, &[(0, factor)], factor * gap));
                let builder = Simulation::builder(system, make(), 0.05).velocity(vec![-0.02; 4]).constraint(rows);
                let mut run = corrected(builder.contact_solver(Pivoting::default()), With::Release).build().unwrap();
                let mut velocities = Vec::new();
                while run.time() < 8.0 {
                    let before = run.state().contacts().closed().contains(&true);
                    run.step().unwrap();
                    opened += u32::from(before && !run.state().contacts().closed().contains(&true));
                    velocities.extend_from_slice(run.state().velocity());
                }
                velocities
            };
            let (one, name) = (end(&[1.0]), make().name());
            for factors in [[1.0, 2.068], [2.068, 1.0]] {
                let worst = one.iter().zip(end(&factors)).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-10 * 0.02, "{name}, {law:?}, {factors:?}: {worst:e}");
            }
        }
    }
    assert!(opened > 60, "{opened}");
}

/// Two masses that have met move on together, without any force between them: whichever way their gap is rounded, what
/// the impact took is not given back.
#[test]
fn bodies_that_stay_together_without_force_are_not_driven_apart() {
    for (make, _) in schemes() {
        for i in 0..60 {
            let (mass, common, gap) = (0.3 + 0.17 * f64::from(i), f64::from(i % 7) * 1.3, 0.01 + 0.0137 * f64::from(i));
            let system = LinearSystem::lumped(vec![1.0, mass], matrix(2, [(0, 0, 0.0), (1, 1, 0.0)])).unwrap();
            let pair = LinearRows::new().unilateral(&[(0, -1.0), (1, 1.0)], gap);
            let builder = Simulation::builder(system, make(), 0.01).velocity(vec![common + 1.0, common - 0.7]);
            let mut run = corrected(builder.constraint(pair), With::Release).build().unwrap();
            run.run_until(2.0, &mut ()).unwrap();
            let v = run.state().velocity();
            let met = (common + 1.0 + mass * (common - 0.7)) / (1.0 + mass);
            assert!(
                (v[0] - met).abs() < 1e-9 && (v[1] - met).abs() < 1e-9,
                "{}, mass {mass}: {v:?} instead of {met}",
                make().name()
            );
        }
    }
}
