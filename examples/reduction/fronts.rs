//! Taper and softening in closed form: a front that meets a wall.

use crate::bars::{TAPERED, Table, bathe, phases};
use contact_dynamics_scenes::front::{Front, best_softening, ringing};
use contact_dynamics_scenes::reduced::wall_impact;
use example_support::output::decimal;
use std::fmt::Write;

/// Fronts of tapers beside the measured force of the bar, and the softening of least error for each exponent.
pub(crate) fn fronts(quick: bool) -> Table {
    let modes = if quick { 20 } else { 100 };
    let [frequency, amplitude] = ringing();
    let mut table = format!(
        "A front at a wall in closed form: ∫ |λ/λ_exact − 1| dt times ω_c, overshoot, the largest A; beside it the \
         overshoot of the bar of {modes} modes (ρ∞-Bathe(1), h = 0.25 ms). Untapered, the force rings with {} ω_c and \
         {} % of its exact value\n\n\
         | p | softening | error of the front | overshoot | largest A | measured overshoot |\n\
         | --- | --- | --- | --- | --- | --- |\n",
        decimal(frequency, 3),
        decimal(100.0 * amplitude, 1)
    );
    let phases = phases(quick);
    let softenings: &[f64] = if quick { &[0.0, 2.0] } else { &[0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0] };
    let others: &[[f64; 2]] = if quick { &[] } else { &[[2.0, 2.0], [4.0, 2.0], [6.0, 2.0]] };
    for taper in softenings.iter().map(|&softening| [3.0, softening]).chain(others.iter().copied()) {
        let [exponent, softening] = taper;
        let shape = Front::new(exponent, softening).ok_or("a taper that rings")?.shape();
        let measured = wall_impact(modes + 1, TAPERED, bathe, 2.5e-4, (&phases, taper))?.overshoot;
        let [overshoot, measured] = [shape.overshoot, measured].map(|x| decimal(100.0 * x, 1));
        let [error, amplification] = [shape.error, shape.amplification].map(|x| decimal(x, 3));
        writeln!(table, "| {exponent} | {softening} | {error} | {overshoot} % | {amplification} | {measured} % |")?;
    }
    table += "\nThe softening of least error of the front, for each exponent\n\n\
              | p | softening | error of the front | overshoot |\n| --- | --- | --- | --- |\n";
    let exponents: &[f64] = if quick { &[3.0] } else { &[1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 6.0] };
    for &exponent in exponents {
        let (softening, shape) = best_softening(exponent).ok_or("a taper that rings")?;
        writeln!(
            table,
            "| {exponent} | {} | {} | {} % |",
            decimal(softening, 2),
            decimal(shape.error, 3),
            decimal(100.0 * shape.overshoot, 1)
        )?;
    }
    Ok(table)
}
