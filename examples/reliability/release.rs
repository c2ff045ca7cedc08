//! Energy after an impact with `Release`, whatever the phase.

use super::{Anything, Row};
use contact_dynamics::corrector::Release;
use contact_dynamics::{Bathe, Bdf2, Newmark, Park, PersistencyCorrection, Simulation, TimeIntegrator};
use contact_dynamics_scenes::Bars;

type Make = fn() -> Result<Box<dyn TimeIntegrator>, Anything>;

/// Energies at the end with release less those without it, over those at the start: least and largest over phases; and
/// the largest with release.
fn energies(make: Make, n: u32, phases: u32) -> Result<String, Anything> {
    let run = |phase: f64, release: bool| -> Result<f64, Anything> {
        let h = 0.05 / f64::from(n);
        let bars = Bars::paper(n as usize).delayed(phase, h);
        let builder = Simulation::builder(bars.system::<f64>(), make()?, h)
            .velocity(bars.velocities())
            .constraint(bars.contact())
            .corrector(PersistencyCorrection::with_history_projection());
        let mut run = if release { builder.corrector(Release) } else { builder }.build()?;
        let start = run.energy().total();
        run.run_until(0.45, &mut ())?;
        Ok(run.energy().total() / start)
    };
    let (mut least, mut most, mut highest) = (f64::INFINITY, 0.0_f64, 0.0_f64);
    for i in 0..phases {
        let phase = (f64::from(i) + 0.5) / f64::from(phases);
        let (with, without) = (run(phase, true)?, run(phase, false)?);
        (least, most, highest) = (least.min(with - without), most.max(with - without), highest.max(with));
    }
    Ok(format!("{:+.2} to {:+.2} %, at most {highest:.4} E₀", 100.0 * least, 100.0 * most))
}

pub(crate) fn cases(quick: bool) -> Result<Vec<Row>, Anything> {
    let phases = if quick { 4 } else { 10 };
    let schemes: [(Make, &str); 4] = [
        (|| Ok(Box::new(Bathe::with_radius(1.0)?)), BEFORE[0]),
        (|| Ok(Box::new(Park)), BEFORE[1]),
        (|| Ok(Box::new(Bdf2)), BEFORE[2]),
        (|| Ok(Box::new(Newmark::trapezoidal())), BEFORE[3]),
    ];
    schemes
        .into_iter()
        .map(|(make, before)| {
            let case = format!("two bars, n = 20, {}: what release adds to the energy", make()?.name());
            Ok(Row { case, before, now: energies(make, 20, phases)? })
        })
        .collect()
}

const BEFORE: [&str; 4] = [
    "-0.12 to +1.60 %, at most 0.9907 E₀",
    "+0.08 to +4.46 %, at most 1.0089 E₀",
    "+0.01 to +3.93 %, at most 0.9766 E₀",
    "+0.02 to +2.03 %, at most 0.9948 E₀",
];
