//! Scenes by chance, run with every scheme and some corrections, and what came of them.

use crate::independent::{Bodies, Compared, Kind, Outcome, Scene, Setting, compare};
use contact_dynamics::{ContactLaw, Error, analysis};
use contact_dynamics_scenes::combinations::Correction;
use contact_dynamics_scenes::schemes;
use std::fmt::Write;

/// Largest difference, over the size of what is compared.
const TOLERANCE: f64 = 1e-9;
/// Steps of a run, and those that have to be compared in the longer ones.
const STEPS: usize = 64;
const LONG: usize = 60;

/// The scheme whose forces are means over the path of a step.
pub(crate) const ALONG_PATHS: &str = "energy–momentum";

/// What a sweep goes through.
pub(crate) struct Sweep<'c> {
    pub(crate) corrections: &'c [Correction],
    pub(crate) law: ContactLaw,
    /// Whether every other row is rigid.
    pub(crate) mixed: bool,
    pub(crate) rubs: bool,
    pub(crate) bodies: Bodies,
    /// What the sizes of steps are of a first one, over and over.
    pub(crate) changes: &'c [f64],
    pub(crate) seeds: u64,
}

/// The runs of a scheme with a correction.
#[derive(Default)]
pub(crate) struct Pair {
    pub(crate) name: String,
    pub(crate) refused: usize,
    /// Refused although nothing is damped.
    pub(crate) refused_undamped: usize,
    pub(crate) runs: Vec<Compared>,
}

impl Pair {
    /// '+' if all runs were compared, 'u' if those of undamped bodies were, '.' if none was.
    fn flag(&self) -> char {
        match (self.runs.is_empty(), self.refused, self.refused_undamped) {
            (true, _, _) => '.',
            (false, 0, _) => '+',
            (false, _, 0) => 'u',
            (false, _, _) => '?',
        }
    }

    pub(crate) fn sum(&self, what: fn(&Compared) -> usize) -> usize {
        self.runs.iter().map(what).sum()
    }

    pub(crate) fn long(&self) -> usize {
        self.runs.iter().filter(|run| run.steps >= LONG).count()
    }
}

/// What came of a sweep: a line for each scheme with a flag for each correction, and all pairs that were compared.
pub(crate) struct Swept {
    pub(crate) table: String,
    pub(crate) pairs: Vec<Pair>,
    pub(crate) worst: f64,
}

impl Sweep<'_> {
    pub(crate) fn run(&self) -> Swept {
        let mut swept = Swept { table: String::new(), pairs: Vec::new(), worst: 0.0 };
        let mut differences = Vec::new();
        // (Forces along a path, of cubic springs, are no part of the truth, nor is friction on dofs without mass where
        // explicit stages solve for these before.)
        let is_told = |listed: &schemes::Listed| match self.bodies {
            Bodies::Linear => true,
            Bodies::Hardening => listed.name() != ALONG_PATHS,
            Bodies::Massless => !(self.rubs && listed.critical.is_some()),
        };
        // (A change of the step makes a past anew, and moves what is stored at another time: neither is told.)
        let keeps = |listed: &schemes::Listed| {
            let tableau = (listed.make)().tableau();
            let order = analysis::order(&tableau);
            tableau.depth() == 1 && order.velocity_shift.abs() + order.acceleration_shift.abs() < 1e-12
        };
        let changes = self.changes.len() > 1;
        let is_told = |listed: &schemes::Listed| is_told(listed) && (!changes || keeps(listed));
        for listed in schemes::all().into_iter().filter(is_told) {
            let mut flags = String::new();
            for &correction in self.corrections {
                let pair = self.pair(&listed, correction, &mut swept.worst, &mut differences);
                flags.push(pair.flag());
                if !pair.runs.is_empty() {
                    swept.pairs.push(pair);
                }
            }
            writeln!(swept.table, "{flags} {}", listed.name()).expect("a string takes all");
        }
        assert!(differences.is_empty(), "{} runs differ:\n{}", differences.len(), differences.join("\n"));
        swept
    }

    fn pair(
        &self,
        listed: &schemes::Listed,
        correction: Correction,
        worst: &mut f64,
        differences: &mut Vec<String>,
    ) -> Pair {
        let mut pair = Pair { name: format!("{}, {}", listed.name(), correction.name()), ..Pair::default() };
        for kind in Kind::ALL {
            // Where bodies rest on each other Laursen's and Love's jump is the root of rounding.
            if correction == Correction::LaursenLove && kind == Kind::Rest {
                continue;
            }
            // (A start in which friction holds what has no mass is none of the truth.)
            if self.bodies == Bodies::Massless && self.rubs && kind == Kind::Rest {
                continue;
            }
            let rests = matches!(kind, Kind::Press | Kind::Rest);
            for seed in 0..self.seeds {
                let Self { law, mixed, rubs, bodies, .. } = *self;
                let setting = Setting { kind, critical: listed.critical, law, mixed, rubs, bodies };
                let scene = Scene { changes: self.changes.to_vec(), ..setting.scene(seed) };
                let place = format!("{}, {law:?}, {kind:?} {seed}", pair.name);
                match compare(&scene, listed.make, correction, STEPS) {
                    // (Where friction holds bodies at rest increments are rounding, which never becomes small beside
                    // the whole one: with the tolerances of users, which are wider, these runs go on.)
                    Err(Error::NewtonNotConverged { .. }) if bodies == Bodies::Hardening && rubs && rests => {}
                    // (Explicit stages know where bodies will be: what has no mass may find no room between them.)
                    Err(Error::ContradictoryContacts { .. })
                        if bodies == Bodies::Massless && listed.critical.is_some() => {}
                    Err(error) => differences.push(format!("{place}: {error}")),
                    Ok(Outcome::Refused) => {
                        pair.refused += 1;
                        pair.refused_undamped += usize::from(scene.damping.is_none());
                    }
                    Ok(Outcome::Compared(run)) => {
                        let deviation = &run.worst;
                        if deviation.size > TOLERANCE {
                            differences.push(format!(
                                "{place}: {} differs by {} in step {} of {}",
                                deviation.what, deviation.size, deviation.step, run.steps
                            ));
                        }
                        *worst = worst.max(deviation.size);
                        pair.runs.push(run);
                    }
                }
            }
        }
        pair
    }
}
