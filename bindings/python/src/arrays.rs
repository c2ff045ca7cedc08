//! Arrays of NumPy and sparse matrices of SciPy as the crate takes them: copied and checked.

use crate::error::{Result, refused};
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::matrix::{self, Stored};
use numpy::{Element, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;

/// Any length, in the shape that an array must have.
pub(crate) const ANY: usize = usize::MAX;

/// The numbers of an array-like, row by row, if it has the kind and the shape expected.
fn numbers<T: Element + Copy>(
    value: &Bound<'_, PyAny>,
    what: &str,
    (kinds, dtype): (&[u8], &str),
    expected: &[usize],
) -> PyResult<Vec<T>> {
    let array = value.py().import("numpy")?.call_method1("asarray", (value,))?.cast_into::<PyUntypedArray>()?;
    let (shape, given) = (array.shape(), array.dtype());
    if shape.len() != expected.len() || shape.iter().zip(expected).any(|(n, expected)| ![*n, ANY].contains(expected)) {
        let expected: Vec<_> = expected.iter().map(|&n| if n == ANY { "any".into() } else { n.to_string() }).collect();
        return Err(refused(format!("{what}: the shape is {shape:?}, expected [{}]", expected.join(", "))));
    }
    if array.len() > 0 && !kinds.contains(&given.kind()) {
        return Err(refused(format!("{what}: the dtype is {given}, expected {dtype}")));
    }
    let in_place = [("copy", false)].into_py_dict(value.py())?;
    let array = array.call_method("astype", (dtype,), Some(&in_place))?.cast_into::<PyArrayDyn<T>>()?;
    Ok(array.readonly().as_array().iter().copied().collect())
}

pub(crate) fn floats(value: &Bound<'_, PyAny>, what: &str, shape: &[usize]) -> PyResult<Vec<f64>> {
    numbers(value, what, (b"fiu", "float64"), shape)
}

fn integers(value: &Bound<'_, PyAny>, what: &str, shape: &[usize]) -> PyResult<Vec<i64>> {
    numbers(value, what, (b"iu", "int64"), shape)
}

pub(crate) fn indices(value: &Bound<'_, PyAny>, what: &str, shape: &[usize]) -> PyResult<Vec<usize>> {
    let index = |value| usize::try_from(value).map_err(|_| refused(format!("{what}: the index {value} is negative")));
    integers(value, what, shape)?.into_iter().map(index).collect()
}

/// The rows of an array of shape (n, N).
pub(crate) fn rows<T: Copy, const N: usize>(values: &[T]) -> Vec<[T; N]> {
    values.as_chunks().0.to_vec()
}

/// The shape of an array-like or of a sparse matrix.
pub(crate) fn shape(value: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
    value.py().import("numpy")?.call_method1("shape", (value,))?.extract()
}

/// A square sparse matrix of SciPy. Other formats than CSR and CSC, and dense matrices, become CSR.
pub(crate) fn matrix(value: &Bound<'_, PyAny>, what: &str) -> Result<SparseColMat<usize, f64>> {
    let format = |value: &Bound<'_, PyAny>| value.getattr("format").and_then(|name| name.extract::<String>()).ok();
    let compressed = match format(value).as_deref() {
        Some("csr" | "csc") => value.clone(),
        _ => value.py().import("scipy.sparse")?.call_method1("csr_matrix", (value,))?,
    };
    let size = shape(&compressed)?;
    if size[0] != size[1] {
        return Err(refused(format!("{what}: the shape is {size:?}, expected a square matrix")).into());
    }
    let list = |name: &str| integers(&compressed.getattr(name)?, what, &[ANY]);
    let (indptr, indices) = (list("indptr")?, list("indices")?);
    let data = floats(&compressed.getattr("data")?, what, &[ANY])?;
    let read = if format(&compressed).as_deref() == Some("csr") { matrix::from_csr } else { matrix::from_csc };
    Ok(read(&indptr, &indices, &data, Stored::All).map_err(|error| refused(format!("{what}: {error}")))?)
}
