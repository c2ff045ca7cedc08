//! What came of many scenes, in tables.

use contact_dynamics_random_scenes::rows::{KINDS, Precision, Recipe, Verdict};
use std::collections::BTreeMap;
use std::fmt;
use std::ops::AddAssign;

/// Scenes of a kind.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    scenes: u64,
    built: u64,
    steps: u64,
    closed: u64,
    compared: u64,
    ended: u64,
    by_rounding: u64,
    findings: u64,
}

impl AddAssign for Count {
    fn add_assign(&mut self, other: Self) {
        self.scenes += other.scenes;
        self.built += other.built;
        self.steps += other.steps;
        self.closed += other.closed;
        self.compared += other.compared;
        self.ended += other.ended;
        self.by_rounding += other.by_rounding;
        self.findings += other.findings;
    }
}

#[derive(Debug, Default)]
pub(crate) struct Tally {
    kinds: BTreeMap<&'static str, Count>,
    /// By the name of the error: before the first step, and later, with the words of the first.
    refused: BTreeMap<String, ([u64; 2], u64, String)>,
    /// Scenes in single precision on which nothing acts from outside; those whose momentum changes by more than 3 %,
    /// and by how much at most if they are run in double precision.
    single: u64,
    drifting: u64,
    in_double: f64,
    /// Seeds by what fails.
    findings: BTreeMap<&'static str, Vec<u64>>,
}

impl Tally {
    pub(crate) fn add(&mut self, seed: u64, recipe: &Recipe, verdict: Verdict) {
        *self.kinds.entry(recipe.kind).or_default() += Count {
            scenes: 1,
            built: u64::from(verdict.built),
            steps: verdict.steps as u64,
            closed: verdict.closed as u64,
            compared: verdict.compared as u64,
            ended: u64::from(verdict.built && verdict.refused.is_some()),
            by_rounding: u64::from(verdict.by_rounding),
            findings: u64::from(verdict.finding.is_some()),
        };
        if recipe.precision == Precision::Single && recipe.conserves_momentum() && verdict.built {
            self.single += 1;
            if verdict.momentum > 0.03 {
                let double = Recipe { precision: Precision::Double, ..recipe.clone() };
                self.drifting += 1;
                self.in_double = self.in_double.max(double.examine().momentum);
            }
        }
        if let Some((name, words)) = verdict.refused {
            let refused = self.refused.entry(name).or_insert(([0; 2], seed, words));
            refused.0[usize::from(verdict.built)] += 1;
        }
        if let Some(finding) = verdict.finding {
            self.findings.entry(finding.what).or_default().push(seed);
        }
    }

    pub(crate) fn merge(&mut self, other: Self) {
        for (kind, count) in other.kinds {
            *self.kinds.entry(kind).or_default() += count;
        }
        self.single += other.single;
        self.drifting += other.drifting;
        self.in_double = self.in_double.max(other.in_double);
        for (name, (counts, seed, words)) in other.refused {
            let all = self.refused.entry(name).or_insert(([0; 2], seed, words));
            all.0[0] += counts[0];
            all.0[1] += counts[1];
        }
        for (what, seeds) in other.findings {
            let all = self.findings.entry(what).or_default();
            all.extend(seeds);
            all.sort_unstable();
        }
    }

    pub(crate) fn findings(&self) -> usize {
        self.findings.values().map(Vec::len).sum()
    }

    /// Seeds of the first scenes that fail in each way.
    pub(crate) fn worst(&self, most: usize) -> impl Iterator<Item = u64> {
        self.findings.values().flat_map(move |seeds| seeds.iter().take(most)).copied()
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| scenes of | drawn | run | ended early | steps | in contact | compared | rounding decides | failed |"
        )?;
        writeln!(f, "| --- | --- | --- | --- | --- | --- | --- | --- | --- |")?;
        let mut all = Count::default();
        let line = |f: &mut fmt::Formatter<'_>, name: &str, c: &Count| {
            let Count { scenes, built, steps, closed, compared, ended, by_rounding, findings } = c;
            write!(f, "| {name} | {scenes} | {built} | {ended} | {steps} | {closed} | {compared} ")?;
            writeln!(f, "| {by_rounding} | {findings} |")
        };
        for kind in KINDS {
            let count = self.kinds.get(kind).copied().unwrap_or_default();
            line(f, kind, &count)?;
            all += count;
        }
        line(f, "all", &all)?;
        writeln!(f, "\n| error | at build | in a step | the first of them |\n| --- | --- | --- | --- |")?;
        for (name, ([before, later], seed, words)) in &self.refused {
            let words = words.replace('|', "/");
            writeln!(f, "| {name} | {before} | {later} | {seed}: {words} |")?;
        }
        let Self { single, drifting, in_double, .. } = self;
        writeln!(
            f,
            "\nmomentum in f32: changes by more than 3 % of the sum of all in {drifting} of {single} scenes without \
             outer forces, in the same scenes in f64 by {in_double:.0e} at most"
        )?;
        for (what, seeds) in &self.findings {
            writeln!(f, "\n{what}: {} scenes, {:?}", seeds.len(), &seeds[..seeds.len().min(10)])?;
        }
        Ok(())
    }
}
