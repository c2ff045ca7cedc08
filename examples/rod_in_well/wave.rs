//! A straight rod on a level bed, pulled suddenly: the front of the wave that friction stops.

use crate::drag::{CD_LAGRANGE, CORRECTED, MOREAU_JEAN, RAW, TRAPEZOIDAL, TRAPEZOIDAL_RAW};
use contact_dynamics::Result;
use contact_dynamics_scenes::well::{Rod, Well};
use example_support::output::decimal;
use std::f64::consts::FRAC_PI_2;
use std::fmt::Write;

/// When the pull begins; the weight is on before.
pub(crate) const START: f64 = 0.5;

/// The velocity of the pull.
const VELOCITY: f64 = 0.4;

/// Drill pipe on a level bed, 1500 m, with a friction of 0.5.
pub(crate) fn rod(elements: usize) -> Rod {
    let well = Well { kick_off: 0.0, radius: 1e3, inclination: [FRAC_PI_2; 2] };
    Rod { well, length: 1500.0, friction: 0.5, ..Rod::drill_pipe(elements) }
}

/// The pull from the start on.
pub(crate) fn pull(t: f64) -> [f64; 3] {
    if t > START { [VELOCITY * (t - START), VELOCITY, 0.0] } else { [0.0; 3] }
}

/// A time, this part of that at which the front stops, and the velocities along the rod then.
pub(crate) fn exact(rod: &Rod, part: f64) -> (f64, Vec<(f64, f64)>) {
    let (c, q) = (rod.wave_speed(), rod.friction * rod.weight);
    let stop = 2.0 * rod.density * c * VELOCITY / q;
    let front = part * stop;
    let last = VELOCITY * (1.0 - front / stop);
    (front / c, vec![(0.0, VELOCITY), (front, last), (front, 0.0), (rod.length, 0.0)])
}

/// Until the front stops at 2 ρA c V/q the hook pulls with ρA c V + q c t/2, and the velocity behind the front is
/// V − q x/(2 ρA c): mean errors of both.
pub(crate) fn table(quick: bool) -> Result<String> {
    let sizes: &[usize] = if quick { &[60] } else { &[75, 150, 300] };
    let exact = rod(sizes[0]);
    let (c, q) = (exact.wave_speed(), exact.friction * exact.weight);
    let impedance = exact.density * c;
    let stop = 2.0 * impedance * VELOCITY / q;
    let mut text = format!(
        "Rod on a level bed pulled with {VELOCITY} m/s from rest: mean error of the hook load over its value at the \
         start, {} kN, until friction has stopped the front after {} m and {} ms; mean error of the velocity along the \
         rod, half way, over that of the pull; depth that has moved by 1 mm when the front stops\n\n| elements | h \
         ms | scheme | hook % | velocity % | moved m |\n|{}\n",
        decimal(1e-3 * impedance * VELOCITY, 2),
        decimal(stop, 0),
        decimal(1e3 * stop / c, 1),
        " --- |".repeat(6)
    );
    for &elements in sizes {
        let rod = rod(elements);
        let implicit = [CORRECTED, RAW, TRAPEZOIDAL, TRAPEZOIDAL_RAW, MOREAU_JEAN].map(|way| (way, 0.5));
        for (way, courant) in implicit.into_iter().chain([(CD_LAGRANGE, 0.5), (CD_LAGRANGE, 1.0)]) {
            let h = courant * rod.size() / c;
            let mut run = way.run(&rod, h, 0.2, pull)?;
            run.run_until(START, &mut ())?;
            let (mut hook, mut count, mut velocity) = (0.0, 0, None);
            while run.time() < START + stop / c {
                run.step()?;
                let t = run.time() - START;
                if t <= 0.0 {
                    continue;
                }
                let found = rod.hook_load(&mut run)?;
                hook += (found / (impedance * VELOCITY) - 1.0 - 0.5 * q * c * t / (impedance * VELOCITY)).abs();
                count += 1;
                if velocity.is_none() && t >= 0.5 * stop / c {
                    let v = run.state().velocity();
                    let behind = (1..=elements).filter(|&node| rod.depth(node) < c * t);
                    let error = |node| (-rod.way(node, v) - VELOCITY + q * rod.depth(node) / (2.0 * impedance)).abs();
                    let errors: Vec<_> = behind.map(error).collect();
                    velocity = Some(errors.iter().sum::<f64>() / errors.len() as f64 / VELOCITY);
                }
            }
            let u = run.state().displacement();
            let moved = (0..=elements).rev().find(|&node| -rod.way(node, u) > 1e-3).map_or(0.0, |node| rod.depth(node));
            let numbers = [100.0 * hook / f64::from(count), 100.0 * velocity.unwrap_or(f64::NAN)]
                .map(|x| decimal(x, 2))
                .join(" | ");
            let step = decimal(1e3 * h, 3);
            let _ = writeln!(text, "| {elements} | {step} | {} | {numbers} | {} |", way.name, decimal(moved, 0));
        }
    }
    Ok(text)
}
