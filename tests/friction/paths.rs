//! Oscillators with friction, belts, and the energy that friction takes.

use super::{GRAVITY, masses, run, schemes};
use contact_dynamics::contact::ContactLaw;
use contact_dynamics::{Composite, GeneralizedAlpha, LinearRows, LinearSystem, Newmark, Simulation, TimeIntegrator};
use contact_dynamics_scenes::schemes::Listed;
use contact_dynamics_scenes::sparse::matrix;

/// A mass on a spring, on a floor whose friction is f; m = k = 1.
fn oscillator(scheme: &Listed, x: f64, f: f64, h: f64, belt: f64) -> Simulation<'static, f64> {
    let system = LinearSystem::lumped(vec![1.0; 2], matrix(2, [(0, 0, 1.0), (1, 1, 0.0)])).unwrap();
    let system = system.load(|_, f| f[1] = -GRAVITY);
    let floor = LinearRows::new()
        .unilateral(&[(1, 1.0)], 0.0)
        .friction(f / GRAVITY, &[&[(0, 1.0)]])
        .dragging(move |_| [[belt, 0.0], [0.0; 2]]);
    run(system, (scheme.make)(), h, vec![0.0; 2]).displacement(vec![x, 0.0]).constraint(floor).build().unwrap()
}

/// x ẍ + x = −f sign ẋ from rest at x₀: turning points (−1)ⁿ (x₀ − 2 n f), and rest at the first of them within f.
#[test]
fn the_coulomb_oscillator_turns_where_it_should() {
    for scheme in schemes().filter(|scheme| scheme.name() != "Moreau–Jean(1)") {
        let errors = [0.02, 0.01, 0.005].map(|h| {
            let mut run = oscillator(&scheme, 1.0, 0.15, h, 0.0);
            run.run_until(12.0, &mut ()).unwrap();
            // 1, −.7, .4, −.1: it stays.
            (run.state().displacement()[0] + 0.1).abs()
        });
        let name = scheme.name();
        let falls = errors[2] < 0.75 * errors[0] || errors.iter().all(|&error| error < 1e-4);
        assert!(errors[2] < 0.01 && falls, "{name} {errors:?}");
        let mut run = oscillator(&scheme, 1.0, 0.15, 0.01, 0.0);
        run.run_until(11.0, &mut ()).unwrap();
        let rest = run.state().displacement()[0];
        run.run_until(12.0, &mut ()).unwrap();
        assert!((run.state().displacement()[0] - rest).abs() < 1e-15, "{name}");
    }
}

/// On a belt a mass on a spring sticks until the spring pulls with f, then slides around f: with one coefficient it
/// comes to an oscillation in which its velocity just reaches that of the belt, or less.
#[test]
fn a_belt_carries_an_oscillator_to_its_limit() {
    let scheme = schemes().find(|scheme| scheme.name() == "Newmark(0.25, 0.5)").unwrap();
    let (f, belt) = (0.4, 0.1);
    let mut run = oscillator(&scheme, 0.0, f, 1e-3, belt);
    run.run_until(3.0, &mut ()).unwrap();
    // Carried: x = v t, less what it takes to be as fast as the belt.
    let behind = belt * belt / (2.0 * f);
    assert!((run.state().displacement()[0] - belt * 3.0 + behind).abs() < 0.02 * behind);
    assert!((run.state().velocity()[0] - belt).abs() < 1e-12);
    run.run_until(5.0, &mut ()).unwrap();
    let (mut largest, mut fastest) = (0.0_f64, 0.0_f64);
    while run.state().time() < 40.0 {
        run.step().unwrap();
        largest = largest.max((run.state().displacement()[0] - f).abs());
        fastest = fastest.max(run.state().velocity()[0]);
    }
    assert!((largest - belt).abs() < 1e-3 * f + 1e-3 && fastest < belt * (1.0 + 1e-9), "{largest} {fastest}");
}

/// Friction does the work −μ N times the way, and the balance closes.
#[test]
fn the_books_have_a_line_for_friction() {
    for scheme in schemes() {
        let block = masses(vec![2.0; 2], vec![0.0, -2.0 * GRAVITY]).unwrap();
        let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(0.25, &[&[(0, 1.0)]]);
        let mut run =
            run(block, (scheme.make)(), 0.01, vec![1.0, 0.0]).constraint(floor).energy_balance().build().unwrap();
        let mut before = 0.0;
        for _ in 0..60 {
            run.step().unwrap();
            let works = run.energy().works.unwrap();
            // (In the step in which it stops forces jump, and their mean is not that of the step.)
            assert!(works.friction <= before + 2e-3, "{} {works:?}", scheme.name());
            before = works.friction;
        }
        let works = run.energy().works.unwrap();
        // (The step in which it stops is not resolved, and schemes differ in where their forces live.)
        let way = run.state().displacement()[0];
        assert!((works.friction + 0.25 * 2.0 * GRAVITY * way).abs() < 0.04, "{} {works:?} {way}", scheme.name());
        assert!((works.friction + works.corrections + works.remainder + 1.0).abs() < 1e-12, "{works:?}");
        assert!(works.remainder.abs() < 0.04, "{} {works:?}", scheme.name());
    }
}

/// Other units change no bit of the numbers (powers of two; of masses powers of four, for factors have square roots).
#[test]
fn units_do_not_matter() {
    let go = |length: f64, mass: f64, time: f64| {
        let (stiffness, force) = (mass / (time * time), mass * length / (time * time));
        let system = LinearSystem::lumped(vec![mass; 2], matrix(2, [(0, 0, stiffness), (1, 1, 0.0)])).unwrap();
        let system = system.load(move |_, f| f[1] = -GRAVITY * force);
        let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.1 * length).friction(0.02, &[&[(0, 1.0)]]);
        let mut run = run(system, Box::new(Newmark::trapezoidal()), 0.01 * time, vec![0.5 * length / time, 0.0])
            .displacement(vec![length, 0.0])
            .constraint(floor)
            .build()
            .unwrap();
        run.run_until(6.0 * time, &mut ()).unwrap();
        let contacts = run.state().contacts();
        (
            (run.state().displacement()[0] / length).to_bits(),
            (contacts.friction_forces(0)[0] / force).to_bits(),
            (contacts.slip(0)[0] / length * time).to_bits(),
        )
    };
    let expected = go(1.0, 1.0, 1.0);
    for (length, mass, time) in [(1024.0, 1.0, 1.0), (1.0, 0.25, 1.0), (1.0, 1.0, 4.0), (0.25, 64.0, 0.5)] {
        assert_eq!(go(length, mass, time), expected, "{length} {mass} {time}");
    }
}

/// Mode coupling: a mass on two springs that are not along the floor, pressed onto a spring that slides on a belt.
/// Friction makes the stiffness unsymmetric, K = [k₁₁, k₁₂ + μ k₃; k₁₂, k₂₂], and above a threshold of μ vibrations
/// grow.
#[test]
fn modes_couple_above_the_threshold() {
    let ([k11, k12, k22], k3, load) = ([2.0, -0.3, 1.0], 1.2, 10.0);
    let difference: f64 = k11 - (k22 + k3);
    let threshold = (-k12 - difference * difference / (4.0 * k12)) / k3;
    for (share, grows) in [(0.99, false), (1.01, true)] {
        let friction = share * threshold;
        let k = matrix(2, [(0, 0, k11), (0, 1, k12), (1, 0, k12), (1, 1, k22)]);
        let system = LinearSystem::lumped(vec![1.0; 2], k).unwrap().load(move |_, f| f[1] = -load);
        let belt = LinearRows::new()
            .row(ContactLaw::Penalty { stiffness: k3 }, &[(1, 1.0)], 0.0)
            .friction(friction, &[&[(0, 1.0)]])
            .dragging(|_| [[1e3, 0.0], [0.0; 2]]);
        // At rest: K u = (0, −load).
        let coupled = k12 + friction * k3;
        let determinant = k11 * (k22 + k3) - k12 * coupled;
        let rest = [coupled * load / determinant, -k11 * load / determinant];
        let mut run = run(system, Box::new(Newmark::trapezoidal()), 0.05, vec![0.0; 2])
            .displacement(vec![rest[0] + 1e-4, rest[1]])
            .constraint(belt)
            .build()
            .unwrap();
        let mut largest = [0.0_f64; 2];
        while run.state().time() < 1200.0 {
            run.step().unwrap();
            let half = usize::from(run.state().time() > 600.0);
            largest[half] = largest[half].max((run.state().displacement()[0] - rest[0]).abs());
        }
        let growth = largest[1] / largest[0];
        assert!(if grows { growth > 5.0 } else { growth < 1.2 }, "{share}: {growth}");
    }
}

/// A contact node without mass, pulled along a floor by its spring at the start: it stays where friction can hold it,
/// or slides until it can, and the run goes on from there.
#[test]
fn dofs_without_mass_begin_with_friction() {
    for (friction, rests) in [(0.0, 0.5), (0.6, 0.0), (0.3, 0.2)] {
        let springs = |i: usize, j: usize, k: f64| [(i, i, k), (j, j, k), (i, j, -k), (j, i, -k)];
        let stiffness = matrix(4, [springs(0, 2, 2.0), springs(1, 3, 100.0)].concat());
        let system = LinearSystem::lumped(vec![1.0, 1.0, 0.0, 0.0], stiffness).unwrap();
        let system = system.load(|_, f| f[1] = -2.0);
        let floor = LinearRows::new().unilateral(&[(3, 1.0)], 0.0).friction(friction, &[&[(2, 1.0)]]);
        let scheme: Box<dyn TimeIntegrator> = Box::new(GeneralizedAlpha::chung_hulbert(0.5).unwrap());
        let mut run = run(system, scheme, 1e-3, vec![0.0; 4])
            .displacement(vec![0.5, -0.02, 0.0, 0.0])
            .constraint(floor)
            .build()
            .unwrap();
        assert!((run.state().displacement()[2] - rests).abs() < 1e-14, "{friction} {:?}", run.state().displacement());
        let contacts = run.state().contacts();
        assert!((contacts.forces()[0] - 2.0).abs() < 1e-13);
        let held = contacts.friction_forces(0).first().copied().unwrap_or(0.0);
        assert!((held + 2.0 * (0.5 - rests)).abs() < 1e-12, "{friction} {held}");
        // It goes on as it stood: the mass accelerates with the spring, and no jump is seen.
        assert!((run.state().acceleration()[0] + 2.0 * (0.5 - rests)).abs() < 1e-12);
        run.step().unwrap();
        assert!((run.state().displacement()[2] - rests).abs() < 1e-5, "{friction} {:?}", run.state().displacement());
        assert!((run.state().contacts().forces()[0] - 2.0).abs() < 1e-3);
    }
}

/// A contact node without mass on a spring whose other end is driven (Jenkins' element): it stays where it is until the
/// spring pulls with f, and then follows at the distance f/k: the play of the drive, in each step anew.
#[test]
fn a_dragged_node_without_mass_is_the_play_of_its_spring() {
    let (friction, width) = (0.3, 0.3);
    let springs = |i: usize, j: usize, k: f64| [(i, i, k), (j, j, k), (i, j, -k), (j, i, -k)];
    let drive = |t: f64| [t.sin(), t.cos(), -t.sin()];
    // (The composite's first stage may go further than both ends of a step around a turning point.)
    let schemes: [(Box<dyn TimeIntegrator>, f64); 2] =
        [(Box::new(Newmark::trapezoidal()), 1e-10), (Box::new(Composite), 2e-5)];
    for (scheme, tolerance) in schemes {
        let name = scheme.name();
        let stiffness = matrix(4, [springs(0, 2, 2.0), springs(1, 3, 100.0)].concat());
        let system = LinearSystem::lumped(vec![1.0, 1.0, 0.0, 0.0], stiffness).unwrap();
        let system = system.load(|_, f| f[1] = -2.0).drive(0, drive).unwrap();
        let floor = LinearRows::new().unilateral(&[(3, 1.0)], 0.0).friction(friction, &[&[(2, 1.0)]]);
        let mut run = run(system, scheme, 1e-2, vec![1.0, 0.0, 0.0, 0.0])
            .displacement(vec![0.0, -0.02, 0.0, 0.0])
            .constraint(floor)
            .build()
            .unwrap();
        let (mut play, mut ways) = (0.0_f64, [0.0, 0.0]);
        while run.state().time() < 12.0 {
            run.step().unwrap();
            let x = drive(run.state().time())[0];
            let next = play.clamp(x - width, x + width);
            ways[usize::from(next > play)] += (next - play).abs();
            play = next;
            let found = run.state().displacement()[2];
            assert!((found - play).abs() < tolerance, "{name}: {found} {play} at {}", run.state().time());
        }
        // There and back at least once.
        assert!(ways[0] > 1.0 && ways[1] > 1.0, "{ways:?}");
    }
}

/// A body that starts as fast as its belt, but for the last bit, does not slide.
#[test]
fn a_slip_of_rounding_is_none_at_the_start() {
    for scheme in schemes() {
        for (v, belt) in [(0.1 + 0.2, 0.3), (0.3, 0.1 + 0.2), (-0.7 - 0.1, -0.8), (0.8, 0.7 + 0.1)] {
            let system = masses(vec![1.0; 2], vec![0.0, -GRAVITY]).unwrap();
            let floor = LinearRows::new()
                .unilateral(&[(1, 1.0)], 0.0)
                .friction(0.5, &[&[(0, 1.0)]])
                .dragging(move |_| [[belt, 0.0], [0.0; 2]]);
            let mut run = run(system, (scheme.make)(), 1e-2, vec![0.0; 2])
                .velocity(vec![v, 0.0])
                .constraint(floor)
                .build()
                .unwrap();
            for step in 0..3 {
                let friction = run.state().contacts().friction_forces(0)[0];
                assert!(friction.abs() < 1e-10, "{}, {v} on {belt}, step {step}: {friction}", scheme.name());
                run.step().unwrap();
            }
        }
    }
}
