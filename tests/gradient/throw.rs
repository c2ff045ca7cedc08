//! A bar is thrown at a wall, by every scheme.

use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::verify::GradientError;
use contact_dynamics::{
    ContactLaw, Error, GeneralizedAlpha, LinearRows, LinearSystem, Result, Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::gradients::{assert_equal, compare};
use contact_dynamics_scenes::schemes;

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
    /// The mean load pushes toward the wall.
    load: f64,
    speed: f64,
    /// How many derivatives are compared.
    varied: usize,
}

impl Throw {
    const ELEMENTS: usize = 10;

    fn new() -> Self {
        Self {
            law: ContactLaw::Rigid,
            damping: 0.0,
            is_consistent: false,
            gap: 0.0323,
            h: 0.01,
            end: 1.3,
            load: -0.4,
            speed: -0.5,
            varied: 8,
        }
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
        let (factor, mean) = (at[3], self.load);
        let system = system.load(move |t, f| f[n] = factor * (mean + 0.3 * (2.0 * t).sin()));
        let velocity = (0..=n).map(|i| at[4] * (self.speed + 0.02 * i as f64)).collect();
        let contact = LinearRows::new().row(scaled(self.law, at[5]), &[(0, 1.0)], self.gap + at[7]);
        Simulation::builder(system, scheme, self.h).velocity(velocity).constraint(contact).build()
    }

    fn compare(&self, scheme: &dyn Fn() -> Box<dyn TimeIntegrator>) -> Result<GradientError> {
        let build = |at: &[f64]| self.run(scheme(), at);
        compare(&build, &|run| run.run_until(self.end, &mut ()).map(drop), (self.varied, 0.1))
    }
}

/// Compares every n-th scheme that accepts the scene; returns how many did.
fn compare_every(n: usize, throw: &Throw, what: &str) -> usize {
    let mut compared = 0;
    for listed in schemes::all().into_iter().step_by(n) {
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
    assert!(compare_every(1, &Throw::new(), "rigid") > 30);
    assert!(compare_every(3, &Throw { is_consistent: true, ..Throw::new() }, "consistent mass") > 8);
}

/// Corrections of velocities change damping forces, by M⁻¹ or by the effective matrix.
#[test]
fn damped_bodies() {
    let throw = Throw { damping: 0.004, ..Throw::new() };
    assert!(compare_every(3, &throw, "damped") > 8);
    assert!(compare_every(3, &Throw { is_consistent: true, ..throw }, "damped, consistent mass") > 8);
}

#[test]
fn compliant_contact() {
    for law in [
        ContactLaw::Penalty { stiffness: 30.0 },
        ContactLaw::PowerLaw { stiffness: 100.0, exponent: 1.5 },
        ContactLaw::KelvinVoigt { stiffness: 30.0, damping: 0.3 },
        ContactLaw::HuntCrossley { stiffness: 100.0, exponent: 1.5, dissipation: 0.8 },
    ] {
        assert!(compare_every(3, &Throw { law, ..Throw::new() }, &format!("{law:?}")) > 8);
    }
}

/// A compliant law with a factor.
fn scaled(law: ContactLaw, factor: f64) -> ContactLaw {
    match law {
        ContactLaw::Penalty { stiffness } => ContactLaw::Penalty { stiffness: factor * stiffness },
        ContactLaw::PowerLaw { stiffness, exponent } => {
            ContactLaw::PowerLaw { stiffness: factor * stiffness, exponent }
        }
        ContactLaw::KelvinVoigt { stiffness, damping } => {
            ContactLaw::KelvinVoigt { stiffness: factor * stiffness, damping: factor * damping }
        }
        ContactLaw::HuntCrossley { stiffness, exponent, dissipation } => {
            ContactLaw::HuntCrossley { stiffness: factor * stiffness, exponent, dissipation }
        }
        rigid => rigid,
    }
}

/// Tied to the wall, and pressed to it: contacts carry forces at the start.
#[test]
fn contact_at_the_start() {
    let throw = Throw { gap: 0.0, speed: 0.0, varied: 7, ..Throw::new() };
    assert!(compare_every(3, &Throw { law: ContactLaw::Equality, ..throw }, "tied") > 8);
    assert!(compare_every(3, &throw, "pressed") > 8);
}

/// Where a step does not resolve the damping, corrections apply a part of their forces, and its derivative is unknown.
#[test]
fn damping_that_a_step_does_not_resolve_is_refused() {
    let throw = Throw { damping: 3.0, ..Throw::new() };
    let result = throw.compare(&|| Box::new(GeneralizedAlpha::default()));
    assert!(
        matches!(&result, Err(Error::Incompatible { part, .. }) if part.contains("damping in corrected contacts")),
        "{result:?}"
    );
}
