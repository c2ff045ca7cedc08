//! Small cases with exact solutions: a block on an incline, one that stops, the Coulomb oscillator, bodies that roll, a
//! disc that spins flat on a floor.

use crate::rows::{BATHE, CD_LAGRANGE, COMPOSITE, MOREAU_JEAN, Scheme, TRAPEZOIDAL, Table};
use contact_dynamics::{LinearRows, LinearSystem, Result, Simulation, TimeIntegrator};
use contact_dynamics_scenes::sparse::{diagonal, matrix};
use std::f64::consts::{PI, TAU};

const GRAVITY: f64 = 10.0;

/// A case: the heading of its column, the digits, and what is measured; with `true` (quick) of fewer or smaller runs.
type Case = (&'static str, i32, fn(Scheme, bool) -> Result<f64>);

const CASES: [Case; 9] = [
    ("incline: a", -2, |scheme, _| incline(scheme)),
    ("stop: way %", 4, stop),
    ("oscillator: h = 0.02", -2, |scheme, quick| oscillator(scheme, 0.02, quick)),
    ("0.01", -2, |scheme, quick| oscillator(scheme, 0.01, quick)),
    ("0.005", -2, |scheme, quick| oscillator(scheme, 0.005, quick)),
    ("order", 2, order),
    ("sphere: v", -2, |scheme, _| rolling(scheme, 0.4)),
    ("disc: v", -2, |scheme, _| rolling(scheme, 0.5)),
    ("spinning disc: ω", -2, spinning),
];

pub(crate) fn tables(quick: bool) -> Vec<String> {
    let title = "Exact cases: errors of the acceleration of a block down an incline; of its way until it stops (worst \
                 phase); of the Coulomb oscillator after three half swings, with the order; of the velocity of bodies \
                 that come to roll; of the stopping law of a disc that spins flat on a floor";
    let head: Vec<&str> = ["scheme"].into_iter().chain(CASES.map(|(heading, ..)| heading)).collect();
    let mut table = Table::new(title, &head);
    for scheme in [TRAPEZOIDAL, COMPOSITE, BATHE, CD_LAGRANGE, MOREAU_JEAN] {
        table.row(&[scheme.name], CASES.map(|(_, digits, _)| digits), vec![measured(scheme, quick)]);
    }
    vec![table.text()]
}

fn measured(scheme: Scheme, quick: bool) -> Result<[f64; 9]> {
    let mut numbers = [0.0; 9];
    for (number, (.., case)) in numbers.iter_mut().zip(CASES) {
        *number = case(scheme, quick)?;
    }
    Ok(numbers)
}

/// Masses without springs, each under a constant force, on a floor.
fn masses(
    scheme: Scheme,
    h: f64,
    masses: Vec<f64>,
    forces: Vec<f64>,
    velocity: Vec<f64>,
    floor: LinearRows<'static, f64>,
) -> Result<Simulation<'static, f64>> {
    let none = diagonal(&vec![0.0; masses.len()]);
    let system = LinearSystem::lumped(masses, none)?.load(move |_, f| f.copy_from_slice(&forces));
    let integrator: Box<dyn TimeIntegrator> = (scheme.make)();
    Simulation::builder(system, integrator, h).velocity(velocity).constraint(floor).build()
}

/// A block, x along the slope and y off it.
fn block(scheme: Scheme, h: f64, slope: f64, friction: f64, velocity: f64) -> Result<Simulation<'static, f64>> {
    let mass = 2.0;
    let weight = [mass * GRAVITY * slope.sin(), -mass * GRAVITY * slope.cos()];
    let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(friction, &[&[(0, 1.0)]]);
    masses(scheme, h, vec![mass; 2], weight.into(), vec![velocity, 0.0], floor)
}

/// Error of the acceleration of a block that slides down, from its velocity after a second.
fn incline(scheme: Scheme) -> Result<f64> {
    let (slope, friction) = (0.5_f64, 0.3);
    let mut run = block(scheme, 0.01, slope, friction, 0.0)?;
    run.run_until(1.0, &mut ())?;
    Ok((run.state().velocity()[0] / (GRAVITY * (slope.sin() - friction * slope.cos())) - 1.0).abs())
}

/// Largest error of the way of a block until it stops, in percent, over phases of the stop in its step.
fn stop(scheme: Scheme, quick: bool) -> Result<f64> {
    let (h, friction) = (0.01, 0.25);
    let phases = if quick { 2 } else { 10 };
    let mut worst = 0.0_f64;
    for phase in 0..phases {
        // 40 steps and a part of one.
        let velocity = friction * GRAVITY * h * (40.0 + f64::from(phase) / f64::from(phases));
        let mut run = block(scheme, h, 0.0, friction, velocity)?;
        run.run_until(0.6, &mut ())?;
        let way = velocity * velocity / (2.0 * friction * GRAVITY);
        worst = worst.max(100.0 * (run.state().displacement()[0] / way - 1.0).abs());
    }
    Ok(worst)
}

/// ẍ + x = −f sign ẋ from rest at 1 with f = 0.15: after turns at −0.7 and 0.4 it rests at −0.1. Mean error over steps
/// within a percent of h, for the phases in which it turns.
fn oscillator(scheme: Scheme, h: f64, quick: bool) -> Result<f64> {
    let steps = if quick { 2 } else { 10 };
    let mut error = 0.0;
    for k in 0..steps {
        let h = h * (1.0 + 0.01 * f64::from(k) / f64::from(steps));
        let system = LinearSystem::lumped(vec![1.0; 2], matrix(2, [(0, 0, 1.0), (1, 1, 0.0)]))?;
        let system = system.load(|_, f| f[1] = -GRAVITY);
        let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(0.15 / GRAVITY, &[&[(0, 1.0)]]);
        let mut run = Simulation::builder(system, (scheme.make)(), h)
            .displacement(vec![1.0, 0.0])
            .velocity(vec![0.0; 2])
            .constraint(floor)
            .build()?;
        run.run_until(12.0, &mut ())?;
        error += (run.state().displacement()[0] + 0.1).abs() / f64::from(steps);
    }
    Ok(error)
}

/// The order between the longest and the shortest step.
fn order(scheme: Scheme, quick: bool) -> Result<f64> {
    Ok(0.5 * (oscillator(scheme, 0.02, quick)? / oscillator(scheme, 0.005, quick)?).log2())
}

/// Error of the velocity of a round body that slides at first, with this moment of inertia over m R².
fn rolling(scheme: Scheme, inertia: f64) -> Result<f64> {
    let (mass, radius, friction, speed) = (3.0, 0.5, 0.2, 2.0);
    // x, y and the angle (counterclockwise).
    let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(friction, &[&[(0, 1.0), (2, radius)]]);
    let body = vec![mass, mass, inertia * mass * radius * radius];
    let mut run = masses(scheme, 0.0037, body, vec![0.0, -mass * GRAVITY, 0.0], vec![speed, 0.0, 0.0], floor)?;
    run.run_until(1.0, &mut ())?;
    Ok((run.state().velocity()[0] / (speed / (1.0 + inertia)) - 1.0).abs())
}

/// A disc stops after 3 R ω/(4 μ g) under its own weight: the largest error of its velocity until then, over the first.
fn spinning(scheme: Scheme, quick: bool) -> Result<f64> {
    let (rings, rays, radius, friction, spin) = if quick { (2, 6, 1.0, 0.3, 2.0) } else { (5, 12, 1.0, 0.3, 2.0) };
    let points = rings * rays;
    // The disc by its angle, its points by their heights, each with its share of the weight (density 1).
    let area = PI * radius * radius;
    let share = |k: usize| area * (2 * (k / rays) + 1) as f64 / (rings * rings * rays) as f64;
    let mass = (0..points).map(share).chain([0.5 * area * radius * radius]).collect();
    let force = (0..points).map(|k| -GRAVITY * share(k)).chain([0.0]).collect();
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
    let mut run = masses(scheme, h, mass, force, velocity, floor)?;
    let end = 3.0 * radius * spin / (4.0 * friction * GRAVITY);
    let mut worst = 0.0_f64;
    while run.state().time() < end - 2.0 * h {
        run.step()?;
        let expected = spin * (1.0 - run.state().time() / end);
        worst = worst.max((run.state().velocity()[points] - expected).abs() / spin);
    }
    Ok(worst)
}
