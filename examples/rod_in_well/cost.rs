//! What a step costs with all contacts pressed and sliding, beside one bare solve with its effective matrix.

use crate::drag::{ALL, Way};
use contact_dynamics::{GeneralizedAlpha, Result, Simulation, TimeIntegrator};
use contact_dynamics_scenes::well::{Rod, ramp};
use example_support::output::decimal;
use example_support::timing;
use std::fmt::Write;
use std::time::Instant;

pub(crate) fn table(quick: bool) -> Result<String> {
    let (sizes, steps): (&[usize], usize) = if quick { (&[40], 20) } else { (&[50, 100, 200, 400], 50) };
    let mut text = format!(
        "Time of a step in µs, drill pipe that is pulled out, all contacts pressed and sliding (median of {steps} \
         steps): a bare solve, a step without walls, without friction, with friction, and the last one over the \
         solve\n\n| elements | h ms | solve | no walls | no friction | friction | friction, raw | friction/solve | \
         iterations |\n|{}\n",
        " --- |".repeat(9)
    );
    for &elements in sizes {
        let rod = Rod::drill_pipe(elements);
        let h = 2.0 * rod.size() / rod.wave_speed();
        let scheme = || -> Result<Box<dyn TimeIntegrator>> { Ok(Box::new(GeneralizedAlpha::chung_hulbert(0.8)?)) };
        let smooth = Rod { friction: 0.0, ..rod };
        let mut free = rod.scene(scheme()?, h, 0.2, ramp(1.0, 0.1))?.build()?;
        let bare = solve(&rod, h)?;
        let timed = |way: Way, rod: &Rod| -> Result<[f64; 2]> {
            let mut run = way.run(rod, h, 0.2, ramp(1.0, 0.1))?;
            run.run_until(0.3, &mut ())?;
            let before = run.statistics().contact_iterations;
            let time = typical_step(&mut run, steps)?;
            Ok([time, (run.statistics().contact_iterations - before) as f64 / steps as f64])
        };
        let times = [typical_step(&mut free, steps)?, timed(ALL[0], &smooth)?[0]];
        let [with, iterations] = timed(ALL[0], &rod)?;
        let [raw, _] = timed(ALL[1], &rod)?;
        let micro = [bare, times[0], times[1], with, raw].map(|x| decimal(1e6 * x, 1)).join(" | ");
        let step = decimal(1e3 * h, 2);
        let last = [with / bare, iterations].map(|x| decimal(x, 1)).join(" | ");
        let _ = writeln!(text, "| {elements} | {step} | {micro} | {last} |");
    }
    Ok(text)
}

/// Median time of so many steps.
fn typical_step(run: &mut Simulation<'_, f64>, steps: usize) -> Result<f64> {
    let mut times = Vec::with_capacity(steps);
    for _ in 0..steps {
        let start = Instant::now();
        run.step()?;
        times.push(start.elapsed().as_secs_f64());
    }
    Ok(timing::median(&times))
}

/// Time of a solve with the effective matrix of the scheme.
fn solve(rod: &Rod, h: f64) -> Result<f64> {
    let scheme = GeneralizedAlpha::chung_hulbert(0.8)?;
    let a = timing::effective(&rod.stiffness(), &rod.masses(), &scheme, h);
    let mut once = timing::solve(timing::factor(&a, &[]), rod.dofs());
    let times: Vec<_> = (0..200)
        .map(|_| {
            let start = Instant::now();
            once();
            start.elapsed().as_secs_f64()
        })
        .collect();
    Ok(timing::median(&times))
}
