//! A ball, two blocks and a ring that strike, reduced, against the whole models on the same coarse meshes.

use contact_dynamics::reduction::{Boundary, Modes};
use contact_dynamics_scenes::impact_scenes::{Ball, fastest_wave, ring, ring_frequency, two_blocks};
use contact_dynamics_scenes::impacts::{Course, Impact, Model, Step};

const fn reduced(boundary: Boundary, modes: usize) -> Model {
    Model::Reduced { boundary, softening: 2.0, modes }
}

/// Impacts at three instants inside a step of h, at a speed.
fn instants(impact: &Impact, h: f64, speed: f64) -> [Impact; 3] {
    [0.1, 0.4, 0.8].map(|phase| impact.clone().delayed(phase * h * speed))
}

/// The impulses are what changes the momentum of each body, to rounding.
fn assert_momenta(impact: &Impact, course: &Course, signs: &[f64]) {
    for ((part, after), sign) in impact.parts.iter().zip(&course.velocities).zip(signs) {
        let change = part.mass() * (after - part.speed);
        assert!((change - sign * course.impulse).abs() < 1e-8 * course.impulse, "{change} {}", course.impulse);
    }
}

#[test]
fn a_ball_touches_as_its_mesh_by_few_modes_untapered() {
    let ball = Ball::new(0.15, 2, [5, 5, 7]).unwrap();
    let h = ball.hertz.duration() / 100.0;
    let hertz = ball.exact(h);
    for impact in instants(&ball.impact, h, ball.hertz.velocity) {
        let whole = impact.course(Model::Whole, Step::Of(h)).unwrap();
        let untapered = impact.course(reduced(Boundary::Untapered, 10), Step::Of(h)).unwrap();
        let tapered = impact.course(reduced(Boundary::Tapered, 10), Step::Of(h)).unwrap();
        // The mesh has two elements across the contact, of 0.15 of the radius: Hertz has it to some percent.
        assert!((whole.largest() / hertz.largest() - 1.0).abs() < 0.1, "{}", whole.largest() / hertz.largest());
        assert!((whole.last / hertz.last - 1.0).abs() < 0.1, "{} {}", whole.last, hertz.last);
        assert!(untapered.error(&whole) < 0.015, "{}", untapered.error(&whole));
        assert!((untapered.energy - 1.0).abs() < 1e-3, "{}", untapered.energy);
        // What the page warns of.
        assert!(tapered.error(&whole) > 0.4, "{}", tapered.error(&whole));
        for course in [&whole, &untapered, &tapered] {
            assert_momenta(&impact, course, &[1.0]);
        }
    }
}

#[test]
fn two_reduced_blocks_collide_as_their_meshes() {
    let impact = two_blocks(4).unwrap();
    let h = 0.5 / 4.0 / fastest_wave();
    for impact in instants(&impact, h, 1.0) {
        let whole = impact.course(Model::Whole, Step::Of(h)).unwrap();
        let tapered = impact.course(reduced(Boundary::Tapered, 30), Step::Of(h)).unwrap();
        let untapered = impact.course(reduced(Boundary::Untapered, 30), Step::Of(h)).unwrap();
        // The coarse mesh has waves of its own length in the force: what both err is like the error between them.
        assert!(tapered.error(&whole) < 0.2, "{}", tapered.error(&whole));
        assert!(untapered.error(&whole) > 3.0 * tapered.error(&whole), "{}", untapered.error(&whole));
        for ratio in [tapered.impulse / whole.impulse, tapered.largest() / whole.largest(), tapered.energy] {
            assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
        }
        for course in [&whole, &untapered, &tapered] {
            assert_momenta(&impact, course, &[-1.0, 1.0]);
        }
    }
}

/// Too high by what linear elements have of shear in bending, which falls with the square of their size.
#[test]
fn modes_of_a_ring_bend_as_those_of_a_thin_one() {
    let excess = |cells: [usize; 2]| {
        let impact = ring(cells, 0.005, 0.2).unwrap();
        let body = &impact.parts[0].body;
        let modes = Modes::lowest(body.consistent.as_ref(), body.stiffness.as_ref(), &[], 11).unwrap();
        // Three rigid motions, then pairs with n = 2, 3, … waves around.
        [2, 3, 4, 5].map(|n| {
            let [one, other] = [2 * n - 1, 2 * n].map(|k| modes.frequencies()[k] / ring_frequency(n) - 1.0);
            assert!((one - other).abs() < 1e-6, "{n}: {one} {other}");
            one
        })
    };
    for (coarse, fine) in excess([2, 120]).into_iter().zip(excess([4, 240])) {
        assert!(fine > 0.0 && fine < 0.06 && (3.0..5.0).contains(&(coarse / fine)), "{coarse} {fine}");
    }
}

#[test]
fn a_reduced_ring_rebounds_as_its_mesh() {
    let (speed, h) = (0.005, std::f64::consts::TAU / 40.0);
    let impact = ring([1, 40], speed, 0.5).unwrap();
    for impact in instants(&impact, h, speed) {
        let whole = impact.course(Model::Whole, Step::Of(h)).unwrap();
        let tapered = impact.course(reduced(Boundary::Tapered, 30), Step::Of(h)).unwrap();
        let coarse = impact.course(reduced(Boundary::Tapered, 30), Step::Cutoff).unwrap();
        let few = impact.course(reduced(Boundary::Tapered, 5), Step::Of(h)).unwrap();
        let [of_mesh, of_modes, of_long_steps, of_few] =
            [&whole, &tapered, &coarse, &few].map(|course| course.velocities[0] / speed);
        // It rattles: instants inside a step change the rebound of the mesh itself by 0.03.
        assert!((of_modes - of_mesh).abs() < 0.06 && (of_long_steps - of_modes).abs() < 0.02, "{of_mesh} {of_modes}");
        // Rigid motions and one oval cannot bend where the ring touches, and take up too little energy.
        assert!(of_few > of_mesh + 0.08, "{of_few}");
        assert!((tapered.energy - 1.0).abs() < 0.01 && (coarse.energy - 1.0).abs() < 0.01);
        for course in [&whole, &tapered, &coarse, &few] {
            assert_momenta(&impact, course, &[1.0]);
        }
    }
}
