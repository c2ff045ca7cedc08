//! Impacts by explicit steps.

use crate::{Anything, Row};
use contact_dynamics::{Preset, Simulation};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::masses::MassMatrix;
use contact_dynamics_scenes::measure::{figures, record_run};

/// Largest force over F₀ and mean loss of energy of the paper's bars by the explicit preset, over the phases of the
/// impact.
fn impact(n: usize, courant: f64, phases: u32) -> Result<String, Anything> {
    let (mut largest, mut loss) = (0.0_f64, 0.0);
    for k in 0..phases {
        let h = courant * 10.0 / n as f64 / 100.0;
        let bars = Bars::paper(n).delayed((f64::from(k) + 0.5) / f64::from(phases), h);
        let body = bars.body();
        let (m, k) = (body.consistent.as_ref(), body.stiffness.symbolic());
        let preset = Preset::explicit();
        let mass = preset.mass(m, k, &body.contact, &body.groups, courant)?;
        let mut run = Simulation::builder(bars.system_with(MassMatrix::Matrix(mass)), preset.integrator(), h)
            .velocity(bars.velocities())
            .constraint(bars.contact())
            .correctors(preset.correctors())
            .build()?;
        let found = figures(&bars, &record_run(&bars, &mut run, 0.4), h);
        largest = largest.max(found.force_max);
        loss += (1.0 - found.energy) / f64::from(phases);
    }
    Ok(format!("{largest:.2} F₀, {:.3} %", 100.0 * loss))
}

pub(crate) fn cases(quick: bool) -> Result<Vec<Row>, Anything> {
    let phases = if quick { 2 } else { 10 };
    let scenes = [(20, 0.1, "5.00 F₀, 2.493 %"), (100, 0.2, "2.50 F₀, 0.495 %"), (400, 0.9, "1.07 F₀, 0.088 %")];
    let case = |(n, courant, before)| {
        let case =
            format!("`Preset::explicit()`, bars of {n} elements, Courant number {courant}: largest force, energy lost");
        Ok(Row { case, before, now: impact(n, courant, phases)? })
    };
    scenes.into_iter().map(case).collect()
}
