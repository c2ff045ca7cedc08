//! A block on a shaken floor: its slip reverses twice a second, and the error control finds the instants.

use super::masses;
use contact_dynamics::{LinearRows, Simulation, StepControl, TimeIntegrator, analysis};
use contact_dynamics_scenes::schemes::correctable;
use std::f64::consts::TAU;

const GRAVITY: f64 = 9.81;
const FRICTION: f64 = 0.2;
/// The floor accelerates with this share of gravity times sin 2πt.
const SHAKING: f64 = 0.5;
const END: f64 = 3.0;

/// Displacement of the block on the floor at the end, in closed form. The block slides as soon as the floor accelerates
/// with μ g. From a reversal at t₀ on, its slip is w = A/(2π) (cos 2πt − cos 2πt₀) ∓ μ g (t − t₀), until that vanishes;
/// at each reversal the floor accelerates with more than μ g, so that the block never sticks again.
fn exact() -> f64 {
    let (amplitude, deceleration) = (SHAKING * GRAVITY / TAU, FRICTION * GRAVITY);
    let (mut start, mut way, mut sign) = ((FRICTION / SHAKING).asin() / TAU, 0.0, -1.0);
    loop {
        let cosine = (TAU * start).cos();
        let slip = |t: f64| amplitude * ((TAU * t).cos() - cosine) - sign * deceleration * (t - start);
        let moved = |t: f64| {
            let shaken = ((TAU * t).sin() - (TAU * start).sin()) / TAU - cosine * (t - start);
            amplitude * shaken - 0.5 * sign * deceleration * (t - start).powi(2)
        };
        // Slip grows and falls once between two reversals, which are more than 0.3 apart and less than 0.8.
        let (mut before, mut after) = (start + 0.3, start + 0.8);
        for _ in 0..60 {
            let middle = 0.5 * (before + after);
            *(if sign * slip(middle) > 0.0 { &mut before } else { &mut after }) = middle;
        }
        if after > END {
            return way + moved(END);
        }
        (start, way, sign) = (after, way + moved(after), -sign);
    }
}

/// The block in the frame of the floor, which is shaken from `start` on: its displacement `END` later, and the number
/// of steps.
fn shaken(scheme: Box<dyn TimeIntegrator>, h: f64, start: f64, control: Option<StepControl>) -> (f64, u64) {
    let system = masses(vec![1.0; 2], vec![0.0; 2]).unwrap().load(move |t, f| {
        f[0] = -SHAKING * GRAVITY * (TAU * (t - start).max(0.0)).sin();
        f[1] = -GRAVITY;
    });
    let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(FRICTION, &[&[(0, 1.0)]]);
    let builder = Simulation::builder(system, scheme, h).constraint(floor);
    let mut run = match control {
        Some(control) => builder.step_control(control),
        None => builder,
    }
    .build()
    .unwrap();
    run.land_on(start + END, &mut ()).unwrap();
    let statistics = run.statistics();
    assert_eq!(statistics.coarse_steps, 0);
    (run.state().displacement()[0], statistics.steps)
}

/// With a tolerance of 1e-5 m the displacement is right to 1e-3 of itself, wherever in a step the slip reverses.
/// Steps of fixed size miss it by several percent.
#[test]
fn error_control_finds_the_reversals_of_slip() {
    let (h, exact) = (2.5e-3, exact());
    assert!((exact + 0.104_950).abs() < 1e-6, "{exact}");
    let control = StepControl::halving(1e-8).unwrap().local_error(1e-5).unwrap();
    let (mut worst, mut worst_fixed) = (0.0_f64, 0.0_f64);
    for listed in correctable().filter(|listed| analysis::local_error(&(listed.make)().tableau()).is_some()) {
        for phase in [0.0, 0.31, 0.5, 0.77] {
            let (x, steps) = shaken((listed.make)(), h, phase * h, Some(control));
            let error = (x / exact - 1.0).abs();
            assert!(error < 1e-3, "{}, phase {phase}: {error:e} in {steps} steps", listed.name());
            // 1200 nominal steps, and 20 to 30 for each of the reversals.
            assert!(steps < 1400, "{}, phase {phase}: {steps} steps", listed.name());
            worst = worst.max(error);
        }
        let (x, _) = shaken((listed.make)(), h, 0.0, None);
        worst_fixed = worst_fixed.max((x / exact - 1.0).abs());
    }
    println!("largest error {worst:.1e}, with fixed steps {worst_fixed:.1e}");
    assert!(worst_fixed > 2e-2, "{worst_fixed:e}");
}
