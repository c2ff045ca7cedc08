//! Time integrators and corrections by name, with their parameters.

use crate::refusal::{Refusal, Result};
use contact_dynamics::corrector::{ContactImplicit, ContactStabilized, LaursenLove, Release, ZeroAcceleration};
use contact_dynamics::{
    Bathe, Bdf2, CdLagrange, CentralDifference, ChungLee, Composite, Corrector, EnergyMomentum, GeneralizedAlpha,
    Gssss, Houbolt, HulbertChung, MoreauJean, Newmark, NohBathe, Oalts, Park, PersistencyCorrection, TchamwaWielgosz,
    TimeIntegrator,
};
use std::fmt::Write;

type Scheme = Box<dyn TimeIntegrator>;
type Correctors = Vec<Box<dyn Corrector<f64>>>;
type Make = fn(&[f64]) -> contact_dynamics::Result<Scheme>;

/// Name, parameters with their defaults, constructor.
type Named = (&'static str, &'static [(&'static str, f64)], Make);

/// Name, constructor.
type NamedCorrection = (&'static str, fn() -> Option<Correctors>);

fn boxed(scheme: impl TimeIntegrator + 'static) -> Scheme {
    Box::new(scheme)
}

const SCHEMES: &[Named] = &[
    ("chung-hulbert", &[("ρ∞", 0.8)], |p| GeneralizedAlpha::chung_hulbert(p[0]).map(boxed)),
    ("trapezoidal", &[], |_| Ok(boxed(Newmark::trapezoidal()))),
    ("newmark", &[("β", 0.25), ("γ", 0.5)], |p| Newmark::new(p[0], p[1]).map(boxed)),
    ("hht", &[("ρ∞", 0.8)], |p| GeneralizedAlpha::hht(p[0]).map(boxed)),
    ("wbz", &[("ρ∞", 0.8)], |p| GeneralizedAlpha::wbz(p[0]).map(boxed)),
    ("composite", &[], |_| Ok(boxed(Composite))),
    ("bathe", &[("ρ∞", 0.0)], |p| Bathe::with_radius(p[0]).map(boxed)),
    ("houbolt", &[], |_| Ok(boxed(Houbolt))),
    ("park", &[], |_| Ok(boxed(Park))),
    ("bdf2", &[], |_| Ok(boxed(Bdf2))),
    ("oalts", &[("ρ∞", 0.5)], |p| Oalts::new(p[0]).map(boxed)),
    ("gssss", &[("ρ₁", 0.8), ("ρ₂", 0.8), ("ρ₃", 0.8)], |p| Gssss::new(p[0], p[1], p[2]).map(boxed)),
    ("moreau-jean", &[("θ", 0.5)], |p| MoreauJean::new(p[0]).map(boxed)),
    ("energy-momentum", &[], |_| Ok(boxed(EnergyMomentum))),
    ("central-difference", &[], |_| Ok(boxed(CentralDifference))),
    ("cd-lagrange", &[], |_| Ok(boxed(CdLagrange))),
    ("tchamwa-wielgosz", &[("φ", 1.033)], |p| TchamwaWielgosz::new(p[0]).map(boxed)),
    ("chung-lee", &[("β", 28.0 / 27.0)], |p| ChungLee::new(p[0]).map(boxed)),
    ("hulbert-chung", &[("ρ", 0.8)], |p| HulbertChung::new(p[0]).map(boxed)),
    ("noh-bathe", &[("p", 0.54)], |p| NohBathe::new(p[0]).map(boxed)),
];

/// None where the crate chooses.
const CORRECTIONS: &[NamedCorrection] = &[
    ("default", || None),
    ("none", || Some(Vec::new())),
    ("persistency", || Some(vec![Box::new(PersistencyCorrection::new())])),
    ("persistency-history", || Some(vec![Box::new(PersistencyCorrection::with_history_projection())])),
    ("persistency-release", || {
        Some(vec![Box::new(PersistencyCorrection::with_history_projection()), Box::new(Release)])
    }),
    ("contact-implicit", || Some(vec![Box::new(ContactImplicit)])),
    ("contact-stabilized", || Some(vec![Box::new(ContactStabilized::new())])),
    ("laursen-love", || Some(vec![Box::new(LaursenLove)])),
    ("zero-acceleration", || Some(vec![Box::new(ZeroAcceleration)])),
];

/// A scheme as the command line writes it: its name, and its parameters behind colons unless they are the defaults.
pub(crate) fn scheme(text: &str) -> Result<Scheme> {
    let mut words = text.split(':');
    let name = words.next().unwrap_or_default();
    let Some((_, parameters, make)) = SCHEMES.iter().find(|scheme| scheme.0 == name) else {
        let names: Vec<_> = SCHEMES.iter().map(|scheme| scheme.0).collect();
        return Err(Refusal::new(format!("there is no scheme `{name}`; the names are {}", names.join(", "))));
    };
    let given: Vec<f64> = words
        .map(|word| word.parse().map_err(|_| Refusal::new(format!("scheme {text}: `{word}` is not a number"))))
        .collect::<Result<_>>()?;
    let values = match given.len() {
        0 => parameters.iter().map(|parameter| parameter.1).collect(),
        count if count == parameters.len() => given,
        count => {
            let expected = parameters.len();
            let what = format!("scheme {text} has {count} parameters, {name} takes {expected}: {}", written(name));
            return Err(Refusal::new(what));
        }
    };
    make(&values).map_err(|error| Refusal::new(format!("scheme {text}: {error}")))
}

/// Correctors by name; none where the crate chooses.
pub(crate) fn correctors(name: &str) -> Result<Option<Correctors>> {
    if let Some((_, make)) = CORRECTIONS.iter().find(|correction| correction.0 == name) {
        return Ok(make());
    }
    let names: Vec<_> = CORRECTIONS.iter().map(|correction| correction.0).collect();
    Err(Refusal::new(format!("there is no correction `{name}`; the names are {}", names.join(", "))))
}

/// A scheme as it is written with its defaults.
fn written(name: &str) -> String {
    let parameters = SCHEMES.iter().find(|scheme| scheme.0 == name).map_or(&[][..], |scheme| scheme.1);
    parameters.iter().fold(name.to_string(), |mut text, (_, value)| {
        let _ = write!(text, ":{value:.4}");
        text.truncate(text.trim_end_matches('0').len());
        if text.ends_with('.') {
            text.push('0');
        }
        text
    })
}

/// All schemes with their parameters, for the help.
pub(crate) fn scheme_help() -> String {
    let all: Vec<_> = SCHEMES.iter().map(|scheme| written(scheme.0)).collect();
    format!("Time integrator, with parameters behind colons if they are not to be those shown: {}", all.join(", "))
}

/// All corrections, for the help.
pub(crate) fn correction_help() -> String {
    let all: Vec<_> = CORRECTIONS.iter().map(|correction| correction.0).collect();
    format!("What makes velocity and acceleration agree with a contact that has closed: {}", all.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_makes_its_scheme() {
        for (name, parameters, _) in SCHEMES {
            let scheme = scheme(name).unwrap();
            let same = super::scheme(&written(name)).unwrap();
            // Defaults are written with four digits.
            if parameters.iter().all(|(_, value)| (value * 1e4).fract() == 0.0) {
                assert_eq!(scheme.tableau(), same.tableau(), "{name}");
            }
        }
        assert_eq!(scheme("bathe:0.5").unwrap().tableau(), Bathe::with_radius(0.5).unwrap().tableau());
        for (name, _) in CORRECTIONS {
            assert_eq!(correctors(name).unwrap().is_none(), *name == "default");
        }
    }

    #[test]
    fn mistakes_name_what_there_is() {
        let refused = |text| scheme(text).unwrap_err().to_string();
        assert!(refused("Newmark").contains("there is no scheme `Newmark`; the names are chung-hulbert, trapezoidal"));
        assert!(refused("hht:x").contains("`x` is not a number"));
        assert!(refused("hht:0.5:1").contains("has 2 parameters, hht takes 1: hht:0.8"));
        assert!(refused("composite:1").contains("takes 0"));
        assert!(refused("hht:7").starts_with("scheme hht:7: "));
        assert!(correctors("all").unwrap_err().to_string().contains("default, none, persistency"));
    }
}
