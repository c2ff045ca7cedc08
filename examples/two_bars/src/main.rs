//! The paper's experiment: two equal elastic bars fly toward each other, collide, and swap velocities.
//!
//! ```text
//! cargo run --release -p two-bars            # the paper's data, 50 elements a bar, h = 1 ms
//! cargo run --release -p two-bars -- --help  # options
//! ```
//!
//! Prints how well each integrator reproduces the exact solution without correction, with the persistency correction,
//! and with the correction and the projection of the past. Writes the same table, figures and time histories to
//! `output/two_bars/`.
//!
//! `experiment.rs` shows how the library is used; the other modules only present the results.

mod experiment;
mod figures;
mod history;
mod options;
mod table;

use experiment::{Experiment, Run, before_and_after};
use options::{Command, HELP, Options};
use std::error::Error;
use std::fmt;
use std::fs;
use std::io::{self, Write};
use std::path::Path;
use table::Table;

fn main() -> Result<(), Failure> {
    run().map_err(Failure)
}

fn run() -> Result<(), Box<dyn Error>> {
    match options::parse(std::env::args().skip(1))? {
        Command::Help => write!(io::stdout(), "{HELP}")?,
        Command::Run(options) => present(&options)?,
    }
    Ok(())
}

/// An error in words: the runtime shows what `main` returns by `Debug`.
struct Failure(Box<dyn Error>);

impl fmt::Debug for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

/// Runs every chosen case, prints the table and writes the files.
fn present(options: &Options) -> Result<(), Box<dyn Error>> {
    let experiment = Experiment::new(options.elements, options.step, options.phase);
    let (schemes, corrections) = (options.schemes.len(), options.corrections.len());
    writeln!(
        io::stdout(),
        "Two elastic bars fly toward each other and collide: {}, {schemes} schemes × {corrections} corrections.\n",
        experiment.data()
    )?;
    let mut runs = Vec::new();
    for &scheme in &options.schemes {
        for &correction in &options.corrections {
            runs.push(experiment.run(scheme, correction, options.repetitions)?);
        }
    }
    let table = Table::new(&experiment, &runs, options.repetitions);
    // Not println!: a reader who closes the pipe early ends the program with a message, not with a panic.
    writeln!(io::stdout(), "{}", table.text())?;

    let output = &options.output;
    fs::create_dir_all(output).map_err(|error| format!("cannot create {}: {error}", output.display()))?;
    write(output, "table.md", &table.markdown())?;
    write(output, "two_bars.csv", &history::csv(&experiment, &runs))?;
    let of_each_scheme: Vec<&[Run]> = runs.chunk_by(|a, b| a.scheme == b.scheme).collect();
    for runs in &of_each_scheme {
        write_histories(output, &experiment, runs)?;
    }
    write(output, "force.txt", &figures::force_in_characters(&experiment, of_each_scheme[0]))?;
    write(output, "force.svg", &figures::force(&experiment, of_each_scheme[0])?)
}

/// The figures before and after correction of one integrator's runs, as far as they were computed.
fn write_histories(output: &Path, experiment: &Experiment, runs: &[Run]) -> Result<(), Box<dyn Error>> {
    for (run, name) in before_and_after(runs).into_iter().zip(["before", "after"]) {
        if let Some(run) = run {
            let file = format!("{}_{name}.svg", run.scheme.key());
            write(output, &file, &figures::histories(experiment, run)?)?;
        }
    }
    Ok(())
}

/// Writes a file and says so.
fn write(directory: &Path, name: &str, content: &str) -> Result<(), Box<dyn Error>> {
    let path = directory.join(name);
    fs::write(&path, content).map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    Ok(writeln!(io::stdout(), "wrote {}", path.display())?)
}
