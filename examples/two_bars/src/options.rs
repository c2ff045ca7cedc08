//! Command line: every option has a default, and every mistake is named together with what is admissible.

use crate::experiment::{Correction, Scheme};
use std::path::PathBuf;
use std::str::FromStr;

pub(crate) const HELP: &str = "\
Two elastic bars collide: contact force, velocity and energy before and after correction.

usage: two-bars [options]

  --elements N      elements a bar, 1 to 100000 (default 50)
  --step H          step size in seconds, 1e-6 to 1e-2 (default 1e-3)
  --phase PHI       delays the impact by a fraction of a step, 0 to 1 (default 0)
  --integrator I    composite, newmark or all (default all)
  --correction C    none, corrected, history or all (default all)
  --output DIR      where table, figures and time histories are written (default output/two_bars)
  --quick           20 elements a bar unless --elements is given, few repetitions of the timing
  --help            this text
";

/// Runs of which the time of a step is the median.
const REPETITIONS: usize = 101;
const QUICK_REPETITIONS: usize = 5;

/// What the command line asks for.
pub(crate) enum Command {
    Help,
    Run(Options),
}

/// Choices for a run of the experiment.
pub(crate) struct Options {
    pub(crate) elements: usize,
    pub(crate) step: f64,
    pub(crate) phase: f64,
    pub(crate) schemes: Vec<Scheme>,
    pub(crate) corrections: Vec<Correction>,
    pub(crate) repetitions: usize,
    pub(crate) output: PathBuf,
}

/// Reads the arguments after the program's name.
pub(crate) fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Command, String> {
    let mut elements = None;
    let mut quick = false;
    let mut options = Options {
        elements: 50,
        step: 1e-3,
        phase: 0.0,
        schemes: Scheme::ALL.to_vec(),
        corrections: Correction::ALL.to_vec(),
        repetitions: REPETITIONS,
        output: PathBuf::from("output/two_bars"),
    };
    while let Some(option) = arguments.next() {
        let mut value = |admissible| Value::next(&option, admissible, &mut arguments);
        match option.as_str() {
            "--elements" => elements = Some(value("an integer from 1 to 100000")?.number(1, 100_000)?),
            "--step" => options.step = value("a number of seconds from 1e-6 to 1e-2")?.number(1e-6, 1e-2)?,
            "--phase" => options.phase = value("a number from 0 to 1")?.number(0.0, 1.0)?,
            "--integrator" => {
                options.schemes = value("composite, newmark or all")?.choice(&Scheme::ALL, Scheme::key)?;
            }
            "--correction" => {
                let value = value("none, corrected, history or all")?;
                options.corrections = value.choice(&Correction::ALL, Correction::key)?;
            }
            "--output" => options.output = value("a directory")?.text.into(),
            "--quick" => quick = true,
            "--help" | "-h" => return Ok(Command::Help),
            unknown => return Err(format!("unknown option {unknown}\n\n{HELP}")),
        }
    }
    if quick {
        options.elements = 20;
        options.repetitions = QUICK_REPETITIONS;
    }
    options.elements = elements.unwrap_or(options.elements);
    Ok(Command::Run(options))
}

/// The value of an option, with what is needed to say what is wrong with it.
struct Value<'a> {
    option: &'a str,
    admissible: &'a str,
    text: String,
}

impl<'a> Value<'a> {
    fn next(
        option: &'a str,
        admissible: &'a str,
        arguments: &mut impl Iterator<Item = String>,
    ) -> Result<Self, String> {
        match arguments.next() {
            Some(text) => Ok(Self { option, admissible, text }),
            None => Err(format!("{option} needs a value: {admissible}")),
        }
    }

    /// A number between two bounds, both admissible.
    fn number<N: FromStr + PartialOrd>(&self, least: N, most: N) -> Result<N, String> {
        let number = self.text.parse().ok().filter(|number| (least..=most).contains(number));
        number.ok_or_else(|| self.refused())
    }

    /// One of the named values, or all of them.
    fn choice<C: Copy>(&self, all: &[C], key: impl Fn(C) -> &'static str) -> Result<Vec<C>, String> {
        let chosen: Vec<C> = all.iter().copied().filter(|&c| self.text == "all" || self.text == key(c)).collect();
        if chosen.is_empty() { Err(self.refused()) } else { Ok(chosen) }
    }

    fn refused(&self) -> String {
        let Self { option, admissible, text } = self;
        format!("{option} {text}: expected {admissible}")
    }
}
