//! Tables in Markdown, all points as comma-separated values, the figure.

use crate::rows::{REFERENCE, Row};
use crate::scene::{Errors, Point};
use example_support::output::decimal;
use example_support::plot::{Axis, BLUE, Curve, DARK, GRAY, GREEN, ORANGE, PURPLE, Panel, RGBColor, SKY, VERMILION};
use std::fmt::Write;

/// Errors at which work is compared: mean and RMS of the force, energy.
#[derive(Clone, Copy)]
pub(crate) struct Targets {
    pub(crate) forces: [f64; 3],
    pub(crate) rms: f64,
    pub(crate) energies: [f64; 2],
}

/// What was measured of all rows in a scene.
pub(crate) struct Results {
    pub(crate) letter: char,
    pub(crate) key: &'static str,
    pub(crate) title: &'static str,
    pub(crate) targets: Targets,
    pub(crate) points: Vec<Vec<Point>>,
}

type Of<'a> = &'a dyn Fn(&Point) -> f64;

/// The runs that no other one beats in both work and error, by growing work.
fn front(points: &[Point], work: Of<'_>, error: Of<'_>) -> Vec<(f64, f64)> {
    let mut all: Vec<(f64, f64)> = points.iter().map(|point| (work(point), error(point))).collect();
    all.sort_by(|x, y| x.0.total_cmp(&y.0));
    let mut least = f64::INFINITY;
    all.retain(|(_, error)| {
        let better = *error < least;
        least = least.min(*error);
        better
    });
    all
}

/// Work at an error, on the straight line between two runs of the front in logarithms; `None` if no run is that
/// accurate. A row whose cheapest run is better than asked for is charged for that run.
fn work_at(front: &[(f64, f64)], target: f64) -> Option<f64> {
    let reached = front.iter().position(|(_, error)| *error <= target)?;
    let (work, error) = front[reached];
    let Some((before, worse)) = reached.checked_sub(1).map(|i| front[i]) else { return Some(work) };
    let fraction = (worse / target).ln() / (worse / error).ln();
    Some(before * (work / before).powf(fraction))
}

fn seconds(point: &Point) -> f64 {
    point.seconds
}

fn force(point: &Point) -> f64 {
    point.errors.force
}

fn energy(point: &Point) -> f64 {
    point.errors.energy
}

impl Results {
    /// Work to reach errors, over that of the reference row for the first of them. `benches/measure` fills in the date
    /// and the commit of its tag.
    pub(crate) fn table(&self, rows: &[Row]) -> String {
        let Targets { forces, rms, energies } = self.targets;
        let [coarse, middle, fine] = forces.map(percent);
        let [loss, less] = energies.map(percent);
        let within = percent(rms);
        let mut table = format!(
            "### ({}) {}\n\n\
             <!-- printed by: cargo run --release --example work_precision_contact (times of DATE, COMMIT: \
             \"force {coarse} %\" to \"Co\", \"RMS {within} %\" to \"{less} %\") -->\n\
             | integrator | correction | mass | force {coarse} % | {middle} % | {fine} % | Co | \
             solves · dofs {coarse} % | {middle} % | {fine} % | least % | RMS {within} % | energy {loss} % | {less} % |\n\
             |{}\n",
            self.letter,
            self.title,
            " --- |".repeat(14)
        );
        let at = |row: usize, target: f64, work: Of<'_>, error: Of<'_>| {
            work_at(&front(&self.points[row], work, error), target)
        };
        let unit = |work: Of<'_>| at(REFERENCE, forces[0], work, &force);
        let cell = |row: usize, target: f64, work: Of<'_>, error: Of<'_>| {
            let ratio = at(row, target, work, error).zip(unit(work)).map(|(own, unit)| own / unit);
            ratio.map_or("–".into(), three_digits)
        };
        for (number, (row, points)) in rows.iter().zip(&self.points).enumerate() {
            let names = row.names().join(" | ");
            let times = forces.map(|target| cell(number, target, &seconds, &force)).join(" | ");
            let courant = fastest(points, middle_of(forces)).map_or("–".into(), |courant| decimal(courant, 2));
            let solves = forces.map(|target| cell(number, target, &Point::work, &force)).join(" | ");
            let least = points.iter().map(force).fold(f64::INFINITY, f64::min);
            let least = if least.is_finite() { decimal(100.0 * least, 2) } else { "–".into() };
            let with_jumps = cell(number, rms, &seconds, &|point: &Point| point.errors.rms);
            let losses = energies.map(|target| cell(number, target, &seconds, &energy)).join(" | ");
            let _ = writeln!(table, "| {names} | {times} | {courant} | {solves} | {least} | {with_jumps} | {losses} |");
        }
        if let Some((time, work)) = unit(&seconds).zip(unit(&Point::work)) {
            let _ = writeln!(table, "\n1 is {} ms, {work:.1e} solves · dofs.", three_digits(1e3 * time));
        }
        table
    }

    /// One line a point.
    pub(crate) fn csv(&self, rows: &[Row]) -> String {
        let mut lines = String::new();
        for (row, points) in rows.iter().zip(&self.points) {
            let names = row.names().map(|name| format!("\"{name}\"")).join(",");
            for Point { elements, courant, dofs, steps, solves, seconds, errors } in points {
                let Errors { force, rms, energy } = errors;
                let _ = writeln!(
                    lines,
                    "{},{names},{elements},{courant:.4},{dofs},{steps},{solves},\
                     {seconds:e},{force:e},{rms:e},{energy:e}",
                    self.key
                );
            }
        }
        lines
    }

    /// The fronts of some rows, force against time.
    pub(crate) fn panel(&self, rows: &[Row], x: Axis, y: Axis) -> Panel {
        const COLORS: [RGBColor; 8] = [GRAY, SKY, ORANGE, VERMILION, GREEN, BLUE, DARK, PURPLE];
        let drawn = rows.iter().zip(&self.points).filter_map(|(row, points)| Some((row.curve?, points)));
        let curve = |((label, points), color): ((&str, &Vec<Point>), RGBColor)| {
            let points: Vec<_> = front(points, &seconds, &force).iter().map(|(x, y)| (x.log10(), y.log10())).collect();
            Curve { label: Some(label.into()), color, width: 7, points }
        };
        let curves = drawn.zip(COLORS).map(curve).collect();
        Panel { title: format!("({}) {}", self.letter, self.title), x, y, curves, note: None }
    }
}

fn percent(x: f64) -> String {
    decimal(100.0 * x, 4)
}

fn three_digits(x: f64) -> String {
    decimal(x, [100.0, 10.0, 1.0, 0.1].into_iter().filter(|&limit| x < limit).map(|_| 1).sum())
}

fn middle_of([_, middle, _]: [f64; 3]) -> f64 {
    middle
}

/// The Courant number of the fastest run that is as accurate.
fn fastest(points: &[Point], target: f64) -> Option<f64> {
    let accurate = points.iter().filter(|point| force(point) <= target);
    accurate.min_by(|x, y| x.seconds.total_cmp(&y.seconds)).map(|point| point.courant)
}
