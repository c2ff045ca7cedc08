//! Runs of the crate beside those of the truth.

use super::correct::TRANSIT;
use super::{Scene, Truth};
use contact_dynamics::{Newton, Result, Simulation, State, TimeIntegrator};
use contact_dynamics_scenes::combinations::Correction;

/// Where two runs differ most, over the size of what is compared.
#[derive(Clone, Debug, Default)]
pub(crate) struct Deviation {
    pub(crate) size: f64,
    pub(crate) what: &'static str,
    pub(crate) step: usize,
}

/// What came of a comparison.
#[derive(Clone, Debug)]
pub(crate) enum Outcome {
    /// The crate refuses to build the run.
    Refused,
    Compared(Compared),
}

/// A comparison of two whole runs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Compared {
    pub(crate) worst: Deviation,
    /// Steps compared: up to where rounding would decide.
    pub(crate) steps: usize,
    /// How often a contact closed and opened, and in how many steps one was closed.
    pub(crate) closings: usize,
    pub(crate) openings: usize,
    pub(crate) closed: usize,
    /// Steps in which a contact with friction slid, and stuck.
    pub(crate) slid: usize,
    pub(crate) stuck: usize,
    /// Smallest and largest share of the step after which contacts closed.
    pub(crate) phases: [f64; 2],
}

/// u, v, a, reported and raw forces of a state.
type Values = [Vec<f64>; 5];
const NAMES: [&str; 5] = ["u", "v", "a", "forces", "raw forces"];

/// Contact without correction is chaotic with some schemes: roundings grow by the factor of their spikes. Where two
/// runs of the truth whose data differ by a few roundings have come as far apart as this, a comparison ends.
const SENSITIVE: f64 = 2e-12;

/// Runs both, and compares every step.
///
/// # Errors
///
/// Those of a step of the crate.
pub(crate) fn compare(
    scene: &Scene,
    scheme: fn() -> Box<dyn TimeIntegrator>,
    correction: Correction,
    steps: usize,
) -> Result<Outcome> {
    let builder = Simulation::builder(scene.system(), scheme(), scene.h)
        .displacement(scene.u.clone())
        .velocity(scene.v.clone())
        .constraint(scene.contact())
        .start_up(scene.start_up);
    // (As far as rounding lets it.)
    let builder = builder.newton(Newton::full().tolerances(1e-12, 1e-10)?.iterations(40)?);
    let builder = match correction {
        Correction::None => builder.uncorrected(),
        _ => builder.correctors(correction.correctors(TRANSIT * scene.h)?),
    };
    let mut run = match builder.build() {
        Ok(run) => run,
        Err(_) => return Ok(Outcome::Refused),
    };
    let other = scene.rounded();
    let mut truth = Truth::new(scene, &*scheme(), correction);
    let mut twin = Truth::new(&other, &*scheme(), correction);
    let mut pairs = vec![(of_crate(scene, run.state()), of_truth(&truth))];
    let mut scales = Scales::default();
    let mut compared = Compared { phases: [1.0, 0.0], ..Compared::default() };
    for step in 0..steps {
        let (before, gaps) = (truth.contacts().closed.clone(), truth.contacts().gaps.clone());
        let h = scene.h * scene.changes[step % scene.changes.len()];
        if h.to_bits() != run.step_size().to_bits() {
            truth.set_step_size(h);
            twin.set_step_size(h);
        }
        truth.step();
        twin.step();
        let values = of_truth(&truth);
        scales.see(&values, scene.h);
        if scales.deviation(&of_truth(&twin), &values).size > SENSITIVE {
            break;
        }
        run.set_step_size(h)?;
        run.step()?;
        pairs.push((of_crate(scene, run.state()), values));
        compared.count(scene, &truth, &before, &gaps);
        compared.steps = step + 1;
    }
    for (step, (run, truth)) in pairs.iter().enumerate() {
        let deviation = scales.deviation(run, truth);
        if deviation.size > compared.worst.size {
            compared.worst = Deviation { step, ..deviation };
        }
    }
    Ok(Outcome::Compared(compared))
}

impl Compared {
    fn count(&mut self, scene: &Scene, truth: &Truth, before: &[bool], gaps: &[f64]) {
        let contacts = truth.contacts();
        self.closed += usize::from(contacts.closed.iter().any(|closed| *closed));
        for (i, (was, is)) in before.iter().zip(&contacts.closed).enumerate() {
            self.openings += usize::from(*was && !is);
            if *is && !was {
                self.closings += 1;
                let way = scene.h * scene.rate(i, truth.motion().t - scene.h, &scene.v).abs();
                let phase = (gaps[i].abs() / way.max(f64::MIN_POSITIVE)).min(1.0);
                self.phases = [self.phases[0].min(phase), self.phases[1].max(phase)];
            }
            if *is && scene.rows[i].friction.is_some() {
                self.slid += usize::from(contacts.slides[i]);
                self.stuck += usize::from(!contacts.slides[i]);
            }
        }
    }
}

fn of_crate(scene: &Scene, state: &State<f64>) -> Values {
    let contacts = state.contacts();
    let mut forces = contacts.forces().to_vec();
    for i in 0..scene.rows.len() {
        forces.extend_from_slice(contacts.friction_forces(i));
    }
    let motion = [state.displacement(), state.stored_velocity(), state.stored_acceleration()].map(<[f64]>::to_vec);
    let [u, v, a] = motion;
    [u, v, a, forces, contacts.raw_forces().to_vec()]
}

fn of_truth(truth: &Truth) -> Values {
    let (motion, contacts) = (truth.motion(), truth.contacts());
    let raw = contacts.raw[..contacts.closed.len()].to_vec();
    [motion.u.clone(), motion.v.clone(), motion.a.clone(), contacts.forces.clone(), raw]
}

/// The scale of a quantity is the largest value of it, or what the largest force or velocity makes of it in a step.
/// (Masses are about one.)
#[derive(Default)]
struct Scales([f64; 5]);

impl Scales {
    fn see(&mut self, values: &Values, h: f64) {
        let largest = |x: &[f64]| x.iter().fold(f64::MIN_POSITIVE, |largest, x| largest.max(x.abs()));
        let speed = largest(&values[1]).max(h * largest(&values[3]));
        let least = [h * speed, speed, speed / h, speed / h, speed / h];
        for ((scale, values), least) in self.0.iter_mut().zip(values).zip(least) {
            *scale = scale.max(largest(values)).max(least);
        }
    }

    /// The largest difference of two states; what is no number differs without bound.
    fn deviation(&self, values: &Values, truth: &Values) -> Deviation {
        let mut worst = Deviation::default();
        for (((values, truth), scale), what) in values.iter().zip(truth).zip(self.0).zip(NAMES) {
            for (x, y) in values.iter().zip(truth) {
                let size = (x - y).abs() / scale;
                let size = if size.is_nan() { f64::INFINITY } else { size };
                if size > worst.size {
                    worst = Deviation { size, what, ..worst };
                }
            }
        }
        worst
    }
}
