//! The figures: time histories of the contact nodes against the exact solution.

use crate::experiment::{Correction, END, Experiment, Run, Sample, before_and_after};
use example_plot::{Axis, BLUE, Curve, DARK, GREEN, Panel, RGBColor, VERMILION, banner, page};
use std::error::Error;

/// Stroke widths in quarters of a pixel.
const THIN: u32 = 4;
const MEDIUM: u32 = 8;
const THICK: u32 = 10;

/// Ends of the force axis in multiples of the exact force; peaks above the last one are cut off and noted.
const FORCE_AXIS_ENDS: [f64; 2] = [1.5, 3.5];

/// Four panels that show a run against the exact solution: displacement, velocity, contact force and energy.
pub(crate) fn histories(experiment: &Experiment, run: &Run) -> Result<String, Box<dyn Error>> {
    let correction = match run.correction {
        Correction::None => "before correction",
        Correction::Corrected => "after correction",
        Correction::History => "after correction and projection of the past",
    };
    let title = format!("{} scheme {correction}", run.scheme.title());
    let panels = [
        displacement(experiment, run),
        velocity(experiment, run),
        contact_force(experiment, run),
        energy(experiment, run),
    ];
    page(&title, &format!("Two colliding bars, {}", experiment.data()), &panels)
}

/// Contact force of one integrator's runs before and after correction, as far as both were made, against the exact one.
pub(crate) fn force(experiment: &Experiment, runs: &[Run]) -> Result<String, Box<dyn Error>> {
    let [raw, corrected] = before_and_after(runs);
    let mut curves = Vec::new();
    curves.extend(raw.map(|run| computed(run, "without correction", VERMILION, MEDIUM, millinewtons)));
    curves.extend(corrected.map(|run| computed(run, "with correction", BLUE, THICK, millinewtons)));
    curves.push(exact(experiment, Some("exact"), millinewtons));
    let scheme = runs[0].scheme.title();
    let title = format!("{scheme} scheme: contact force of two colliding bars, {}", experiment.data());
    let x = Axis { range: 0.05..0.35, ticks: vec![0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35], ..time_axis() };
    banner(&Panel { x, ..force_panel(experiment, title, curves) })
}

/// The same in characters, for pages that show no images: some steps from the impact on, a column of blocks each.
pub(crate) fn force_in_characters(experiment: &Experiment, runs: &[Run]) -> String {
    const BLOCKS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    // A row is half of the exact force.
    const LABELS: [char; 6] = ['3', ' ', '2', ' ', '1', ' '];
    let (impact, plateau) = (experiment.contact().0, experiment.plateau());
    let mut lines = vec![String::new(); LABELS.len() + 2];
    for run in before_and_after(runs).into_iter().flatten() {
        let first = run.samples().position(|sample| sample.t > impact).unwrap_or(0).saturating_sub(4);
        let forces: Vec<f64> = run.samples().skip(first).take(34).map(|sample| sample.force / plateau).collect();
        let mut panel = vec![format!("F/F₀ {}", run.correction.title())];
        for (label, below) in LABELS.into_iter().zip((0..LABELS.len()).rev()) {
            let block = |force: &f64| BLOCKS[(0..8).filter(|&k| 16.0 * force > (8 * below + k) as f64 + 0.5).count()];
            panel.push(format!("{label} │{}", forces.iter().map(block).collect::<String>()));
        }
        panel.push(format!("0 └{}", "─".repeat(forces.len())));
        for (line, part) in lines.iter_mut().zip(panel) {
            *line = if line.is_empty() { part } else { format!("{line:42}{part}") };
        }
    }
    lines.iter().fold(String::new(), |text, line| text + line.trim_end() + "\n")
}

fn displacement(experiment: &Experiment, run: &Run) -> Panel {
    let curves = both_nodes(experiment, run, |side| move |sample| 1e3 * sample.u[side]);
    Panel {
        title: "(a) Displacement of the contact nodes".into(),
        x: time_axis(),
        y: Axis::symmetric("displacement (mm)", &curves),
        curves,
        note: None,
    }
}

fn velocity(experiment: &Experiment, run: &Run) -> Panel {
    let curves = both_nodes(experiment, run, |side| move |sample| 1e3 * sample.v[side]);
    Panel {
        title: "(b) Velocity of the contact nodes".into(),
        x: time_axis(),
        y: Axis::symmetric("velocity (mm/s)", &curves),
        curves,
        note: None,
    }
}

fn contact_force(experiment: &Experiment, run: &Run) -> Panel {
    let computed = computed(run, "computed", BLUE, MEDIUM, millinewtons);
    let curves = vec![computed, exact(experiment, Some("exact"), millinewtons)];
    force_panel(experiment, "(c) Contact force".into(), curves)
}

fn energy(experiment: &Experiment, run: &Run) -> Panel {
    let total = |sample: &Sample| 1e6 * sample.energy();
    let kinetic = |sample: &Sample| 1e6 * sample.kinetic;
    let elastic = |sample: &Sample| 1e6 * sample.elastic;
    let curves = vec![
        computed(run, "total", BLUE, MEDIUM, total),
        computed(run, "kinetic", GREEN, MEDIUM, kinetic),
        computed(run, "elastic", VERMILION, MEDIUM, elastic),
        exact(experiment, Some("exact"), total),
        exact(experiment, None, kinetic),
        exact(experiment, None, elastic),
    ];
    Panel { title: "(d) Energy".into(), x: time_axis(), y: Axis::upward("energy (µJ)", &curves), curves, note: None }
}

/// A quantity of the left and of the right contact node, computed and exact.
fn both_nodes<F: Fn(&Sample) -> f64>(experiment: &Experiment, run: &Run, of_side: impl Fn(usize) -> F) -> Vec<Curve> {
    vec![
        computed(run, "left bar", BLUE, MEDIUM, of_side(0)),
        computed(run, "right bar", VERMILION, MEDIUM, of_side(1)),
        exact(experiment, Some("exact"), of_side(0)),
        exact(experiment, None, of_side(1)),
    ]
}

fn computed(run: &Run, label: &str, color: RGBColor, width: u32, quantity: impl Fn(&Sample) -> f64) -> Curve {
    let points = run.samples().map(|sample| (sample.t, quantity(&sample))).collect();
    Curve { label: Some(label.into()), color, width, points }
}

/// The exact curve: every quantity shown is piecewise linear in time, with kinks and jumps when a wave reaches an end.
fn exact(experiment: &Experiment, label: Option<&str>, quantity: impl Fn(&Sample) -> f64) -> Curve {
    let (impact, release) = experiment.contact();
    let before = |t: f64| t - 1e-9;
    let knots = [0.0, before(impact), impact, 0.5 * (impact + release), before(release), release, END];
    let points = knots.map(|t| (t, quantity(&experiment.exact(t)))).to_vec();
    Curve { label: label.map(String::from), color: DARK, width: THIN, points }
}

fn millinewtons(sample: &Sample) -> f64 {
    1e3 * sample.force
}

fn time_axis() -> Axis {
    Axis::linear("time (s)", 0.0..END, &[0.0, 0.1, 0.2, 0.3, 0.4])
}

/// A panel of contact forces with ticks at halves or multiples of the exact force; says how high the curves reach if
/// the axis cuts them off.
fn force_panel(experiment: &Experiment, title: String, curves: Vec<Curve>) -> Panel {
    let plateau = 1e3 * experiment.plateau();
    let peak = curves.iter().flat_map(Curve::values).fold(0.0, f64::max) / plateau;
    let [low, high] = FORCE_AXIS_ENDS;
    let (end, ticks) = if peak < low { (low, [0.0, 0.5, 1.0, 1.5]) } else { (high, [0.0, 1.0, 2.0, 3.0]) };
    let range = -0.04 * end * plateau..end * plateau;
    let y = Axis::linear("contact force (mN)", range, &ticks.map(|multiple| multiple * plateau));
    let corner = (experiment.contact().0, 0.98 * y.range.end);
    let note = (peak > high).then(|| (corner, format!("peak {peak:.1} F₀ →")));
    Panel { title, x: time_axis(), y, curves, note }
}
