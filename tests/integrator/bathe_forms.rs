//! The second stage of Bathe's scheme in its two forms: three displacements, or three velocities and accelerations.

use contact_dynamics::tableau::{A, Rows, Stage, Tableau, U, V, Z};
use contact_dynamics::{Bathe, Corrector, PersistencyCorrection, Simulation, TimeIntegrator};
use contact_dynamics_scenes::Bars;

#[derive(Debug)]
struct ThreePoint {
    gamma: f64,
}

impl TimeIntegrator for ThreePoint {
    fn name(&self) -> String {
        "three-point".into()
    }
    fn tableau(&self) -> Tableau {
        let gamma = self.gamma;
        let v = (2.0 / gamma) * (Z - U[0]) - V[0];
        let a = (4.0 / (gamma * gamma)) * (Z - U[0] - gamma * V[0]) - A[0];
        let first = Stage::new(Rows { u: Z, v, a }).ending_at(gamma);
        let c = [(1.0 - gamma) / gamma, -1.0 / ((1.0 - gamma) * gamma), (2.0 - gamma) / (1.0 - gamma)];
        let v = c[0] * U[1] + c[1] * U[0] + c[2] * Z;
        let a = c[0] * V[1] + c[1] * V[0] + c[2] * v;
        Tableau::staged(vec![first, Stage::new(Rows { u: Z, v, a })])
    }
}

/// In the step of impact: raw multiplier, λ_v and reported force over F₀, and all reported forces after it.
struct Found {
    raw: f64,
    lambda_v: f64,
    force: f64,
    forces: Vec<f64>,
}

fn run(scheme: Box<dyn TimeIntegrator>, phase: f64, correction: Option<PersistencyCorrection>) -> Found {
    let h = 1e-3;
    let bars = Bars::paper(50).delayed(phase, h);
    let builder = Simulation::builder(bars.system::<f64>(), scheme, h).velocity(bars.velocities());
    let correctors = correction.map(|correction| Box::new(correction) as Box<dyn Corrector<f64>>);
    let mut run = builder.constraint(bars.contact()).uncorrected().correctors(correctors).build().unwrap();
    let mut found: Option<Found> = None;
    // (Raw contact amplifies rounding: some steps are compared.)
    while found.as_ref().is_none_or(|found| found.forces.len() < 10) {
        run.step().unwrap();
        let contacts = run.state().contacts();
        let [raw, force] = [contacts.raw_forces()[0], contacts.forces()[0]].map(|x| x / 0.0125);
        match &mut found {
            None if !contacts.closed()[0] => {}
            None => found = Some(Found { raw, lambda_v: contacts.lambda_v()[0], force, forces: Vec::new() }),
            Some(found) => found.forces.push(force),
        }
    }
    found.unwrap()
}

/// Nothing edited between the stages, or the past with it: one scheme in two forms. Edited by a correction alone, the
/// forms part in the step of impact, if that is in the first stage: the second one of `Bathe` holds, by its raw
/// multiplier, the approach that the velocity before the step still has, and the correction takes that out of the
/// force.
#[test]
fn the_forms_of_the_second_stage_part_where_a_correction_edits_the_first() {
    for gamma in [2.0 - std::f64::consts::SQRT_2, 0.5] {
        for phase in (0..10).map(|i| 0.05 + 0.1 * f64::from(i)) {
            let forms = |correction: Option<PersistencyCorrection>| {
                let bathe = run(Box::new(Bathe::new(gamma).unwrap()), phase, correction);
                (bathe, run(Box::new(ThreePoint { gamma }), phase, correction))
            };
            let case = format!("γ = {gamma}, phase {phase}");
            let history = PersistencyCorrection::with_history_projection();
            for correction in [None, Some(history)] {
                let (bathe, other) = forms(correction);
                assert!((bathe.raw - other.raw).abs() < 1e-8 * bathe.raw, "{case}: {} {}", bathe.raw, other.raw);
                assert!((bathe.lambda_v - other.lambda_v).abs() < 1e-15, "{case}");
                assert!((bathe.force - other.force).abs() < 1e-8, "{case}");
            }
            let (bathe, other) = forms(Some(PersistencyCorrection::new()));
            let (projected, _) = forms(Some(history));
            // The force of `Bathe` is that of a projected past, in that step and later.
            assert!((bathe.force - projected.force).abs() < 1e-8, "{case}: {} {}", bathe.force, projected.force);
            for (x, y) in bathe.forces.iter().zip(&projected.forces) {
                assert!((x - y).abs() < 1e-8, "{case}: {x} {y}");
            }
            if phase < gamma {
                assert!(
                    (1.3..7.5).contains(&bathe.raw) && other.raw < 1.0 && bathe.lambda_v < -1e-6,
                    "{case}: {}",
                    bathe.raw
                );
                assert!(other.lambda_v.abs() < 0.6 * bathe.lambda_v.abs(), "{case}: {:e}", other.lambda_v);
            } else {
                assert!((bathe.raw - other.raw).abs() < 1e-8 * bathe.raw, "{case}");
            }
            // That of three displacements lets go of an early impact, and ends with another force.
            if phase < 0.1 {
                assert!(other.force > 1.5 * projected.force, "{case}: {} {}", other.force, projected.force);
            }
        }
    }
}
