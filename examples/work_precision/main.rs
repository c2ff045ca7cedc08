//! Error against work on smooth motion: every scheme on a damped bar, and on springs of which the step resolves only
//! the soft one.
//!
//! `cargo run --release --example work_precision`

mod scenes;

use contact_dynamics_scenes::schemes::all;
use example_support::output::Output;
use example_support::output::decimal;
use example_support::plot::{Axis, BLUE, Curve, GRAY, GREEN, ORANGE, PURPLE, Panel, RGBColor, SKY, VERMILION, page};
use scenes::{Scene, damped_bar, stiff_soft};
use std::error::Error;
use std::fmt::Write;

/// A run: steps, solves, relative error, seconds.
#[derive(Clone, Copy)]
struct Point {
    steps: u32,
    solves: f64,
    error: f64,
    seconds: f64,
}

/// A scheme on a scene, by growing numbers of steps.
struct Series {
    scheme: String,
    points: Vec<Point>,
}

/// Errors at which work is compared.
const TARGETS: [f64; 2] = [1e-2, 1e-3];

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("work_precision")?;
    let (finest, repetitions) = if output.quick { (1 << 12, 1) } else { (1 << 16, 5) };
    let mut panels = Vec::new();
    let mut csv = String::from("scene,scheme,steps,solves,error,seconds\n");
    for (letters, decades, scene) in [(["a", "b"], (-4, -1), damped_bar()), (["c", "d"], (-6, -2), stiff_soft())] {
        let series: Vec<Series> =
            all().into_iter().map(|listed| measure(&scene, listed.make, finest, repetitions)).collect();
        println!("{}\n\n{}", scene.title, table(&series)?);
        for Series { scheme, points } in &series {
            for Point { steps, solves, error, seconds } in points {
                writeln!(csv, "{},{scheme},{steps},{solves},{error:e},{seconds:e}", scene.key)?;
            }
        }
        let solves = curves(&series, |point| point.solves);
        let time = curves(&series, |point| point.seconds);
        panels.push(panel(&format!("({}) {}", letters[0], scene.title), "solves", (1, 5), solves));
        panels.push(panel(&format!("({}) {}", letters[1], scene.title), "seconds", decades, time));
    }
    output.write("work_precision.csv", &csv)?;
    let panels: [Panel; 4] = panels.try_into().map_err(|_| "four panels")?;
    let page = page("Error against work on smooth motion", "Relative error in the norm of the energy", &panels)?;
    output.write("work_precision.svg", &page)
}

/// Runs a scheme with 8, 16, … steps up to `finest`, as far as it is stable, until the error is small.
fn measure(scene: &Scene, make: scenes::Make, finest: u32, repetitions: usize) -> Series {
    let stages = make().tableau().stages.len();
    let mut points = Vec::new();
    let mut steps = 8;
    while steps <= finest {
        if let Some((error, seconds)) = scene.run(make, steps, repetitions).filter(|(error, _)| *error < 0.5) {
            points.push(Point { steps, solves: f64::from(steps) * stages as f64, error, seconds });
            if error < 1e-5 {
                break;
            }
        }
        steps *= 2;
    }
    Series { scheme: make().name(), points }
}

/// Work for the target errors, time as a multiple of that of the trapezoidal rule.
fn table(series: &[Series]) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "| scheme | solves for error 1 % | 0.1 % | time for 1 % | 0.1 % |\n| --- | --- | --- | --- | --- |\n",
    );
    let rule = series.iter().find(|series| series.scheme == "Newmark(0.25, 0.5)").ok_or("no trapezoidal rule")?;
    let base = TARGETS.map(|target| work(&rule.points, target, |point| point.seconds));
    for Series { scheme, points } in series {
        let solves = TARGETS.map(|target| work(points, target, |point| point.solves));
        let solves = solves.map(|solves| solves.map_or("–".into(), |solves| decimal(solves, 0)));
        let mut times = TARGETS.iter().zip(base).map(|(&target, base)| {
            let ratio = work(points, target, |point| point.seconds).zip(base).map(|(own, base)| own / base);
            ratio.map_or("–".into(), |ratio| decimal(ratio, 2))
        });
        let (coarse, fine) = (times.next().unwrap_or_default(), times.next().unwrap_or_default());
        writeln!(table, "| {scheme} | {} | {} | {coarse} | {fine} |", solves[0], solves[1])?;
    }
    Ok(table)
}

/// Work at an error, on the straight line between two runs in logarithms; `None` if no run is that accurate. A scheme
/// whose coarsest stable run is better than asked for is charged for that run.
fn work(points: &[Point], target: f64, of: impl Fn(&Point) -> f64) -> Option<f64> {
    let reached = points.iter().position(|point| point.error <= target)?;
    let after = points[reached];
    let Some(before) = reached.checked_sub(1).map(|i| points[i]) else { return Some(of(&after)) };
    let fraction = (before.error / target).ln() / (before.error / after.error).ln();
    Some((of(&before).ln() + fraction * (of(&after) / of(&before)).ln()).exp())
}

/// The curves of the figure; the other schemes are in the table.
fn curves(series: &[Series], work: impl Fn(&Point) -> f64) -> Vec<Curve> {
    let shown: [(&str, &str, RGBColor); 9] = [
        ("Newmark(0.25, 0.5)", "trapezoidal", GRAY),
        ("Houbolt", "Houbolt", ORANGE),
        ("BDF2", "BDF2", GREEN),
        ("Park", "Park", PURPLE),
        ("Chung–Hulbert(0.8)", "Chung–Hulbert(0.8)", SKY),
        ("composite", "composite", VERMILION),
        ("Bathe", "Bathe", BLUE),
        ("central difference", "central difference", RGBColor(0, 0, 0)),
        ("Noh–Bathe(0.5400)", "Noh–Bathe(0.54)", RGBColor(0x8c, 0x56, 0x4b)),
    ];
    let find = |name: &str| series.iter().find(|series| series.scheme == name);
    let curve = |(name, label, color): (&str, &str, RGBColor)| {
        let points: Vec<_> =
            find(name)?.points.iter().map(|point| (work(point).log10(), point.error.log10())).collect();
        // A scheme that is better than the axis already at its stability limit has one point.
        Some(Curve { label: Some(label.into()), color, width: 7, points }).filter(|curve| curve.points.len() > 1)
    };
    shown.into_iter().filter_map(curve).collect()
}

fn panel(title: &str, label: &'static str, (from, to): (i32, i32), curves: Vec<Curve>) -> Panel {
    let (x, y) = (Axis::decades(label, from, to, 1), Axis::decades("relative error", -5, 0, 1));
    Panel { title: title.into(), x, y, curves, note: None }
}
