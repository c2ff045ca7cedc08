//! Calls of Python functions by the crate, which runs without the interpreter's lock.

use crate::error::{Fault, Inadmissible, Result};
use contact_dynamics::Error;
use pyo3::prelude::*;
use std::cell::RefCell;

thread_local! {
    /// The first exception of a function whose errors the crate does not take.
    static PENDING: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// Calls Python; an exception becomes the crate's error, of which [`Fault`] makes the exception again.
pub(crate) fn fallible<T>(
    callback: &'static str,
    call: impl FnOnce(Python<'_>) -> PyResult<T>,
) -> contact_dynamics::Result<T> {
    Python::attach(|py| {
        call(py).map_err(|error| {
            let is_inadmissible = error.is_instance_of::<Inadmissible>(py);
            let source = Box::new(error);
            match is_inadmissible {
                true => Error::Inadmissible { callback, source },
                false => Error::Host { callback, source },
            }
        })
    })
}

/// Calls Python where the crate takes no error: `nan` makes the step fail, and [`detached`] raises the exception.
pub(crate) fn infallible<T>(nan: T, call: impl FnOnce(Python<'_>) -> PyResult<T>) -> T {
    Python::attach(call).unwrap_or_else(|error| {
        PENDING.with_borrow_mut(|pending| _ = pending.get_or_insert(error));
        nan
    })
}

/// Calls the crate without the interpreter's lock, and raises what a callback has raised meanwhile.
pub(crate) fn detached<T: Send>(
    py: Python<'_>,
    call: impl FnOnce() -> contact_dynamics::Result<T> + Send,
) -> Result<T> {
    let result = py.detach(call);
    match PENDING.take() {
        Some(raised) => Err(Fault::Python(raised)),
        None => Ok(result?),
    }
}
