//! A dam of twenty blocks in a valley, whose joints open and close in an earthquake: in one factor, by bodies, by
//! bodies on two threads, body by body with a frame between them, and with reduced blocks.
//!
//! `cargo run --release --features rayon --example dam -- --output target/dam` prints the tables of
//! `docs/scenes/dam.md` and `docs/measured/dam.md` and writes them and the record of the earthquake; with `--quick` the
//! mesh is coarse and the run short. Without the feature everything takes one thread.
//!
//! `valley.rs` has the blocks, their joints and loads, `record.rs` what is written down of a run, `whole.rs` the runs
//! of one system, `split.rs` the loop body by body, `threads.rs` the threads.

mod record;
mod split;
mod threads;
mod valley;
mod whole;

use contact_dynamics::Automatic;
use contact_dynamics::{ByBody, Cholesky};
use contact_dynamics_scenes::ground::Ground;
use example_support::output::Output;
use example_support::output::decimal;
use record::Record;
use std::error::Error;
use std::fmt::Write;
use valley::Scheme::{Damped, Trapezoidal};
use valley::{Dam, Loading, Plan};

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("dam")?;
    let plan = if output.quick { Plan::QUICK } else { Plan::FULL };
    let loading = Loading { ground: earthquake(&output, "ground", plan.duration())? };
    let dam = Dam::new(&plan);
    let records = records(&dam, &loading, &plan)?;
    let rubbing = rubbing(if output.quick { 10 } else { 60 }, &output)?;
    let page = [scene(&dam, &records[0])?, costs(&records)?, joints(&records)?, friction(&rubbing)?].join("\n");
    println!("{page}");
    output.write("dam.md", &page)
}

/// The ground motion across the valley, downstream and upward: made, written, and read again.
fn earthquake(output: &Output, file: &str, duration: f64) -> Result<[Ground; 3], Box<dyn Error>> {
    let mut read = Vec::new();
    for (name, seed, peak) in [("across", 11, 3.5), ("downstream", 12, 3.5), ("upward", 13, 2.0)] {
        let file = format!("{file}_{name}.txt");
        let made = Ground::kanai_tajimi(seed, peak, duration);
        output.write(&file, &made.to_text(&format!("Kanai-Tajimi noise, seed {seed}, {name}")))?;
        read.push(Ground::from_text(&std::fs::read_to_string(output.directory.join(&file))?)?);
    }
    read.try_into().map_err(|_| "three components".into())
}

/// All variants, the monolithic one first.
fn records(dam: &Dam, loading: &Loading, plan: &Plan) -> Result<Vec<Record>, Box<dyn Error>> {
    let cholesky = || Box::new(Cholesky::default());
    let by_body = || Box::new(ByBody::new(Automatic));
    let mut records = vec![
        threads::in_pool(1, || whole::meshes("one factor", Trapezoidal, dam, loading, plan, cholesky()))?,
        threads::in_pool(1, || whole::meshes("by bodies", Trapezoidal, dam, loading, plan, by_body()))?,
        threads::in_pool(1, || split::run("body by body, a frame between them", dam, loading, plan))?,
    ];
    if threads::THERE {
        let name = "by bodies, two threads";
        records.push(threads::in_pool(2, || whole::meshes(name, Trapezoidal, dam, loading, plan, by_body()))?);
        records.push(threads::in_pool(2, || split::run("body by body, two threads", dam, loading, plan))?);
    } else {
        println!("without the feature `rayon` there are no runs on two threads\n");
    }
    let name = "one factor, Chung–Hulbert(0.9)";
    records.push(threads::in_pool(1, || whole::meshes(name, Damped, dam, loading, plan, cholesky()))?);
    for &way in plan.reduced {
        records.push(threads::in_pool(1, || whole::reduced(dam, loading, plan, way))?);
    }
    Ok(records)
}

/// A coarse dam whose joints do not rub, and those that take friction with it.
fn rubbing(steps: usize, output: &Output) -> Result<Vec<Record>, Box<dyn Error>> {
    let [smooth, rough] = [0.0, 0.6].map(|friction| Plan::rubbing(friction, steps));
    let loading = Loading { ground: earthquake(output, "short_ground", smooth.duration())? };
    let dam = Dam::new(&smooth);
    let cholesky = || Box::new(Cholesky::default());
    let by_body = || Box::new(ByBody::new(Automatic));
    let mut records = vec![
        threads::in_pool(1, || {
            whole::meshes("one factor, no friction", Trapezoidal, &dam, &loading, &smooth, cholesky())
        })?,
        threads::in_pool(1, || whole::meshes("one factor", Trapezoidal, &dam, &loading, &rough, cholesky()))?,
        threads::in_pool(1, || whole::meshes("by bodies", Trapezoidal, &dam, &loading, &rough, by_body()))?,
    ];
    for &way in rough.reduced {
        records.push(threads::in_pool(1, || whole::reduced(&dam, &loading, &rough, way))?);
    }
    Ok(records)
}

/// What is computed, and what the dam does.
fn scene(dam: &Dam, record: &Record) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "The dam, and what its joints do (one factor)\n\n\
         | blocks | dofs | contacts | steps | closed at most | at least | openings and closings | largest force of a \
         joint, MN | at the start | largest opening, mm |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let closed = |pick: fn(usize, usize) -> usize| record.closed.iter().copied().reduce(pick).unwrap_or(0);
    writeln!(
        table,
        "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
        dam.blocks.len(),
        dam.dofs(),
        dam.contacts.len(),
        record.forces.len() - 1,
        closed(usize::max),
        closed(usize::min),
        record.changes,
        decimal(1e-6 * record::largest(&record.forces), 1),
        decimal(1e-6 * record::largest(&record.forces[..1]), 1),
        decimal(1e3 * record::largest(&record.openings), 2)
    )?;
    Ok(table)
}

/// All variants side by side.
fn costs(records: &[Record]) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Differences from the first row, of massless blocks from the meshes under their scheme (largest over joints \
         and time, of the largest force and opening), time and memory\n\n\
         | variant | unknowns | forces | openings | build, s | step, ms | factors, MB | held, MB |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let mega = |bytes: usize| decimal(1e-6 * bytes as f64, 1);
    let damped = records.iter().find(|record| record.is_damped);
    for record in records {
        // (Meshes with the first of them, whatever the scheme.)
        let other = damped.filter(|_| record.is_damped && record.is_reduced).unwrap_or(&records[0]);
        let differences =
            [record::difference(&record.forces, &other.forces), record::difference(&record.openings, &other.openings)]
                .map(|difference| if difference > 0.0 { format!("{difference:.0e}") } else { "–".into() });
        writeln!(
            table,
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            record.name,
            record.unknowns,
            differences[0],
            differences[1],
            decimal(record.build, 2),
            decimal(record.step(), 1),
            mega(record.factor),
            record.held.map_or("–".into(), mega)
        )?;
    }
    Ok(table)
}

/// Largest force and opening of some joints, of the meshes and of the reduced blocks.
fn joints(records: &[Record]) -> Result<String, Box<dyn Error>> {
    let is_shown = |record: &Record| record.is_damped || record.is_reduced;
    let shown: Vec<&Record> = records.iter().take(1).chain(records.iter().filter(|r| is_shown(r))).collect();
    let heads = shown.iter().map(|record| format!(" {}: force, MN | opening, mm |", record.name));
    let mut table =
        format!("Largest force and opening of every third joint\n\n| joint |{}\n", heads.collect::<String>());
    writeln!(table, "| --- |{}", " --- | --- |".repeat(shown.len()))?;
    let count = records[0].forces.first().map_or(0, Vec::len);
    for joint in (0..count).step_by(3) {
        let of = |rows: &[Vec<f64>]| rows.iter().fold(0.0_f64, |most, row| most.max(row[joint]));
        let cell = |record: &&Record| {
            let [force, opening] = [1e-6 * of(&record.forces), 1e3 * of(&record.openings)];
            format!(" {} | {} |", decimal(force, 1), decimal(opening, 2))
        };
        writeln!(table, "| {} |{}", joint + 1, shown.iter().map(cell).collect::<String>())?;
    }
    Ok(table)
}

/// What friction does, and which variants agree on it.
fn friction(records: &[Record]) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Joints that rub, on a coarse mesh; differences from the second row\n\n\
         | variant | unknowns | largest force of a joint, MN | largest opening, mm | largest slip, mm | forces | \
         openings | step, ms |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (place, record) in records.iter().enumerate() {
        let differences = [
            record::difference(&record.forces, &records[1].forces),
            record::difference(&record.openings, &records[1].openings),
        ]
        .map(|difference| if place == 1 { "–".into() } else { format!("{difference:.0e}") });
        writeln!(
            table,
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            record.name,
            record.unknowns,
            decimal(1e-6 * record::largest(&record.forces), 1),
            decimal(1e3 * record::largest(&record.openings), 2),
            decimal(1e3 * record.slip, 2),
            differences[0],
            differences[1],
            decimal(record.step(), 1)
        )?;
    }
    Ok(table)
}
