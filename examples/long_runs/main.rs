//! Runs of ten million steps: a bar that bounces, one at rest on a floor, a body at rest on a slope below its angle of
//! friction. What drifts of energy, momentum, penetration and place, what is allocated, and whether steps get harder.
//!
//! `cargo run --release --example long_runs` prints the tables of `docs/measured/long_runs.md` and writes them, in about ten
//! minutes; `--steps N` takes so many steps, `--quick` twenty thousand. The program fails if something drifts that must
//! not.
//!
//! `bounce.rs`, `rest.rs` and `slope.rs` have the scenes, `follow.rs` what is common to them.

mod bounce;
mod follow;
mod rest;
mod slope;

use contact_dynamics::{
    Bathe, CdLagrange, CentralDifference, Composite, GeneralizedAlpha, MoreauJean, Newmark, Preset,
};
use contact_dynamics_scenes::combinations::{Combination, Correction, Make, plain, preset};
use contact_dynamics_scenes::masses::{Takers, Treatment};
use std::fmt::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

type Anything = Box<dyn std::error::Error>;

const USAGE: &str = "usage: long_runs [--steps N] [--quick] [--output DIR]";

/// Elements of the bodies: few, so that there is time for many steps.
pub(crate) const ELEMENTS: usize = 8;

/// Waves travel this share of an element in a step, but for explicit schemes that must stay below.
pub(crate) const COURANT: f64 = 0.5;

fn combinations() -> Vec<Combination> {
    const SCHEMES: [(Make, Correction); 8] = [
        (|| Ok(Box::new(Composite)), Correction::History),
        (|| Ok(Box::new(Newmark::trapezoidal())), Correction::History),
        (|| Ok(Box::new(Newmark::trapezoidal())), Correction::Release),
        (|| Ok(Box::new(GeneralizedAlpha::chung_hulbert(0.8)?)), Correction::History),
        (|| Ok(Box::new(Bathe::default())), Correction::History),
        (|| Ok(Box::new(MoreauJean::new(0.5)?)), Correction::None),
        (|| Ok(Box::new(CentralDifference)), Correction::None),
        (|| Ok(Box::new(CdLagrange)), Correction::None),
    ];
    let presets = [Preset::smooth(), Preset::conservative(), Preset::explicit()];
    let tapered = Treatment::RedistributedBlend(Takers::Tapered);
    let presets = presets.map(|of| preset(|| Ok(Box::new(Composite)), tapered, of));
    let schemes = SCHEMES.map(|(make, correction)| Combination { correction, ..plain(make) });
    presets.into_iter().chain(schemes).collect()
}

/// A table of a scene: its title and head, the cells of a combination, and what of it must not be.
pub(crate) struct Scene {
    pub(crate) title: String,
    pub(crate) head: Vec<String>,
    pub(crate) run: fn(&Combination, u64) -> contact_dynamics::Result<Line>,
}

/// Cells, and what is wrong with them.
#[derive(Default)]
pub(crate) struct Line {
    pub(crate) cells: Vec<String>,
    pub(crate) wrong: Vec<String>,
}

struct Options {
    steps: u64,
    output: PathBuf,
}

impl Options {
    fn from_command_line() -> Result<Self, Anything> {
        let mut options = Self { steps: 10_000_000, output: "output/long_runs".into() };
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or(USAGE);
            match argument.as_str() {
                "--steps" => options.steps = value()?.parse()?,
                "--quick" => options.steps = 20_000,
                "--output" => options.output = value()?.into(),
                unknown => return Err(format!("unknown option {unknown}; {USAGE}").into()),
            }
        }
        if options.steps < 1000 {
            return Err("a long run has a thousand steps at least".into());
        }
        std::fs::create_dir_all(&options.output)?;
        Ok(options)
    }
}

fn main() -> Result<(), Anything> {
    let Options { steps, output } = Options::from_command_line()?;
    let (rows, scenes) =
        (combinations(), [bounce::scene(steps), rest::scene(), slope::scene(), bounce::penetration(), bounce::gains()]);
    // All runs of all tables are one list of work.
    let jobs: Vec<(usize, usize)> = (0..scenes.len()).flat_map(|s| (0..rows.len()).map(move |r| (s, r))).collect();
    let (next, threads) = (AtomicUsize::new(0), std::thread::available_parallelism().map_or(1, usize::from));
    let work = || {
        let mut done = Vec::new();
        while let Some(&(scene, row)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
            done.push(((scene, row), (scenes[scene].run)(&rows[row], steps)));
        }
        done
    };
    let mut lines: Vec<_> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("a run that panics is a finding")).collect()
    });
    lines.sort_by_key(|line| line.0);
    let (mut page, mut wrong) = (String::new(), Vec::new());
    for (k, scene) in scenes.iter().enumerate() {
        writeln!(
            page,
            "{}\n\n| scheme | {} |\n|{}",
            scene.title,
            scene.head.join(" | "),
            " --- |".repeat(scene.head.len() + 1)
        )?;
        for ((_, row), line) in lines.iter().filter(|line| line.0.0 == k) {
            let names = rows[*row].names().into_iter().filter(|name| name != "–" && name != "lumped");
            let name = names.take(2).collect::<Vec<_>>().join(", ");
            match line {
                Ok(line) if line.cells.is_empty() => {}
                Ok(line) => {
                    writeln!(page, "| {name} | {} |", line.cells.join(" | "))?;
                    wrong.extend(line.wrong.iter().map(|what| format!("{name}: {what}")));
                }
                // What is refused claims nothing.
                Err(contact_dynamics::Error::Incompatible { .. }) => {}
                Err(error) => wrong.push(format!("{name}: {error}")),
            }
        }
        page.push('\n');
    }
    println!("{page}");
    let path = output.join("long_runs.md");
    std::fs::write(&path, &page)?;
    println!("wrote {}", path.display());
    match wrong.as_slice() {
        [] => Ok(()),
        wrong => Err(wrong.join("\n").into()),
    }
}
