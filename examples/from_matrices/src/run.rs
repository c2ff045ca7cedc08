//! A run from files to files.

use crate::contacts::{self, Contact};
use crate::model::Model;
use crate::options::{Options, Overlap, recorded};
use crate::output::{Peak, Sheets, Summary, friction_size};
use crate::refusal::{Refusal, Result};
use crate::schemes;
use contact_dynamics::{ContactState, InitialOverclosure, Lu, Simulation};
use std::path::Path;
use std::time::Instant;

/// Steps a run may have: more are a mistake in the units of --step or --end.
const MOST_STEPS: f64 = 1e9;

/// Reads the files that the options name, runs, and writes the results.
pub fn run(options: &Options) -> Result<Summary> {
    let (Some(step), Some(end)) = (options.step, options.end) else {
        return Err(Refusal::new("--step and --end are missing"));
    };
    for (name, value) in [("step", step), ("end", end)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(Refusal::new(format!("--{name} is {value}, it must be positive and finite")));
        }
    }
    if end / step > MOST_STEPS {
        let what = format!("--end {end:e} takes {:e} steps of {step:e}; are both in the same unit?", end / step);
        return Err(Refusal::new(what));
    }
    if options.every == 0 {
        return Err(Refusal::new("--every is 0, it must be 1 or more"));
    }
    let scheme = schemes::scheme(&options.scheme)?;
    let correctors = schemes::correctors(&options.correction)?;
    let mut model = Model::read(options)?;
    let (dofs, is_unsymmetric) = (model.dofs(), model.is_unsymmetric);
    let table = std::mem::take(&mut model.contacts);
    let recorded = options.record.as_ref().map_or_else(|| Ok(own_dofs(&table)), |text| recorded(text, dofs))?;
    let path = options.contacts.as_deref().unwrap_or(Path::new("the table of contacts"));
    let explain = |error: contact_dynamics::Error| {
        Refusal::by_crate(&error, |index| table.get(index).map(|contact| contact.place(path)))
    };

    let name = scheme.name();
    let (u, v) = (std::mem::take(&mut model.u), std::mem::take(&mut model.v));
    let builder = Simulation::builder(model.system().map_err(explain)?, scheme, step)
        .displacement(u)
        .velocity(v)
        .constraint(contacts::constraint(&table))
        .initial_overclosure(match options.overlap {
            Overlap::Refused => InitialOverclosure::Refused,
            Overlap::Adjusted => InitialOverclosure::AdjustedGaps,
        })
        .energy_balance();
    let builder = if is_unsymmetric { builder.linear_solver(Lu) } else { builder };
    let builder = match correctors {
        Some(correctors) => builder.correctors(correctors),
        None => builder,
    };
    let mut run = builder.build().map_err(explain)?;

    let mut sheets = Sheets::create(&options.output, recorded)?;
    let mut watch = Watch::new(run.state().contacts());
    let begin = Instant::now();
    let start = run.energy();
    sheets.write(run.state(), start, &table, &watch.impulses)?;
    watch.forces.push((run.time(), totals(run.state().contacts())));
    while run.time() < end - 1e-9 * step {
        if let Err(error) = run.step() {
            sheets.finish()?;
            let so_far = format!("{} holds what was computed until t = {:?}", options.output.display(), run.time());
            return Err(Refusal::new(format!("{}; {so_far}", explain(error))));
        }
        watch.look(run.time(), run.state().contacts(), |index| table[index].name.clone());
        if run.statistics().steps % options.every == 0 || run.time() >= end - 1e-9 * step {
            let energy = run.energy();
            sheets.write(run.state(), energy, &table, &watch.impulses)?;
            watch.written(run.time(), run.state().contacts());
        }
    }
    sheets.finish()?;
    let elapsed = begin.elapsed();
    Ok(Summary {
        scheme: name,
        dofs,
        contacts: table.len(),
        step,
        steps: run.statistics().steps,
        end: run.time(),
        impacts: watch.impacts,
        releases: watch.releases,
        peak: watch.peak,
        impulse: watch.impulse,
        energies: [start, run.energy()],
        is_unsymmetric,
        elapsed,
        directory: options.output.clone(),
        forces: watch.forces,
    })
}

/// The dofs of the contacts' nodes.
fn own_dofs(table: &[Contact]) -> Vec<usize> {
    let mut own: Vec<_> = table.iter().flat_map(|contact| contact.dofs.iter().copied()).collect();
    own.sort_unstable();
    own.dedup();
    own
}

/// What is counted while a run goes on.
struct Watch {
    closed: Vec<bool>,
    impacts: u64,
    releases: u64,
    peak: Option<Peak>,
    impulse: f64,
    /// Impulses of the contacts since the last line that was written.
    impulses: Vec<f64>,
    forces: Vec<(f64, [f64; 2])>,
}

impl Watch {
    fn new(contacts: &ContactState<f64>) -> Self {
        let closed = contacts.closed().to_vec();
        let impulses = vec![0.0; closed.len()];
        Self { closed, impacts: 0, releases: 0, peak: None, impulse: 0.0, impulses, forces: Vec::new() }
    }

    fn look(&mut self, time: f64, contacts: &ContactState<f64>, name: impl Fn(usize) -> String) {
        for (index, (&closed, &force)) in contacts.closed().iter().zip(contacts.forces()).enumerate() {
            match (self.closed[index], closed) {
                (false, true) => self.impacts += 1,
                (true, false) => self.releases += 1,
                _ => {}
            }
            self.closed[index] = closed;
            self.impulses[index] += contacts.impulses()[index];
            self.impulse += contacts.impulses()[index];
            if force > self.peak.as_ref().map_or(0.0, |peak| peak.force) {
                self.peak = Some(Peak { force, time, contact: name(index) });
            }
        }
    }

    fn written(&mut self, time: f64, contacts: &ContactState<f64>) {
        self.impulses.fill(0.0);
        self.forces.push((time, totals(contacts)));
    }
}

/// Sums of the normal forces and of the sizes of friction.
fn totals(contacts: &ContactState<f64>) -> [f64; 2] {
    let friction = (0..contacts.ids().len()).map(|index| friction_size(contacts, index)).sum();
    [contacts.forces().iter().sum(), friction]
}
