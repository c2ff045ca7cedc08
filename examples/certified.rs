//! Random scenes in which every step is certified: two and three bodies, and bodies that fold, in the plane and in
//! space, by all schemes. Counts crossings, gains of energy, and what the certificate costs in steps.
//!
//! `cargo run --release --example certified` draws 200 scenes a line, or as many as the variable `SCENES` says.

use contact_dynamics_random_scenes::surfaces::{Figures, Meeting, Variant, meetings, run};
use example_support::output::Output;
use std::error::Error;
use std::fmt::Write;

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
    fn add(&mut self, figures: &Figures) {
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
        self.gained += u64::from(figures.corrected && figures.gain > GAIN);
        self.found += figures.findings.len();
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let output = Output::from_command_line("certified")?;
    let seeds = match std::env::var("SCENES") {
        Ok(count) => count.parse()?,
        Err(_) if output.quick => 2,
        Err(_) => 200,
    };
    let mut table = String::from(
        "| contact | scenes | in contact | steps | halved | of them not certified | ended not certified | ended \
         otherwise | gain energy | cross |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for meeting in meetings().into_iter().filter(Meeting::keeps_apart) {
        let mut line = Line::default();
        for seed in 0..seeds {
            let figures = run(meeting, seed, Variant { certified: true, ..Variant::default() });
            line.add(&figures);
            if let Some(what) = figures.findings.first() {
                eprintln!("{meeting}, seed {seed} ({}): {what}", figures.made_of);
            }
            if figures.corrected && figures.gain > GAIN {
                eprintln!("{meeting}, seed {seed} ({}): gain {:.3}", figures.made_of, figures.gain);
            }
            if let Some((name, words)) = &figures.refused {
                eprintln!("{meeting}, seed {seed} ({}): {name}: {words}", figures.made_of);
            }
        }
        let Line { scenes, touched, steps, halved, rejected, uncertified, ended, gained, found } = line;
        writeln!(
            table,
            "| {meeting} | {scenes} | {touched} | {steps} | {halved} | {rejected} | {uncertified} | {ended} | {gained} \
             | {found} |"
        )?;
    }
    println!("{table}");
    output.write("certified.md", &table)
}
