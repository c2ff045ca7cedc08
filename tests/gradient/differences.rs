//! Gradients against central differences of whole runs: by factors of mass, damping, stiffness and load, by initial
//! velocities, and by the gap.

use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::gradient::{Gradient, RecordedStep, Scales, Seed};
use contact_dynamics::verify::{self, GradientError};
use contact_dynamics::{ContactLaw, Error, LinearRows, LinearSystem, Result, Simulation, TimeIntegrator};
use contact_dynamics_scenes::schemes;

/// Factors of M, C, K, F and of the initial velocities, and an addition to the gap.
const AT: [f64; 6] = [1.0, 1.0, 1.0, 1.0, 1.0, 0.0];
const NAMES: [&str; 6] = ["mass", "damping", "stiffness", "load", "velocity", "gap"];

/// A bar of ten elements with a load on its far end, thrown at a wall.
#[derive(Clone, Copy, Debug)]
struct Throw {
    law: ContactLaw,
    /// Rayleigh damping, stiffness-proportional.
    damping: f64,
    is_consistent: bool,
    /// The distance of the wall.
    gap: f64,
    h: f64,
    end: f64,
}

impl Throw {
    const ELEMENTS: usize = 10;

    fn new() -> Self {
        Self { law: ContactLaw::Rigid, damping: 0.0, is_consistent: false, gap: 0.0323, h: 0.01, end: 1.3 }
    }

    fn run(&self, scheme: Box<dyn TimeIntegrator>, at: &[f64]) -> Result<Simulation<'static, f64>> {
        let n = Self::ELEMENTS;
        let (stiffness, mass) = (n as f64, 1.0 / n as f64);
        let assemble = |entries: [f64; 2], factor: f64| {
            let mut triplets = Vec::new();
            for i in 0..n {
                for (r, c, which) in [(0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0)] {
                    triplets.push(Triplet::new(i + r, i + c, factor * entries[which]));
                }
            }
            SparseColMat::<usize, f64>::try_new_from_triplets(n + 1, n + 1, &triplets).unwrap()
        };
        let k = assemble([stiffness, -stiffness], at[2]);
        let mut lumped = vec![mass * at[0]; n + 1];
        (lumped[0], lumped[n]) = (0.5 * mass * at[0], 0.5 * mass * at[0]);
        let mut system = match self.is_consistent {
            true => LinearSystem::new(assemble([mass / 3.0, mass / 6.0], at[0]), k)?,
            false => LinearSystem::lumped(lumped, k)?,
        };
        if self.damping > 0.0 {
            system = system.damping(assemble([stiffness, -stiffness], at[1] * self.damping))?;
        }
        let load = at[3];
        let system = system.load(move |t, f| f[n] = load * (-0.4 + 0.3 * (2.0 * t).sin()));
        let velocity = (0..=n).map(|i| at[4] * (-0.5 + 0.02 * i as f64)).collect();
        let contact = LinearRows::new().row(self.law, &[(0, 1.0)], self.gap + at[5]);
        Simulation::builder(system, scheme, self.h).velocity(velocity).constraint(contact).build()
    }

    /// The objective of a run, with its gradient by the parameters.
    fn gradient(&self, scheme: Box<dyn TimeIntegrator>, at: &[f64]) -> Result<(f64, Vec<f64>)> {
        let mut run = self.run(scheme, at)?;
        run.record()?;
        run.run_until(self.end, &mut ())?;
        let mut scales = Scales::default();
        let gradient = run.gradient(&mut objective, &mut scales)?;
        let Gradient { value, ref velocity, .. } = gradient;
        let by_velocity = velocity.iter().enumerate().map(|(i, &by)| by * (-0.5 + 0.02 * i as f64)).sum();
        let gap = gradient.gaps.iter().map(|&(_, by)| by).sum();
        Ok((value, vec![scales.mass, scales.damping, scales.stiffness, scales.load, by_velocity, gap]))
    }

    fn compare(&self, scheme: &dyn Fn() -> Box<dyn TimeIntegrator>) -> Result<GradientError> {
        let (_, gradient) = self.gradient(scheme(), &AT)?;
        let value = |at: &[f64]| {
            let mut run = self.run(scheme(), at)?;
            run.record()?;
            run.run_until(self.end, &mut ())?;
            Ok(run.gradient(&mut objective, &mut ())?.value)
        };
        verify::gradient(value, &AT, &gradient, &[1e-5, 1e-3, 1e-5, 1e-5, 1e-5, 1e-6])
    }
}

/// A sum that reads everything that an objective can read.
fn objective(step: &RecordedStep<'_, f64>, seed: &mut Seed<'_, f64>) -> f64 {
    let state = step.state;
    let (t, last) = (state.time(), state.displacement().len() - 1);
    let weight = step.h * (1.0 + (3.0 * t).cos());
    let mut value = 0.0;
    for (i, share) in [(0, 1.0), (last / 2, 0.5), (last, 2.0)] {
        let (u, v, a) = (state.displacement()[i], state.velocity()[i], state.acceleration()[i]);
        value += weight * share * (u * u + 0.3 * v + 0.01 * a);
        seed.displacement[i] += weight * share * 2.0 * u;
        seed.velocity[i] += weight * share * 0.3;
        seed.acceleration[i] += weight * share * 0.01;
    }
    let (force, impulse) = (state.contacts().forces(), state.contacts().impulses());
    value += weight * (force[0] + 0.2 * force[0] * force[0]) + (t.sin() + 0.5) * impulse[0];
    seed.force[0] += weight * (1.0 + 0.4 * force[0]);
    seed.impulse[0] += t.sin() + 0.5;
    value
}

fn assert_equal(error: &GradientError, what: &str) {
    assert!(error.spread.iter().all(|&spread| spread < 1e-2), "{what}: a kink lies near: {error:?}");
    assert!(error.relative < 1e-6, "{what}, by {}: {error:?}", NAMES[error.parameter]);
}

/// Compares all schemes that accept the scene; returns how many did.
fn compare_all(throw: &Throw, what: &str) -> usize {
    let mut compared = 0;
    for listed in schemes::all() {
        let name = format!("{what}, {}", listed.name());
        match throw.compare(&|| (listed.make)()) {
            Ok(error) => assert_equal(&error, &name),
            // Explicit schemes whose displacements do not contain the unknown take compliant contact only.
            Err(Error::Incompatible { .. }) if !listed.takes_multipliers() => continue,
            Err(error) => panic!("{name}: {error}"),
        }
        compared += 1;
    }
    compared
}

/// All schemes with their default corrections: λ_v/λ_a and the projection of the past, where they apply.
#[test]
fn rigid_contact() {
    assert!(compare_all(&Throw::new(), "rigid") > 30);
    assert!(compare_all(&Throw { is_consistent: true, ..Throw::new() }, "consistent mass") > 30);
}

/// Corrections of velocities change damping forces, by M⁻¹ or by the effective matrix.
#[test]
fn damped_bodies() {
    let throw = Throw { damping: 0.004, ..Throw::new() };
    assert!(compare_all(&throw, "damped") > 30);
    assert!(compare_all(&Throw { is_consistent: true, ..throw }, "damped, consistent mass") > 30);
}

#[test]
fn compliant_contact() {
    let law = ContactLaw::Penalty { stiffness: 30.0 };
    assert!(compare_all(&Throw { law, ..Throw::new() }, "penalty") > 30);
    let law = ContactLaw::PowerLaw { stiffness: 100.0, exponent: 1.5 };
    assert!(compare_all(&Throw { law, ..Throw::new() }, "power law") > 30);
}
