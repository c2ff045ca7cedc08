//! Rigid bodies by generalized coordinates: rolling, spinning, and the rod of Painlevé.

use super::{GRAVITY, masses, run, schemes};
use contact_dynamics::{ContactStatus, Error, LinearRows, Newmark};
use std::f64::consts::TAU;

/// x, y and the angle (counterclockwise) of a round body on a floor.
#[test]
fn spheres_and_discs_roll_after_sliding() {
    let (mass, radius, friction, speed) = (3.0, 0.5, 0.2, 2.0);
    for scheme in schemes().filter(|scheme| scheme.name() != "Moreau–Jean(1)") {
        for (inertia, share) in [(0.4, 2.0 / 7.0), (0.5, 1.0 / 3.0)] {
            let body =
                masses(vec![mass, mass, inertia * mass * radius * radius], vec![0.0, -mass * GRAVITY, 0.0]).unwrap();
            let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(friction, &[&[(0, 1.0), (2, radius)]]);
            let h = 0.0037;
            let mut run = run(body, (scheme.make)(), h, vec![speed, 0.0, 0.0]).constraint(floor).build().unwrap();
            let rolls = share * speed / (friction * GRAVITY);
            while run.state().time() < rolls - 2.0 * h {
                run.step().unwrap();
                let expected = speed - friction * GRAVITY * run.state().time();
                assert!((run.state().velocity()[0] - expected).abs() < 1e-11, "{}", scheme.name());
            }
            run.run_until(2.0 * rolls, &mut ()).unwrap();
            let (v, contacts) = (run.state().velocity(), run.state().contacts());
            assert!((v[0] / (speed * (1.0 - share)) - 1.0).abs() < 1e-12, "{} {}", scheme.name(), v[0]);
            assert!((v[0] + radius * v[2]).abs() < 1e-12 && contacts.slip(0)[0].abs() < 1e-12, "{}", scheme.name());
            assert!(contacts.friction_forces(0)[0].abs() < 1e-9, "{}", scheme.name());
        }
    }
}

/// A disc that spins flat on a floor under its own weight stops after 3 R ω/(4 μ g): all directions of slip at once.
#[test]
fn a_spinning_disc_stops() {
    let (rings, rays, radius, friction, spin) = (5, 12, 1.0, 0.3, 2.0);
    let points = rings * rays;
    // The disc by its angle, its points by their heights, each with its share of the weight (density 1).
    let area = std::f64::consts::PI * radius * radius;
    let share = |ring: usize| area * (2 * ring + 1) as f64 / (rings * rings * rays) as f64;
    let mass = (0..points).map(|k| share(k / rays)).chain([0.5 * area * radius * radius]).collect();
    let force = (0..points).map(|k| -GRAVITY * share(k / rays)).chain([0.0]).collect();
    let floor = (0..points).fold(LinearRows::new(), |rows, k| {
        // The radius at which the ring has its moment.
        let ring = (k / rays) as f64;
        let r = radius / rings as f64 * (2.0 / 3.0) * ((ring + 1.0).powi(3) - ring.powi(3)) / (2.0 * ring + 1.0);
        let (sine, cosine) = (TAU * (k % rays) as f64 / rays as f64 + 0.1).sin_cos();
        let tangents: [&[_]; 2] = [&[(points, -r * sine)], &[(points, r * cosine)]];
        rows.unilateral(&[(k, 1.0)], 0.0).friction(friction, &tangents)
    });
    let velocity = (0..points).map(|_| 0.0).chain([spin]).collect();
    let h = 1e-3;
    let disc = masses(mass, force).unwrap();
    let mut run = run(disc, Box::new(Newmark::trapezoidal()), h, velocity).constraint(floor).build().unwrap();
    let end = 3.0 * radius * spin / (4.0 * friction * GRAVITY);
    while run.state().time() < end - 2.0 * h {
        run.step().unwrap();
        let expected = spin * (1.0 - run.state().time() / end);
        assert!((run.state().velocity()[points] - expected).abs() < 1e-9 * spin, "{}", run.state().time());
    }
    run.run_until(2.0 * end, &mut ()).unwrap();
    assert!(run.state().velocity()[points].abs() < 1e-12);
}

/// Along any direction in space friction is the same, and against the slip.
#[test]
fn the_cone_is_round() {
    let (friction, speed) = (0.4, 1.5);
    for degrees in (0..360).step_by(15) {
        let (sine, cosine) = f64::from(degrees).to_radians().sin_cos();
        let ball = masses(vec![2.0; 3], vec![0.0, 0.0, -2.0 * GRAVITY]).unwrap();
        let floor = LinearRows::new().unilateral(&[(2, 1.0)], 0.0).friction(friction, &[&[(0, 1.0)], &[(1, 1.0)]]);
        let velocity = vec![speed * cosine, speed * sine, 0.0];
        let mut run = run(ball, Box::new(Newmark::trapezoidal()), 0.01, velocity).constraint(floor).build().unwrap();
        run.run_until(0.2, &mut ()).unwrap();
        let (v, expected) = (run.state().velocity(), speed - friction * GRAVITY * 0.2);
        assert!((v[0] - expected * cosine).abs() < 1e-12 && (v[1] - expected * sine).abs() < 1e-12, "{degrees}");
        run.run_until(1.0, &mut ()).unwrap();
        let way = run.state().displacement();
        let stop = speed * speed / (2.0 * friction * GRAVITY);
        assert!((way[0].hypot(way[1]) / stop - 1.0).abs() < 1e-3 && run.state().velocity()[0].abs() < 1e-14);
    }
}

/// A rod that slides on its end, pressed down: where μ |W_nt| exceeds W_nn no force stops its approach as it slides on
/// (Painlevé). At the start it is refused with the numbers. Where it gets there by falling, the end stops at once: an
/// impact without collision, the other solution.
#[test]
fn the_rod_of_painleve() {
    let (mass, half, angle) = (1.0, 1.0, 1.0_f64);
    let (sine, cosine) = angle.sin_cos();
    let inertia = mass * half * half / 3.0;
    let threshold = (1.0 + 3.0 * cosine * cosine) / (3.0 * sine * cosine);
    let build = |friction: f64, gap: f64| {
        // (x, y, angle) of the middle; the end that touches is below it, and slides ahead of it.
        let rod = masses(vec![mass, mass, inertia], vec![0.0, -mass * GRAVITY, 0.0]).unwrap();
        let floor = LinearRows::new()
            .unilateral(&[(1, 1.0), (2, -half * cosine)], gap)
            .friction(friction, &[&[(0, 1.0), (2, half * sine)]]);
        let scheme = Box::new(Newmark::trapezoidal());
        run(rod, scheme, 1e-3, vec![-1.0, 0.0, 0.0]).constraint(floor).build()
    };
    let mut slides = build(0.95 * threshold, 0.0).unwrap();
    slides.step().unwrap();
    assert_eq!(slides.state().contacts().status(0), ContactStatus::Sliding);
    let friction = 1.05 * threshold;
    match build(friction, 0.0) {
        Err(Error::Jammed { friction: found, normal, coupling, .. }) => {
            assert!((found - friction).abs() < 1e-12 && friction * coupling > normal, "{normal} {coupling}");
            let w = [1.0 / mass + half * half * cosine * cosine / inertia, half * half * sine * cosine / inertia];
            assert!((normal / w[0] - 1.0).abs() < 1e-12 && (coupling / w[1] - 1.0).abs() < 1e-12);
        }
        Ok(_) => panic!("taken"),
        Err(other) => panic!("{other}"),
    }
    let mut falls = build(friction, 1e-4).unwrap();
    falls.run_until(0.01, &mut ()).unwrap();
    let (v, contacts) = (falls.state().velocity(), falls.state().contacts());
    assert!((v[0] + half * sine * v[2]).abs() < 1e-12 && contacts.closed()[0], "{v:?}");
}
