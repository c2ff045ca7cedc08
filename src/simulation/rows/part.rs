//! One constraint of a run: its dofs, the properties it has reported, and its local vectors.

use crate::contact::{Candidates, ContactConstraint, ContactId, Contacts, Rates, Variation};
use crate::error::{Error, Result};
use crate::real::Real;

/// A constraint with the properties it has reported.
pub(crate) struct Part<'a, T: Real> {
    pub(crate) constraint: Box<dyn ContactConstraint<T> + 'a>,
    pub(crate) dofs: Vec<usize>,
    pub(crate) contacts: Contacts<T>,
    pub(crate) variation: Variation,
    pub(crate) inspects: bool,
    /// Where its rows are linearized: time and displacements.
    pub(crate) place: (f64, Vec<T>),
    /// Whether its rows may have changed since they were read.
    pub(crate) stale: bool,
    /// The common version of all rows when its own were last read.
    pub(crate) version: u64,
    /// How it gives its rates, once evaluated; reset when its rows change.
    pub(crate) rates: Option<Rates>,
    /// The same for its slip rates.
    pub(crate) slip_rates: Option<Rates>,
}

impl<T: Real> Part<'_, T> {
    /// Moves the linearization to its local displacements u.
    pub(crate) fn follow(&mut self, t: f64, u: &[T]) -> Result<Candidates> {
        if self.variation != Variation::Follows {
            return Ok(Candidates::Unchanged);
        }
        self.store_place(t, u);
        self.constraint.follow(t, u)
    }

    /// Stores where the rows are linearized.
    pub(crate) fn store_place(&mut self, t: f64, u: &[T]) {
        if self.variation == Variation::Follows {
            self.place.0 = t;
            self.place.1.clear();
            self.place.1.extend_from_slice(u);
        }
    }
}

/// Vectors of a constraint.
#[derive(Default)]
pub(crate) struct Local<T> {
    pub(crate) u: Vec<T>,
    pub(crate) v: Vec<T>,
    pub(crate) other: Vec<T>,
}

/// The entries of a vector of the system that belong to a constraint.
pub(crate) fn gather<'l, T: Real>(dofs: &[usize], x: &[T], local: &'l mut Vec<T>) -> &'l [T] {
    local.clear();
    local.extend(dofs.iter().map(|&dof| x[dof]));
    local
}

/// Adds the number of the constraint to its error.
pub(crate) fn of(constraint: usize, error: Error) -> Error {
    match error {
        Error::PassedThrough { t, h, contact, what, way, gap } => {
            let contact = ContactId { constraint, ..contact };
            Error::PassedThrough { t, h, contact, what, way, gap }
        }
        Error::NotCertified { t, h, facets, way, .. } => Error::NotCertified { t, h, constraint, facets, way },
        Error::ContactLost { t, contact } => Error::ContactLost { t, contact: ContactId { constraint, ..contact } },
        Error::ContactNotFinite { t, what, contact, value } => {
            Error::ContactNotFinite { t, what, contact: ContactId { constraint, ..contact }, value }
        }
        other => other,
    }
}
