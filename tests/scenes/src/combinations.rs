//! Integrators with corrections, laws and masses: what examples compare.

use crate::masses::{Body, MassMatrix, Treatment};
use crate::schemes::Listed;
use contact_dynamics::corrector::{
    ContactImplicit, ContactStabilized, LaursenLove, NonsmoothSplitting, Release, TaylorPapadopoulos, ZeroAcceleration,
};
use contact_dynamics::{ContactLaw, Corrector, PersistencyCorrection, Preset, Real, Result, TimeIntegrator, mass};

/// Makes an integrator.
pub type Make = fn() -> Result<Box<dyn TimeIntegrator>>;

/// How the integrator of a combination is made: of parameters that might be refused, or as one of the list of all
/// schemes.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    Made(Make),
    Listed(fn() -> Box<dyn TimeIntegrator>),
}

/// What is done to the result of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Correction {
    None,
    Persistency,
    History,
    Release,
    TaylorPapadopoulos,
    Splitting,
    Implicit,
    Stabilized,
    StabilizedClosed,
    LaursenLove,
    ZeroAcceleration,
}

impl Correction {
    pub const ALL: [Self; 11] = [
        Self::None,
        Self::Persistency,
        Self::History,
        Self::Release,
        Self::TaylorPapadopoulos,
        Self::Splitting,
        Self::Implicit,
        Self::Stabilized,
        Self::StabilizedClosed,
        Self::LaursenLove,
        Self::ZeroAcceleration,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::None => "–",
            Self::Persistency => "λ_v/λ_a",
            Self::History => "λ_v/λ_a + history",
            Self::Release => "λ_v/λ_a + history, release",
            Self::TaylorPapadopoulos => "Taylor–Papadopoulos",
            Self::Splitting => "nonsmooth splitting",
            Self::Implicit => "contact-implicit",
            Self::Stabilized => "contact-stabilized",
            Self::StabilizedClosed => "contact-stabilized (closed)",
            Self::LaursenLove => "Laursen–Love",
            Self::ZeroAcceleration => "a = 0",
        }
    }

    /// The correctors; `transit` is the time of a wave through a contact element.
    pub fn correctors<T: Real>(self, transit: f64) -> Result<Vec<Box<dyn Corrector<T>>>> {
        let history = || Box::new(PersistencyCorrection::with_history_projection());
        Ok(match self {
            Self::None => Vec::new(),
            Self::Persistency => vec![Box::new(PersistencyCorrection::new())],
            Self::History => vec![history()],
            Self::Release => vec![history(), Box::new(Release)],
            Self::TaylorPapadopoulos => vec![Box::new(TaylorPapadopoulos::new(transit)?)],
            Self::Splitting => vec![Box::new(NonsmoothSplitting)],
            Self::Implicit => vec![Box::new(ContactImplicit)],
            Self::Stabilized => vec![Box::new(ContactStabilized::new())],
            Self::StabilizedClosed => vec![Box::new(ContactStabilized::improved())],
            Self::LaursenLove => vec![Box::new(LaursenLove)],
            Self::ZeroAcceleration => vec![Box::new(ZeroAcceleration)],
        })
    }
}

/// An integrator with what goes with it; with another law it is `Combination { law, ..plain(make) }`.
#[derive(Clone, Copy, Debug)]
pub struct Combination {
    pub source: Source,
    pub correction: Correction,
    pub law: ContactLaw,
    pub mass: Treatment,
    /// Integrator, correction and mass are those of a preset.
    pub preset: Option<Preset>,
}

/// An integrator alone, on a lumped mass.
pub const fn plain(make: Make) -> Combination {
    alone(Source::Made(make))
}

/// A scheme of the list alone, on a lumped mass.
pub const fn listed(scheme: &Listed) -> Combination {
    alone(Source::Listed(scheme.make))
}

const fn alone(source: Source) -> Combination {
    let (correction, mass) = (Correction::None, Treatment::Lumped);
    Combination { source, correction, law: ContactLaw::Rigid, mass, preset: None }
}

/// A preset, with what it consists of.
pub const fn preset(make: Make, mass: Treatment, preset: Preset) -> Combination {
    Combination { mass, preset: Some(preset), ..plain(make) }
}

impl Combination {
    pub fn integrator(&self) -> Result<Box<dyn TimeIntegrator>> {
        match &self.preset {
            Some(preset) => Ok(preset.integrator()),
            None => match self.source {
                Source::Made(make) => make(),
                Source::Listed(make) => Ok(make()),
            },
        }
    }

    /// Where in the step its forces act.
    pub fn load(&self) -> f64 {
        let stage = self.integrator().ok().and_then(|scheme| scheme.tableau().stages.pop());
        stage.map_or(1.0, |stage| stage.load)
    }

    pub fn correctors(&self, transit: f64) -> Result<Vec<Box<dyn Corrector<f64>>>> {
        match &self.preset {
            Some(preset) => Ok(preset.correctors()),
            None => self.correction.correctors(transit),
        }
    }

    /// The step to take where `h` is asked for: explicit schemes stay a tenth below the limit of stability, at which
    /// the energy of the shortest wave grows.
    pub fn step(&self, body: &Body, h: f64) -> Result<f64> {
        let explicit = self.integrator()?.tableau().stages.iter().all(|stage| stage.balance.u.z == 0.0);
        Ok(if explicit { h.min(0.9 * h / body.largest_courant(h)?) } else { h })
    }

    /// The law in a scene: stiffnesses are in units of the softest diagonal entry of K at the contact dofs, and the
    /// mass of a bipenalty is that of the step.
    pub fn law(&self, body: &Body, h: f64) -> Result<ContactLaw> {
        let diagonal = body.contact.iter().map(|&dof| body.stiffness.get(dof, dof).copied().unwrap_or(0.0));
        let unit = diagonal.fold(f64::INFINITY, f64::min);
        Ok(match self.law {
            ContactLaw::Bipenalty { stiffness, .. } => {
                ContactLaw::Bipenalty { stiffness: stiffness * unit, mass: mass::bipenalty(stiffness * unit, h)? }
            }
            ContactLaw::StabilizedBipenalty { stiffness } => {
                ContactLaw::StabilizedBipenalty { stiffness: stiffness * unit }
            }
            law => law,
        })
    }

    /// The mass of a body for a step.
    pub fn mass(&self, body: &Body, h: f64) -> Result<MassMatrix> {
        let courant = body.courant(h)?;
        match &self.preset {
            Some(preset) => {
                let (m, k) = (body.consistent.as_ref(), body.stiffness.symbolic());
                preset.mass(m, k, &body.contact, &body.groups, courant).map(MassMatrix::Matrix)
            }
            None => self.mass.mass(body, &self.integrator()?.tableau(), courant),
        }
    }

    /// Names for tables: integrator, correction (or law), mass.
    pub fn names(&self) -> [String; 3] {
        [self.scheme(), self.correction(), self.mass.name()]
    }

    /// Name of the integrator, behind that of the preset.
    pub fn scheme(&self) -> String {
        let name = self.integrator().map_or_else(|error| error.to_string(), |scheme| scheme.name());
        match &self.preset {
            Some(preset) if *preset == Preset::smooth() => format!("**smooth**: {name}"),
            Some(preset) if *preset == Preset::conservative() => format!("**conservative**: {name}"),
            Some(_) => format!("**explicit**: {name}"),
            None => name,
        }
    }

    /// Name of the correction, or of the law that takes its place.
    fn correction(&self) -> String {
        match self.law {
            ContactLaw::Rigid => self.correction.name().into(),
            ContactLaw::RateCondition => "rate condition".into(),
            ContactLaw::PersistencySwitch => "persistency switch".into(),
            ContactLaw::Penalty { .. } => "penalty".into(),
            ContactLaw::Bipenalty { stiffness, .. } => format!("bipenalty({stiffness})"),
            ContactLaw::StabilizedBipenalty { stiffness } => format!("stabilized bipenalty({stiffness})"),
            law => format!("{law:?}"),
        }
    }
}
