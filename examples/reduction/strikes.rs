//! What the tables of impacts have in common: models and their names, figures over those of a reference.

use contact_dynamics::reduction::Boundary;
use contact_dynamics_scenes::impacts::{Course, Model, Step};
use example_support::output::decimal;

/// A boundary and a softening.
#[derive(Clone, Copy)]
pub(crate) struct Kind(Boundary, f64);

pub(crate) const TAPERED: Kind = Kind(Boundary::Tapered, 2.0);
pub(crate) const UNTAPERED: Kind = Kind(Boundary::Untapered, 0.0);

impl Kind {
    /// The tapered boundary with another softening.
    pub(crate) fn softened(softening: f64) -> Self {
        Self(Boundary::Tapered, softening)
    }

    pub(crate) fn of(self, modes: usize) -> Model {
        Model::Reduced { boundary: self.0, softening: self.1, modes }
    }
}

/// So many modes, tapered and not, in steps h; and both in steps as long as the modes allow.
pub(crate) fn models(count: usize, h: f64) -> [(String, Model, Step); 4] {
    let of = |name: &str, kind: Kind, step| (format!("{count} modes, {name}"), kind.of(count), step);
    [
        of("tapered", TAPERED, Step::Of(h)),
        of("tapered, h = 1/ω_c", TAPERED, Step::Cutoff),
        of("untapered", UNTAPERED, Step::Of(h)),
        of("untapered, h = 1/ω_c", UNTAPERED, Step::Cutoff),
    ]
}

/// Largest and mean force and impulse over those of a reference, the rebound as given, energy, [`cost`].
pub(crate) fn relative(course: &Course, [reference, whole]: [&Course; 2], rebound: f64) -> String {
    let largest = course.largest() / reference.largest();
    let cells = [largest, course.mean() / reference.mean(), course.impulse / reference.impulse, rebound];
    let cells = cells.map(|x| decimal(x, 3)).join(" | ");
    format!("{cells} | {} | {}", decimal(course.energy, 4), cost(course, whole))
}

/// Steps, times, and after how many impacts the whole model would have taken longer.
pub(crate) fn cost(course: &Course, whole: &Course) -> String {
    let [run, both] = [course.run, course.run + course.build].map(|time| decimal(1e3 * time, 1));
    let (extra, gained) = (course.build - whole.build, whole.run - course.run);
    let is_reduced = course.unknowns < whole.unknowns && extra > 0.0;
    let paid = match (is_reduced, gained > 0.0) {
        (false, _) => "–".into(),
        (true, true) => decimal((extra / gained).ceil(), 0),
        (true, false) => "never".into(),
    };
    format!("{} | {run} | {both} | {paid}", course.steps)
}
