//! Scenes by chance of all constraints with all that they can be given: what is refused, what gains energy.

use contact_dynamics_random_scenes::surfaces::{Figures, Meeting, Variant, meetings, run};
use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write;

/// A rise of the energy that is not the scheme's own.
const GAIN: f64 = 0.01;

/// What the scenes of a line were like.
#[derive(Default)]
struct Line {
    scenes: u32,
    closed: u32,
    halved: u64,
    /// Names of errors that ended runs, by the motion of the obstacle: how often, and how often though steps were
    /// halved.
    ended: [BTreeMap<&'static str, [u32; 2]>; 3],
    gained: u32,
    highest: f64,
    depth: f64,
    found: usize,
}

impl Line {
    fn add(&mut self, meeting: Meeting, figures: &Figures) {
        self.scenes += 1;
        self.closed += u32::from(figures.touched);
        self.halved += figures.halved;
        if let Some((name, _)) = &figures.refused {
            let [all, in_vain] = self.ended[meeting.motion()].entry(short(name)).or_default();
            *all += 1;
            *in_vain += u32::from(figures.halves);
        }
        if figures.corrected {
            self.gained += u32::from(figures.gain > GAIN);
            self.highest = self.highest.max(figures.gain);
        }
        self.depth = self.depth.max(figures.depth);
        self.found += figures.findings.len();
    }

    fn write(&self, table: &mut String) -> std::fmt::Result {
        let Self { scenes, closed, halved, ended, gained, highest, depth, found } = self;
        write!(table, " {scenes} | {closed} | {halved} |")?;
        for errors in ended {
            let word = |(name, [all, in_vain]): (&&str, &[u32; 2])| match in_vain {
                0 => format!("{all} {name}"),
                _ => format!("{all} {name} ({in_vain})"),
            };
            let words: Vec<_> = errors.iter().map(word).collect();
            let space = if words.is_empty() { "" } else { " " };
            write!(table, "{space}{} |", words.join(", "))?;
        }
        writeln!(table, " {gained} | {highest:.0e} | {depth:.0e} | {found} |")
    }
}

/// What an error says, in a word.
fn short(name: &str) -> &'static str {
    match name {
        "PassedThrough" => "passed",
        "ContactLost" => "lost",
        "Contact" | "ContactUnsettled" => "unsolved",
        "InitialViolation" => "inside at first",
        "Inadmissible" | "IndefiniteTangent" | "NewtonNotConverged" => "crumpled",
        _ => "other",
    }
}

/// A line for each constraint and what it is given.
pub(crate) fn table(quick: bool) -> Result<String, Box<dyn Error>> {
    let mut table = String::from(
        "Scenes by chance, 40 steps each: those in which a contact closed, attempts of steps that were halved, runs \
         that ended with an error by the motion of the obstacle (in parentheses those that halve steps), corrected \
         runs whose energy rises by more than 1 %, their largest rise over the energy at the start, deepest node over \
         the element size, findings\n\n\
         | constraint | with | scenes | closed | halved | ended, at rest | moving | turning | gain | largest | \
         deepest | found |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let seeds = if quick { 1..2 } else { 1..61 };
    let mut lines: Vec<(String, Line)> = Vec::new();
    for meeting in meetings() {
        let name = format!("| {} | {}, {}-D |", meeting.constraint(), meeting.what(), meeting.space());
        if lines.last().is_none_or(|line| line.0 != name) {
            lines.push((name, Line::default()));
        }
        let Some((_, line)) = lines.last_mut() else { continue };
        for seed in seeds.clone() {
            let figures = run(meeting, seed, Variant::default());
            line.add(meeting, &figures);
            let gains = figures.corrected && figures.gain > GAIN;
            if gains || !figures.findings.is_empty() {
                let Figures { gain, findings, made_of, .. } = &figures;
                eprintln!("{meeting}, seed {seed} ({made_of}): gain {gain:.3} {findings:?}");
            }
            if let Some((name, words)) = &figures.refused {
                eprintln!("{meeting}, seed {seed} ({}): {name}: {words}", figures.made_of);
            }
        }
    }
    for (name, line) in &lines {
        write!(table, "{name}")?;
        line.write(&mut table)?;
    }
    Ok(table)
}
