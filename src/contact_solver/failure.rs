//! Converts failures of contact problems to step errors that name contacts instead of rows.

use crate::contact_failure::ContactFailure;
use crate::contact_id::ContactId;
use crate::error::Error;
use crate::real::Real;

/// The error for a contact whose response to a force is not a number.
pub(crate) fn no_response(t: f64, contact: ContactId) -> Error {
    Error::ContactNotFinite { t, what: "the response G M⁻¹ Gᵀ", contact, value: f64::NAN }
}

/// The error for a contact problem that failed at time t.
pub(crate) fn contact_error<T: Real>(t: f64, failure: ContactFailure<T>, id: impl Fn(usize) -> ContactId) -> Error {
    match failure {
        ContactFailure::Contradictory { row, other, residual } => {
            Error::ContradictoryContacts { t, contact: id(row), other: id(other), violation: residual.value() }
        }
        // The values have overflowed.
        ContactFailure::NotConverged { row, residual, .. } if !residual.is_finite() => {
            let what = "what the contact solver leaves of the gap";
            Error::ContactNotFinite { t, what, contact: id(row), value: residual.value() }
        }
        ContactFailure::NotConverged { iterations, row, residual } => {
            Error::Contact { t, iterations, contact: id(row), residual: residual.value() }
        }
        ContactFailure::Jammed { row, friction, normal, coupling } => {
            Error::Jammed { t, contact: id(row), friction, normal: normal.value(), coupling: coupling.value() }
        }
        ContactFailure::Friction { row } => Error::Incompatible {
            part: format!("the contact solver, for contact {}", id(row)),
            reason: "the contact has friction; use ActiveSet or GaussSeidel",
        },
        ContactFailure::Unsymmetric { row, other } => {
            Error::UnsymmetricContacts { t, contact: id(row), other: id(other) }
        }
    }
}
