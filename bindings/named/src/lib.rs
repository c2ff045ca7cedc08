//! Schemes, contact laws, corrections and linear solvers by name: the names of the program from-matrices.

use contact_dynamics::corrector::{
    ContactImplicit, ContactStabilized, LaursenLove, NonsmoothSplitting, Release, WorkBalance, ZeroAcceleration,
};
use contact_dynamics::{
    Automatic, Bathe, Bdf2, ByBody, CdLagrange, CentralDifference, Cholesky, ChungLee, Composite, ConjugateGradients,
    ContactLaw, Corrector, EnergyMomentum, Error, GeneralizedAlpha, Gssss, Houbolt, HulbertChung, LinearSolver, Lu,
    MoreauJean, Newmark, NohBathe, Oalts, Park, PersistencyCorrection, Result, TchamwaWielgosz, TimeIntegrator,
};
use std::collections::BTreeMap;

pub type Scheme = Box<dyn TimeIntegrator>;
pub type Solver = Box<dyn LinearSolver<f64>>;
pub type Correctors = Vec<Box<dyn Corrector<f64>>>;
/// Name, parameters with their defaults, constructor.
pub type Named<T> = (&'static str, &'static [(&'static str, Option<f64>)], fn(&[f64]) -> Result<T>);

/// The reason why there is nothing of a name.
#[derive(Debug)]
pub enum Refused {
    /// No such name or parameter, or a parameter that is missing.
    Name(String),
    /// The error of the constructor.
    Crate(Error),
}

/// Makes the entry of a table with this name and these parameters. `kind` is the noun of messages.
pub fn make<T>(
    kind: &str,
    table: &[Named<T>],
    name: &str,
    mut given: BTreeMap<String, f64>,
) -> std::result::Result<T, Refused> {
    let Some(&(_, parameters, make)) = table.iter().find(|entry| entry.0 == name) else {
        let names: Vec<_> = table.iter().map(|entry| entry.0).collect();
        return Err(Refused::Name(format!("there is no {kind} \"{name}\"; the names are {}", names.join(", "))));
    };
    let mut value = |&(parameter, default): &(&str, Option<f64>)| {
        let missing = || Refused::Name(format!("the {kind} \"{name}\" needs the parameter {parameter}"));
        given.remove(parameter).or(default).ok_or_else(missing)
    };
    let values: Vec<f64> = parameters.iter().map(&mut value).collect::<std::result::Result<_, _>>()?;
    match given.keys().next() {
        Some(other) => Err(Refused::Name(format!("the {kind} \"{name}\" has no parameter {other}"))),
        None => make(&values).map_err(Refused::Crate),
    }
}

fn boxed(scheme: impl TimeIntegrator + 'static) -> Scheme {
    Box::new(scheme)
}

#[rustfmt::skip]
pub const SCHEMES: &[Named<Scheme>] = &[
    ("generalized-alpha", &[("rho", Some(0.8))], |p| GeneralizedAlpha::chung_hulbert(p[0]).map(boxed)),
    ("hht", &[("rho", Some(0.8))], |p| GeneralizedAlpha::hht(p[0]).map(boxed)),
    ("wbz", &[("rho", Some(0.8))], |p| GeneralizedAlpha::wbz(p[0]).map(boxed)),
    ("trapezoidal", &[], |_| Ok(boxed(Newmark::trapezoidal()))),
    ("newmark", &[("beta", Some(0.25)), ("gamma", Some(0.5))], |p| Newmark::new(p[0], p[1]).map(boxed)),
    ("composite", &[], |_| Ok(boxed(Composite))),
    ("bathe", &[("rho", Some(0.0))], |p| Bathe::with_radius(p[0]).map(boxed)),
    ("houbolt", &[], |_| Ok(boxed(Houbolt))),
    ("park", &[], |_| Ok(boxed(Park))),
    ("bdf2", &[], |_| Ok(boxed(Bdf2))),
    ("oalts", &[("rho", Some(0.5))], |p| Oalts::new(p[0]).map(boxed)),
    ("gssss", &[("rho_1", Some(0.8)), ("rho_2", Some(0.8)), ("rho_3", Some(0.8))],
     |p| Gssss::new(p[0], p[1], p[2]).map(boxed)),
    ("moreau-jean", &[("theta", Some(0.5))], |p| MoreauJean::new(p[0]).map(boxed)),
    ("energy-momentum", &[], |_| Ok(boxed(EnergyMomentum))),
    ("central-difference", &[], |_| Ok(boxed(CentralDifference))),
    ("cd-lagrange", &[], |_| Ok(boxed(CdLagrange))),
    ("tchamwa-wielgosz", &[("phi", Some(1.033))], |p| TchamwaWielgosz::new(p[0]).map(boxed)),
    ("chung-lee", &[("beta", Some(28.0 / 27.0))], |p| ChungLee::new(p[0]).map(boxed)),
    ("hulbert-chung", &[("rho", Some(0.8))], |p| HulbertChung::new(p[0]).map(boxed)),
    ("noh-bathe", &[("p", Some(0.54))], |p| NohBathe::new(p[0]).map(boxed)),
];

/// Besides "equality", which only rows take.
#[rustfmt::skip]
pub const LAWS: &[Named<ContactLaw>] = &[
    ("rigid", &[], |_| Ok(ContactLaw::Rigid)),
    ("restitution", &[("coefficient", None)], |p| Ok(ContactLaw::Restitution { coefficient: p[0] })),
    ("penalty", &[("stiffness", None)], |p| Ok(ContactLaw::Penalty { stiffness: p[0] })),
    ("power", &[("stiffness", None), ("exponent", None)], |p| Ok(ContactLaw::PowerLaw { stiffness: p[0], exponent: p[1] })),
    ("hertz", &[("modulus", None), ("radius", None)], |p| Ok(ContactLaw::hertz(p[0], p[1]))),
    ("kelvin-voigt", &[("stiffness", None), ("damping", None)],
     |p| Ok(ContactLaw::KelvinVoigt { stiffness: p[0], damping: p[1] })),
    ("hunt-crossley", &[("stiffness", None), ("exponent", Some(1.5)), ("dissipation", None)],
     |p| Ok(ContactLaw::HuntCrossley { stiffness: p[0], exponent: p[1], dissipation: p[2] })),
    ("rate-condition", &[], |_| Ok(ContactLaw::RateCondition)),
    ("persistency-switch", &[], |_| Ok(ContactLaw::PersistencySwitch)),
    ("bipenalty", &[("stiffness", None), ("mass", None)], |p| Ok(ContactLaw::Bipenalty { stiffness: p[0], mass: p[1] })),
    ("stabilized-bipenalty", &[("stiffness", None)], |p| Ok(ContactLaw::StabilizedBipenalty { stiffness: p[0] })),
];

#[expect(clippy::unnecessary_wraps, reason = "the type of constructors")]
fn one(corrector: impl Corrector<f64> + 'static) -> Result<Option<Correctors>> {
    Ok(Some(vec![Box::new(corrector)]))
}

/// None where the crate chooses.
#[rustfmt::skip]
pub const CORRECTIONS: &[Named<Option<Correctors>>] = &[
    ("default", &[], |_| Ok(None)),
    ("none", &[], |_| Ok(Some(Vec::new()))),
    ("persistency", &[], |_| one(PersistencyCorrection::new())),
    ("persistency-history", &[], |_| one(PersistencyCorrection::with_history_projection())),
    ("persistency-release", &[],
     |_| Ok(Some(vec![Box::new(PersistencyCorrection::with_history_projection()), Box::new(Release)]))),
    ("contact-implicit", &[], |_| one(ContactImplicit)),
    ("contact-stabilized", &[], |_| one(ContactStabilized::new())),
    ("laursen-love", &[], |_| one(LaursenLove)),
    ("nonsmooth-splitting", &[], |_| one(NonsmoothSplitting)),
    ("work-balance", &[], |_| one(WorkBalance)),
    ("zero-acceleration", &[], |_| one(ZeroAcceleration)),
];

pub const SOLVERS: &[Named<Solver>] = &[
    ("automatic", &[], |_| Ok(Box::new(Automatic))),
    ("cholesky", &[], |_| Ok(Box::new(Cholesky::default()))),
    ("lu", &[], |_| Ok(Box::new(Lu))),
    ("conjugate-gradients", &[], |_| Ok(Box::new(ConjugateGradients::default()))),
    ("by-body", &[], |_| Ok(Box::new(ByBody::default()))),
];
