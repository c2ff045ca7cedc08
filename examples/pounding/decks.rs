//! Two bridge decks: elastic bodies, whose peak force is a figure of their own.

use crate::deck_models::Decks;
use crate::models::{RESTITUTION, Scheme};
use contact_dynamics::{ContactLaw, Preset, Result};
use contact_dynamics_scenes::damped_contact::DampedLaw;
use contact_dynamics_scenes::ground::{GRAVITY, Ground};
use contact_dynamics_scenes::pounding::{Impacts, Pounding, Record};
use example_support::output::decimal;
use std::fmt::Write;
use std::sync::Arc;

/// Elements of the shorter deck, in the table and for the reference.
const ELEMENTS: [usize; 2] = [20, 80];

/// Steps in seconds; the last one is below the limit of explicit schemes.
const STEPS: [f64; 3] = [5e-3, 1e-3, 5e-4];

/// A preset, or a scheme with a contact law.
#[derive(Clone, Copy)]
enum Way {
    Preset(fn() -> Preset),
    Law(Scheme, Pounding),
}

/// The decks with the ground that shakes them.
pub(crate) struct Bridge {
    decks: [Decks; 2],
    ground: Arc<Ground>,
    until: f64,
    fine: f64,
}

impl Bridge {
    pub(crate) fn new(quick: bool) -> Self {
        let (until, fine, elements) = if quick { (4.0, 1e-3, [10, 20]) } else { (15.0, 1e-3 / 16.0, ELEMENTS) };
        let ground = Arc::new(Ground::kanai_tajimi(2, 0.35 * GRAVITY, until));
        Self { decks: elements.map(Decks::of_the_study), ground, until, fine }
    }

    /// Stiffness of a spring that engineers put in for the decks: EA/L of the shorter one.
    fn stiffness(&self) -> f64 {
        self.decks[0].stretching / self.decks[0].decks[1].length
    }

    fn ways(&self) -> Vec<(String, Way)> {
        let rigid = Pounding::Law(ContactLaw::Rigid);
        let mut ways = vec![
            ("preset conservative".into(), Way::Preset(Preset::conservative)),
            ("preset smooth".into(), Way::Preset(Preset::smooth)),
            ("preset explicit".into(), Way::Preset(Preset::explicit)),
        ];
        for scheme in [Scheme::TrapezoidalCorrected, Scheme::ChungHulbertCorrected, Scheme::Trapezoidal] {
            ways.push((format!("rigid, {}", scheme.name()), Way::Law(scheme, rigid)));
        }
        let stiffness = self.stiffness();
        for (name, factor) in [("EA/L", 1.0), ("10 EA/L", 10.0), ("100 EA/L", 100.0)] {
            let spring = Pounding::Law(ContactLaw::Penalty { stiffness: factor * stiffness });
            ways.push((format!("linear spring, {name}"), Way::Law(Scheme::Trapezoidal, spring)));
        }
        let masses = self.decks[0].decks.map(|deck| self.decks[0].density * deck.length);
        let damped = Pounding::Damped(DampedLaw::kelvin_voigt(stiffness, RESTITUTION, masses));
        ways.push(("Kelvin–Voigt, EA/L, e = 0.65".into(), Way::Law(Scheme::Trapezoidal, damped)));
        ways
    }

    fn run(&self, decks: &Decks, way: Way, h: f64) -> Result<Record> {
        match way {
            Way::Preset(preset) => decks.preset(&self.ground, preset(), [h, self.until]),
            Way::Law(scheme, pounding) => {
                let (scheme, correctors) = scheme.parts()?;
                decks.lumped(&self.ground, pounding, scheme, correctors, [h, self.until])
            }
        }
    }

    /// Largest displacements of the ends that meet, each toward the other deck.
    fn toward(decks: &Decks, record: &Record) -> [f64; 2] {
        let [i, j] = decks.contact();
        record.displacements().fold([0.0; 2], |most: [f64; 2], (_, u)| [most[0].max(u[i]), most[1].max(-u[j])])
    }

    /// Largest force until the wave of the first touch comes back from the far end of the shorter deck, and ½ ρA c
    /// times the velocity of approach in the step before it: what plane waves of two equal cross-sections have.
    fn first(decks: &Decks, record: &Record) -> [f64; 2] {
        let Some(touch) = record.forces().position(|(_, force)| force[0] > 0.0) else { return [0.0; 2] };
        let [i, j] = decks.contact();
        let wave = 2.0 * decks.decks[1].length / decks.wave_speed();
        let back = (touch + 1) as f64 * record.h + wave;
        let while_there = record.forces().skip(touch).take_while(|(t, _)| *t < back);
        let force = while_there.fold(0.0, |most: f64, (_, force)| most.max(force[0]));
        let apart: Vec<f64> =
            record.displacements().skip(touch.saturating_sub(2)).take(2).map(|(_, u)| u[i] - u[j]).collect();
        let approach = apart.windows(2).map(|pair| (pair[1] - pair[0]) / record.h).sum::<f64>();
        [force, 0.5 * decks.density * decks.wave_speed() * approach]
    }

    pub(crate) fn table(&self) -> Result<String> {
        let [decks, fine] = &self.decks;
        let reference = self.run(fine, Way::Preset(Preset::conservative), self.fine)?;
        let mut text = format!(
            "Two bridge decks of {} and {} elements: impacts, force of the first one until its wave is back, peak \
             force (MN), hardest impact and sum of impulses (MN s), displacements of the ends that meet toward the \
             other deck (mm), time of a step; the reference has {} and {} elements, and at its first touch ½ ρA c Δv \
             = {} MN\n\n| model | h ms | impacts | first | force | hardest | impulses | left | right | µs/step \
             |\n|{}\n",
            decks.decks[0].elements,
            decks.decks[1].elements,
            fine.decks[0].elements,
            fine.decks[1].elements,
            decimal(1e-6 * Self::first(fine, &reference)[1], 2),
            " --- |".repeat(10)
        );
        let mut failures = String::new();
        let mut row = |name: &str, h: f64, decks: &Decks, record: &Record| {
            let Impacts { count, force, impulse, hardest } = record.impacts();
            let [first, _] = Self::first(decks, record);
            let numbers = [first, force, hardest, impulse].map(|x| decimal(1e-6 * x, 2)).join(" | ");
            let ways = Self::toward(decks, record).map(|x| decimal(1e3 * x, 1)).join(" | ");
            let time = decimal(1e6 * record.seconds, 2);
            let _ = writeln!(text, "| {name} | {} | {count} | {numbers} | {ways} | {time} |", 1e3 * h);
        };
        row("reference", self.fine, fine, &reference);
        for (name, way) in self.ways() {
            for h in STEPS {
                match self.run(decks, way, h) {
                    Ok(record) => row(&name, h, decks, &record),
                    Err(error) => {
                        let _ = writeln!(failures, "\n{name}, h = {} ms: {error}", 1e3 * h);
                    }
                }
            }
        }
        Ok(text + &failures)
    }
}
