//! A block on an incline: it slides down as it should, comes to rest, and stays there.

use super::{GRAVITY, masses, run, schemes};
use contact_dynamics::{
    CdLagrange, ContactLaw, ContactStatus, LinearRows, LinearSystem, Newmark, Real, Result, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::sparse::matrix;

/// Where blocks begin: what is below its rounding is no creep.
const START: f64 = 0.1;

/// A block of one mass, x down the slope and y off it.
fn incline(
    scheme: Box<dyn TimeIntegrator>,
    mass: f64,
    [slope, friction]: [f64; 2],
    v: f64,
    h: f64,
) -> Result<Simulation<'static, f64>> {
    let (sine, cosine) = slope.sin_cos();
    let block = masses(vec![mass; 2], vec![mass * GRAVITY * sine, -mass * GRAVITY * cosine])?;
    let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(friction, &[&[(0, 1.0)]]);
    run(block, scheme, h, vec![v, 0.0]).displacement(vec![START, 0.0]).constraint(floor).build()
}

#[test]
fn above_the_angle_of_friction_a_block_slides_down() {
    let acceleration = GRAVITY * (0.5_f64.sin() - 0.3 * 0.5_f64.cos());
    for scheme in schemes() {
        let name = scheme.name();
        let mut run = incline((scheme.make)(), 2.0, [0.5, 0.3], 0.0, 0.01).unwrap();
        run.run_until(1.0, &mut ()).unwrap();
        assert!((run.state().velocity()[0] / acceleration - 1.0).abs() < 1e-12, "{name}");
        // (Moreau and Jean's scheme with θ = 1 moves by the velocity of the end.)
        let way = (run.state().displacement()[0] - START) / (0.5 * acceleration) - 1.0;
        assert!(way.abs() < if name == "Moreau–Jean(1)" { 0.0101 } else { 1e-12 }, "{name} {way}");
        let contacts = run.state().contacts();
        assert_eq!(contacts.status(0), ContactStatus::Sliding, "{name}");
        assert!((contacts.slip(0)[0] / acceleration - 1.0).abs() < 1e-12, "{name}");
        let friction = -0.3 * 2.0 * GRAVITY * 0.5_f64.cos();
        assert!((contacts.friction_forces(0)[0] / friction - 1.0).abs() < 1e-12, "{name}");
    }
}

#[test]
fn a_block_comes_to_rest_and_stays() {
    for scheme in schemes() {
        let name = scheme.name();
        for phase in 0..7 {
            let h = 0.01 * (1.0 + f64::from(phase) / 13.0);
            let mut run = incline((scheme.make)(), 2.0, [0.0, 0.25], 1.0, h).unwrap();
            run.run_until(0.5, &mut ()).unwrap();
            let rest = run.state().displacement()[0];
            run.run_until(1.0, &mut ()).unwrap();
            // Of first order in the event: a share of the last step's way at the speed of that step.
            let error = rest - START - 0.5 / (0.25 * GRAVITY);
            let event = if name == "Moreau–Jean(1)" { 0.6 * h } else { 2.0 * 0.25 * GRAVITY * h * h };
            assert!(error.abs() < event, "{name} {h} {error}");
            let (state, contacts) = (run.state(), run.state().contacts());
            assert!(state.velocity()[0].abs() < 1e-14, "{name} {:e}", state.velocity()[0]);
            assert!((state.displacement()[0] - rest).abs() < 1e-15, "{name} {:e}", state.displacement()[0] - rest);
            assert_eq!(contacts.status(0), ContactStatus::Sticking, "{name} {h}");
            assert!(contacts.friction_forces(0)[0].abs() < 1e-10, "{name} {:?}", contacts.friction_forces(0));
        }
    }
}

/// A gutter of three walls, more than a block in it needs: whatever the share of each, walls press and do not pull,
/// their forces carry the block, and it slows down at least as on a floor and at most as in a gutter of two walls.
#[test]
fn a_block_slides_in_a_gutter_of_more_walls_than_it_needs() {
    const FRICTION: f64 = 0.3;
    // The walls take turns, and the block moves a little across.
    const SLACK: f64 = 0.1;
    for tilt in [1e-4, 0.01, 0.1, 0.4] {
        for (scheme, height) in schemes().flat_map(|scheme| [0.0, 0.02].map(|height| (scheme, height))) {
            let name = format!("{}, walls tilted by {tilt}, from {height}", scheme.name());
            // Along the gutter, across, up.
            let weight = 2.0 * GRAVITY;
            let block = masses(vec![2.0; 3], vec![0.0, 0.0, -weight]).unwrap();
            let walls = [-tilt, 0.2 * tilt, tilt].into_iter().fold(LinearRows::new(), |walls, tilt: f64| {
                let (sine, cosine) = tilt.sin_cos();
                let tangents: [&[(usize, f64)]; 2] = [&[(0, 1.0)], &[(1, cosine), (2, -sine)]];
                walls.unilateral(&[(1, sine), (2, cosine)], 0.0).friction(FRICTION, &tangents)
            });
            let mut run = run(block, (scheme.make)(), 0.01, vec![2.0, 0.0, 0.0])
                .displacement(vec![START, 0.0, height])
                .constraint(walls)
                .build()
                .unwrap();
            // In explicit schemes a block that has fallen bounces for a while.
            run.run_until(0.4, &mut ()).unwrap();
            let (mut speed, step) = (run.state().velocity()[0], 0.01);
            for _ in 0..20 {
                run.step().unwrap();
                let forces = run.state().contacts().forces();
                let up: f64 =
                    [-tilt, 0.2 * tilt, tilt].iter().zip(forces).map(|(tilt, force)| tilt.cos() * force).sum();
                assert!(forces.iter().all(|force| *force > -1e-9 * weight), "{name}: {forces:?}");
                assert!((up / weight - 1.0).abs() < SLACK, "{name}: {forces:?}");
                let slows = (speed - run.state().velocity()[0]) / (step * FRICTION * GRAVITY);
                assert!((1.0 - SLACK..1.0 / tilt.cos() + SLACK).contains(&slows), "{name}: {slows}");
                speed = run.state().velocity()[0];
            }
        }
    }
}

/// Below the angle of friction nothing moves, by not one bit, and friction holds the weight.
#[test]
fn below_the_angle_of_friction_nothing_creeps() {
    let holds = -2.0 * GRAVITY * 0.2_f64.sin();
    for scheme in schemes() {
        let name = scheme.name();
        let mut run = incline((scheme.make)(), 2.0, [0.2, 0.25], 0.0, 0.01).unwrap();
        run.run_until(100.0, &mut ()).unwrap();
        let friction = run.state().contacts().friction_forces(0)[0];
        assert!((friction / holds - 1.0).abs() < 1e-12, "{name} {friction}");
        assert_eq!(run.state().displacement()[0].to_bits(), START.to_bits(), "{name}");
    }
    for scheme in [Box::new(Newmark::trapezoidal()) as Box<dyn TimeIntegrator>, Box::new(CdLagrange)] {
        let mut run = incline(scheme, 2.0, [0.2, 0.25], 0.0, 0.01).unwrap();
        for _ in 0..100_000 {
            run.step().unwrap();
        }
        assert_eq!(run.state().displacement()[0].to_bits(), START.to_bits());
    }
}

/// Two masses that a spring ties, along the slope: size, mass and stiffness do not matter.
#[test]
fn twelve_decades_of_size_mass_and_stiffness() {
    let (slope, friction) = (0.5_f64, 0.3);
    let acceleration = GRAVITY * (slope.sin() - friction * slope.cos());
    for exponent in [-6, -3, 0, 3, 6] {
        for (mass, stiffness, size) in [(exponent, 0, 0), (0, exponent, 0), (0, 0, exponent), (exponent, exponent, 3)] {
            let [mass, stiffness, size] = [mass, stiffness, size].map(|e| 10.0_f64.powi(e));
            // Times and forces scale with the size, at the same gravity.
            let (g, time) = (GRAVITY, size.sqrt());
            let k = matrix(
                4,
                [(0, 0, stiffness), (2, 2, stiffness), (0, 2, -stiffness), (2, 0, -stiffness)]
                    .into_iter()
                    .chain([(1, 1, 0.0), (3, 3, 0.0)]),
            );
            let block = LinearSystem::lumped(vec![mass; 4], k).unwrap().load(move |_, f| {
                for node in 0..2 {
                    f[2 * node] = mass * g * slope.sin();
                    f[2 * node + 1] = -mass * g * slope.cos();
                }
            });
            let floor = [0, 2].into_iter().fold(LinearRows::new(), |rows, x| {
                rows.unilateral(&[(x + 1, 1.0)], 0.0).friction(friction, &[&[(x, 1.0)]])
            });
            let mut run = run(block, Box::new(Newmark::trapezoidal()), 0.01 * time, vec![0.0; 4])
                .constraint(floor)
                .build()
                .unwrap();
            run.run_until(time, &mut ()).unwrap();
            for x in [0, 2] {
                let error = run.state().displacement()[x] / (0.5 * acceleration * time * time) - 1.0;
                assert!(error.abs() < 1e-10, "{mass:e} {stiffness:e} {size:e}: {error:e}");
            }
        }
    }
}

/// Friction that would stop a block in a small part of the first step stops it within that, and is no larger: a block
/// on a floor as rough as one likes goes as far as one on a floor that is rough enough, in single precision too.
#[test]
fn rough_floors_stop_a_block_in_the_first_step() {
    fn way<T: Real>(scheme: Box<dyn TimeIntegrator>, friction: f64, spring: bool) -> [T; 3] {
        let [zero, one, weight] = [0.0, 1.0, 10.0].map(T::of);
        let block = LinearSystem::lumped(vec![one; 2], matrix::<T>(2, [])).unwrap().load(move |_, f| f[1] = -weight);
        let law = if spring { ContactLaw::Penalty { stiffness: 1e3 } } else { ContactLaw::Rigid };
        let floor = LinearRows::new().row(law, &[(1, one)], zero).friction(friction, &[&[(0, one)]]);
        let sunk = if spring { T::of(-0.01) } else { zero };
        let builder = Simulation::builder(block, scheme, 0.01).velocity(vec![T::of(0.05), zero]);
        let mut run = builder.displacement(vec![zero, sunk]).constraint(floor).build().unwrap();
        run.step().unwrap();
        let first = run.state().displacement()[0];
        (0..3).for_each(|_| run.step().unwrap());
        [first, run.state().displacement()[0], run.state().velocity()[0]]
    }
    for scheme in schemes() {
        for spring in [false, true] {
            let stops = way::<f64>((scheme.make)(), 1e2, spring);
            assert!((-1e-15..=0.05 * 0.01).contains(&stops[0]), "{} {spring} {stops:?}", scheme.name());
            for friction in [1e2, 1e4, 1e6] {
                let [double, single] = [way::<f64>((scheme.make)(), friction, spring), {
                    way::<f32>((scheme.make)(), friction, spring).map(f64::from)
                }];
                for (k, size) in [0.05 * 0.01, 0.05 * 0.01, 0.05].into_iter().enumerate() {
                    let [rough, rounded] = [double, single].map(|found| (found[k] - stops[k]).abs() / size);
                    let fine = rough < 1e-12 && rounded < 1e-5;
                    assert!(fine, "{} {friction} {spring}: {double:?} {single:?}", scheme.name());
                }
            }
        }
    }
}
