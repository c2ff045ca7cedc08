//! Settings as stored in files, under the names of the methods that choose them; reading calls these methods.

use crate::simulation::stage::newton::{Newton, TangentUpdate};
use crate::simulation::step::judge::StepControl;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// [`StepControl`] in a file.
#[derive(Serialize, Deserialize)]
#[serde(rename = "StepControl")]
struct ControlRecord {
    smallest: f64,
    local_error: Option<f64>,
    contact_changes: Option<usize>,
}

impl Serialize for StepControl {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { smallest, tolerance, changes } = *self;
        ControlRecord { smallest, local_error: tolerance, contact_changes: changes }.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for StepControl {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let ControlRecord { smallest, local_error, contact_changes } = ControlRecord::deserialize(deserializer)?;
        let control = Self::halving(smallest).map_err(D::Error::custom)?;
        let control = local_error.map_or(Ok(control), |tolerance| control.local_error(tolerance));
        let control = control.map_err(D::Error::custom)?;
        contact_changes.map_or(Ok(control), |limit| control.contact_changes(limit)).map_err(D::Error::custom)
    }
}

/// [`Newton`] in a file.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Newton")]
struct NewtonRecord {
    tangent: TangentRecord,
    line_search: bool,
    /// In force and displacement.
    tolerances: [f64; 2],
    iterations: usize,
}

/// The method that creates the settings.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum TangentRecord {
    Full,
    Modified,
}

impl Serialize for Newton {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { tangent, line_search, force, displacement, iterations } = *self;
        let tangent = match tangent {
            TangentUpdate::Iteration => TangentRecord::Full,
            TangentUpdate::Stage => TangentRecord::Modified,
        };
        NewtonRecord { tangent, line_search, tolerances: [force, displacement], iterations }.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Newton {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let NewtonRecord { tangent, line_search, tolerances: [force, displacement], iterations } =
            NewtonRecord::deserialize(deserializer)?;
        let newton = match tangent {
            TangentRecord::Full => Self::full(),
            TangentRecord::Modified => Self::modified(),
        };
        let newton = if line_search { newton.line_search() } else { newton };
        let newton = newton.tolerances(force, displacement).map_err(D::Error::custom)?;
        newton.iterations(iterations).map_err(D::Error::custom)
    }
}
