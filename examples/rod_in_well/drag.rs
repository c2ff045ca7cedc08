//! The hook load of a rod that moves with a constant velocity, against torque and drag of the soft string.

use contact_dynamics::{
    CdLagrange, ContactStatus, Corrector, GeneralizedAlpha, MoreauJean, Newmark, PersistencyCorrection, Result,
    Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::well::{Rod, ramp};
use example_support::output::decimal;
use std::fmt::Write;

/// The velocity of the top once it moves, and the step.
const VELOCITY: f64 = 0.2;
const STEP: f64 = 1e-2;

type Parts = (Box<dyn TimeIntegrator>, Vec<Box<dyn Corrector<f64>>>);

/// A scheme with its correction, and what tables call them.
#[derive(Clone, Copy)]
pub(crate) struct Way {
    pub(crate) name: &'static str,
    make: fn() -> Result<Parts>,
}

pub(crate) const CORRECTED: Way = Way {
    name: "Chung–Hulbert(0.8), λ_v/λ_a",
    make: || Ok((Box::new(GeneralizedAlpha::chung_hulbert(0.8)?), correction())),
};
pub(crate) const RAW: Way = Way {
    name: "Chung–Hulbert(0.8), raw",
    make: || Ok((Box::new(GeneralizedAlpha::chung_hulbert(0.8)?), Vec::new())),
};
pub(crate) const TRAPEZOIDAL: Way =
    Way { name: "trapezoidal rule, λ_v/λ_a", make: || Ok((Box::new(Newmark::trapezoidal()), correction())) };
pub(crate) const TRAPEZOIDAL_RAW: Way =
    Way { name: "trapezoidal rule, raw", make: || Ok((Box::new(Newmark::trapezoidal()), Vec::new())) };
pub(crate) const MOREAU_JEAN: Way =
    Way { name: "Moreau–Jean(0.5)", make: || Ok((Box::new(MoreauJean::new(0.5)?), Vec::new())) };

pub(crate) const CD_LAGRANGE: Way = Way { name: "CD-Lagrange", make: || Ok((Box::new(CdLagrange), Vec::new())) };

pub(crate) const ALL: [Way; 5] = [CORRECTED, RAW, TRAPEZOIDAL, TRAPEZOIDAL_RAW, MOREAU_JEAN];

fn correction() -> Vec<Box<dyn Corrector<f64>>> {
    vec![Box::new(PersistencyCorrection::with_history_projection())]
}

impl Way {
    /// A run that is steady at the end: the top moves up with the sign +1, down with −1.
    pub(crate) fn steady(self, rod: &Rod, sign: f64, until: f64) -> Result<Simulation<'static, f64>> {
        self.run(rod, STEP, 0.6 * until, ramp(sign * VELOCITY, 0.3 * until))
    }

    /// A run whose weight comes on within `onset`.
    pub(crate) fn run(
        self,
        rod: &Rod,
        h: f64,
        onset: f64,
        hoist: impl Fn(f64) -> [f64; 3] + Send + 'static,
    ) -> Result<Simulation<'static, f64>> {
        let (scheme, correctors) = (self.make)()?;
        rod.run(scheme, correctors, h, onset, hoist)
    }
}

/// How many contacts stick and slide.
pub(crate) fn states(run: &Simulation<'_, f64>) -> [usize; 2] {
    let contacts = run.state().contacts();
    let count = |status| (0..contacts.gaps().len()).filter(|&k| contacts.status(k) == status).count();
    [count(ContactStatus::Sticking), count(ContactStatus::Sliding)]
}

/// Pulled out and run in: mean hook load at the end of a run, its scatter, and the forces on the wall.
pub(crate) fn table(quick: bool) -> Result<String> {
    let (sizes, until): (&[usize], f64) = if quick { (&[40], 4.0) } else { (&[50, 100, 200], 10.0) };
    let mut text = format!(
        "Drill pipe moved at {VELOCITY} m/s, h = {} ms: hook load over that of the soft string, mean of the last \
         tenth of {until} s, its standard deviation over the mean, sum of the forces on the wall over that of the \
         soft string, contacts that stick and slide at the end\n\n| elements | scheme | motion | soft string kN | \
         error % | deviation % | wall force error % | stick | slide |\n|{}\n",
        1e3 * STEP,
        " --- |".repeat(9)
    );
    for &elements in sizes {
        let rod = Rod::drill_pipe(elements);
        let ways: &[Way] = if elements == sizes[0] { &ALL } else { &ALL[..1] };
        for way in ways {
            for (name, sign) in [("out", 1.0_f64), ("in", -1.0)] {
                let profile = rod.soft_string(sign, 4001);
                let (hook, wall) = (profile[0][1], wall_force(&profile));
                let mut run = way.steady(&rod, sign, until)?;
                let mut hooks = Vec::new();
                let mut pressed = 0.0;
                while run.time() < until {
                    run.step()?;
                    if run.time() > 0.9 * until {
                        hooks.push(rod.hook_load(&mut run)?);
                        pressed += run.state().contacts().forces().iter().sum::<f64>();
                    }
                }
                let count = hooks.len() as f64;
                let mean = hooks.iter().sum::<f64>() / count;
                let deviation = (hooks.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt();
                let [stick, slide] = states(&run);
                let percent = |x: f64, digits| decimal(100.0 * x, digits);
                let numbers = [
                    decimal(1e-3 * hook, 1),
                    percent(mean / hook - 1.0, 2),
                    percent(deviation / mean, 2),
                    percent(pressed / count / wall - 1.0, 2),
                ]
                .join(" | ");
                let _ = writeln!(text, "| {elements} | {} | {name} | {numbers} | {stick} | {slide} |", way.name);
            }
        }
    }
    Ok(text)
}

/// ∫ |N| ds of a profile of the soft string.
fn wall_force(profile: &[[f64; 3]]) -> f64 {
    profile.windows(2).map(|pair| 0.5 * (pair[1][0] - pair[0][0]) * (pair[0][2].abs() + pair[1][2].abs())).sum()
}
