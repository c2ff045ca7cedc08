//! Calls of Python functions by the crate, which runs without the interpreter's lock.

use crate::error::{Inadmissible, Result, refused};
use contact_dynamics::Error;
use numpy::{AllowTypeChange, PyArrayLike1, PyUntypedArrayMethods};
use pyo3::call::PyCallArgs;
use pyo3::prelude::*;
use std::cell::RefCell;

thread_local! {
    /// The first exception of a function whose errors the crate does not take.
    static PENDING: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

/// Calls Python; an exception becomes the crate's error, of which the exception is made again.
pub(crate) fn fallible<T>(
    callback: &'static str,
    call: impl FnOnce(Python<'_>) -> PyResult<T>,
) -> contact_dynamics::Result<T> {
    Python::attach(|py| {
        call(py).map_err(|source| match source.is_instance_of::<Inadmissible>(py) {
            true => Error::Inadmissible { callback, source: Box::new(source) },
            false => Error::Host { callback, source: Box::new(source) },
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
    PENDING.take().map_or(Ok(()), Err)?;
    Ok(result?)
}

/// Copies the vector that a function returns: any array-like of the length of `out`.
pub(crate) fn fill<'py>(
    function: &Py<PyAny>,
    py: Python<'py>,
    arguments: impl PyCallArgs<'py>,
    (what, out): (&str, &mut [f64]),
) -> PyResult<()> {
    let array: PyArrayLike1<'_, f64, AllowTypeChange> = function.bind(py).call1(arguments)?.extract()?;
    if array.len() != out.len() {
        return Err(refused(format!("{what} returned {} numbers, expected {}", array.len(), out.len())));
    }
    out.iter_mut().zip(array.as_array()).for_each(|(out, value)| *out = *value);
    Ok(())
}
