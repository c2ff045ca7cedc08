//! Schemes, contact laws, corrections and solvers by name. Parameters follow the name: "bathe rho=0.5".

use crate::error::{Result, invalid};
use contact_dynamics::{ContactLaw, InitialOverclosure};
use contact_dynamics_named::{CORRECTIONS, Correctors, LAWS, Named, Refused, SCHEMES, SOLVERS, Scheme, Solver, make};
use std::collections::BTreeMap;

/// The entry of a table for a name with parameters.
fn read<T>(kind: &str, table: &[Named<T>], text: &str) -> Result<T> {
    let mut words = text.split_whitespace();
    let name = words.next().unwrap_or("");
    let mut given = BTreeMap::new();
    for word in words {
        let value = word.split_once('=').and_then(|(parameter, value)| Some((parameter, value.parse().ok()?)));
        let (parameter, value): (&str, f64) =
            value.ok_or_else(|| invalid(format!("the {kind} \"{text}\": \"{word}\" is not parameter=number")))?;
        given.insert(parameter.to_owned(), value);
    }
    make(kind, table, name, given).map_err(|refused| match refused {
        Refused::Name(text) => invalid(text),
        Refused::Crate(error) => error.into(),
    })
}

pub(crate) fn scheme(text: &str) -> Result<Scheme> {
    read("scheme", SCHEMES, text)
}

pub(crate) fn law(text: &str) -> Result<ContactLaw> {
    const EQUALITY: Named<ContactLaw> = ("equality", &[], |_| Ok(ContactLaw::Equality));
    read("contact law", &[&[EQUALITY], LAWS].concat(), text)
}

/// Correctors by name; none where the crate chooses.
pub(crate) fn correctors(text: &str) -> Result<Option<Correctors>> {
    read("correction", CORRECTIONS, text)
}

pub(crate) fn linear_solver(text: &str) -> Result<Solver> {
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
