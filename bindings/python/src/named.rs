//! Schemes, contact laws, corrections and solvers by name: the names of the program from-matrices.

use crate::error::{Result, refused};
use contact_dynamics::corrector::{
    ContactImplicit, ContactStabilized, LaursenLove, NonsmoothSplitting, Release, WorkBalance, ZeroAcceleration,
};
use contact_dynamics::{
    Automatic, Bathe, Bdf2, ByBody, CdLagrange, CentralDifference, Cholesky, ChungLee, Composite, ConjugateGradients,
    ContactLaw, Corrector, EnergyMomentum, GeneralizedAlpha, Gssss, Houbolt, HulbertChung, LinearSolver, Lu,
    MoreauJean, Newmark, NohBathe, Oalts, Park, PersistencyCorrection, Preset, TchamwaWielgosz, TimeIntegrator,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;

type Correctors = Vec<Box<dyn Corrector<f64>>>;
/// Name, parameters with their defaults, constructor.
type Named<T> = (&'static str, &'static [(&'static str, Option<f64>)], fn(&[f64]) -> contact_dynamics::Result<T>);

/// The entry of a table for a name, or for a dictionary with a name and parameters.
fn read<T>(kind: &str, table: &[Named<T>], value: &Bound<'_, PyAny>) -> Result<T> {
    let (name, mut given) = match value.cast::<PyDict>() {
        Ok(all) => {
            let all = all.copy()?;
            let name = all.get_item("name")?.ok_or_else(|| refused(format!("a {kind} needs a \"name\"")))?;
            all.del_item("name")?;
            (name.extract::<String>()?, all.extract::<BTreeMap<String, f64>>()?)
        }
        Err(_) => (value.extract()?, BTreeMap::new()),
    };
    let Some((_, parameters, make)) = table.iter().find(|entry| entry.0 == name) else {
        let names: Vec<_> = table.iter().map(|entry| entry.0).collect();
        return Err(refused(format!("there is no {kind} \"{name}\"; the names are {}", names.join(", "))).into());
    };
    let mut value = |&(parameter, default): &(&str, Option<f64>)| {
        let missing = || refused(format!("the {kind} \"{name}\" needs the parameter {parameter}"));
        given.remove(parameter).or(default).ok_or_else(missing)
    };
    let values: Vec<f64> = parameters.iter().map(&mut value).collect::<PyResult<_>>()?;
    match given.keys().next() {
        Some(other) => Err(refused(format!("the {kind} \"{name}\" has no parameter {other}")).into()),
        None => Ok(make(&values)?),
    }
}

type Scheme = Box<dyn TimeIntegrator>;

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

/// A preset by its name, if there is one.
pub(crate) fn preset(name: &str) -> Option<Preset> {
    match name {
        "smooth" => Some(Preset::smooth()),
        "conservative" => Some(Preset::conservative()),
        "explicit" => Some(Preset::explicit()),
        _ => None,
    }
}

/// A scheme by its name, or the scheme and the correctors of a preset.
pub(crate) fn scheme(value: &Bound<'_, PyAny>) -> Result<(Scheme, Option<Correctors>)> {
    match value.extract::<String>().ok().as_deref().and_then(preset) {
        Some(preset) => Ok((preset.integrator(), Some(preset.correctors()))),
        None => Ok((read("scheme (besides smooth, conservative, explicit)", SCHEMES, value)?, None)),
    }
}

pub(crate) fn law(value: &Bound<'_, PyAny>) -> Result<ContactLaw> {
    use ContactLaw::{
        Bipenalty, HuntCrossley, KelvinVoigt, Penalty, PersistencySwitch, PowerLaw, RateCondition, Restitution, Rigid,
        StabilizedBipenalty,
    };
    #[rustfmt::skip]
    const LAWS: &[Named<ContactLaw>] = &[
        ("rigid", &[], |_| Ok(Rigid)),
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
    read("contact law", LAWS, value)
}

/// Correctors by name; none where the crate chooses.
pub(crate) fn correctors(value: &Bound<'_, PyAny>) -> Result<Option<Correctors>> {
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
    read("correction", CORRECTIONS, value)
}

pub(crate) fn linear_solver(value: &Bound<'_, PyAny>) -> Result<Box<dyn LinearSolver<f64>>> {
    const SOLVERS: &[Named<Box<dyn LinearSolver<f64>>>] = &[
        ("automatic", &[], |_| Ok(Box::new(Automatic))),
        ("cholesky", &[], |_| Ok(Box::new(Cholesky::default()))),
        ("lu", &[], |_| Ok(Box::new(Lu))),
        ("conjugate-gradients", &[], |_| Ok(Box::new(ConjugateGradients::default()))),
        ("by-body", &[], |_| Ok(Box::new(ByBody::default()))),
    ];
    read("linear solver", SOLVERS, value)
}
