//! Runs of a recipe, and what came of them.

use super::apart::{by_files, on_threads};
use super::recipe::{Precision, Recipe, Twin};
use super::rubber;
use super::twins::{self, Trace};
use super::watch::Watch;
use contact_dynamics::{Error, Real, Result, Simulation};
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What must not be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// A few words that are the same for the same fault.
    pub what: &'static str,
    pub step: usize,
    pub words: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, step {}: {}", self.what, self.step, self.words)
    }
}

/// What came of a scene.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    pub finding: Option<Finding>,
    /// The error that has ended the run, or has kept it from being built: its name and its words.
    pub refused: Option<(String, String)>,
    pub built: bool,
    /// Steps accepted, and in how many of them a contact was closed.
    pub steps: usize,
    pub closed: usize,
    /// Steps in which both runs were compared.
    pub compared: usize,
    /// Roundings of the data changed results so far that both runs were compared no longer.
    pub by_rounding: bool,
    /// Largest energy over that at the start, where nothing brings energy in.
    pub gain: f64,
    /// Largest change of momentum over Σ m (|v| + |u|/h + h |a|), where nothing acts from outside.
    pub momentum: f64,
}

/// A run from its start, or from the middle of another one.
pub(super) struct Run<'a, T: Real> {
    pub(super) recipe: &'a Recipe,
    pub(super) run: Simulation<'static, T>,
    pub(super) step: usize,
    changes: usize,
}

impl<'a, T: Real> Run<'a, T> {
    pub(super) fn new(recipe: &'a Recipe) -> Result<Self> {
        Ok(Self { recipe, run: recipe.simulation()?, step: 0, changes: 0 })
    }

    /// One that goes on from where this one is.
    pub(super) fn resumed(&self) -> Result<Self> {
        let h = if self.recipe.changes.is_empty() { self.recipe.step_size() } else { self.run.step_size() };
        let builder = self.recipe.builder(h)?;
        let run = match self.recipe.twin {
            Twin::Filed => by_files(&self.run, builder)?,
            _ => builder.resume(self.run.state().clone(), self.run.history().clone()).build()?,
        };
        Ok(Self { run, ..*self })
    }

    /// One step.
    pub(super) fn advance(&mut self) -> Result<()> {
        self.change()?;
        self.run.step()?;
        self.step += 1;
        Ok(())
    }

    /// The step size of the next step.
    pub(super) fn change(&mut self) -> Result<()> {
        while let Some((_, factor)) = self.recipe.changes.get(self.changes).filter(|change| change.0 <= self.step) {
            self.changes += 1;
            self.run.set_step_size(factor * self.recipe.step_size())?;
        }
        Ok(())
    }
}

impl Recipe {
    /// Runs the scene in both ways. A panic is a finding.
    #[must_use]
    pub fn examine(&self) -> Verdict {
        let examine = || match self.precision {
            Precision::Single => self.examined::<f32>(),
            Precision::Double => self.examined::<f64>(),
        };
        catch_unwind(AssertUnwindSafe(examine)).unwrap_or_else(|panic| {
            let words = match panic.downcast::<String>() {
                Ok(words) => *words,
                Err(panic) => panic.downcast_ref::<&str>().map_or("something", |words| *words).into(),
            };
            Verdict { finding: Some(Finding { what: "panic", step: 0, words }), ..Verdict::default() }
        })
    }

    fn examined<T: Real>(&self) -> Verdict {
        let mut verdict = Verdict::default();
        let threaded = self.twin == Twin::Threaded;
        let watched = |verdict: &mut Verdict| self.watched::<T>(verdict);
        let traces = if threaded { on_threads(1, || watched(&mut verdict)) } else { watched(&mut verdict) };
        if verdict.finding.is_none() {
            let compare = |verdict: &mut Verdict| twins::compare::<T>(self, &traces, verdict);
            verdict.finding = if threaded { on_threads(3, || compare(&mut verdict)) } else { compare(&mut verdict) };
        }
        verdict
    }

    /// The first run, every step looked at.
    fn watched<T: Real>(&self, verdict: &mut Verdict) -> Vec<Trace> {
        let mut traces = Vec::new();
        let mut run = match Run::<T>::new(self) {
            Ok(run) => run,
            Err(error) => {
                verdict.refused = Some(named(&error));
                return traces;
            }
        };
        verdict.built = true;
        let mut watch = Watch::new(self, &mut run.run);
        traces.push(Trace::of(self, &run.run));
        while run.step < self.steps {
            if let Err(error) = run.change() {
                verdict.refused = Some(named(&error));
                break;
            }
            let (before, history) = (run.run.state().clone(), run.run.history().clone());
            match run.advance() {
                Ok(()) => {
                    traces.push(Trace::of(self, &run.run));
                    verdict.finding = watch.look(&mut run, verdict);
                    verdict.steps += 1;
                    verdict.closed += usize::from(run.run.state().contacts().closed().iter().any(|closed| *closed));
                }
                Err(error) => {
                    verdict.refused = Some(named(&error));
                    verdict.finding = watch.after_failure(&mut run, &error, &before, &history);
                    break;
                }
            }
            if verdict.finding.is_some() || watch.has_died_out(run.run.state()) {
                break;
            }
        }
        traces
    }

    /// Whether the second run has the same bits.
    pub(super) fn is_exact(&self) -> bool {
        matches!(self.twin, Twin::Repeated | Twin::Resumed | Twin::Filed | Twin::Threaded | Twin::PowersOfTwo(_))
    }
}

/// An error by its variant, and its words; of a step that was halved in vain that of the last attempt.
pub(super) fn named(error: &Error) -> (String, String) {
    match error {
        Error::StepRefused { source, .. } => named(source),
        // (Whether displacements or what is made of them are beyond all numbers first depends on their unit.)
        Error::Inadmissible { source, .. } if source.to_string().ends_with(rubber::BEYOND) => {
            ("StepNotFinite".into(), error.to_string())
        }
        _ => {
            let name = format!("{error:?}");
            (name.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().into(), error.to_string())
        }
    }
}
