//! Schemes, contact laws, corrections and solvers by name: the names of the program from-matrices.
//!
//! Parameters follow the name: "bathe rho=0.5".

use crate::error::{Result, invalid};
use contact_dynamics::corrector::{
    ContactImplicit, ContactStabilized, LaursenLove, NonsmoothSplitting, Release, WorkBalance, ZeroAcceleration,
};
use contact_dynamics::{
    Automatic, Bathe, Bdf2, ByBody, CdLagrange, CentralDifference, Cholesky, ChungLee, Composite, ConjugateGradients,
    ContactLaw, Corrector, EnergyMomentum, GeneralizedAlpha, Gssss, Houbolt, HulbertChung, InitialOverclosure,
    LinearSolver, Lu, MoreauJean, Newmark, NohBathe, Oalts, Park, PersistencyCorrection, TchamwaWielgosz,
    TimeIntegrator,
};
use std::collections::BTreeMap;

pub(crate) type Correctors = Vec<Box<dyn Corrector<f64>>>;
/// Name, parameters with their defaults, constructor.
type Named<T> = (&'static str, &'static [(&'static str, Option<f64>)], fn(&[f64]) -> contact_dynamics::Result<T>);

/// The entry of a table for a name with parameters.
fn read<T>(kind: &str, table: &[Named<T>], text: &str) -> Result<T> {
    let mut words = text.split_whitespace();
    let name = words.next().unwrap_or("");
    let Some(&(_, parameters, make)) = table.iter().find(|entry| entry.0 == name) else {
        let names: Vec<_> = table.iter().map(|entry| entry.0).collect();
        return Err(invalid(format!("there is no {kind} \"{name}\"; the names are {}", names.join(", "))));
    };
    let mut given = BTreeMap::new();
    for word in words {
        let value = word.split_once('=').and_then(|(parameter, value)| Some((parameter, value.parse().ok()?)));
        let (parameter, value): (_, f64) =
            value.ok_or_else(|| invalid(format!("the {kind} \"{text}\": \"{word}\" is not parameter=number")))?;
        given.insert(parameter, value);
    }
    let mut value = |&(parameter, default): &(&str, Option<f64>)| {
        let missing = || invalid(format!("the {kind} \"{name}\" needs the parameter {parameter}"));
        given.remove(parameter).or(default).ok_or_else(missing)
    };
    let values: Vec<f64> = parameters.iter().map(&mut value).collect::<Result<_>>()?;
    if let Some(other) = given.keys().next() {
        return Err(invalid(format!("the {kind} \"{name}\" has no parameter {other}")));
    }
    Ok(make(&values)?)
}

pub(crate) type Scheme = Box<dyn TimeIntegrator>;
pub(crate) type Solver = Box<dyn LinearSolver<f64>>;

fn boxed(scheme: impl TimeIntegrator + 'static) -> Scheme {
    Box::new(scheme)
}

#[rustfmt::skip]
const SCHEMES: &[Named<Scheme>] = &[
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

pub(crate) fn scheme(text: &str) -> Result<Scheme> {
    read("scheme", SCHEMES, text)
}

pub(crate) fn law(text: &str) -> Result<ContactLaw> {
    use ContactLaw::{
        Bipenalty, Equality, HuntCrossley, KelvinVoigt, Penalty, PersistencySwitch, PowerLaw, RateCondition,
        Restitution, Rigid, StabilizedBipenalty,
    };
    #[rustfmt::skip]
    const LAWS: &[Named<ContactLaw>] = &[
        ("rigid", &[], |_| Ok(Rigid)),
        ("equality", &[], |_| Ok(Equality)),
        ("restitution", &[("coefficient", None)], |p| Ok(Restitution { coefficient: p[0] })),
        ("penalty", &[("stiffness", None)], |p| Ok(Penalty { stiffness: p[0] })),
        ("power", &[("stiffness", None), ("exponent", None)], |p| Ok(PowerLaw { stiffness: p[0], exponent: p[1] })),
        ("hertz", &[("modulus", None), ("radius", None)], |p| Ok(ContactLaw::hertz(p[0], p[1]))),
        ("kelvin-voigt", &[("stiffness", None), ("damping", None)],
         |p| Ok(KelvinVoigt { stiffness: p[0], damping: p[1] })),
        ("hunt-crossley", &[("stiffness", None), ("exponent", Some(1.5)), ("dissipation", None)],
         |p| Ok(HuntCrossley { stiffness: p[0], exponent: p[1], dissipation: p[2] })),
        ("rate-condition", &[], |_| Ok(RateCondition)),
        ("persistency-switch", &[], |_| Ok(PersistencySwitch)),
        ("bipenalty", &[("stiffness", None), ("mass", None)], |p| Ok(Bipenalty { stiffness: p[0], mass: p[1] })),
        ("stabilized-bipenalty", &[("stiffness", None)], |p| Ok(StabilizedBipenalty { stiffness: p[0] })),
    ];
    read("contact law", LAWS, text)
}

/// Correctors by name; none where the crate chooses.
pub(crate) fn correctors(text: &str) -> Result<Option<Correctors>> {
    #[expect(clippy::unnecessary_wraps, reason = "the type of constructors")]
    fn one(corrector: impl Corrector<f64> + 'static) -> contact_dynamics::Result<Option<Correctors>> {
        Ok(Some(vec![Box::new(corrector)]))
    }
    #[rustfmt::skip]
    const CORRECTIONS: &[Named<Option<Correctors>>] = &[
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
    read("correction", CORRECTIONS, text)
}

pub(crate) fn linear_solver(text: &str) -> Result<Solver> {
    const SOLVERS: &[Named<Solver>] = &[
        ("automatic", &[], |_| Ok(Box::new(Automatic))),
        ("cholesky", &[], |_| Ok(Box::new(Cholesky::default()))),
        ("lu", &[], |_| Ok(Box::new(Lu))),
        ("conjugate-gradients", &[], |_| Ok(Box::new(ConjugateGradients::default()))),
        ("by-body", &[], |_| Ok(Box::new(ByBody::default()))),
    ];
    read("linear solver", SOLVERS, text)
}

pub(crate) fn overlap(text: &str) -> Result<InitialOverclosure> {
    const OVERLAPS: &[Named<InitialOverclosure>] = &[
        ("refused", &[], |_| Ok(InitialOverclosure::Refused)),
        ("adjusted", &[], |_| Ok(InitialOverclosure::AdjustedGaps)),
        ("removed", &[("time", None)], |p| Ok(InitialOverclosure::RemovedOver(p[0]))),
    ];
    read("treatment of overlaps", OVERLAPS, text)
}
