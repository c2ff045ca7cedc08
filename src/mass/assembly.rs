//! Checks of elements and of lists of dofs.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;

/// Rejects dofs that the system does not have.
pub(super) fn check_dofs(what: &'static str, dofs: &[usize], size: usize) -> Result<()> {
    match dofs.iter().find(|dof| **dof >= size) {
        Some(&dof) => Err(Error::MissingDof { what, dof, dofs: size }),
        None => Ok(()),
    }
}

/// Flags of the listed dofs.
pub(super) fn flags(what: &'static str, list: &[usize], size: usize) -> Result<Vec<bool>> {
    check_dofs(what, list, size)?;
    let mut flags = vec![false; size];
    for &dof in list {
        flags[dof] = true;
    }
    Ok(flags)
}

/// Rejects element matrices that do not fit their dofs, are not finite, or not symmetric.
pub(super) fn check_element<T: Real>(dofs: &[usize], matrix: &[T], size: usize) -> Result<()> {
    let n = dofs.len();
    if matrix.len() != n * n {
        return Err(Error::Dimension { what: "an element's mass matrix", expected: n * n, found: matrix.len() });
    }
    check_dofs("an element", dofs, size)?;
    if let Some(at) = matrix.iter().position(|m| !m.is_finite()) {
        let (row, column, value) = (dofs[at / n], dofs[at % n], matrix[at].value());
        return Err(Error::MatrixNotFinite { matrix: "element mass", row, column, value });
    }
    let largest = matrix.iter().fold(T::zero(), |largest, m| largest.max(m.abs()));
    for (i, j) in (0..n).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let (value, mirrored) = (matrix[i * n + j], matrix[j * n + i]);
        if (value - mirrored).abs() > rounding(largest) {
            let (row, column, value, mirrored) = (dofs[i], dofs[j], value.value(), mirrored.value());
            return Err(Error::Asymmetric { matrix: "element mass", row, column, value, mirrored });
        }
    }
    Ok(())
}
