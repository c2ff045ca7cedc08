//! Runs of the two-bar scene and the figures that are taken from them.

use crate::Bars;
use crate::reference::{CollidingBars, Side};
use contact_dynamics::observer::{Control, EnergyRecorder, StepView};
use contact_dynamics::{Corrector, Real, Result, Simulation, TimeIntegrator};
use std::ops::Range;

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
    /// Gap, and whether the contact is closed.
    pub gap: Vec<f64>,
    pub closed: Vec<bool>,
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

    /// How often the contact has closed or opened at times in a range.
    pub fn changes(&self, times: Range<f64>) -> usize {
        let changed = |i: &usize| self.closed[*i] != self.closed[i - 1] && times.contains(&self.t[*i]);
        (1..self.closed.len()).filter(changed).count()
    }

    /// Mean reported force at times in a range, those of the forces being `late` after those of the states.
    pub fn mean_force(&self, late: f64, times: Range<f64>) -> f64 {
        let inside = self.t.iter().zip(&self.force).filter(|(t, _)| times.contains(&(*t + late)));
        let (sum, count) = inside.fold((0.0, 0.0), |(sum, count), (_, force)| (sum + force, count + 1.0));
        sum / count
    }

    /// First and last time at which the contact is pressed.
    pub fn pressed(&self) -> Option<(f64, f64)> {
        let pressed = |raw: &f64| *raw > 0.0;
        Some((self.t[self.raw.iter().position(pressed)?], self.t[self.raw.iter().rposition(pressed)?]))
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
    try_record_run(bars, run, until).unwrap()
}

/// Records a simulation of two bars that may fail.
pub fn try_record_run<T: Real>(bars: &Bars, run: &mut Simulation<'_, T>, until: f64) -> Result<Record> {
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
        record.closed.push(contacts.closed()[0]);
        Control::Continue
    };
    let mut observers = (steps, EnergyRecorder::new());
    run.run_until(until, &mut observers)?;
    let (_, energies) = observers;
    for energy in energies.energies() {
        record.kinetic.push(energy.kinetic.value());
        record.elastic.push(energy.potential.unwrap().value());
    }
    record.total_impulse = record.impulse.iter().sum();
    record.momentum[1] = momentum(run);
    Ok(record)
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
            let exact = exact.velocity(Side::Left, bars.length[0], record.t[i]);
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

/// What is measured of the impact of bars against the exact solution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Impact {
    /// Mean error of the force over [0.8, 3.2] impact times (of the paper's bars) without the points within a step of
    /// the jumps, and RMS error over [0.8, 3.4] with them, relative to the largest exact force.
    pub force_l1: f64,
    pub force_l2: f64,
    /// How late the contact is pressed first, and last.
    pub touch: f64,
    pub release: f64,
    /// Deepest penetration over the way the bodies approach each other in a step.
    pub penetration: f64,
    /// How often the contact closed or opened in the whole run (exact: 2).
    pub changes: usize,
}

/// Measures a run with step `h` whose forces act `load` of a step after the states before those they are recorded with:
/// the `load` of the scheme's last stage.
pub fn impact(bars: &Bars, record: &Record, h: f64, load: f64) -> Impact {
    let until = record.t[record.t.len() - 1] + h;
    let exact = bars.exact(until);
    let (start, end) = exact.contact_intervals()[0];
    let pressed_until = last_force(&exact, start, end);
    let largest = exact.contact_force(start + 1e-6 * (pressed_until - start));
    let travel = 0.5 * (pressed_until - start);
    let late = (load - 1.0) * h;
    let errors = |window: Range<f64>, skip: &dyn Fn(f64) -> bool| -> Vec<f64> {
        let times = record.t.iter().map(|t| t + late).zip(&record.force);
        let inside = times.filter(|(t, _)| *t >= window.start && *t <= window.end && !skip(*t));
        inside.map(|(t, force)| (force - exact.contact_force(t)) / largest).collect()
    };
    let at_jump = |t: f64| {
        let jumps = |x: f64| (exact.contact_force(x) - exact.contact_force(t)).abs() > 1e-9 * largest;
        jumps((t - h).max(0.0)) || jumps((t + h).min(until))
    };
    let smooth = errors(start - 0.2 * travel..pressed_until + 0.2 * travel, &at_jump);
    let all = errors(start - 0.2 * travel..pressed_until + 0.4 * travel, &|_| false);
    let (first, last) = record.pressed().unwrap_or((f64::NAN, f64::NAN));
    let deepest = record.gap.iter().fold(0.0_f64, |deepest, gap| deepest.max(-gap));
    Impact {
        force_l1: smooth.iter().map(|x| x.abs()).sum::<f64>() / smooth.len() as f64,
        force_l2: rms(&all),
        touch: first - start,
        release: last - pressed_until,
        penetration: deepest / (h * (bars.velocity[0] - bars.velocity[1])),
        changes: record.changes(0.0..f64::INFINITY),
    }
}

/// The time at which the exact force of a contact interval has vanished: bars may go on touching without force.
fn last_force(exact: &CollidingBars, start: f64, end: f64) -> f64 {
    let force = |t: f64| exact.contact_force(t) > 0.0;
    if force(end - 1e-9 * (end - start)) {
        return end;
    }
    let (mut pressed, mut free) = (start, end);
    while free - pressed > 1e-12 * (end - start) {
        let middle = 0.5 * (pressed + free);
        *(if force(middle) { &mut pressed } else { &mut free }) = middle;
    }
    free
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt()
}
