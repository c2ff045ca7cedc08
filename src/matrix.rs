//! Sparse matrices from the arrays of other codes: compressed rows (CSR) or columns (CSC), whole or one triangle.
//!
//! Most libraries have these arrays; their names here are SciPy's. `indptr` has the start of each row (or column) in
//! the two others, and their length at its end; `indices` has the column (or row) of each entry, and `data` its value.
//! Entries may come in any order; entries at the same place are added up.
//!
//! ```
//! use contact_dynamics::matrix::{self, Stored};
//! use contact_dynamics::LinearSystem;
//!
//! // Two masses on springs, K = [[2, −1], [−1, 1]]: its lower triangle by rows, as 32-bit integers.
//! let (indptr, indices, data) = ([0, 1, 3], [0, 0, 1], [2.0, -1.0, 1.0]);
//! let stiffness = matrix::from_csr(&indptr, &indices, &data, Stored::Lower)?;
//! let system = LinearSystem::lumped(vec![1.0, 1.0], stiffness)?;
//! # Ok::<(), contact_dynamics::Error>(())
//! ```
//!
//! Matrices of two other crates have these arrays:
//!
//! ```
//! use contact_dynamics::matrix::{self, Stored};
//! use nalgebra_sparse::{CooMatrix, CsrMatrix};
//!
//! let coo = CooMatrix::try_from_triplets(2, 2, vec![0, 0, 1, 1], vec![0, 1, 0, 1], vec![2.0, -1.0, -1.0, 1.0])?;
//! let k = CsrMatrix::from(&coo);
//! let stiffness = matrix::from_csr(k.row_offsets(), k.col_indices(), k.values(), Stored::All)?;
//! assert_eq!(stiffness[(1, 0)], -1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! ```text
//! let k: sprs::CsMat<f64> = …;        // stored by rows; by columns: from_csc
//! let stiffness = matrix::from_csr(k.indptr().raw_storage(), k.indices(), k.data(), Stored::All)?;
//! ```

use crate::error::{Error, Result};
use crate::real::Real;
use crate::sparse::assembled;
use faer::sparse::SparseColMat;

/// Which entries of a matrix the arrays hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stored {
    /// All of them.
    All,
    /// Those of a symmetric matrix on and below its diagonal.
    Lower,
    /// Those of a symmetric matrix on and above its diagonal.
    Upper,
}

/// A square matrix from compressed rows; see the [module](self).
///
/// # Errors
///
/// [`Error::Dimension`] if `indices` and `data` differ in length; [`Error::Empty`] without rows;
/// [`Error::Incompatible`] if `indptr` does not rise from zero to the number of entries, if an index is negative, or if
/// an entry is outside the stored triangle; [`Error::MissingDof`] for a column beyond the last;
/// [`Error::NotFinite`] for a value; [`Error::OutOfMemory`].
pub fn from_csr<I, T: Real>(indptr: &[I], indices: &[I], data: &[T], stored: Stored) -> Result<SparseColMat<usize, T>>
where
    I: Copy + TryInto<usize>,
{
    compressed([indptr, indices], data, stored, |line, index| [line, index])
}

/// A square matrix from compressed columns; see the [module](self).
///
/// # Errors
///
/// As [`from_csr`].
pub fn from_csc<I, T: Real>(indptr: &[I], indices: &[I], data: &[T], stored: Stored) -> Result<SparseColMat<usize, T>>
where
    I: Copy + TryInto<usize>,
{
    compressed([indptr, indices], data, stored, |line, index| [index, line])
}

/// `place` gives row and column of an entry with this index in a line.
fn compressed<I: Copy + TryInto<usize>, T: Real>(
    [indptr, indices]: [&[I]; 2],
    data: &[T],
    stored: Stored,
    place: impl Fn(usize, usize) -> [usize; 2],
) -> Result<SparseColMat<usize, T>> {
    let refuse = |part: String, reason| Err(Error::Incompatible { part, reason });
    let Some(size) = indptr.len().checked_sub(1).filter(|&size| size > 0) else {
        return Err(Error::Empty { what: "a compressed matrix", remedy: "`indptr` has one entry more than rows" });
    };
    if indices.len() != data.len() {
        let (expected, found) = (data.len(), indices.len());
        return Err(Error::Dimension { what: "the list of indices of a compressed matrix", expected, found });
    }
    let mut entries = crate::memory::reserve(data.len(), 2, "a compressed matrix")?;
    let mut end = 0;
    for (line, &next) in indptr.iter().enumerate() {
        let start = end;
        end = next.try_into().unwrap_or(usize::MAX);
        let is_right = if line == 0 { end == 0 } else { start <= end && end <= data.len() };
        if !is_right || line == size && end != data.len() {
            let reason = "`indptr` must rise from 0 to the number of entries";
            return refuse(format!("entry {line} of `indptr` of a compressed matrix"), reason);
        }
        for at in start..end {
            let Ok(index) = indices[at].try_into() else {
                return refuse(format!("index {at} of a compressed matrix"), "it is negative");
            };
            if index >= size {
                return Err(Error::MissingDof { what: "an index of a compressed matrix", dof: index, dofs: size });
            }
            let value = data[at];
            if !value.is_finite() {
                let what = "the data of a compressed matrix";
                return Err(Error::NotFinite { what, index: at, value: value.value() });
            }
            let [row, column] = place(line - 1, index);
            let is_stored = match stored {
                Stored::All => true,
                Stored::Lower => row >= column,
                Stored::Upper => row <= column,
            };
            if !is_stored {
                let part = format!("entry ({row}, {column}) of a compressed matrix");
                return refuse(part, "it is in the other triangle than the one that is said to be stored");
            }
            entries.push((row, column, value));
            if stored != Stored::All && row != column {
                entries.push((column, row, value));
            }
        }
    }
    assembled(size, entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    type Case = (&'static [i32], &'static [i32], &'static [f64], Stored, &'static str);

    fn dense(matrix: &SparseColMat<usize, f64>) -> Vec<Vec<f64>> {
        let entry = |i, j| matrix.get(i, j).copied().unwrap_or(0.0);
        (0..matrix.nrows()).map(|i| (0..matrix.ncols()).map(|j| entry(i, j)).collect()).collect()
    }

    #[test]
    fn rows_columns_and_triangles_give_the_matrix_that_they_store() {
        // [[1, 2, 0], [3, 4, 0], [0, 5, 6]], the entry 4 in two parts, a row in descending order.
        let (indptr, indices, data) = ([0_i32, 2, 5, 7], [0, 1, 1, 0, 1, 2, 1], [1.0, 2.0, 1.5, 3.0, 2.5, 6.0, 5.0]);
        let expected = vec![vec![1.0, 2.0, 0.0], vec![3.0, 4.0, 0.0], vec![0.0, 5.0, 6.0]];
        assert_eq!(dense(&from_csr(&indptr, &indices, &data, Stored::All).unwrap()), expected);
        let transposed = dense(&from_csc(&indptr, &indices, &data, Stored::All).unwrap());
        assert_eq!(transposed, [[1.0, 3.0, 0.0], [2.0, 4.0, 5.0], [0.0, 0.0, 6.0]]);
        // The same lower triangle by rows, and by columns that hold the upper one.
        let (indptr, indices, data) = ([0_usize, 1, 3, 5], [0, 0, 1, 1, 2], [1.0, 2.0, 4.0, 5.0, 6.0]);
        let symmetric = vec![vec![1.0, 2.0, 0.0], vec![2.0, 4.0, 5.0], vec![0.0, 5.0, 6.0]];
        assert_eq!(dense(&from_csr(&indptr, &indices, &data, Stored::Lower).unwrap()), symmetric);
        assert_eq!(dense(&from_csc(&indptr, &indices, &data, Stored::Upper).unwrap()), symmetric);
    }

    #[test]
    fn arrays_that_are_no_matrix_are_refused() {
        let cases: [Case; 10] = [
            (&[], &[], &[], Stored::All, "empty"),
            (&[0], &[], &[], Stored::All, "empty"),
            (&[0, 1, 2], &[0, 1], &[1.0], Stored::All, "list of indices"),
            (&[1, 1, 2], &[0, 1], &[1.0; 2], Stored::All, "entry 0 of `indptr`"),
            (&[0, 2, 1], &[0, 1], &[1.0; 2], Stored::All, "entry 2 of `indptr`"),
            (&[0, 1, 1], &[0, 1], &[1.0; 2], Stored::All, "entry 2 of `indptr`"),
            (&[0, -1, 2], &[0, 1], &[1.0; 2], Stored::All, "entry 1 of `indptr`"),
            (&[0, 1, 2], &[0, 2], &[1.0; 2], Stored::All, "names dof 2"),
            (&[0, 1, 2], &[0, -1], &[1.0; 2], Stored::All, "index 1 of a compressed matrix"),
            (&[0, 2, 2], &[0, 1], &[1.0; 2], Stored::Lower, "entry (0, 1)"),
        ];
        for (indptr, indices, data, stored, said) in cases {
            let message = from_csr(indptr, indices, data, stored).unwrap_err().to_string();
            assert!(message.contains(said), "{message}: {said}");
        }
        let message = from_csc(&[0, 1, 2], &[0, 1], &[1.0, f64::NAN], Stored::All).unwrap_err().to_string();
        assert!(message.contains("not finite at index 1"), "{message}");
    }
}
