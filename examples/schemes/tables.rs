//! The tables of `docs/schemes.md`, in Markdown: printed by the example `schemes`, compared with the page by a test.

use contact_dynamics::analysis::{Report, report};
use contact_dynamics::{Corrector, PersistencyCorrection};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::measure::{Figures, figures, record};
use contact_dynamics_scenes::schemes::{Listed, all};
use example_support::output::decimal;
use std::fmt::Write;

/// Accuracy and stability of every scheme.
pub(crate) fn accuracy() -> String {
    let mut table = String::from(
        "| scheme | order | ρ∞ | stable for Ω | period error | damping | solves | vectors | overshoot of u, v |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (scheme, report) in reports() {
        let order = report.order.displacement;
        let radius = report.radius_at_infinity.map_or("–".into(), |radius| decimal(radius, 3));
        let limit = report.critical_omega.map_or("all".into(), |omega| format!("< {}", decimal(omega, 3)));
        let (period, damping) = report.period_and_damping.unwrap_or((f64::NAN, f64::NAN));
        let (period, damping) = (decimal(100.0 * period, 2), decimal(100.0 * damping, 3));
        let growth = |[u, v]: [f64; 2]| format!("{}, {}", power(u), power(v));
        let overshoot = report.overshoot_growth.map_or("–".into(), growth);
        let Report { stages, stored, .. } = report;
        row(
            &mut table,
            &format!(
                "{} | {order} | {radius} | {limit} | {period} % | {damping} % | {stages} | {stored} | {overshoot}",
                scheme.name()
            ),
        );
    }
    table
}

/// What every scheme conserves, and where it imposes contact.
pub(crate) fn conservation() -> String {
    let mut table = String::from(
        "| scheme | momentum conserved | amplitudes | stored a lives at | contact |\n| --- | --- | --- | --- | --- |\n",
    );
    for (scheme, report) in reports() {
        let amplitudes = if report.keeps_amplitudes { "kept" } else { "damped" };
        let shift = report.order.acceleration_shift;
        let place = match shift.abs() > 0.0 {
            true => format!("t − {} h", decimal(-shift, 3)),
            false => "t".into(),
        };
        let (momentum, contact) = (report.momentum_in_words(), report.contact_in_words());
        row(&mut table, &format!("{} | {momentum} | {amplitudes} | {place} | {contact}", scheme.name()));
    }
    table
}

/// Two bars of 50 elements at Courant number ½, worst of ten impact phases: force error, largest force, energy left;
/// raw, and corrected where a correction applies.
pub(crate) fn contact() -> String {
    let mut table = String::from(
        "| scheme | raw: force RMS | max/F₀ | energy | corrected: force RMS | max/F₀ | energy |\n\
         | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for scheme in all().into_iter().filter(Listed::takes_multipliers) {
        let cells = |corrected: Option<PersistencyCorrection>| {
            let figures = worst(scheme, corrected);
            [decimal(figures.force_rms, 3), decimal(figures.force_max, 2), decimal(figures.energy, 3)].join(" | ")
        };
        let corrected = match scheme.takes_corrections() {
            true => cells(Some(PersistencyCorrection::with_history_projection())),
            false => "– | – | –".into(),
        };
        row(&mut table, &format!("{} | {} | {corrected}", scheme.name(), cells(None)));
    }
    table
}

/// The worst of ten phases: largest errors and force, energy farthest from 1.
fn worst(scheme: Listed, corrected: Option<PersistencyCorrection>) -> Figures {
    let h = 1e-3;
    let runs = (0..10).map(|i| {
        let bars = Bars::paper(50).delayed(0.05 + 0.1 * f64::from(i), h);
        let corrector = corrected.map(|correction| Box::new(correction) as Box<dyn Corrector<f64>>);
        figures(&bars, &record(&bars, (scheme.make)(), corrector, h, 0.4), h)
    });
    let farther = |x: f64, y: f64| if (x - 1.0).abs() > (y - 1.0).abs() { x } else { y };
    let fold = |worst: Figures, run: Figures| Figures {
        force_rms: worst.force_rms.max(run.force_rms),
        force_max: worst.force_max.max(run.force_max),
        energy: farther(worst.energy, run.energy),
        ..worst
    };
    runs.reduce(fold).unwrap()
}

fn reports() -> impl Iterator<Item = (Listed, Report)> {
    all().into_iter().map(|scheme| (scheme, report(&(scheme.make)().tableau()).unwrap()))
}

fn row(table: &mut String, cells: &str) {
    writeln!(table, "| {cells} |").unwrap();
}

fn power(exponent: f64) -> &'static str {
    match exponent {
        none if none < 0.5 => "none",
        one if one < 1.5 => "Ω",
        _ => "Ω²",
    }
}
