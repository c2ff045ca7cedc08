//! Oblique impact of a slab: pressure and friction are constant while contact lasts.

use crate::rows::{BATHE, CHUNG_HULBERT, COMPOSITE, Correction, TRAPEZOIDAL, Table};
use contact_dynamics::{Preset, Result, Simulation};
use contact_dynamics_scenes::slabs::{Impact, Slab};
use example_support::plot::{Axis, BLUE, Curve, DARK, Panel, RGBColor, VERMILION, pair};
use std::error::Error;

/// Speeds along the wall with what follows from them.
const ALONG: [(f64, &str); 2] = [(0.02, "stick"), (0.05, "slip")];

/// A preset and what tables call it.
type Named = (&'static str, fn() -> Preset);

const PRESETS: [Named; 3] = [
    ("preset smooth", Preset::smooth),
    ("preset conservative", Preset::conservative),
    ("preset explicit", Preset::explicit),
];

pub(crate) fn tables(quick: bool) -> Vec<String> {
    let (elements, phases) = if quick { (20, 2) } else { (50, 10) };
    let mut tables: Vec<_> = [1e-3, 2.5e-4].map(|h| rows(elements, h, phases)).into();
    tables.push(meshes(if quick { &[20] } else { &[20, 50, 100] }, phases));
    tables
}

/// Mean errors in percent, and the rest.
fn measured(
    slab: &Slab,
    h: f64,
    phases: usize,
    run: impl Fn(f64) -> Result<Simulation<'static, f64>>,
) -> Result<[f64; 4]> {
    let Impact { error, variation, largest, .. } = Impact::mean(slab, h, phases, run)?;
    Ok([100.0 * error[0], 100.0 * error[1], variation, largest])
}

const FIGURES: [&str; 4] = ["pressure %", "friction %", "variation", "largest"];
const DIGITS: [i32; 4] = [2, 2, 2, 3];

fn rows(elements: usize, h: f64, phases: usize) -> String {
    let title = format!(
        "Oblique slab, {elements} elements, h = {} ms, {phases} phases: mean errors of pressure and friction, mean \
         variation and largest of the friction over its exact value",
        1e3 * h
    );
    let of = |(_, name): (f64, &str)| FIGURES.map(|figure| format!("{name}: {figure}"));
    let figures = ALONG.map(of).concat();
    let head: Vec<&str> = ["scheme", "correction"].into_iter().chain(figures.iter().map(String::as_str)).collect();
    let mut table = Table::new(&title, &head);
    let slabs = ALONG.map(|(along, _)| Slab::thrown(elements, along));
    for scheme in [TRAPEZOIDAL, COMPOSITE, CHUNG_HULBERT, BATHE] {
        for correction in Correction::ALL.into_iter().filter(|correction| correction.serves(scheme)) {
            let of = |slab: &Slab| {
                let run = |gap| slab.lumped((scheme.make)(), correction.correctors(), h, gap);
                measured(slab, h, phases, run)
            };
            table.row(&[scheme.name, correction.name()], DIGITS, slabs.iter().map(of).collect());
        }
    }
    for (name, preset) in PRESETS {
        let of = |slab: &Slab| measured(slab, h, phases, |gap| slab.preset(preset(), h, gap));
        table.row(&[name, "–"], DIGITS, slabs.iter().map(of).collect());
    }
    table.text()
}

fn meshes(elements: &[usize], phases: usize) -> String {
    let correction = Correction::History;
    let title = format!("Oblique slab by mesh and step: {}, {}, {phases} phases", TRAPEZOIDAL.name, correction.name());
    let head: Vec<&str> = ["h ms", "elements", "impact"].into_iter().chain(FIGURES).collect();
    let mut table = Table::new(&title, &head);
    for (along, name) in ALONG {
        for h in [1e-3, 2e-4] {
            for &n in elements {
                let slab = Slab::thrown(n, along);
                let run = |gap| slab.lumped((TRAPEZOIDAL.make)(), correction.correctors(), h, gap);
                let names = [&(1e3 * h).to_string(), &n.to_string(), name];
                table.row(&names, DIGITS, vec![measured(&slab, h, phases, run)]);
            }
        }
    }
    table.text()
}

/// Pressure and friction of a slab that sticks, over time: raw, corrected, exact.
pub(crate) fn figure() -> std::result::Result<String, Box<dyn Error>> {
    let h = 1e-3;
    let slab = Slab::thrown(50, ALONG[0].0);
    let raw = history(&slab, h, Correction::None)?;
    let corrected = history(&slab, h, Correction::History)?;
    let panel = |k: usize, title: &str| {
        let curve = |label: String, color: RGBColor, width: u32, history: &[[f64; 3]]| {
            let points = history.iter().map(|sample| (1e3 * sample[0], sample[1 + k])).collect();
            Curve { label: Some(label), color, width, points }
        };
        let peak = raw.iter().map(|sample| sample[1 + k]).fold(0.0, f64::max);
        let [start, end] = [start(h), start(h) + slab.contact_time()].map(|t| 1e3 * t);
        let exact = [(0.0, 0.0), (start, 0.0), (start, 1.0), (end, 1.0), (end, 0.0), (1.2 * end, 0.0)];
        let curves = vec![
            curve(format!("raw, to {peak:.1}"), VERMILION, 5, &raw),
            curve("corrected".into(), BLUE, 10, &corrected),
            Curve { label: Some("exact".into()), color: DARK, width: 4, points: exact.to_vec() },
        ];
        Panel {
            title: title.into(),
            x: Axis::linear("time (ms)", 0.0..240.0, &[0.0, 50.0, 100.0, 150.0, 200.0]),
            y: Axis::linear("over the exact value", -1.25..3.0, &[-1.0, 0.0, 1.0, 2.0, 3.0]),
            curves,
            note: None,
        }
    };
    let title = "An elastic slab strikes a rough wall obliquely, and sticks";
    let subtitle = "Trapezoidal rule, 50 elements, h = 1 ms; corrected by λ_v/λ_a with history projection";
    pair(title, subtitle, &[panel(0, "(a) Pressure"), panel(1, "(b) Friction")])
}

/// When the slab of the figure touches the wall.
fn start(h: f64) -> f64 {
    20.3 * h
}

/// Time, pressure and friction over their exact values.
fn history(slab: &Slab, h: f64, correction: Correction) -> Result<Vec<[f64; 3]>> {
    let [pressure, friction] = slab.forces();
    let start = start(h);
    let mut run = slab.lumped((TRAPEZOIDAL.make)(), correction.correctors(), h, start * slab.velocity[0])?;
    let mut history = Vec::new();
    while run.state().time() < start + 1.2 * slab.contact_time() {
        run.step()?;
        let contacts = run.state().contacts();
        let forces = [contacts.forces()[0] / pressure, -contacts.friction_forces(0)[0] / friction];
        history.push([run.state().time(), forces[0], forces[1]]);
    }
    Ok(history)
}
