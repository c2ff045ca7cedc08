//! Reciprocal mass matrices: a sparse M⁻¹ assembled from the elements.

use super::assembly::check_element;
use super::lump::check_positive;
use crate::dense::DenseCholesky;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::sparse::assembled;
use faer::sparse::SparseColMat;

/// A sparse inverse of the mass matrix, assembled directly: C = A⁻¹ (Σ_e L_eᵀ A_e M_e⁻¹ A_e L_e) A⁻¹ with the lumped
/// element masses A_e = diag(M_e 1) and A = Σ_e L_eᵀ A_e L_e (Tkachuk, Bischoff, Int. J. Numer. Methods Eng. 101,
/// 2015; González, Kolman, Cho, Felippa, Park, same journal 113, 2018). It replaces M⁻¹ (unit 1/mass) and has the
/// pattern of the elements.
///
/// `elements` are pairs of dofs and the row-major element matrix. Momentum p = A v gives element velocities M_e⁻¹ A_e
/// A⁻¹ p, which are averaged at the nodes with A: v = C p. An explicit step is
///
/// ```text
/// v ← v + h C (f + Gᵀ λ),   u ← u + h v
/// ```
///
/// For the momentum A 1 of a uniform unit velocity, C A 1 = 1: rigid translation is exact, total momentum is 1ᵀA v
/// for any M_e, and forces change it by exactly h 1ᵀf. C is symmetric, and positive definite if all M_e are. Lumped
/// elements give 1/A.
///
/// The frequency error for a bar of equal linear elements is (r/4 − 1/3) (kh)²/2, with r the quotient of lumped and
/// given mass for the element's alternating motion: +5/24 (kh)² for consistent elements (r = 3); the consistent M has
/// +1/24 and the lumped one −1/24. With 3/8 consistent and 5/8 lumped (r = 4/3) the error is of fourth order. The
/// critical step of a free bar is 1/√r of the lumped one; elements with r < 1 allow larger steps, with frequencies
/// that are too low.
///
/// Supports: leave out rows and columns of fixed dofs, as if they had no momentum; a bar fixed at one end keeps these
/// orders (`tests/mass/reciprocal.rs`).
///
/// Known failure: elements with row sums that are not positive (quadratic ones) are rejected.
///
/// # Errors
///
/// [`Error::MissingDof`] for dofs beyond `size`, [`Error::Dimension`] for an element matrix whose size differs from
/// its number of dofs, [`Error::MatrixNotFinite`], [`Error::Asymmetric`] (row and column are dofs of the system);
/// [`Error::Mass`] for a row sum of an element that is not positive, and for a dof of no element; [`Error::Singular`]
/// for an element matrix that is not positive definite.
///
/// ```
/// use contact_dynamics::mass;
/// // Two bar elements of mass 6: C_e = A_e M_e⁻¹ A_e = [6 −3; −3 6], A = (3, 6, 3).
/// let c = mass::reciprocal([[0, 1], [1, 2]].map(|dofs| (dofs, [2.0_f64, 1.0, 1.0, 2.0])), 3)?;
/// let expected = [6.0 / 9.0, -3.0 / 18.0, -3.0 / 18.0, 12.0 / 36.0, -3.0 / 18.0, -3.0 / 18.0, 6.0 / 9.0];
/// assert!(c.val().iter().zip(expected).all(|(c, exact)| (c - exact).abs() < 1e-15));
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn reciprocal<T: Real, I: AsRef<[usize]>, M: AsRef<[T]>>(
    elements: impl IntoIterator<Item = (I, M)>,
    size: usize,
) -> Result<SparseColMat<usize, T>> {
    let mut lumped = vec![T::zero(); size];
    let mut entries = Vec::new();
    let mut factor = DenseCholesky::with_capacity(0);
    let (mut own, mut inverse) = (Vec::new(), Vec::new());
    for (dofs, matrix) in elements {
        let (dofs, matrix) = (dofs.as_ref(), matrix.as_ref());
        let n = dofs.len();
        check_element(dofs, matrix, size)?;
        own.clear();
        own.extend(matrix.chunks_exact(n.max(1)).map(|row| row.iter().copied().sum::<T>()));
        check_positive(&own).map_err(|error| of_element(error, dofs))?;
        let singular = |row: usize| Error::Singular { matrix: "mass matrix of an element", dof: dofs[row] };
        factor.factorize(n, |i, j| matrix[i * n + j]).map_err(singular)?;
        if factor.is_singular() {
            return Err(singular(0));
        }
        inverse.clear();
        inverse.resize(n * n, T::zero());
        for (k, column) in inverse.chunks_exact_mut(n.max(1)).enumerate() {
            column[k] = own[k];
            factor.solve(column);
        }
        for (i, (&dof, &mass)) in dofs.iter().zip(&own).enumerate() {
            lumped[dof] += mass;
            for (j, &other) in dofs.iter().enumerate() {
                // The mean of both triangles is bitwise symmetric.
                let value = T::of(0.5) * (mass * inverse[i + j * n] + own[j] * inverse[j + i * n]);
                entries.push((dof, other, value));
            }
        }
    }
    check_positive(&lumped)?;
    for (row, column, value) in &mut entries {
        // The product first: it is the same on both sides of the diagonal.
        *value /= lumped[*row] * lumped[*column];
    }
    // Removes products of dofs that the element does not couple.
    entries.retain(|&(row, column, value)| row == column || value != T::zero());
    assembled(size, entries)
}

fn of_element(error: Error, dofs: &[usize]) -> Error {
    match error {
        Error::Mass { dof, value } => Error::Mass { dof: dofs[dof], value },
        other => other,
    }
}
