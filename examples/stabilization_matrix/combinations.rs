//! What is combined: integrators, corrections, laws and masses, by rules.

use contact_dynamics::corrector::{
    ContactImplicit, ContactStabilized, LaursenLove, Release, TaylorPapadopoulos, ZeroAcceleration,
};
use contact_dynamics::{
    Bathe, CdLagrange, Composite, ContactLaw, Corrector, GeneralizedAlpha, Gssss, MoreauJean, Newmark,
    PersistencyCorrection, Preset, Result, TimeIntegrator,
};
use contact_dynamics_scenes::masses::{Body, MassMatrix, Takers, Treatment};

/// Makes an integrator.
type Make = fn() -> Result<Box<dyn TimeIntegrator>>;

const COMPOSITE: Make = || Ok(Box::new(Composite));
const TRAPEZOIDAL: Make = || Ok(Box::new(Newmark::trapezoidal()));
const CHUNG_HULBERT_09: Make = || Ok(Box::new(GeneralizedAlpha::chung_hulbert(0.9)?));
const CHUNG_HULBERT_08: Make = || Ok(Box::new(GeneralizedAlpha::chung_hulbert(0.8)?));
const BATHE: Make = || Ok(Box::new(Bathe::default()));
const BATHE_1: Make = || Ok(Box::new(Bathe::with_radius(1.0)?));
const MIDPOINT: Make = || Ok(Box::new(Gssss::new(1.0, 1.0, 1.0)?));
const MOREAU_JEAN: Make = || Ok(Box::new(MoreauJean::new(0.5)?));
const CD_LAGRANGE: Make = || Ok(Box::new(CdLagrange));

/// Those that impose contact on displacements, with one, two or any number of solves a step.
const IMPLICIT: [Make; 6] = [COMPOSITE, TRAPEZOIDAL, CHUNG_HULBERT_09, CHUNG_HULBERT_08, BATHE, BATHE_1];

/// What is done to the result of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Correction {
    None,
    Persistency,
    History,
    Release,
    TaylorPapadopoulos,
    Implicit,
    Stabilized,
    StabilizedClosed,
    LaursenLove,
    ZeroAcceleration,
}

impl Correction {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::None => "–",
            Self::Persistency => "λ_v/λ_a",
            Self::History => "λ_v/λ_a + history",
            Self::Release => "λ_v/λ_a + history, release",
            Self::TaylorPapadopoulos => "Taylor–Papadopoulos",
            Self::Implicit => "contact-implicit",
            Self::Stabilized => "contact-stabilized",
            Self::StabilizedClosed => "contact-stabilized (closed)",
            Self::LaursenLove => "Laursen–Love",
            Self::ZeroAcceleration => "a = 0",
        }
    }

    /// The correctors; `transit` is the time of a wave through a contact element.
    fn correctors(self, transit: f64) -> Result<Vec<Box<dyn Corrector<f64>>>> {
        let history = || Box::new(PersistencyCorrection::with_history_projection());
        Ok(match self {
            Self::None => Vec::new(),
            Self::Persistency => vec![Box::new(PersistencyCorrection::new())],
            Self::History => vec![history()],
            Self::Release => vec![history(), Box::new(Release)],
            Self::TaylorPapadopoulos => vec![Box::new(TaylorPapadopoulos::new(transit)?)],
            Self::Implicit => vec![Box::new(ContactImplicit)],
            Self::Stabilized => vec![Box::new(ContactStabilized::new())],
            Self::StabilizedClosed => vec![Box::new(ContactStabilized::improved())],
            Self::LaursenLove => vec![Box::new(LaursenLove)],
            Self::ZeroAcceleration => vec![Box::new(ZeroAcceleration)],
        })
    }
}

/// One row of the matrix. With another law it is `Combination { law, ..plain(make) }`, one more line in [`all`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Combination {
    make: Make,
    pub(crate) correction: Correction,
    pub(crate) law: ContactLaw,
    pub(crate) mass: Treatment,
    /// Integrator, correction and mass are those of a preset.
    pub(crate) preset: Option<Preset>,
}

const fn plain(make: Make) -> Combination {
    let (correction, mass) = (Correction::None, Treatment::Lumped);
    Combination { make, correction, law: ContactLaw::Rigid, mass, preset: None }
}

const fn preset(make: Make, mass: Treatment, preset: Preset) -> Combination {
    Combination { mass, preset: Some(preset), ..plain(make) }
}

/// All rows: presets, then those without correction, those with one, those on other masses.
pub(crate) fn all() -> Vec<Combination> {
    use Correction::{
        History, Implicit, LaursenLove, Persistency, Release, Stabilized, StabilizedClosed, TaylorPapadopoulos,
        ZeroAcceleration,
    };
    let tapered = Treatment::RedistributedBlend(Takers::Tapered);
    let mut rows = vec![
        preset(CHUNG_HULBERT_09, tapered, Preset::smooth()),
        preset(BATHE_1, tapered, Preset::conservative()),
        preset(CD_LAGRANGE, Treatment::Lumped, Preset::explicit()),
    ];
    let mut add = |makes: &[Make], corrections: &[Correction], masses: &[Treatment]| {
        for &make in makes {
            for &correction in corrections {
                rows.extend(masses.iter().map(|&mass| Combination { correction, mass, ..plain(make) }));
            }
        }
    };
    let lumped = [Treatment::Lumped];
    add(&IMPLICIT, &[Correction::None], &lumped);
    // Schemes of one stage that read one state have no past to project.
    add(&[COMPOSITE, BATHE, BATHE_1], &[Persistency, History], &lumped);
    add(&[TRAPEZOIDAL, CHUNG_HULBERT_09, CHUNG_HULBERT_08], &[History], &lumped);
    add(&[MIDPOINT], &[Correction::None, Persistency, LaursenLove], &lumped);
    add(&[MOREAU_JEAN], &[Correction::None], &lumped);
    add(
        &[COMPOSITE, TRAPEZOIDAL, CHUNG_HULBERT_08, BATHE_1],
        &[Release, TaylorPapadopoulos, ZeroAcceleration],
        &lumped,
    );
    add(&[TRAPEZOIDAL, CHUNG_HULBERT_08], &[Implicit, Stabilized, StabilizedClosed], &lumped);
    add(&[COMPOSITE, TRAPEZOIDAL, CHUNG_HULBERT_08], &[History], &[Treatment::Consistent, Treatment::Blend]);
    let redistributed = [Takers::Neighbors, Takers::Uniform, Takers::LeastSquares].map(Treatment::Redistributed);
    let blended = [Takers::Uniform, Takers::Tapered].map(Treatment::RedistributedBlend);
    add(&IMPLICIT, &[Correction::None], &[&redistributed[..], &blended[..]].concat());
    rows.push(Combination { law: ContactLaw::RateCondition, ..plain(MIDPOINT) });
    rows.extend([MIDPOINT, COMPOSITE].map(|make| Combination { law: ContactLaw::PersistencySwitch, ..plain(make) }));
    rows
}

impl Combination {
    pub(crate) fn integrator(&self) -> Result<Box<dyn TimeIntegrator>> {
        match &self.preset {
            Some(preset) => Ok(preset.integrator()),
            None => (self.make)(),
        }
    }

    /// Where in the step its forces act.
    pub(crate) fn load(&self) -> f64 {
        let stage = self.integrator().ok().and_then(|scheme| scheme.tableau().stages.pop());
        stage.map_or(1.0, |stage| stage.load)
    }

    pub(crate) fn correctors(&self, transit: f64) -> Result<Vec<Box<dyn Corrector<f64>>>> {
        match &self.preset {
            Some(preset) => Ok(preset.correctors()),
            None => self.correction.correctors(transit),
        }
    }

    /// The step to take where `h` is asked for: explicit schemes stay a tenth below the limit of stability, at which the energy
    /// of the shortest wave grows.
    pub(crate) fn step(&self, body: &Body, h: f64) -> Result<f64> {
        let explicit = self.integrator()?.tableau().stages.iter().all(|stage| stage.balance.u.z == 0.0);
        Ok(if explicit { h.min(0.9 * h / body.largest_courant(h)?) } else { h })
    }

    /// The mass of a body for a step.
    pub(crate) fn mass(&self, body: &Body, h: f64) -> Result<MassMatrix> {
        let courant = body.courant(h)?;
        match &self.preset {
            Some(preset) => {
                let (m, k) = (body.consistent.as_ref(), body.stiffness.symbolic());
                preset.mass(m, k, &body.contact, &body.groups, courant).map(MassMatrix::Matrix)
            }
            None => self.mass.mass(body, &self.integrator()?.tableau(), courant),
        }
    }

    /// The scheme against which times are measured.
    pub(crate) fn reference() -> Self {
        plain(TRAPEZOIDAL)
    }

    /// Names for tables: integrator, correction (or law), mass.
    pub(crate) fn names(&self) -> [String; 3] {
        [self.scheme(), self.correction(), self.mass.name()]
    }

    pub(crate) fn scheme(&self) -> String {
        let name = self.integrator().map_or_else(|error| error.to_string(), |scheme| scheme.name());
        match &self.preset {
            Some(preset) if *preset == Preset::smooth() => format!("**smooth**: {name}"),
            Some(preset) if *preset == Preset::conservative() => format!("**conservative**: {name}"),
            Some(_) => format!("**explicit**: {name}"),
            None => name,
        }
    }

    fn correction(&self) -> String {
        match self.law {
            ContactLaw::Rigid => self.correction.name().into(),
            ContactLaw::RateCondition => "rate condition".into(),
            ContactLaw::PersistencySwitch => "persistency switch".into(),
            law => format!("{law:?}"),
        }
    }
}
