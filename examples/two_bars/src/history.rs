//! Time histories of all runs and of the exact solution, as comma-separated values.

use crate::experiment::{Experiment, Run, Sample};

const HEADING: &str = "integrator,correction,t [s],u left [m],u right [m],v left [m/s],v right [m/s],\
                       force [N],kinetic energy [J],elastic energy [J]\n";

/// One line a step: displacement and velocity of the contact nodes, contact force and energies.
pub(crate) fn csv(experiment: &Experiment, runs: &[Run]) -> String {
    let mut csv = HEADING.to_owned();
    if let Some(run) = runs.first() {
        csv.extend(run.record.t.iter().map(|&t| line("exact", "", &experiment.exact(t))));
    }
    for run in runs {
        csv.extend(run.samples().map(|sample| line(run.scheme.key(), run.correction.key(), &sample)));
    }
    csv
}

fn line(integrator: &str, correction: &str, sample: &Sample) -> String {
    let Sample { t, u, v, force, kinetic, elastic } = sample;
    let values = [u[0], u[1], v[0], v[1], *force, *kinetic, *elastic].map(|value| format!("{value:.6e}"));
    format!("{integrator},{correction},{t:.6},{}\n", values.join(","))
}
