//! What is compared: contact models of engineers, and the schemes that go with them.

use contact_dynamics::{
    ContactLaw, Corrector, GeneralizedAlpha, MoreauJean, Newmark, PersistencyCorrection, Result, TimeIntegrator,
};
use contact_dynamics_scenes::damped_contact::DampedLaw;
use contact_dynamics_scenes::frames::Frames;
use contact_dynamics_scenes::ground::Ground;
use contact_dynamics_scenes::pounding::{Pounding, Record};
use std::sync::Arc;

/// A scheme and its correctors.
type Parts = (Box<dyn TimeIntegrator>, Vec<Box<dyn Corrector<f64>>>);

/// The coefficient of restitution of the models that have one.
pub(crate) const RESTITUTION: f64 = 0.65;

/// The stiffness of the linear springs (N/m), and that of Hertz' law (N/m^3/2).
pub(crate) const STIFFNESS: [f64; 2] = [2e9, 2e10];

/// A contact model with its scheme, and what tables call them.
#[derive(Clone, Copy)]
pub(crate) struct Model {
    pub(crate) name: &'static str,
    pub(crate) scheme: Scheme,
    pub(crate) pounding: Pounding,
}

/// A scheme and its correction.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scheme {
    Trapezoidal,
    TrapezoidalCorrected,
    ChungHulbertCorrected,
    MoreauJean,
}

impl Scheme {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Trapezoidal => "trapezoidal rule",
            Self::TrapezoidalCorrected => "trapezoidal rule, λ_v/λ_a",
            Self::ChungHulbertCorrected => "Chung–Hulbert(0.8), λ_v/λ_a",
            Self::MoreauJean => "Moreau–Jean(0.5)",
        }
    }

    pub(crate) fn parts(self) -> Result<Parts> {
        let correction = || -> Vec<Box<dyn Corrector<f64>>> { vec![Box::new(PersistencyCorrection::new())] };
        Ok(match self {
            Self::Trapezoidal => (Box::new(Newmark::trapezoidal()), Vec::new()),
            Self::TrapezoidalCorrected => (Box::new(Newmark::trapezoidal()), correction()),
            Self::ChungHulbertCorrected => (Box::new(GeneralizedAlpha::chung_hulbert(0.8)?), correction()),
            Self::MoreauJean => (Box::new(MoreauJean::new(0.5)?), Vec::new()),
        })
    }
}

impl Model {
    pub(crate) fn run(&self, frames: &Frames, ground: &Arc<Ground>, h: f64, until: f64) -> Result<Record> {
        let (scheme, correctors) = self.scheme.parts()?;
        frames.run(ground, self.pounding, scheme, correctors, h, until)
    }
}

/// A linear spring between floors.
pub(crate) fn linear(stiffness: f64) -> Model {
    let pounding = Pounding::Law(ContactLaw::Penalty { stiffness });
    Model { name: "linear spring", scheme: Scheme::Trapezoidal, pounding }
}

/// Kelvin and Voigt's law with this stiffness between floors of two frames.
pub(crate) fn kelvin_voigt(frames: &Frames, stiffness: f64) -> Model {
    let masses = frames.frames.map(|frame| frame.mass);
    Model {
        name: "Kelvin–Voigt, e = 0.65",
        scheme: Scheme::Trapezoidal,
        pounding: Pounding::Damped(DampedLaw::kelvin_voigt(stiffness, RESTITUTION, masses)),
    }
}

/// All models, the rigid ones first.
pub(crate) fn all(frames: &Frames) -> Vec<Model> {
    let model = |name, scheme, pounding| Model { name, scheme, pounding };
    let rigid = Pounding::Law(ContactLaw::Rigid);
    let [stiffness, hertz] = STIFFNESS;
    vec![
        model("rigid", Scheme::TrapezoidalCorrected, rigid),
        model("rigid", Scheme::ChungHulbertCorrected, rigid),
        model("rigid, raw", Scheme::Trapezoidal, rigid),
        model("rigid", Scheme::MoreauJean, rigid),
        model(
            "restitution e = 0.65",
            Scheme::MoreauJean,
            Pounding::Law(ContactLaw::Restitution { coefficient: RESTITUTION }),
        ),
        linear(stiffness),
        kelvin_voigt(frames, stiffness),
        model("Hertz", Scheme::Trapezoidal, Pounding::Law(ContactLaw::PowerLaw { stiffness: hertz, exponent: 1.5 })),
        model(
            "Hertz, damped, e = 0.65",
            Scheme::Trapezoidal,
            Pounding::Damped(DampedLaw::HertzDamp { stiffness: hertz, restitution: RESTITUTION }),
        ),
    ]
}
