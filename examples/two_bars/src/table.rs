//! The measured figures as an aligned table and in Markdown.

use crate::experiment::{Experiment, Run};

const COLUMNS: usize = 9;

/// Leading columns that hold names.
const NAMES: usize = 2;

type Row = [String; COLUMNS];

const HEADING: [&str; COLUMNS] = [
    "integrator",
    "correction",
    "force RMS",
    "max F/F0",
    "TV of F/F0",
    "velocity RMS",
    "E end/start",
    "closure",
    "µs/step",
];

const EXACT: [&str; COLUMNS] = ["exact", "", "0", "1", "2", "0", "1", "0", ""];

/// Figures of all runs, with a line of exact values.
pub(crate) struct Table {
    title: String,
    heading: Row,
    runs: Vec<Row>,
    exact: Row,
    notes: Vec<String>,
}

impl Table {
    pub(crate) fn new(experiment: &Experiment, runs: &[Run], repetitions: usize) -> Self {
        Self {
            title: format!("Two colliding bars, {}", experiment.data()),
            heading: HEADING.map(String::from),
            runs: runs.iter().map(row).collect(),
            exact: EXACT.map(String::from),
            notes: notes(experiment, repetitions),
        }
    }

    /// Columns aligned for a terminal.
    pub(crate) fn text(&self) -> String {
        let widths = self.widths();
        let line = |row: &Row| padded(row, &widths).join("  ").trim_end().to_owned();
        let rule = widths.map(|width| "-".repeat(width)).join("  ");
        let mut lines = vec![self.title.clone(), String::new(), line(&self.heading), rule.clone()];
        lines.extend(self.runs.iter().map(line));
        lines.extend([rule, line(&self.exact), String::new()]);
        lines.extend(self.notes.iter().cloned());
        lines.join("\n") + "\n"
    }

    /// The same in Markdown.
    pub(crate) fn markdown(&self) -> String {
        let widths = self.widths();
        let line = |row: &Row| format!("| {} |", padded(row, &widths).join(" | "));
        let mut lines = vec![self.title.clone(), String::new(), line(&self.heading), line(&rule(&widths))];
        lines.extend(self.runs.iter().chain([&self.exact]).map(line));
        lines.push(String::new());
        lines.extend(self.notes.iter().map(|note| format!("- {note}")));
        lines.join("\n") + "\n"
    }

    fn widths(&self) -> [usize; COLUMNS] {
        let mut widths = [0; COLUMNS];
        for row in self.runs.iter().chain([&self.heading, &self.exact]) {
            for (width, cell) in widths.iter_mut().zip(row) {
                *width = cell.chars().count().max(*width);
            }
        }
        widths
    }
}

fn row(run: &Run) -> Row {
    let figures = &run.figures;
    [
        run.scheme.title().into(),
        run.correction.title().into(),
        format!("{:.3}", figures.force_rms),
        format!("{:.3}", figures.force_max),
        format!("{:.2}", figures.variation),
        format!("{:.3}", figures.velocity_rms),
        format!("{:.4}", figures.energy),
        format!("{:.0e}", figures.closure),
        format!("{:.2}", run.time_per_step),
    ]
}

/// Names to the left, numbers to the right.
fn padded(row: &Row, widths: &[usize; COLUMNS]) -> Row {
    std::array::from_fn(|column| {
        let (cell, width) = (&row[column], widths[column]);
        if column < NAMES { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
    })
}

/// Markdown's rule under the heading, with a colon where numbers end.
fn rule(widths: &[usize; COLUMNS]) -> Row {
    std::array::from_fn(|column| {
        let dashes = "-".repeat(widths[column] - 1);
        if column < NAMES { dashes + "-" } else { dashes + ":" }
    })
}

fn notes(experiment: &Experiment, repetitions: usize) -> Vec<String> {
    let (impact, release) = experiment.contact();
    let plateau = experiment.plateau();
    vec![
        format!("F0 = {plateau:.4} N: exact contact force, acting from {impact:.4} s to {release:.4} s."),
        "force RMS: of F/F0 - 1 during contact.".into(),
        "TV: total variation, the sum of |change of F|/F0 over the steps.".into(),
        "velocity RMS: error of the left contact node over half the closing speed, from 0.02 s before impact to 0.04 s \
         after release."
            .into(),
        "closure: contact impulses against the change of momentum of each bar, relative.".into(),
        "history: the past states are projected too, which matters where contact would be lost right after impact; \
         compare --phase 0.05 or --elements 20 --phase 0.5."
            .into(),
        format!("µs/step: median of {repetitions} runs; it depends on the machine."),
    ]
}
