//! Lumping: diagonal matrices with the mass of a consistent one.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::sparse;
use faer::sparse::SparseColMatRef;
use std::collections::BTreeMap;

/// Row-sum lumping: the diagonal matrix with the same row sums and so the same total mass.
///
/// # Errors
///
/// [`Error::Mass`] if a row sum is not positive, with the dof and the sum. This occurs for quadratic elements; use
/// [`lump_diagonal`] for them.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// // One linear bar element of mass 6: consistent [2 1; 1 2].
/// let m = SparseColMat::try_new_from_triplets(
///     2, 2, &[Triplet::new(0, 0, 2.0), Triplet::new(0, 1, 1.0), Triplet::new(1, 0, 1.0), Triplet::new(1, 1, 2.0)],
/// )?;
/// assert_eq!(contact_dynamics::mass::lump(m.as_ref())?, [3.0, 3.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn lump<T: Real>(mass: SparseColMatRef<'_, usize, T>) -> Result<Vec<T>> {
    sparse::square("mass", mass)?;
    let mut lumped = vec![T::zero(); mass.nrows()];
    T::product(T::one(), mass, &vec![T::one(); mass.ncols()], &mut lumped);
    check_positive(&lumped)?;
    Ok(lumped)
}

/// Diagonal scaling: the diagonal of the consistent matrix, scaled so that each group keeps its total mass (Hinton,
/// Rock, Zienkiewicz, Earthq. Eng. Struct. Dyn. 4, 1976).
///
/// `groups` gives every dof a number; dofs with the same number share one total, the sum of all entries between them.
/// Directions should be separate groups (`dof % 3` for three dofs per node), and so should rotations, whose units
/// differ. Bodies may be.
///
/// The method of the paper scales **element by element**: for that, call this on each element's matrix before
/// assembly. On an assembled matrix all elements of a group share one factor. Both agree if all elements have the
/// same quotient of mass and trace, for any sizes and densities: one kind of element with constant Jacobian (bars,
/// straight triangles and tetrahedra, parallelograms, parallelepipeds). If these are linear, both also equal the row
/// sums of [`lump`]. On distorted quadrilaterals and hexahedra the three differ; in a group that mixes kinds of
/// elements the one factor moves mass from one kind to the other.
///
/// Masses are positive for any element, unlike row sums: a corner of the square 8-node quadrilateral of mass m has
/// the row sum −m/12 and gets 3m/76.
///
/// # Errors
///
/// [`Error::Dimension`] if the matrix is not square or `groups` does not have one number per dof, [`Error::Mass`]
/// with the first dof whose diagonal entry or scaled mass is not positive.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// // A quadratic bar element of mass 30.
/// let rows = [[4.0, 2.0, -1.0], [2.0, 16.0, 2.0], [-1.0, 2.0, 4.0]];
/// let entries: Vec<_> = (0..9).map(|k| Triplet::new(k / 3, k % 3, rows[k / 3][k % 3])).collect();
/// let m = SparseColMat::try_new_from_triplets(3, 3, &entries)?;
/// assert_eq!(contact_dynamics::mass::lump_diagonal(m.as_ref(), &[0; 3])?, [5.0, 20.0, 5.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn lump_diagonal<T: Real>(mass: SparseColMatRef<'_, usize, T>, groups: &[usize]) -> Result<Vec<T>> {
    let n = sparse::square("mass", mass)?;
    sparse::check_pattern("mass", mass.symbolic())?;
    if groups.len() != n {
        return Err(Error::Dimension { what: "groups of the mass matrix", expected: n, found: groups.len() });
    }
    let diagonal: Vec<T> = (0..n).map(|dof| sparse::entry(mass, dof, dof)).collect();
    check_positive(&diagonal)?;
    // Total and trace of each group.
    let mut sums: BTreeMap<usize, [T; 2]> = BTreeMap::new();
    for (column, (&group, &m)) in groups.iter().zip(&diagonal).enumerate() {
        let inside = mass.row_idx_of_col_raw(column).iter().zip(mass.val_of_col(column));
        let total: T = inside.filter(|&(&row, _)| groups[row] == group).map(|(_, &value)| value).sum();
        let [totals, trace] = sums.entry(group).or_default();
        *totals += total;
        *trace += m;
    }
    let factors: BTreeMap<usize, T> = sums.into_iter().map(|(group, [total, trace])| (group, total / trace)).collect();
    let lumped: Vec<T> = diagonal.into_iter().zip(groups).map(|(m, group)| m * factors[group]).collect();
    check_positive(&lumped)?;
    Ok(lumped)
}

/// Rejects masses that are not positive and finite.
pub(super) fn check_positive<T: Real>(mass: &[T]) -> Result<()> {
    match mass.iter().position(|&m| !(m > T::zero() && m.is_finite())) {
        Some(dof) => Err(Error::Mass { dof, value: mass[dof].value() }),
        None => Ok(()),
    }
}
