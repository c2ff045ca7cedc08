//! Errors of the crate as Python exceptions.

use contact_dynamics::Error;
use pyo3::exceptions::{PyException, PyMemoryError, PyValueError};
use pyo3::prelude::*;

pyo3::create_exception!(
    contact_dynamics,
    ContactDynamicsError,
    PyException,
    "A model, a start or a step that the library refuses, in its own words: docs/errors.md lists them with remedies. \
     A step that fails leaves the simulation as it was."
);
pyo3::create_exception!(
    contact_dynamics,
    Inadmissible,
    PyException,
    "Raise it in a callback that cannot evaluate a trial state, for instance because an element is inverted: the step \
     is undone, and repeated with half its size if `smallest_step` is given."
);

pub(crate) type Result<T, E = Fault> = std::result::Result<T, E>;

/// An error of either side, on its way to Python.
#[derive(Debug)]
pub(crate) enum Fault {
    Crate(Error),
    Python(PyErr),
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        Self::Crate(error)
    }
}

impl From<PyErr> for Fault {
    fn from(error: PyErr) -> Self {
        Self::Python(error)
    }
}

impl From<Fault> for PyErr {
    fn from(fault: Fault) -> Self {
        let error = match fault {
            Fault::Python(error) => return error,
            // The exception of a callback is raised again, with its traceback.
            Fault::Crate(Error::Host { callback, source }) => match source.downcast::<Self>() {
                Ok(error) => return *error,
                Err(source) => Error::Host { callback, source },
            },
            Fault::Crate(error) => error,
        };
        match error {
            Error::Dimension { .. }
            | Error::Parameter { .. }
            | Error::NotFinite { .. }
            | Error::MatrixNotFinite { .. }
            | Error::MissingDof { .. }
            | Error::RepeatedDof { .. }
            | Error::Empty { .. } => refused(error.to_string()),
            Error::OutOfMemory { .. } => PyMemoryError::new_err(error.to_string()),
            _ => ContactDynamicsError::new_err(error.to_string()),
        }
    }
}

/// A `ValueError` for an object of a type that is not expected.
pub(crate) fn unexpected(what: &str, object: &Bound<'_, PyAny>, expected: &str) -> Fault {
    let name = object.get_type().name().map_or_else(|_| "?".into(), |name| name.to_string());
    Fault::Python(refused(format!("{what} is of the type {name}, expected {expected}")))
}

/// A `ValueError`.
pub(crate) fn refused(text: impl Into<String>) -> PyErr {
    PyValueError::new_err(text.into())
}
