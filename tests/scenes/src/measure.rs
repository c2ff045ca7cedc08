//! Runs of the two-bar scene and the figures that are taken from them.

use crate::Bars;
use contact_dynamics::observer::{Control, EnergyRecorder, StepView};
use contact_dynamics::{Corrector, Real, Simulation, TimeIntegrator};

/// What a run leaves behind, one entry a step.
#[derive(Clone, Debug, Default)]
pub struct Record {
    pub t: Vec<f64>,
    /// Reported contact force, and the raw one.
    pub force: Vec<f64>,
    pub raw: Vec<f64>,
    /// Step impulses.
    pub impulse: Vec<f64>,
    /// Displacement and velocity of the two contact nodes.
    pub u: Vec<[f64; 2]>,
    pub v: Vec<[f64; 2]>,
    /// Gap.
    pub gap: Vec<f64>,
    /// Kinetic and elastic energy.
    pub kinetic: Vec<f64>,
    pub elastic: Vec<f64>,
    /// Energy at the start.
    pub start_energy: f64,
    /// Momentum of each bar before and after the run, in the form the scheme conserves.
    pub momentum: [[f64; 2]; 2],
    /// Contact impulses of the whole run, Σ (h β p + J).
    pub total_impulse: f64,
}

impl Record {
    pub fn energy(&self, i: usize) -> f64 {
        self.kinetic[i] + self.elastic[i]
    }

    /// |Σ(hβp + J) − change of momentum| of the worse bar, relative to the total impulse.
    pub fn closure(&self) -> f64 {
        let miss = |bar: usize, sign: f64| {
            let change = self.momentum[1][bar] - self.momentum[0][bar];
            (change - sign * self.total_impulse).abs() / self.total_impulse.abs()
        };
        miss(0, -1.0).max(miss(1, 1.0))
    }

    /// Change of total momentum relative to the momentum of one bar.
    pub fn drift(&self) -> f64 {
        let total = |m: [f64; 2]| m[0] + m[1];
        let scale = self.momentum[0][0].abs().max(self.momentum[0][1].abs());
        (total(self.momentum[1]) - total(self.momentum[0])).abs() / scale
    }
}

/// Runs two bars to time `until` with step `h` and records every step.
pub fn record<T: Real>(
    bars: &Bars,
    integrator: impl TimeIntegrator + 'static,
    corrector: Option<Box<dyn Corrector<T>>>,
    h: f64,
    until: f64,
) -> Record {
    let mut run = Simulation::builder(bars.system::<T>(), integrator, h)
        .velocity(bars.velocities())
        .constraint(bars.contact())
        .correctors(corrector)
        .build()
        .unwrap();
    record_run(bars, &mut run, until)
}

/// Records a simulation of two bars that is ready to run.
pub fn record_run<T: Real>(bars: &Bars, run: &mut Simulation<'_, T>, until: f64) -> Record {
    let direction = |bar: usize| -> Vec<T> {
        let split = bars.elements[0] + 1;
        (0..bars.dofs()).map(|dof| if (dof < split) == (bar == 0) { T::one() } else { T::zero() }).collect()
    };
    let momentum = |run: &Simulation<'_, T>| [0, 1].map(|bar| run.momentum(&direction(bar)).unwrap().value());
    let mut record =
        Record { momentum: [momentum(run); 2], start_energy: run.energy().total().value(), ..Record::default() };
    let [left, right] = bars.contact_dofs();
    let steps = |step: &StepView<'_, T>| {
        let (state, contacts) = (step.state, step.state.contacts());
        record.t.push(state.time());
        record.force.push(contacts.forces()[0].value());
        record.raw.push(contacts.raw_forces()[0].value());
        record.impulse.push(contacts.impulses()[0].value());
        record.u.push([left, right].map(|dof| state.displacement()[dof].value()));
        record.v.push([left, right].map(|dof| state.velocity()[dof].value()));
        record.gap.push(contacts.gaps()[0].value());
        Control::Continue
    };
    let mut observers = (steps, EnergyRecorder::new());
    run.run_until(until, &mut observers).unwrap();
    let (_, energies) = observers;
    for energy in energies.energies() {
        record.kinetic.push(energy.kinetic.value());
        record.elastic.push(energy.potential.unwrap().value());
    }
    record.total_impulse = record.impulse.iter().sum();
    record.momentum[1] = momentum(run);
    record
}

/// The figures of a run of two bars.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// RMS of p'/F0 − 1 on the grid points strictly inside the contact interval.
    pub force_rms: f64,
    /// Largest p'/F0 of the whole run.
    pub force_max: f64,
    /// Total variation Σ|δp'|/F0 (exact: 2).
    pub variation: f64,
    /// RMS of the error of the left contact node's velocity over [0.8, 3.4] impact times, relative to half the closing
    /// speed.
    pub velocity_rms: f64,
    /// Energy at the end over energy at the start.
    pub energy: f64,
    /// Largest energy over energy at the start.
    pub energy_max: f64,
    pub closure: f64,
    pub drift: f64,
}

/// Figures of a run of equal bars.
pub fn figures(bars: &Bars, record: &Record, h: f64) -> Figures {
    let impact = bars.impact_time();
    let until = record.t[record.t.len() - 1] + h;
    let exact = bars.exact(until);
    let wave = (bars.young[0] / bars.density[0]).sqrt();
    let release = impact + 2.0 * bars.length[0] / wave;
    let speed = 0.5 * (bars.velocity[0] - bars.velocity[1]);
    let reference = exact.contact_force(0.5 * (impact + release));
    let inside: Vec<f64> = (0..record.t.len())
        .filter(|&i| record.t[i] > impact + 1e-6 * h && record.t[i] < release - 1e-6 * h)
        .map(|i| record.force[i] / reference - 1.0)
        .collect();
    // [0.08, 0.34] s of the paper's clock, in whatever units: 0.2 of the wave time before impact, 0.4 after release.
    let travel = 0.5 * (release - impact);
    let window = (impact - 0.2 * travel, release + 0.4 * travel);
    let velocity: Vec<f64> = (0..record.t.len())
        .filter(|&i| record.t[i] >= window.0 && record.t[i] <= window.1)
        .map(|i| {
            let exact = exact.velocity(contact_dynamics::reference::Side::Left, bars.length[0], record.t[i]);
            (record.v[i][0] - exact) / speed
        })
        .collect();
    let variation = record.force.windows(2).map(|p| (p[1] - p[0]).abs()).sum::<f64>() / reference;
    let energies = (0..record.t.len()).map(|i| record.energy(i) / record.start_energy);
    Figures {
        force_rms: rms(&inside),
        force_max: record.force.iter().fold(0.0, |a: f64, &b| a.max(b)) / reference,
        variation,
        velocity_rms: rms(&velocity),
        energy: record.energy(record.t.len() - 1) / record.start_energy,
        energy_max: energies.fold(0.0, f64::max),
        closure: record.closure(),
        drift: record.drift(),
    }
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt()
}
