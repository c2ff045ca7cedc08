//! Stiffness and damping of a stop in a shaken frame, from the accelerations of its top.

use crate::descent::{Evaluation, Found, descend};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::gradient::{CompliantContact, Parameters, RecordedStep, Seed};
use contact_dynamics::{ContactLaw, GeneralizedAlpha, LinearRows, LinearSystem, Result, Simulation};
use std::error::Error;

const STOREYS: usize = 3;
const TOP: usize = STOREYS - 1;
/// Stiffness and damping of the stop (kN/m, kN s/m).
const STOP: [f64; 2] = [8e4, 200.0];
const H: f64 = 1e-3;
const END: f64 = 2.0;

/// A shear frame with storeys of 20 t and 3e4 kN/m, shaken for two seconds; 10 mm beside its top is a stop. The
/// factors are those of the stop.
fn simulation(factors: &[f64]) -> Result<Simulation<'static, f64>> {
    let (mass, stiffness) = (20.0, 3e4);
    let mut triplets = Vec::new();
    for storey in 0..STOREYS {
        triplets.push(Triplet::new(storey, storey, stiffness));
        if storey > 0 {
            triplets.push(Triplet::new(storey - 1, storey - 1, stiffness));
            triplets.push(Triplet::new(storey, storey - 1, -stiffness));
            triplets.push(Triplet::new(storey - 1, storey, -stiffness));
        }
    }
    let k =
        SparseColMat::try_new_from_triplets(STOREYS, STOREYS, &triplets).unwrap_or_else(|error| panic!("{error:?}"));
    let ground = |t: f64| 4.0 * (9.0 * t).sin() * (std::f64::consts::PI * t / END).sin();
    let system = LinearSystem::lumped(vec![mass; STOREYS], k)?.rayleigh(0.3, 0.002)?;
    let system = system.load(move |t, force| force.fill(-mass * ground(t)));
    let law = ContactLaw::KelvinVoigt { stiffness: STOP[0] * factors[0], damping: STOP[1] * factors[1] };
    let stop = LinearRows::new().row(law, &[(TOP, -1.0)], 0.01);
    Simulation::builder(system, GeneralizedAlpha::default(), H).constraint(stop).build()
}

/// The derivatives by stiffness and damping of the stop.
#[derive(Default)]
struct Stop([f64; 2]);

impl Parameters<f64> for Stop {
    fn contact(&mut self, contact: &CompliantContact<f64>, w: f64) {
        // λ = −k g − c ġ.
        self.0[0] -= w * contact.gap;
        self.0[1] -= w * contact.rate;
    }
}

/// ½ Σ (a − a_measured)² h/(a₀² T), and its derivatives by the factors.
fn misfit(measured: &[f64], factors: &[f64]) -> Result<Evaluation> {
    let mut run = simulation(factors)?;
    run.record()?;
    run.run_until(END, &mut ())?;
    let scale = measured.iter().fold(0.0_f64, |largest, a| largest.max(a.abs()));
    let weight = H / END / (scale * scale);
    let mut objective = |step: &RecordedStep<'_, f64>, seed: &mut Seed<'_, f64>| {
        let miss = step.state.acceleration()[TOP] - measured[step.step];
        seed.acceleration[TOP] += weight * miss;
        0.5 * weight * miss * miss
    };
    let mut stop = Stop::default();
    let value = run.gradient(&mut objective, &mut stop)?.value;
    Ok((value, vec![STOP[0] * stop.0[0], STOP[1] * stop.0[1]]))
}

pub(crate) fn identify() -> std::result::Result<(), Box<dyn Error>> {
    println!(
        "A frame of {STOREYS} storeys strikes a stop. Its stiffness and damping are found from the accelerations of"
    );
    println!("the top; relative errors of what is found, from +60 % and −60 %:\n");
    println!("{:<28} {:>9} {:>9} {:>9} {:>10} {:>5}", "", "k", "c", "J", "iterations", "runs");
    for (name, noise) in [("without noise", 0.0), ("2 % noise", 0.02)] {
        let mut run = simulation(&[1.0; 2])?;
        let mut measured = vec![run.state().acceleration()[TOP]];
        while run.time() < END - 0.5 * H {
            run.step()?;
            measured.push(run.state().acceleration()[TOP]);
        }
        let scale = measured.iter().fold(0.0_f64, |largest, a| largest.max(a.abs()));
        for (step, a) in measured.iter_mut().enumerate() {
            *a += noise * scale * (2.0 * (step as f64 * 0.618_033_988_749_895).fract() - 1.0);
        }
        let Found { parameters, value, iterations, runs } =
            descend(&[1.6, 0.4], 60, |factors| Ok(misfit(&measured, factors)?))?;
        let [k, c] = [0, 1].map(|k| format!("{:.0e}", (parameters[k] - 1.0).abs()));
        println!("{name:<28} {k:>9} {c:>9} {value:>9.0e} {iterations:>10} {runs:>5}");
    }
    Ok(())
}
