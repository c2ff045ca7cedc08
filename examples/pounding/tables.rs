//! The tables of the frames: what the models say when steps are fine, what coarse steps make of it, and what the
//! stiffness of a contact does.

use crate::models::{self, Model, Scheme};
use contact_dynamics::Result;
use contact_dynamics_scenes::damped_contact::{damping_ratio, restitution_of_hertz_damp, restitution_without_pull};
use contact_dynamics_scenes::frames::{Figures, Frames};
use contact_dynamics_scenes::ground::{GRAVITY, Ground};
use contact_dynamics_scenes::pounding::{Impacts, Pounding};
use example_support::output::decimal;
use std::fmt::Write;
use std::sync::Arc;

/// Steps in seconds.
const STEPS: [f64; 4] = [10e-3, 5e-3, 2e-3, 1e-3];

/// Two frames, a ground motion, and how far to go.
pub(crate) struct Study {
    pub(crate) frames: Frames,
    pub(crate) ground: Arc<Ground>,
    /// The end of runs (s).
    pub(crate) until: f64,
    /// Step of the references.
    pub(crate) fine: f64,
    /// How often a run is timed.
    repetitions: usize,
}

impl Study {
    pub(crate) fn new(quick: bool) -> Self {
        let (until, fine, repetitions) = if quick { (4.0, 1e-3, 1) } else { (15.0, 1e-3 / 16.0, 5) };
        let ground = Arc::new(Ground::kanai_tajimi(2, 0.35 * GRAVITY, until));
        Self { frames: Frames::of_the_study(), ground, until, fine, repetitions }
    }

    /// All tables of the frames.
    pub(crate) fn tables(&self) -> Result<Vec<String>> {
        let models = models::all(&self.frames);
        let references: Result<Vec<_>> = models.iter().map(|model| self.figures(model, self.fine)).collect();
        let references = references?;
        Ok(vec![self.references(&models, &references)?, self.errors(&models, &references)?, self.stiffnesses()?])
    }

    pub(crate) fn figures(&self, model: &Model, h: f64) -> Result<Figures> {
        Ok(self.frames.figures(&model.run(&self.frames, &self.ground, h, self.until)?))
    }

    /// All models at the finest step.
    fn references(&self, models: &[Model], references: &[Figures]) -> Result<String> {
        let mut text = format!(
            "All models, h = {} ms: impacts, peak force (MN), hardest impact and sum of impulses (MN s), largest \
             displacement of the floors of the highest contact toward the other frame (mm), largest drift of each \
             storey (mm)\n\n| model | scheme | impacts | force | hardest | impulses | left | right |",
            1e3 * self.fine
        );
        let [left, right] = self.frames.frames.map(|frame| frame.storeys);
        text.extend((1..=left).map(|storey| format!(" L{storey} |")));
        text.extend((1..=right).map(|storey| format!(" R{storey} |")));
        let _ = writeln!(text, "\n|{}", " --- |".repeat(8 + left + right));
        let none = Model { name: "no contact", scheme: Scheme::Trapezoidal, pounding: Pounding::None };
        let alone = self.figures(&none, self.fine)?;
        for (model, figures) in models.iter().zip(references).chain([(&none, &alone)]) {
            let Figures { impacts: Impacts { count, force, impulse, hardest }, toward, drifts, .. } = figures;
            let _ = write!(text, "| {} | {} | {count} |", model.name, model.scheme.name());
            let numbers = [1e-6 * force, 1e-6 * hardest, 1e-6 * impulse];
            text.extend(numbers.map(|x| format!(" {} |", decimal(x, 2))));
            text.extend(toward.iter().chain(drifts).map(|x| format!(" {} |", decimal(1e3 * x, 1))));
            text.push('\n');
        }
        Ok(text)
    }

    /// Errors of the models against their own references, by step.
    fn errors(&self, models: &[Model], references: &[Figures]) -> Result<String> {
        let mut text = format!(
            "Errors against the model's own figures at h = {} ms, in percent: impacts counted, peak force, sum of \
             impulses, worst drift of a storey; and the time of a step\n\n| model | scheme | h ms | impacts | force | \
             impulses | drift | µs/step |\n|{}\n",
            1e3 * self.fine,
            " --- |".repeat(8)
        );
        for (model, reference) in models.iter().zip(references) {
            for h in STEPS {
                let mut figures = self.figures(model, h)?;
                for _ in 1..self.repetitions {
                    figures.seconds = figures.seconds.min(self.figures(model, h)?.seconds);
                }
                let error = |found: f64, exact: f64| 100.0 * (found / exact - 1.0);
                let drifts = figures.drifts.iter().zip(&reference.drifts).map(|(&found, &exact)| error(found, exact));
                let worst = drifts.fold(0.0, |worst: f64, own| if own.abs() > worst.abs() { own } else { worst });
                let _ = writeln!(
                    text,
                    "| {} | {} | {} | {} | {} | {} | {} | {} |",
                    model.name,
                    model.scheme.name(),
                    1e3 * h,
                    figures.impacts.count,
                    decimal(error(figures.impacts.force, reference.impacts.force), 1),
                    decimal(error(figures.impacts.impulse, reference.impacts.impulse), 1),
                    decimal(worst, 1),
                    decimal(1e6 * figures.seconds, 2)
                );
            }
        }
        Ok(text)
    }

    /// What the stiffness of the contact does to its figures.
    fn stiffnesses(&self) -> Result<String> {
        let mut text = format!(
            "Linear spring, and Kelvin–Voigt with e = 0.65, by stiffness, h = {} ms: impacts, peak force (MN), hardest \
             impact and sum of impulses (MN s), largest drift of each frame (mm)\n\n| stiffness MN/m | model | impacts \
             | force | hardest | impulses | left | right |\n|{}\n",
            1e3 * self.fine,
            " --- |".repeat(8)
        );
        let storeys = self.frames.frames[0].storeys;
        for factor in [0.1, 1.0, 10.0, 100.0] {
            let stiffness = factor * models::STIFFNESS[0];
            for model in [models::linear(stiffness), models::kelvin_voigt(&self.frames, stiffness)] {
                let Figures { impacts: Impacts { count, force, impulse, hardest }, drifts, .. } =
                    self.figures(&model, self.fine)?;
                let numbers = [force, hardest, impulse].map(|x| decimal(1e-6 * x, 2)).join(" | ");
                let (left, right) = drifts.split_at(storeys);
                let largest = [left, right]
                    .map(|drifts| decimal(1e3 * drifts.iter().copied().fold(0.0, f64::max), 1))
                    .join(" | ");
                let (stiffness, name) = (1e-6 * stiffness, model.name);
                let _ = writeln!(text, "| {stiffness} | {name} | {count} | {numbers} | {largest} |");
            }
        }
        Ok(text)
    }
}

/// What two free masses keep of their approach under the damped laws, by the coefficient that was put in.
pub(crate) fn restitutions() -> String {
    let mut text = String::from(
        "Restitution of two free masses by the e put in (closed forms)\n\n| e | Kelvin–Voigt, without pull | Hertz, \
         damped |\n| --- | --- | --- |\n",
    );
    for nominal in [0.4, 0.5, models::RESTITUTION, 0.8, 0.9] {
        let found = [restitution_without_pull(damping_ratio(nominal)), restitution_of_hertz_damp(nominal)];
        let _ = writeln!(text, "| {nominal} | {} |", found.map(|e| decimal(e, 3)).join(" | "));
    }
    text
}
