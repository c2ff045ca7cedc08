//! Settings as files hold them, under the names of the methods that choose them; what is read goes through those.

use super::judge::StepControl;
use super::newton::{Newton, TangentUpdate};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// [`StepControl`] in a file.
#[derive(Serialize, Deserialize)]
pub(super) struct ControlRecord {
    smallest: f64,
    local_error: Option<f64>,
    contact_changes: Option<usize>,
}

impl From<StepControl> for ControlRecord {
    fn from(control: StepControl) -> Self {
        let StepControl { smallest, tolerance, changes } = control;
        Self { smallest, local_error: tolerance, contact_changes: changes }
    }
}

impl TryFrom<ControlRecord> for StepControl {
    type Error = Error;

    fn try_from(record: ControlRecord) -> Result<Self> {
        let control = Self::halving(record.smallest)?;
        let control = record.local_error.map_or(Ok(control), |tolerance| control.local_error(tolerance))?;
        record.contact_changes.map_or(Ok(control), |limit| control.contact_changes(limit))
    }
}

/// [`Newton`] in a file.
#[derive(Serialize, Deserialize)]
pub(super) struct NewtonRecord {
    tangent: TangentUpdate,
    line_search: bool,
    tolerances: [f64; 2],
    iterations: usize,
}

impl From<Newton> for NewtonRecord {
    fn from(newton: Newton) -> Self {
        let Newton { tangent, line_search, force, displacement, iterations } = newton;
        Self { tangent, line_search, tolerances: [force, displacement], iterations }
    }
}

impl TryFrom<NewtonRecord> for Newton {
    type Error = Error;

    fn try_from(record: NewtonRecord) -> Result<Self> {
        let NewtonRecord { tangent, line_search, tolerances: [force, displacement], iterations } = record;
        let newton = match tangent {
            TangentUpdate::Iteration => Self::full(),
            TangentUpdate::Stage => Self::modified(),
        };
        let newton = if line_search { newton.line_search() } else { newton };
        newton.tolerances(force, displacement)?.iterations(iterations)
    }
}
