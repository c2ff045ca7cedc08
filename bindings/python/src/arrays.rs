//! Arrays of NumPy and sparse matrices of SciPy as the crate takes them: copied and checked.

use crate::error::{Result, refused};
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::matrix::{self, Stored};
use numpy::{
    AllowTypeChange, Element, PyArrayDescrMethods, PyArrayDyn, PyArrayLike1, PyArrayLike2, PyArrayMethods,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

/// The numbers of an array-like, row by row, and its shape, in which `None` stands for any length.
fn numbers<T: Element + Copy>(
    value: &Bound<'_, PyAny>,
    what: &str,
    (kinds, dtype): (&[u8], &str),
    expected: &[Option<usize>],
) -> PyResult<(Vec<T>, Vec<usize>)> {
    let array = value.py().import("numpy")?.call_method1("asarray", (value,))?.cast_into::<PyUntypedArray>()?;
    let shape = array.shape().to_vec();
    if shape.len() != expected.len()
        || shape.iter().zip(expected).any(|(&n, expected)| expected.is_some_and(|e| e != n))
    {
        let expected: Vec<_> = expected.iter().map(|n| n.map_or("any".into(), |n| n.to_string())).collect();
        return Err(refused(format!("{what}: the shape is {shape:?}, expected [{}]", expected.join(", "))));
    }
    if array.len() > 0 && !kinds.contains(&array.dtype().kind()) {
        return Err(refused(format!("{what}: the dtype is {}, expected {dtype}", array.dtype())));
    }
    let array = array.call_method1("astype", (dtype,))?.cast_into::<PyArrayDyn<T>>()?;
    let values = array.readonly().as_array().iter().copied().collect();
    Ok((values, shape))
}

const FLOATS: (&[u8], &str) = (b"fiu", "float64");

/// Indices, row by row, and the shape of their array.
fn whole(value: &Bound<'_, PyAny>, what: &str, expected: &[Option<usize>]) -> PyResult<(Vec<usize>, Vec<usize>)> {
    let (values, shape) = numbers::<i64>(value, what, (b"iu", "int64"), expected)?;
    let index = |value| usize::try_from(value).map_err(|_| refused(format!("{what}: the index {value} is negative")));
    Ok((values.into_iter().map(index).collect::<PyResult<_>>()?, shape))
}

/// An array of shape (n).
pub(crate) fn vector(value: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<f64>> {
    Ok(numbers(value, what, FLOATS, &[None])?.0)
}

/// An array of shape (N).
pub(crate) fn point<const N: usize>(value: &Bound<'_, PyAny>, what: &str) -> PyResult<[f64; N]> {
    Ok(numbers(value, what, FLOATS, &[Some(N)])?.0.as_chunks().0[0])
}

/// An array of shape (n, N).
pub(crate) fn points<const N: usize>(value: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<[f64; N]>> {
    Ok(numbers(value, what, FLOATS, &[None, Some(N)])?.0.as_chunks().0.to_vec())
}

/// An array of indices of shape (n).
pub(crate) fn indices(value: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<usize>> {
    Ok(whole(value, what, &[None])?.0)
}

/// An array of indices of shape (n, N).
pub(crate) fn index_rows<const N: usize>(value: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<[usize; N]>> {
    Ok(whole(value, what, &[None, Some(N)])?.0.as_chunks().0.to_vec())
}

/// Lists of indices: an array of shape (n, any), or a list of such arrays.
pub(crate) fn index_lists(value: &Bound<'_, PyAny>, what: &str) -> PyResult<Vec<Vec<usize>>> {
    let blocks: Vec<Bound<'_, PyAny>> = match value.get_item(0) {
        Ok(first) if shape(&first)?.len() == 2 => value.try_iter()?.collect::<PyResult<_>>()?,
        _ => vec![value.clone()],
    };
    let mut lists = Vec::new();
    for block in blocks {
        let (values, shape) = whole(&block, what, &[None, None])?;
        lists.extend(values.chunks_exact(shape[1].max(1)).map(<[usize]>::to_vec));
    }
    Ok(lists)
}

/// The shape of an array, of an array-like, or of a sparse matrix.
pub(crate) fn shape(value: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
    value.py().import("numpy")?.call_method1("shape", (value,))?.extract()
}

/// What a callback returns, without a copy if it is an array of the right type.
fn returned<const N: usize>(shape: &[usize], expected: [usize; N], what: &str) -> PyResult<()> {
    if shape == expected {
        Ok(())
    } else {
        Err(refused(format!("{what} returned the shape {shape:?}, expected {expected:?}")))
    }
}

/// Copies a vector that a callback returns.
pub(crate) fn copy_into(value: &Bound<'_, PyAny>, what: &str, out: &mut [f64]) -> PyResult<()> {
    let array: PyArrayLike1<'_, f64, AllowTypeChange> = value.extract()?;
    returned(array.shape(), [out.len()], what)?;
    out.iter_mut().zip(array.as_array()).for_each(|(out, value)| *out = *value);
    Ok(())
}

/// Copies rows that a callback returns.
pub(crate) fn rows<const M: usize, const N: usize>(value: &Bound<'_, PyAny>, what: &str) -> PyResult<[[f64; N]; M]> {
    let array: PyArrayLike2<'_, f64, AllowTypeChange> = value.extract()?;
    returned(array.shape(), [M, N], what)?;
    Ok(std::array::from_fn(|i| std::array::from_fn(|j| array.as_array()[[i, j]])))
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
    let [indptr, indices] = [compressed.getattr("indptr")?, compressed.getattr("indices")?];
    let [indptr, indices] = [&indptr, &indices].map(|list| numbers::<i64>(list, what, (b"iu", "int64"), &[None]));
    let (data, _) = numbers::<f64>(&compressed.getattr("data")?, what, FLOATS, &[None])?;
    let read = if format(&compressed).as_deref() == Some("csr") { matrix::from_csr } else { matrix::from_csc };
    Ok(read(&indptr?.0, &indices?.0, &data, Stored::All).map_err(|error| refused(format!("{what}: {error}")))?)
}
