//! Random scenes in which every step is certified: two and three bodies, and bodies that fold, in the plane and in
//! space, by all schemes. Counts crossings, gains of energy, and what the certificate costs in steps.
//!
//! `cargo run --release --example certified` draws 200 scenes a line, or as many as the variable `SCENES` says, on all
//! cores.

use contact_dynamics_random_scenes::surfaces::{Figures, Meeting, Variant, meetings, run};
use example_support::output::Output;
use std::error::Error;
use std::thread;

/// A rise of the energy that is not the scheme's own.
const GAIN: f64 = 0.01;

#[derive(Default)]
struct Line {
    scenes: u64,
    touched: u64,
    steps: u64,
    /// Halved attempts, and the number of them that had no certificate.
    halved: u64,
    rejected: usize,
    /// Runs that ended early: without a certificate, or for another reason.
    uncertified: u64,
    ended: u64,
    /// Corrected runs whose energy rises.
    gained: u64,
    found: usize,
}

impl Line {
    /// Runs the seeds `first`, `first + stride`, … below `seeds`, and says what is wrong with any.
    fn of(meeting: Meeting, first: usize, stride: usize, seeds: u64) -> Self {
        let mut line = Self::default();
        for seed in (0..seeds).skip(first).step_by(stride) {
            let figures = run(meeting, seed, Variant { certified: true, ..Variant::default() });
            line.count(&figures);
            let scene = || format!("{meeting}, seed {seed} ({})", figures.made_of);
            if let Some(what) = figures.findings.first() {
                eprintln!("{}: {what}", scene());
            }
            if gains(&figures) {
                eprintln!("{}: gain {:.3}", scene(), figures.gain);
            }
            if let Some((name, words)) = &figures.refused {
                eprintln!("{}: {name}: {words}", scene());
            }
        }
        line
    }

    fn count(&mut self, figures: &Figures) {
        self.scenes += 1;
        self.touched += u64::from(figures.touched);
        self.steps += figures.steps;
        self.halved += figures.halved;
        self.rejected += figures.rejected;
        match &figures.refused {
            Some((name, _)) if name == "NotCertified" => self.uncertified += 1,
            Some(_) => self.ended += 1,
            None => {}
        }
        self.gained += u64::from(gains(figures));
        self.found += figures.findings.len();
    }

    fn add(&mut self, other: &Self) {
        self.scenes += other.scenes;
        self.touched += other.touched;
        self.steps += other.steps;
        self.halved += other.halved;
        self.rejected += other.rejected;
        self.uncertified += other.uncertified;
        self.ended += other.ended;
        self.gained += other.gained;
        self.found += other.found;
    }
}

/// Whether the energy of a corrected run rises.
fn gains(figures: &Figures) -> bool {
    figures.corrected && figures.gain > GAIN
}

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("certified")?;
    let seeds = match std::env::var("SCENES") {
        Ok(count) => count.parse()?,
        Err(_) if output.quick => 2,
        Err(_) => 200,
    };
    let mut table = String::new();
    let mut print = |row: String| {
        println!("{row}");
        table.push_str(&row);
        table.push('\n');
    };
    print(
        "| contact | scenes | in contact | steps | halved | of them not certified | ended not certified | ended \
         otherwise | gain energy | cross |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
            .to_owned(),
    );
    let cores = thread::available_parallelism()?.get();
    for meeting in meetings().into_iter().filter(Meeting::keeps_apart) {
        let mut line = Line::default();
        thread::scope(|scope| {
            let start = |first| scope.spawn(move || Line::of(meeting, first, cores, seeds));
            let parts: Vec<_> = (0..cores).map(start).collect();
            for part in parts {
                line.add(&part.join().expect("no scene panics"));
            }
        });
        let Line { scenes, touched, steps, halved, rejected, uncertified, ended, gained, found } = line;
        print(format!(
            "| {meeting} | {scenes} | {touched} | {steps} | {halved} | {rejected} | {uncertified} | {ended} | {gained} \
             | {found} |"
        ));
    }
    output.write("certified.md", &table)
}
