//! Nodes against rigid obstacles: geometry, motion of the obstacle, curved surfaces, bodies far away.
#![allow(clippy::float_cmp)] // unchanged values are meant exactly

use contact_dynamics::contact::{
    Candidates, Capsule, ContactJacobian, Contacts, Cuboid, Cylinder, GapOffset, GapRates, Obstacle, Plane, Rates,
    Side, Sphere,
};
use contact_dynamics::{
    Composite, ContactConstraint, ContactLaw, Error, LinearRows, LinearSystem, Newmark, NodesOnObstacle,
    PersistencyCorrection, Result, Simulation, StepControl, verify,
};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::sparse::free;
use proptest::prelude::*;

/// Free particles in D dimensions under gravity along the last axis.
fn particles<const D: usize>(count: usize, gravity: f64) -> LinearSystem<'static, f64> {
    let n = D * count;
    let load = move |_: f64, f: &mut [f64]| (0..n).for_each(|i| f[i] = if i % D == D - 1 { -gravity } else { 0.0 });
    free(&vec![1.0; n]).load(load)
}

/// Particles at these places on an obstacle.
fn on<'a, const D: usize>(obstacle: impl Obstacle<f64, D> + 'a, places: &[[f64; D]]) -> NodesOnObstacle<'a, f64, D> {
    let dofs: Vec<[usize; D]> = (0..places.len()).map(|i| std::array::from_fn(|axis| D * i + axis)).collect();
    let all: Vec<usize> = (0..places.len()).collect();
    NodesOnObstacle::new(obstacle, places, &dofs, &all).unwrap()
}

/// Numbers that look random, in [−1, 1].
fn noise(count: usize, seed: f64) -> Vec<f64> {
    (0..count).map(|i| ((i as f64 + seed) * 12.9898).sin() * 43758.5453 % 1.0).collect()
}

#[test]
fn jacobians_are_the_derivatives_of_the_gaps() {
    let places = noise(60, 0.3);
    let nodes3: Vec<_> = (0..20).map(|i| [places[3 * i], places[3 * i + 1], places[3 * i + 2]]).collect();
    let nodes2: Vec<_> = (0..20).map(|i| [places[2 * i], places[2 * i + 1]]).collect();
    let (u, v) = (noise(60, 7.7).iter().map(|x| 0.1 * x).collect::<Vec<_>>(), noise(60, 3.1));
    let motion3 = |t: f64| [[0.1 * t, t * t, 0.0], [0.1, 2.0 * t, 0.0], [0.0, 2.0, 0.0]];
    let motion2 = |t: f64| [[0.1 * t, t * t], [0.1, 2.0 * t], [0.0, 2.0]];
    let center = [0.05, -0.02, 0.03];
    let mut solids: Vec<(&str, NodesOnObstacle<'_, f64, 3>)> = Vec::new();
    for side in [Side::Outside, Side::Inside] {
        let sphere = Sphere::new(center, 0.7, side).unwrap();
        solids.push(("sphere", on(sphere, &nodes3)));
        let cylinder = Cylinder::new(center, [1.0, 2.0, -0.5], 0.4, side).unwrap();
        solids.push(("cylinder", on(cylinder, &nodes3)));
    }
    let plane = Plane::new(center, [0.3, -2.0, 1.0]).unwrap();
    solids.push(("plane", on(plane, &nodes3)));
    let capsule = Capsule::new([center, [0.4, -0.3, 0.2]], 0.3).unwrap();
    solids.push(("capsule", on(capsule, &nodes3)));
    let cuboid = Cuboid::new(center, [0.5, 0.3, 0.4], 0.1).unwrap();
    solids.push(("cuboid", on(cuboid, &nodes3)));
    for (name, contact) in solids {
        let mut contact = contact.moving(motion3);
        let error = verify::gap_jacobian(&mut contact, 0.4, &u, &v, 1e-6).unwrap();
        assert_eq!((error.rows, error.rows_lost), (20, 0), "{name}");
        assert!(error.jacobian < 1e-7 && error.rate < 1e-5 && error.acceleration < 1e-4, "{name}: {error:?}");
    }
    for side in [Side::Outside, Side::Inside] {
        let disc = Sphere::new([0.05, 0.04], 0.7, side).unwrap();
        let mut contact = on(disc, &nodes2).moving(motion2);
        let error = verify::gap_jacobian(&mut contact, 0.4, &u, &v, 1e-6).unwrap();
        assert!(error.rows == 20 && error.jacobian < 1e-7, "{error:?}");
        assert!(error.rate < 1e-5 && error.acceleration < 1e-4, "{error:?}");
    }
}

#[test]
fn a_wrong_jacobian_is_found_with_its_worst_entry() {
    struct Wrong(LinearRows<'static, f64>);
    impl ContactConstraint<f64> for Wrong {
        fn dofs(&self) -> &[usize] {
            self.0.dofs()
        }
        fn contacts(&self, contacts: &mut Contacts<f64>) {
            contacts.push((0, 0), ContactLaw::Rigid, &[(0, 1.0)]);
            contacts.push((1, 0), ContactLaw::Rigid, &[(1, -1.0), (2, 0.9)]); // the gap below says 1
        }
        fn gaps(&mut self, t: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
            self.0.gaps(t, u, gaps)
        }
        fn rates(&mut self, _: f64, _: &[f64], _: &[f64], rates: &mut [GapRates<f64>]) -> Result<Rates> {
            rates.fill(GapRates::default());
            Ok(Rates::Given)
        }
    }
    let offset = GapOffset::moving(|t| [1.0 + 3.0 * t, 0.0, 0.0]); // its rate is 3, not 0
    let rows = LinearRows::new().unilateral(&[(0, 1.0)], 0.5).unilateral(&[(1, -1.0), (2, 1.0)], offset);
    let error = verify::gap_jacobian(&mut Wrong(rows), 0.0, &[0.0; 3], &[0.0; 3], 1e-6).unwrap();
    assert!((error.jacobian - 0.1).abs() < 1e-8 && error.worst == ((1, 0), 2), "{error:?}");
    assert!((error.rate - 3.0).abs() < 1e-6, "{error:?}");
}

#[test]
fn curvature_is_the_acceleration_along_the_surface() {
    // Second difference of the distance along a straight line.
    let (x, w, s) = ([0.4, -0.7, 0.5], [0.3, 0.9, -0.4], 1e-4);
    let check = |obstacle: &dyn Obstacle<f64, 3>| {
        let at = |s: f64| obstacle.distance(std::array::from_fn(|k| x[k] + s * w[k])).0;
        let difference = (at(s) - 2.0 * at(0.0) + at(-s)) / (s * s);
        assert!((difference - obstacle.curvature(x, w)).abs() < 1e-6, "{difference}");
    };
    for side in [Side::Outside, Side::Inside] {
        check(&Sphere::new([0.1, 0.2, 0.3], 0.5, side).unwrap());
        check(&Cylinder::new([0.1, 0.2, 0.3], [1.0, 0.5, 2.0], 0.5, side).unwrap());
    }
    check(&Plane::new([0.0; 3], [1.0, 2.0, 3.0]).unwrap());
}

/// Of a body as large, and as far away, as one likes.
#[test]
fn curvature_has_the_unit_of_an_inverse_length() {
    let (x, w, side) = ([0.4, -0.7, 0.5], [0.3, 0.9, -0.4], Side::Inside);
    let of = |unit: f64| {
        let scaled = |x: [f64; 3]| x.map(|x| x * unit);
        let (center, radius) = (scaled([0.1, 0.2, 0.3]), 0.5 * unit);
        let sphere = Sphere::new(center, radius, side).unwrap().curvature(scaled(x), w);
        [sphere, Cylinder::new(center, [1.0, 0.5, 2.0], radius, side).unwrap().curvature(scaled(x), w)]
    };
    for unit in [1e-100, 1e-3, 1e100] {
        for (found, expected) in of(unit).into_iter().zip(of(1.0)) {
            assert!((found * unit / expected - 1.0).abs() < 1e-13, "{unit:e}: {found:e} {expected:e}");
        }
    }
}

/// What `distance` says is the distance from the closest of many points of a body, and its normal points away from it.
fn check_distance<const D: usize>(body: &dyn Obstacle<f64, D>, holds: impl Fn([f64; D]) -> f64, seed: f64) {
    let numbers = noise(200 * D, seed);
    for x in numbers.as_chunks::<D>().0 {
        let x = x.map(|x| 2.0 * x);
        let (distance, normal) = body.distance(x);
        assert!((distance - holds(x)).abs() < 1e-14, "{x:?}: {distance} {}", holds(x));
        let length: f64 = normal.iter().map(|n| n * n).sum();
        assert!((length - 1.0).abs() < 1e-14, "{x:?}");
        // Straight along the normal the distance grows by the way.
        let farther = body.distance(std::array::from_fn(|k| x[k] + 0.1 * normal[k])).0;
        assert!((farther - distance - 0.1).abs() < 1e-14, "{x:?}: {distance} {farther}");
    }
}

#[test]
fn capsules_and_cuboids_have_their_distances() {
    let ends = [[0.3, -0.2, 0.1], [-0.4, 0.5, 0.2]];
    let near = |x: [f64; 3]| {
        // The smallest distance from the axis, found by halving the range of a convex function.
        let at = |s: f64| (0..3).map(|k| (x[k] - ends[0][k] - s * (ends[1][k] - ends[0][k])).powi(2)).sum::<f64>();
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..200 {
            let [a, b] = [(2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0];
            if at(a) < at(b) { high = b } else { low = a }
        }
        at(0.5 * (low + high)).sqrt() - 0.4
    };
    check_distance(&Capsule::new(ends, 0.4).unwrap(), near, 1.3);
    let ball = Sphere::new([0.2, 0.1], 0.4, Side::Outside).unwrap();
    check_distance(&Capsule::new([[0.2, 0.1]; 2], 0.4).unwrap(), |x| ball.distance(x).0, 0.7);

    // A ball rolled over a smaller box.
    let (center, half, radius) = ([0.2, -0.1, 0.3], [0.7, 0.4, 0.9], 0.15);
    let outside = |x: [f64; 3]| {
        let beyond: [f64; 3] = std::array::from_fn(|k| (x[k] - center[k]).abs() - half[k] + radius);
        let squares: f64 = beyond.iter().map(|b| b.max(0.0).powi(2)).sum();
        squares.sqrt() + beyond.iter().fold(f64::NEG_INFINITY, |most, b| most.max(*b)).min(0.0) - radius
    };
    check_distance(&Cuboid::new(center, half, radius).unwrap(), outside, 5.1);
    // On its axis, in its middle, and at no place.
    let rod = Capsule::new([[0.0_f64, 0.0], [2.0, 0.0]], 0.5).unwrap();
    let (depth, normal) = rod.distance([1.0, 0.0]);
    assert_eq!((depth, normal[0].abs(), normal[1].abs()), (-0.5, 0.0, 1.0));
    let plate = Cuboid::new([0.0; 2], [1.0, 0.5], 0.25).unwrap();
    assert_eq!(plate.distance([0.0; 2]), (-0.5, [0.0, 1.0]));
    assert!(plate.distance([0.0, f64::NAN]).0.is_nan() && plate.distance([f64::NAN, 0.0]).0.is_nan());
}

#[test]
fn a_particle_slides_over_a_cuboid_and_a_capsule_and_falls_off() {
    // Where the end of the box begins to turn it leaves along a parabola, too fast for the edge; around the end of the
    // rod it stays until gravity does not hold it, at a height of two thirds of the radius above the middle less
    // v²/(3 g).
    let run = |obstacle: Box<dyn Obstacle<f64, 2>>, start: [f64; 2]| {
        let mut run = Simulation::builder(particles::<2>(1, 10.0), Newmark::trapezoidal(), 1e-3)
            .displacement(start.to_vec())
            .velocity(vec![1.0, 0.0])
            .constraint(on(obstacle, &[[0.0; 2]]))
            .step_control(StepControl::halving(1e-6).unwrap())
            .build()
            .unwrap();
        while run.state().contacts().forces().iter().any(|force| *force > 0.0) || run.time() < 0.1 {
            run.step().unwrap();
            assert!(run.gaps().iter().all(|gap| *gap > -1e-9), "{:?}", run.gaps());
        }
        let [x, y] = [run.state().displacement()[0], run.state().displacement()[1]];
        let v = run.state().velocity();
        let energy = 0.5 * (v[0] * v[0] + v[1] * v[1]) + 10.0 * y;
        (x, y, energy)
    };
    let (x, _, energy) = run(Box::new(Cuboid::new([0.0, -0.5], [0.5, 0.5], 0.05).unwrap()), [0.0, 0.0]);
    assert!((x - 0.45).abs() < 2e-3 && (energy - 0.5).abs() < 1e-9, "{x} {energy}");
    let (_, y, energy) = run(Box::new(Capsule::new([[-1.0, -1.0], [0.5, -1.0]], 1.0).unwrap()), [0.0, 0.0]);
    assert!((y + 1.0 - (2.0 / 3.0 + 1.0 / 30.0)).abs() < 5e-3 && (energy - 0.5).abs() < 1e-3, "{y} {energy}");
}

/// A particle that slides in a bowl is a pendulum.
#[test]
fn a_particle_in_a_bowl_swings_like_a_pendulum() {
    let (radius, g, angle) = (2.0_f64, 10.0, 1.0_f64);
    let run = |h: f64| {
        let bowl = Sphere::new([0.0, radius], radius, Side::Inside).unwrap();
        let start = [radius * angle.sin(), radius * (1.0 - angle.cos())];
        let contact = on(bowl, &[start]);
        let mut run = Simulation::builder(particles::<2>(1, g), Newmark::trapezoidal(), h)
            .constraint(contact)
            .corrector(PersistencyCorrection::new())
            .build()
            .unwrap();
        let (mut deviation, mut force_error, mut turn) = (0.0_f64, 0.0_f64, 0.0);
        let mut previous = 0.0;
        while turn == 0.0 {
            run.step().unwrap();
            let (u, v) = (run.state().displacement(), run.state().velocity());
            let [x, y] = [start[0] + u[0], start[1] + u[1] - radius];
            deviation = deviation.max((x.hypot(y) - radius).abs());
            // N = m g cos θ + m v²/R.
            let exact = g * (-y / radius) + (v[0] * v[0] + v[1] * v[1]) / radius;
            force_error = force_error.max((run.state().contacts().forces()[0] - exact).abs() / exact);
            if v[0] > 0.0 && previous < 0.0 {
                turn = run.time() - h * v[0] / (v[0] - previous);
            }
            previous = v[0];
        }
        (deviation, force_error, turn)
    };
    // Half a period: 2 √(R/g) K(sin θ/2), with the arithmetic–geometric mean.
    let (mut a, mut b) = (1.0, (0.5 * angle).cos());
    for _ in 0..8 {
        (a, b) = (0.5 * (a + b), f64::sqrt(a * b));
    }
    let half = std::f64::consts::PI / a * (radius / g).sqrt();
    let (deviation, force, time) = run(2e-3);
    assert!(deviation < 1e-13, "{deviation:e}");
    // The balance at the end of a step is met on the surface, whatever the step; where the particle is has order 2.
    assert!(force < 1e-12 && (time / half - 1.0).abs() < 1e-5, "{force:e} {time} {half}");
    let (_, coarser_force, coarser) = run(8e-3);
    assert!(coarser_force < 1e-12 && (coarser - half).abs() > 8.0 * (time - half).abs(), "{coarser} {time} {half}");
}

#[test]
fn a_body_rests_on_a_table_that_shakes() {
    // Amplitude and frequency such that the table's acceleration stays below gravity: contact lasts, N = m (g + z̈).
    let (amplitude, omega, g) = (0.01_f64, 20.0_f64, 10.0);
    let table = Plane::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap();
    let motion = move |t: f64| {
        let (s, c) = (omega * t).sin_cos();
        // Begins at rest: z = A (1 − cos ω t).
        let z = [amplitude * (1.0 - c), amplitude * omega * s, amplitude * omega * omega * c];
        z.map(|z| [0.0, 0.0, z])
    };
    let contact = on(table, &[[0.3, 0.2, 0.0]]).moving(motion);
    let mut run = Simulation::builder(particles::<3>(1, g), Composite, 1e-3)
        .constraint(contact)
        .corrector(PersistencyCorrection::with_history_projection())
        .build()
        .unwrap();
    while run.time() < 1.0 {
        run.step().unwrap();
        let [[.., z], [.., v], [.., a]] = motion(run.time());
        let state = run.state();
        assert!((state.displacement()[2] - z).abs() < 1e-14);
        assert!((state.velocity()[2] - v).abs() < 1e-13 && (state.acceleration()[2] - a).abs() < 1e-11);
        assert!((state.contacts().forces()[0] - (g + a)).abs() < 1e-10);
        assert!(state.displacement()[..2].iter().all(|u| *u == 0.0));
    }
    assert!(run.statistics().contact_changes <= 1);
}

#[test]
fn bodies_far_away_are_no_candidates_and_cost_no_contact_problem() {
    // A ball flies over another one, in reach for a short time only.
    let ball = Sphere::new([0.0, 0.0, -1.0], 1.0, Side::Outside).unwrap();
    let nodes: Vec<_> = (0..30).map(|i| [-3.0 - 0.1 * f64::from(i), 0.0, 0.01]).collect();
    let contact = on(ball, &nodes).reach(0.2).unwrap();
    let velocity: Vec<f64> = (0..90).map(|dof| if dof % 3 == 0 { 1.0 } else { 0.0 }).collect();
    let mut run = Simulation::builder(particles::<3>(30, 0.0), Composite, 0.01)
        .velocity(velocity)
        .constraint(contact)
        .build()
        .unwrap();
    let mut most = 0;
    while run.time() < 8.0 {
        run.step().unwrap();
        let candidates = run.gaps().len();
        most = most.max(candidates);
        assert!(run.gaps().iter().all(|gap| *gap < 0.25));
        if run.time() < 2.0 || run.time() > 7.0 {
            assert_eq!(candidates, 0, "{}", run.time());
        }
    }
    assert!(most > 5 && most < 15, "{most}");
    assert_eq!((run.statistics().contact_solves, run.statistics().factorizations), (0, 1));
}

#[test]
fn planes_keep_their_rows() {
    let floor = Plane::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap();
    let mut contact = on(floor, &[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]);
    assert_eq!(contact.search_on(0.0, &[0.0; 6], &[0.0; 6], 0.0).unwrap(), Candidates::Changed);
    assert_eq!(contact.search_on(0.1, &[0.5; 6], &[0.0; 6], 0.0).unwrap(), Candidates::Unchanged);
    // Only the normal dofs are eliminated last.
    assert_eq!(contact.dofs(), [0, 1, 2, 3, 4, 5]);
    assert!((0..6).all(|place| contact.only_reads(place) == (place % 3 < 2)));
}

#[test]
fn obstacles_refuse_what_is_no_geometry() {
    assert!(matches!(Plane::new([0.0; 2], [0.0; 2]), Err(Error::Parameter { .. })));
    assert!(matches!(Plane::new([f64::NAN, 0.0], [0.0, 1.0]), Err(Error::NotFinite { .. })));
    assert!(matches!(Sphere::new([0.0; 3], -1.0, Side::Inside), Err(Error::Parameter { .. })));
    assert!(matches!(
        Cylinder::new([0.0; 3], [0.0, 0.0, f64::INFINITY], 1.0, Side::Inside),
        Err(Error::NotFinite { .. })
    ));
    assert!(matches!(Capsule::new([[0.0; 2], [f64::NAN; 2]], 1.0), Err(Error::NotFinite { .. })));
    assert!(matches!(Capsule::new([[0.0; 2]; 2], 0.0), Err(Error::Parameter { .. })));
    assert!(matches!(Cuboid::new([0.0; 2], [1.0, -1.0], 0.1), Err(Error::Parameter { .. })));
    assert!(matches!(Cuboid::new([0.0; 2], [1.0, 0.5], 0.6), Err(Error::Parameter { .. })));
    assert!(matches!(Cuboid::new([0.0; 2], [1.0; 2], 0.0), Err(Error::Parameter { .. })));
    assert!(matches!(Cuboid::new([f64::INFINITY, 0.0], [1.0; 2], 0.1), Err(Error::NotFinite { .. })));
    let plane = Plane::new([0.0; 2], [0.0, 1e-200]).unwrap();
    assert_eq!(plane.distance([5.0, 2.0]), (2.0, [0.0, 1.0]));
    let built =
        |places: &[[f64; 2]], dofs: &[[usize; 2]], node| NodesOnObstacle::new(plane, places, dofs, &[node]).map(|_| ());
    assert!(matches!(built(&[[f64::NAN, 0.0]], &[[0, 1]], 0), Err(Error::NotFinite { index: 0, .. })));
    assert!(matches!(built(&[[0.0; 2]], &[], 0), Err(Error::Dimension { expected: 1, found: 0, .. })));
    assert!(matches!(built(&[[0.0; 2]], &[[0, 1]], 3), Err(Error::Dimension { found: 3, .. })));
    assert!(on(plane, &[[0.0; 2]]).reach(0.0).is_err());
    let contact = NodesOnObstacle::new(plane, &[[0.0; 2]], &[[6, 7]], &[0]).unwrap();
    let built = Simulation::builder(particles::<2>(1, 0.0), Composite, 0.1).constraint(contact).build();
    assert!(matches!(built, Err(Error::MissingContactDof { constraint: 0, dof: 6, dofs: 2 })));
}

/// Rows and gaps.
fn read<const D: usize>(
    contact: &mut NodesOnObstacle<'_, f64, D>,
    t: f64,
    u: &[f64],
) -> (ContactJacobian<f64>, Vec<f64>) {
    let mut gaps = vec![f64::INFINITY; contact.candidates()];
    contact.gap(t, u, &mut gaps);
    (contact.jacobian(), gaps)
}

/// Follows from one state to another, and compares with a search there.
fn check_follow<const D: usize>(
    make: impl Fn() -> NodesOnObstacle<'static, f64, D>,
    from: &[f64],
    (t, to): (f64, &[f64]),
) {
    let (mut contact, mut fresh) = (make(), make());
    contact.search_on(0.0, from, from, 0.0).unwrap();
    let before = contact.candidates();
    assert_eq!(contact.follow_on(t, to).unwrap(), Candidates::Changed);
    fresh.search_on(t, to, to, 0.0).unwrap();
    assert_eq!(read(&mut contact, t, to), read(&mut fresh, t, to));
    assert!((0..before).all(|row| contact.identity(row) == (row, 0) && contact.magnitude(row) == fresh.magnitude(row)));
    assert_eq!(contact.follow_on(t, to).unwrap(), Candidates::Unchanged);
    assert_eq!(contact.search_on(t, to, to, 0.0).unwrap(), Candidates::Unchanged);
    assert_eq!(contact.follow_on(0.0, from).unwrap(), Candidates::Changed);
    assert_eq!(contact.search_on(t, to, to, 0.0).unwrap(), Candidates::Changed);
}

proptest! {
    #[test]
    fn followed_rows_are_those_of_a_search(seed in 0.0..100.0_f64, t in 0.01..1.0_f64) {
        let places = noise(30, seed);
        let solid: Vec<_> = (0..10).map(|i| [places[3 * i], places[3 * i + 1], places[3 * i + 2]]).collect();
        let flat: Vec<_> = (0..15).map(|i| [places[2 * i], places[2 * i + 1]]).collect();
        let (from, to) = (noise(30, seed + 3.3), noise(30, seed + 5.7));
        for side in [Side::Outside, Side::Inside] {
            let moving = |contact: NodesOnObstacle<'static, f64, 3>| {
                contact.moving(|t| [[0.1 * t, t * t, 0.0], [0.1, 2.0 * t, 0.0], [0.0, 2.0, 0.0]])
            };
            let sphere = Sphere::new([0.1, 0.0, -0.2], 0.7, side).unwrap();
            check_follow(|| moving(on(sphere, &solid)), &from, (t, &to));
            let cylinder = Cylinder::new([0.1, 0.0, -0.2], [1.0, 2.0, -0.5], 0.4, side).unwrap();
            check_follow(|| moving(on(cylinder, &solid)), &from, (t, &to));
            let disc = Sphere::new([0.1, 0.0], 0.7, side).unwrap();
            check_follow(|| on(disc, &flat), &from, (t, &to));
        }
    }
}

#[test]
fn planes_have_nothing_to_follow() {
    let mut contact = on(Plane::new([0.0; 2], [0.6, 0.8]).unwrap(), &[[0.0, 1.0], [1.0, 0.0]]).moving(|t| {
        assert!(t < 1.0, "the motion is not asked for");
        [[0.0, t], [0.0, 1.0], [0.0; 2]]
    });
    let u = [0.3, 0.2, 0.1, -0.4];
    contact.search_on(0.0, &[0.0; 4], &[0.0; 4], 0.0).unwrap();
    let before = read(&mut contact, 0.5, &u);
    assert_eq!(contact.follow_on(1.5, &u).unwrap(), Candidates::Unchanged);
    assert_eq!(before, read(&mut contact, 0.5, &u));
}

#[test]
fn followed_nodes_stay_candidates_out_of_reach() {
    let ball = Sphere::new([0.0; 2], 1.0, Side::Outside).unwrap();
    let mut contact = on(ball, &[[0.0, 1.1], [3.0, 0.0], [1.2, 0.0]]).reach(0.5).unwrap();
    contact.search_on(0.0, &[0.0; 6], &[0.0; 6], 0.0).unwrap();
    let to = [0.0, 3.0, -1.8, 0.0, 0.1, 0.1];
    contact.follow_on(0.0, &to).unwrap();
    assert_eq!((0..2).map(|row| contact.identity(row).0).collect::<Vec<_>>(), [0, 2]);
    assert!((read(&mut contact, 0.0, &to).1[0] - 3.1).abs() < 1e-14);
    assert_eq!(contact.search_on(0.0, &to, &to, 0.0).unwrap(), Candidates::Changed);
    assert_eq!((0..2).map(|row| contact.identity(row).0).collect::<Vec<_>>(), [1, 2]);
}

#[test]
fn trial_states_without_a_distance_have_no_normal_and_are_said_to_have_none() {
    /// A floor that is defined for x > 0 only.
    struct Half;
    impl Obstacle<f64, 2> for Half {
        fn distance(&self, [x, y]: [f64; 2]) -> (f64, [f64; 2]) {
            let root = x.sqrt();
            (y + 0.0 * root, [0.0 * root, 1.0])
        }
    }
    let mut contact = on(Half, &[[1.0, 1.0], [2.0, 1.0]]);
    contact.search_on(0.0, &[0.0; 4], &[0.0; 4], 0.0).unwrap();
    for (to, bad) in [([-2.0, 0.0, 0.0, 0.0], 0), ([0.0, 0.0, f64::NAN, 0.0], 1)] {
        let rows = read(&mut contact, 0.0, &[0.0; 4]).0;
        match contact.follow_on(0.0, &to) {
            Err(Error::ContactNotFinite { what: "the normal", contact, .. }) => assert_eq!(contact.feature, bad),
            other => panic!("{other:?}"),
        }
        assert!(read(&mut contact, 0.0, &to).0 == rows);
        contact.follow_on(0.0, &[0.0; 4]).unwrap();
        assert_eq!(read(&mut contact, 0.0, &[0.0; 4]).1, [1.0, 1.0]);
    }
}
