//! What is asked of a case, what came out, and the lines of a table that say so.

use contact_dynamics::{Error, Result};
use contact_dynamics_scenes::combinations::Combination;
use std::fmt::{self, Write};
use std::sync::atomic::{AtomicUsize, Ordering};

/// What a figure has to be.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Bound {
    AtMost(f64),
    AtLeast(f64),
    /// This, within a share of it.
    About(f64, f64),
}

impl Bound {
    fn holds(self, x: f64) -> bool {
        match self {
            Self::AtMost(most) => x <= most,
            Self::AtLeast(least) => x >= least,
            Self::About(exact, share) => (x - exact).abs() <= share * exact.abs(),
        }
    }

    /// How bad a figure is: the larger the worse.
    fn badness(self, x: f64) -> f64 {
        let badness = match self {
            Self::AtMost(_) => x,
            Self::AtLeast(_) => -x,
            Self::About(exact, _) => (x - exact).abs(),
        };
        if badness.is_nan() { f64::INFINITY } else { badness }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::AtMost(most) => write!(f, "≤ {}", digits(most)),
            Self::AtLeast(least) => write!(f, "≥ {}", digits(least)),
            Self::About(exact, share) => write!(f, "{} ± {} %", digits(exact), digits(100.0 * share)),
        }
    }
}

/// What came out of the runs of one combination: figures of each of them.
pub(crate) struct Outcome<const N: usize> {
    pub(crate) name: String,
    pub(crate) figures: std::result::Result<Vec<[f64; N]>, String>,
}

/// A line: one figure of a case, over all combinations.
pub(crate) struct Row {
    case: &'static str,
    what: String,
    bound: Bound,
    /// The worst figure and whose it is.
    worst: (f64, String),
    held: usize,
    tried: usize,
    /// Runs that broke off, and combinations with a figure that is not as asked.
    failures: Vec<String>,
}

impl Row {
    pub(crate) fn holds(&self) -> bool {
        self.tried > 0 && self.held == self.tried
    }

    /// Where its case stands in the list: contact before friction, then by number.
    pub(crate) fn place(&self) -> (bool, u32) {
        let digits: String = self.case.chars().skip(1).take_while(char::is_ascii_digit).collect();
        (self.case.starts_with('F'), digits.parse().unwrap_or(0))
    }

    pub(crate) fn failures(&self) -> &[String] {
        &self.failures
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { case, what, bound, worst: (worst, whose), held, tried, .. } = self;
        let verdict = if self.holds() { "" } else { " **no**" };
        // Whose rounding is the largest says nothing.
        let whose = if is_rounding(*worst) { "–" } else { whose };
        write!(f, "| {case} | {what} | {bound} | {} | {whose} | {held} of {tried}{verdict} |", number(*worst))
    }
}

/// One line for each figure.
pub(crate) fn rows<const N: usize>(case: &'static str, asked: [(&str, Bound); N], outcomes: &[Outcome<N>]) -> Vec<Row> {
    let line = |(k, (what, bound)): (usize, (&str, Bound))| {
        let (mut worst, mut held) = ((f64::NAN, String::from("–")), 0);
        let mut failures = Vec::new();
        for Outcome { name, figures } in outcomes {
            match figures {
                Err(reason) => failures.push(format!("{case}, {name}: {reason}")),
                Ok(figures) => {
                    let of = figures.iter().map(|figures| figures[k]);
                    let missed: Vec<String> = of.clone().filter(|x| !bound.holds(*x)).map(digits).collect();
                    if figures.is_empty() || !missed.is_empty() {
                        failures.push(format!("{case}, {name}: {what}: {} is not {bound}", missed.join(", ")));
                    } else {
                        held += 1;
                    }
                    for x in of {
                        if worst.0.is_nan() || bound.badness(x) > bound.badness(worst.0) {
                            worst = (x, name.clone());
                        }
                    }
                }
            }
        }
        Row { case, what: what.into(), bound, worst, held, tried: outcomes.len(), failures }
    };
    asked.into_iter().enumerate().map(line).collect()
}

/// Runs combinations on all cores; those that a scheme, a system or a law refuses claim nothing and are left out,
/// and so are steps beyond the limit of a scheme.
pub(crate) fn each<const N: usize>(
    combinations: &[Combination],
    run: impl Fn(&Combination) -> Result<Vec<[f64; N]>> + Sync,
) -> Vec<Outcome<N>> {
    let one = |combination: &Combination| match run(combination) {
        Err(Error::Incompatible { .. } | Error::BeyondStability { .. }) => None,
        figures => {
            let name = combination.names().into_iter().filter(|name| name != "–" && name != "lumped");
            let figures = figures.map_err(|error| error.to_string());
            Some(Outcome { name: name.collect::<Vec<_>>().join(", "), figures })
        }
    };
    parallel(combinations, one).into_iter().flatten().collect()
}

/// Maps a slice on all cores.
pub(crate) fn parallel<I: Sync, O: Send>(items: &[I], map: impl Fn(&I) -> O + Sync) -> Vec<O> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some((k, item)) = Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|k| Some((k, items.get(k)?))) {
            done.push((k, map(item)));
        }
        done
    };
    let mut all: Vec<(usize, O)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("a run that panics is a finding")).collect()
    });
    all.sort_by_key(|of| of.0);
    all.into_iter().map(|of| of.1).collect()
}

/// The table.
pub(crate) fn table(rows: &[Row]) -> String {
    let mut text =
        String::from("| case | measure | asked | worst | with | hold |\n| --- | --- | --- | --- | --- | --- |\n");
    for row in rows {
        let _ = writeln!(text, "{row}");
    }
    text
}

/// Three digits; without rounding below 1e-12, which is another on every machine.
fn number(x: f64) -> String {
    if is_rounding(x) { "0".into() } else { digits(x) }
}

fn is_rounding(x: f64) -> bool {
    x.abs() < 1e-12
}

/// Three digits.
fn digits(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        size if (1e-3..1e4).contains(&size) => {
            let scale = 10.0_f64.powf(2.0 - size.log10().floor());
            ((x * scale).round() / scale).to_string().replace('-', "−")
        }
        _ => format!("{x:.1e}").replace('-', "−"),
    }
}
