//! Tables in Markdown, and all figures as comma-separated values.

use crate::combinations::Combination;
use example_support::collisions::Swept;
use example_support::output::decimal;

/// What was measured of all combinations in one scene.
pub(crate) struct Results {
    /// Scene, elements and step, as the first cells of a line of the CSV.
    pub(crate) scene: &'static str,
    pub(crate) elements: usize,
    pub(crate) h: f64,
    /// One entry a combination; `None` if it was refused or failed.
    pub(crate) rows: Vec<Option<Vec<Swept>>>,
}

impl Results {
    pub(crate) fn of(&self, row: usize, name: &str) -> Option<Swept> {
        self.rows[row].as_ref()?.iter().find(|swept| swept.name == name).copied()
    }

    /// One line a combination and figure.
    pub(crate) fn csv(&self, combinations: &[Combination]) -> String {
        let lines = combinations.iter().zip(&self.rows).flat_map(|(combination, row)| {
            let lines = row.iter().flatten().map(|swept| self.line(combination, swept));
            lines.collect::<Vec<_>>()
        });
        lines.collect()
    }

    /// A line of the CSV.
    pub(crate) fn line(&self, combination: &Combination, Swept { name, mean, worst }: &Swept) -> String {
        let names = combination.names().map(|name| format!("\"{name}\"")).join(",");
        format!("{},{},{},{names},{name},{mean:e},{worst:e}\n", self.scene, self.elements, self.h)
    }
}

/// How a figure is written.
#[derive(Clone, Copy)]
pub(crate) enum Cell {
    /// Mean times a factor, with decimals.
    Mean(f64, i32),
    /// Mean, worst in parentheses.
    Both(f64, i32),
    /// Worst.
    Worst(f64, i32),
    /// Power of ten of the worst.
    Power,
}

/// A column of a table: heading, results, figure.
pub(crate) struct Column<'a> {
    pub(crate) heading: &'a str,
    pub(crate) results: &'a Results,
    pub(crate) figure: &'a str,
    pub(crate) cell: Cell,
}

fn cell(cell: Cell, swept: Swept) -> String {
    let number = |x: f64, digits: i32| match x.abs() {
        size if !size.is_finite() => "–".into(),
        size if size >= 1e4 => format!("{x:.0e}").replace('-', "−"),
        _ => decimal(x, digits),
    };
    match cell {
        Cell::Mean(scale, digits) => number(scale * swept.mean, digits),
        Cell::Worst(scale, digits) => number(scale * swept.worst, digits),
        Cell::Both(scale, digits) => {
            format!("{} ({})", number(scale * swept.mean, digits), number(scale * swept.worst, digits))
        }
        Cell::Power => format!("{:.0e}", swept.worst).replace('-', "−"),
    }
}

/// The rows of which there is anything to show.
pub(crate) fn table(title: &str, combinations: &[Combination], columns: &[Column<'_>]) -> String {
    let headings: Vec<&str> = columns.iter().map(|column| column.heading).collect();
    let heading = format!("| integrator | correction | mass | {} |", headings.join(" | "));
    let rule = format!("|{}", " --- |".repeat(columns.len() + 3));
    let line = |(row, combination): (usize, &Combination)| {
        let cells: Vec<Option<String>> =
            columns.iter().map(|c| c.results.of(row, c.figure).map(|swept| cell(c.cell, swept))).collect();
        let any = cells.iter().any(Option::is_some);
        let cells: Vec<String> = cells.into_iter().map(|cell| cell.unwrap_or("–".into())).collect();
        any.then(|| format!("| {} | {} |", combination.names().join(" | "), cells.join(" | ")))
    };
    let head = [title.into(), String::new(), heading, rule];
    head.into_iter().chain(combinations.iter().enumerate().filter_map(line)).collect::<Vec<_>>().join("\n") + "\n"
}
