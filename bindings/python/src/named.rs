//! Schemes, contact laws, corrections and solvers by name.

use crate::error::{Fault, Result, refused};
use contact_dynamics::{ContactLaw, Preset};
use contact_dynamics_named::{CORRECTIONS, Correctors, LAWS, Named, Refused, SCHEMES, SOLVERS, Scheme, Solver, make};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;

/// The entry of a table for a name, or for a dictionary with a name and parameters.
fn read<T>(kind: &str, table: &[Named<T>], value: &Bound<'_, PyAny>) -> Result<T> {
    let (name, given): (String, BTreeMap<String, f64>) = match value.cast::<PyDict>() {
        Ok(all) => {
            let all = all.copy()?;
            let name = all.get_item("name")?.ok_or_else(|| refused(format!("a {kind} needs a \"name\"")))?;
            all.del_item("name")?;
            (name.extract()?, all.extract()?)
        }
        Err(_) => (value.extract()?, BTreeMap::new()),
    };
    make(kind, table, &name, given).map_err(|reason| match reason {
        Refused::Name(text) => refused(text).into(),
        Refused::Crate(error) => Fault::Crate(error),
    })
}

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
    read("contact law", LAWS, value)
}

/// Correctors by name; none where the crate chooses.
pub(crate) fn correctors(value: &Bound<'_, PyAny>) -> Result<Option<Correctors>> {
    read("correction", CORRECTIONS, value)
}

pub(crate) fn linear_solver(value: &Bound<'_, PyAny>) -> Result<Solver> {
    read("linear solver", SOLVERS, value)
}
