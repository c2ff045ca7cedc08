//! What is compared: integrators with corrections, masses and laws.

use contact_dynamics::corrector::Corrector;
use contact_dynamics::{
    Bathe, CdLagrange, CentralDifference, Composite, ContactLaw, EnergyMomentum, GeneralizedAlpha, MoreauJean, Newmark,
    Preset, Result,
};
use contact_dynamics_scenes::combinations::{Combination, Correction, Make, plain, preset};
use contact_dynamics_scenes::masses::{Body, MassMatrix, Takers, Treatment};

const COMPOSITE: Make = || Ok(Box::new(Composite));
const TRAPEZOIDAL: Make = || Ok(Box::new(Newmark::trapezoidal()));
const CHUNG_HULBERT: Make = || Ok(Box::new(GeneralizedAlpha::chung_hulbert(0.9)?));
const BATHE: Make = || Ok(Box::new(Bathe::default()));
const BATHE_1: Make = || Ok(Box::new(Bathe::with_radius(1.0)?));
const ENERGY_MOMENTUM: Make = || Ok(Box::new(EnergyMomentum));
const MOREAU_JEAN: Make = || Ok(Box::new(MoreauJean::new(0.5)?));
const CENTRAL: Make = || Ok(Box::new(CentralDifference));
const CD_LAGRANGE: Make = || Ok(Box::new(CdLagrange));
/// HHT-α with the α = −0.05 and −0.41421 that are usual in commercial codes, the latter where there is contact.
const HHT_005: Make = || Ok(Box::new(hht(-0.05)?));
const HHT_041: Make = || Ok(Box::new(hht(1.0 - std::f64::consts::SQRT_2)?));

fn hht(alpha: f64) -> Result<GeneralizedAlpha> {
    GeneralizedAlpha::new(0.0, -alpha, 0.25 * (1.0 - alpha) * (1.0 - alpha), 0.5 - alpha)
}

/// Stiffness of a penalty over that of the element behind the contact: usual in implicit and in explicit codes.
const PENALTY: f64 = 10.0;
const EXPLICIT_PENALTY: f64 = 0.1;

/// A line of the tables.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    combination: Combination,
    /// Name, where the scheme's own says too little.
    name: Option<&'static str>,
    /// Contact by a spring of so many times the stiffness of an element.
    penalty: Option<f64>,
    /// Label in the figure.
    pub(crate) curve: Option<&'static str>,
}

/// The trapezoidal rule with λ_v/λ_a, in whose work the tables count: without the correction it reaches no error at
/// all.
pub(crate) const REFERENCE: usize = 1;

/// Two with neither scheme nor mass nor correction in common: the conservative preset, and the composite scheme with
/// λ_v/λ_a on a blend.
pub(crate) const UNRELATED: [usize; 2] = [17, 7];

/// All rows.
pub(crate) fn all() -> Vec<Row> {
    use Correction::{History, Implicit, LaursenLove, None, Persistency, StabilizedClosed};
    use Treatment::{Blend, Lumped};
    let tapered = Treatment::RedistributedBlend(Takers::Tapered);
    let row = |make, correction, mass| Row::new(Combination { correction, mass, ..plain(make) });
    let preset = |make, mass, kind| Row::new(preset(make, mass, kind));
    vec![
        row(TRAPEZOIDAL, None, Lumped).drawn("trapezoidal, raw"),
        row(TRAPEZOIDAL, Persistency, Lumped).drawn("trapezoidal, λ_v/λ_a"),
        row(TRAPEZOIDAL, Persistency, Blend).drawn("the same, blend"),
        row(TRAPEZOIDAL, None, tapered),
        row(COMPOSITE, None, Lumped),
        row(COMPOSITE, Persistency, Lumped),
        row(COMPOSITE, History, Lumped).drawn("composite, λ_v/λ_a"),
        row(COMPOSITE, History, Blend),
        row(COMPOSITE, None, tapered),
        row(CHUNG_HULBERT, None, Lumped),
        row(CHUNG_HULBERT, Persistency, Lumped),
        row(CHUNG_HULBERT, Persistency, Blend),
        preset(CHUNG_HULBERT, tapered, Preset::smooth()).drawn("smooth"),
        row(BATHE, History, Lumped),
        row(BATHE, None, tapered),
        row(BATHE_1, None, Lumped),
        row(BATHE_1, History, Lumped),
        preset(BATHE_1, tapered, Preset::conservative()).drawn("conservative"),
        row(CD_LAGRANGE, None, Lumped).drawn("CD-Lagrange"),
        row(CENTRAL, None, Lumped),
        row(MOREAU_JEAN, None, Lumped),
        row(ENERGY_MOMENTUM, Persistency, Lumped),
        row(ENERGY_MOMENTUM, LaursenLove, Lumped),
        row(TRAPEZOIDAL, Implicit, Lumped),
        row(TRAPEZOIDAL, StabilizedClosed, Lumped),
        row(HHT_005, None, Lumped).named("HHT-α(α = −0.05)"),
        row(HHT_041, None, Lumped).named("HHT-α(α = −0.41)"),
        row(HHT_005, None, Lumped).named("HHT-α(α = −0.05)").softened(PENALTY),
        row(HHT_041, None, Lumped).named("HHT-α(α = −0.41)").softened(PENALTY).drawn("HHT-α, penalty"),
        row(CENTRAL, None, Lumped).softened(EXPLICIT_PENALTY),
    ]
}

impl Row {
    const fn new(combination: Combination) -> Self {
        Self { combination, name: None, penalty: None, curve: None }
    }

    const fn drawn(self, label: &'static str) -> Self {
        Self { curve: Some(label), ..self }
    }

    const fn named(self, name: &'static str) -> Self {
        Self { name: Some(name), ..self }
    }

    const fn softened(self, penalty: f64) -> Self {
        Self { penalty: Some(penalty), ..self }
    }

    /// The law of a contact behind which an element has this stiffness.
    pub(crate) fn law(&self, element: f64) -> ContactLaw {
        self.penalty.map_or(self.combination.law, |factor| ContactLaw::Penalty { stiffness: factor * element })
    }

    /// Integrator, correction (or law), mass.
    pub(crate) fn names(&self) -> [String; 3] {
        let [scheme, correction, mass] = self.combination.names();
        let correction = self.penalty.map_or(correction, |factor| format!("penalty, {factor} K_e"));
        [self.name.map_or(scheme, str::to_owned), correction, mass]
    }

    pub(crate) fn load(&self) -> f64 {
        self.combination.load()
    }

    pub(crate) fn integrator(&self) -> Result<Box<dyn contact_dynamics::TimeIntegrator>> {
        self.combination.integrator()
    }

    pub(crate) fn correctors(&self, transit: f64) -> Result<Vec<Box<dyn Corrector<f64>>>> {
        self.combination.correctors(transit)
    }

    pub(crate) fn is_explicit(&self) -> bool {
        self.integrator().is_ok_and(|scheme| scheme.tableau().stages.iter().all(|stage| stage.balance.u.z == 0.0))
    }

    pub(crate) fn step(&self, body: &Body, h: f64) -> Result<f64> {
        self.combination.step(body, h)
    }

    pub(crate) fn mass(&self, body: &Body, h: f64) -> Result<MassMatrix> {
        self.combination.mass(body, h)
    }
}
