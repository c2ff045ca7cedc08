//! Integrators, corrections and mass matrices against each other: two bars that collide, bars of different stiffness
//! and length, a bar that bounces, a soft disc.
//!
//! `cargo run --release --example stabilization_matrix` prints the tables of `docs/measured/corrections.md` and writes them, a
//! figure and all numbers (`stabilization_matrix.csv`); with `--quick` meshes are coarse, phases two, and times are not
//! measured.
//!
//! `combinations.rs` has the rows, by rules; what is measured of them is in `examples/support/src/collisions.rs`.

mod combinations;
mod pareto;
mod report;

use combinations::Combination;
use contact_dynamics::Error as Refused;
use contact_dynamics_scenes::disc::SoftDisc;
use example_support::collisions::{Collision, Swept, bounces, disc};
use example_support::output::Output;
use example_support::output::decimal;
use report::{Cell, Column, Results, table};
use std::error::Error;
use std::fmt::Write;

/// How much is run.
struct Extent {
    /// Elements of the paper's bars, and those of the main table.
    elements: Vec<usize>,
    main: usize,
    steps: Vec<f64>,
    phases: Vec<f64>,
    /// Elements of the dissimilar bars, of the shorter of the unequal ones, of the bar that bounces.
    dissimilar: usize,
    unequal: usize,
    bouncing: usize,
    /// Elements across the disc, and the time it is followed.
    disc: (usize, f64),
    /// Of the measurement of time.
    repetitions: usize,
}

impl Extent {
    fn full() -> Self {
        Self {
            elements: vec![20, 50, 100, 400],
            main: 100,
            steps: vec![2e-3, 1e-3, 5e-4, 2.5e-4],
            phases: (0..10).map(|k| 0.05 + 0.1 * f64::from(k)).collect(),
            dissimilar: 100,
            unequal: 50,
            bouncing: 100,
            disc: (24, 40.0),
            repetitions: 60,
        }
    }

    fn quick() -> Self {
        Self {
            elements: vec![20],
            main: 20,
            steps: vec![1e-3],
            phases: vec![0.25, 0.75],
            dissimilar: 25,
            unequal: 12,
            bouncing: 20,
            disc: (8, 20.0),
            repetitions: 0,
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("stabilization_matrix")?;
    let extent = if output.quick { Extent::quick() } else { Extent::full() };
    let all = combinations::all();
    let mut refusals = Vec::new();
    let mut csv = String::from("scene,elements,h,integrator,correction,mass,figure,mean,worst\n");
    let mut page = String::new();

    // Every scene is measured for every row; what does not go together, or breaks off, is noted.
    let mut measure = |scene, elements, h, run: &dyn Fn(&Combination) -> contact_dynamics::Result<Vec<Swept>>| {
        let mut rows = Vec::new();
        for combination in &all {
            rows.push(match run(combination) {
                Ok(figures) => Some(figures),
                Err(error) => {
                    let what = combination.names().join(", ");
                    let verb = if matches!(error, Refused::Incompatible { .. }) { "is refused" } else { "fails" };
                    refusals.push(format!("- {scene}, {elements}: {what} {verb}: {error}"));
                    None
                }
            });
        }
        let results = Results { scene, elements, h, rows };
        csv += &results.csv(&all);
        results
    };

    let phases = &extent.phases;
    let h = 1e-3;
    let mut sizes = Vec::new();
    for &n in &extent.elements {
        sizes.push(measure("bars", n, h, &|row| Collision::paper(n, h).measure(row, phases)));
    }
    let mut steps = Vec::new();
    for &h in &extent.steps {
        steps.push(measure("steps", 50, h, &|row| Collision::paper(50, h).measure(row, phases)));
    }
    let h = 5e-4;
    let n = extent.dissimilar;
    let dissimilar = measure("dissimilar", n, h, &|row| Collision::dissimilar(n, h).measure_plateaus(row, phases));
    let h = 1e-3;
    let n = extent.unequal;
    let unequal = measure("unequal", n, h, &|row| Collision::unequal(n, h).measure_touching(row, phases));
    let n = extent.bouncing;
    let bouncing = measure("bouncing", n, 0.5 * 10.0 / n as f64 / 30.0, &|row| bounces(row, n, 0.5));
    let (cells, until) = extent.disc;
    let body = SoftDisc::new(cells);
    let falling = measure("disc", cells, 0.05, &|row| disc(row, &body, until));

    let main = sizes.iter().position(|results| results.elements == extent.main).ok_or("no main table")?;
    let cost = costs(&all, extent.main, extent.repetitions);
    let mut main_results = sizes.remove(main);
    for (row, (combination, cost)) in all.iter().zip(&cost).enumerate() {
        let Some(cost) = *cost else { continue };
        let time = Swept { name: "time", mean: cost, worst: cost };
        csv += &main_results.line(combination, &time);
        main_results.rows[row].iter_mut().for_each(|figures| figures.push(time));
    }

    writeln!(page, "{}", main_table(&all, &main_results))?;
    writeln!(page, "{}", front(&all, &main_results, &cost))?;
    if !sizes.is_empty() {
        writeln!(page, "{}", sizes_table(&all, &sizes))?;
    }
    writeln!(page, "{}", steps_table(&all, &steps))?;
    writeln!(page, "{}", plateaus_table(&all, &dissimilar))?;
    writeln!(page, "{}", touching_table(&all, &unequal))?;
    writeln!(page, "{}", bounces_table(&all, &bouncing))?;
    writeln!(page, "{}", disc_table(&all, &falling))?;
    if !refusals.is_empty() {
        writeln!(page, "Left out:\n\n{}", refusals.join("\n"))?;
    }
    println!("{page}");
    output.write("stabilization_matrix.md", &page)?;
    output.write("stabilization_matrix.csv", &csv)?;
    output.write("stabilization_matrix.svg", &pareto::figure(&all, &main_results, &cost)?)
}

/// Time of a step of every row over that of the trapezoidal rule with a lumped mass.
fn costs(all: &[Combination], elements: usize, repetitions: usize) -> Vec<Option<f64>> {
    let scene = Collision::paper(elements, 1e-3);
    let time = |row: &Combination| scene.time_per_step(row, repetitions).ok().filter(|time| time.is_finite());
    let base = time(&combinations::reference());
    all.iter().map(|row| Some(time(row)? / base?)).collect()
}

/// Columns of a table of one scene.
fn columns<'a>(results: &'a Results, list: &[(&'a str, &'a str, Cell)]) -> Vec<Column<'a>> {
    list.iter().map(|&(heading, figure, cell)| Column { heading, results, figure, cell }).collect()
}

fn main_table(all: &[Combination], results: &Results) -> String {
    let title =
        format!("Paper's bars, {} elements each, h = {} s, mean over the phases (worst)", results.elements, results.h);
    let list = [
        ("F_in", "force_in", Cell::Mean(1.0, 3)),
        ("F_L1", "force_l1", Cell::Both(1.0, 4)),
        ("F_L2", "force_l2", Cell::Both(1.0, 3)),
        ("max/F₀", "force_max", Cell::Both(1.0, 3)),
        ("TV", "force_variation", Cell::Mean(1.0, 2)),
        ("V_L2", "velocity_l2", Cell::Mean(1.0, 3)),
        ("loss %", "energy_loss", Cell::Both(100.0, 3)),
        ("touch ms", "touch", Cell::Worst(1e3, 1)),
        ("release ms", "release", Cell::Both(1e3, 1)),
        ("penetration", "penetration", Cell::Worst(1.0, 2)),
        ("changes", "changes", Cell::Both(1.0, 1)),
        ("closure", "closure", Cell::Power),
        ("solves", "solves", Cell::Mean(1.0, 1)),
        ("time", "time", Cell::Mean(1.0, 2)),
    ];
    table(&title, all, &columns(results, &list))
}

/// The rows that no other one beats.
fn front(all: &[Combination], results: &Results, cost: &[Option<f64>]) -> String {
    let head = "Rows that no other one beats in F_L1, max/F₀, loss and time together, with their numbers in the \
                figure:\n\n\
                | | integrator | correction | mass | F_L1 | max/F₀ | loss % | time |\n\
                | --- | --- | --- | --- | --- | --- | --- | --- |\n";
    let line = |(number, row): (usize, usize)| {
        let names = all[row].names().join(" | ");
        let mean = |name| results.of(row, name).map_or(f64::NAN, |swept| swept.mean);
        let [force, largest] = [decimal(mean("force_l1"), 4), decimal(mean("force_max"), 3)];
        let loss = decimal(100.0 * mean("energy_loss"), 3);
        let time = cost[row].map_or("–".into(), |time| decimal(time, 2));
        format!("| {number} | {names} | {force} | {largest} | {loss} | {time} |\n")
    };
    head.to_owned() + &(1..).zip(pareto::front(results, cost)).map(line).collect::<String>()
}

fn sizes_table(all: &[Combination], sizes: &[Results]) -> String {
    let headings: Vec<[String; 3]> = sizes
        .iter()
        .map(|results| ["F_L1", "max/F₀", "loss %"].map(|heading| format!("n = {}: {heading}", results.elements)))
        .collect();
    let figures =
        [("force_l1", Cell::Mean(1.0, 4)), ("force_max", Cell::Mean(1.0, 3)), ("energy_loss", Cell::Mean(100.0, 3))];
    let mut columns = Vec::new();
    for (results, headings) in sizes.iter().zip(&headings) {
        for (heading, (figure, cell)) in headings.iter().zip(figures) {
            columns.push(Column { heading, results, figure, cell });
        }
    }
    table("Paper's bars of other meshes, h = 0.001 s, mean over the phases", all, &columns)
}

fn steps_table(all: &[Combination], steps: &[Results]) -> String {
    let headings: Vec<[String; 3]> = steps
        .iter()
        .map(|results| ["F_L2", "max/F₀", "loss %"].map(|heading| format!("h = {} ms: {heading}", 1e3 * results.h)))
        .collect();
    let figures =
        [("force_l2", Cell::Worst(1.0, 3)), ("force_max", Cell::Worst(1.0, 2)), ("energy_loss", Cell::Mean(100.0, 2))];
    let mut columns = Vec::new();
    for (results, headings) in steps.iter().zip(&headings) {
        for (heading, (figure, cell)) in headings.iter().zip(figures) {
            columns.push(Column { heading, results, figure, cell });
        }
    }
    table("Paper's bars, 50 elements each, other steps; worst force, mean loss", all, &columns)
}

fn plateaus_table(all: &[Combination], results: &Results) -> String {
    let title = format!("Dissimilar bars, {} elements each, h = {} s, mean (worst)", results.elements, results.h);
    let list = [
        ("F_L1", "force_l1", Cell::Both(1.0, 4)),
        ("first plateau %", "plateau_1", Cell::Worst(100.0, 2)),
        ("second plateau %", "plateau_2", Cell::Worst(100.0, 2)),
        ("release ms", "release", Cell::Both(1e3, 1)),
        ("v₁ (0.01142)", "speed_1", Cell::Worst(1.0, 5)),
        ("v₂ (0.08858)", "speed_2", Cell::Worst(1.0, 5)),
        ("e (0.7716)", "restitution", Cell::Worst(1.0, 4)),
        ("changes", "changes", Cell::Both(1.0, 1)),
        ("loss %", "energy_loss", Cell::Mean(100.0, 3)),
    ];
    table(&title, all, &columns(results, &list))
}

fn touching_table(all: &[Combination], results: &Results) -> String {
    let title = format!(
        "Bars of length 10 and 20, {} and {} elements, h = {} s: touching without force, mean (worst)",
        results.elements,
        2 * results.elements,
        results.h
    );
    let list = [
        ("F_L1", "force_l1", Cell::Both(1.0, 4)),
        ("changes", "changes", Cell::Both(1.0, 1)),
        ("force/F₀", "touching_force", Cell::Both(1.0, 4)),
        ("widest gap", "widest_gap", Cell::Worst(1.0, 4)),
        ("e (0.5)", "restitution", Cell::Worst(1.0, 4)),
        ("impulse %", "impulse", Cell::Worst(100.0, 2)),
        ("loss %", "energy_loss", Cell::Mean(100.0, 3)),
    ];
    table(&title, all, &columns(results, &list))
}

fn bounces_table(all: &[Combination], results: &Results) -> String {
    let title = format!("Bouncing bar, {} elements, Courant number 1/2: energy after each period", results.elements);
    let list = [
        ("1", "energy_1", Cell::Mean(1.0, 4)),
        ("2", "energy_2", Cell::Mean(1.0, 4)),
        ("3", "energy_3", Cell::Mean(1.0, 4)),
        ("4", "energy_4", Cell::Mean(1.0, 4)),
        ("5", "energy_5", Cell::Mean(1.0, 4)),
        ("6", "energy_6", Cell::Mean(1.0, 4)),
        ("F_in", "force_in", Cell::Mean(1.0, 3)),
        ("ramp", "ramp", Cell::Mean(1.0, 4)),
        ("max", "force_max", Cell::Mean(1.0, 3)),
        ("touch ms", "touch_1", Cell::Mean(1e3, 1)),
        ("release ms", "release_1", Cell::Mean(1e3, 1)),
        ("second touch ms", "touch_2", Cell::Mean(1e3, 1)),
        ("second release ms", "release_2", Cell::Mean(1e3, 1)),
        ("changes", "changes", Cell::Mean(1.0, 0)),
    ];
    table(&title, all, &columns(results, &list))
}

fn disc_table(all: &[Combination], results: &Results) -> String {
    let title = format!("Soft disc, {0} x {0} elements, h = {1} s", results.elements, results.h);
    let list = [
        ("loss %", "energy_loss", Cell::Mean(100.0, 2)),
        ("highest rise %", "energy_rise", Cell::Mean(100.0, 3)),
        ("max force/weight", "force_max", Cell::Mean(1.0, 3)),
        ("TV/max", "force_variation", Cell::Mean(1.0, 2)),
        ("pressure max/median", "pressure_ratio", Cell::Mean(1.0, 3)),
        ("penetration", "penetration", Cell::Mean(1.0, 3)),
        ("changes", "changes", Cell::Mean(1.0, 2)),
    ];
    table(&title, all, &columns(results, &list))
}
