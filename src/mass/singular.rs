//! Singular mass matrices: assembled so that contact dofs have no mass.

use super::assembly::{check_element, flags};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::sparse::{self, assembled};
use faer::sparse::{SparseColMat, SparseColMatRef};
use std::collections::BTreeMap;

/// A mass matrix assembled without some dofs: each element moves their mass to its other dofs. Hager, Hüeber,
/// Wohlmuth (Int. J. Numer. Methods Eng. 73, 2008) and Tkachuk, Wohlmuth, Bischoff (Int. J. Numer. Methods Eng. 94,
/// 2013) also treat the elements at the contact boundary separately.
///
/// `elements` are pairs of dofs and the row-major element matrix, consistent, lumped or blended. An element with
/// listed dofs (`massless`, in any order) loses their rows and columns; the rest is scaled by one factor for each
/// group, so that the element keeps the total of each. `groups` gives every dof of the system a number as in
/// [`lump_diagonal`](super::lump_diagonal); entries between groups use the geometric mean of both factors. Elements
/// without such dofs are assembled unchanged.
///
/// Compared with [`redistribute_consistent`](super::redistribute_consistent) with neighbors, this needs the elements,
/// and mass stays within its element. Centers of mass move inward by the order of h_e². In a bar of equal linear
/// elements both agree.
///
/// The result is positive semidefinite if the element matrices are, with exactly the listed dofs massless: their rows
/// and columns have no stored entries. Zeros are not stored either, so lumped elements give a diagonal pattern.
///
/// If all dofs of a group in an element are listed, as in a triangle in a corner of the boundary, the element cannot
/// keep its mass, which is an error: list fewer dofs there, or use redistribution.
///
/// # Errors
///
/// [`Error::MissingDof`] for dofs that have no group, [`Error::Dimension`] for an element matrix whose size differs
/// from its number of dofs, [`Error::MatrixNotFinite`] and [`Error::Asymmetric`] (row and column are dofs of the
/// system); [`Error::Incompatible`] with the number of an element that cannot keep its mass; [`Error::Mass`] if an
/// unlisted dof has no mass.
///
/// ```
/// use contact_dynamics::mass;
/// // Three linear bar elements of mass 6, the first node massless.
/// let elements = [[0, 1], [1, 2], [2, 3]].map(|dofs| (dofs, [2.0, 1.0, 1.0, 2.0]));
/// let m = mass::singular(elements, &[0], &[0; 4])?;
/// // 6 + 2 on the node that took the mass of the first element.
/// assert_eq!(m.val(), [8.0, 1.0, 1.0, 4.0, 1.0, 1.0, 2.0]);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn singular<T: Real, I: AsRef<[usize]>, M: AsRef<[T]>>(
    elements: impl IntoIterator<Item = (I, M)>,
    massless: &[usize],
    groups: &[usize],
) -> Result<SparseColMat<usize, T>> {
    let size = groups.len();
    let massless = flags("the list of massless dofs", massless, size)?;
    let mut entries = Vec::new();
    for (number, (dofs, matrix)) in elements.into_iter().enumerate() {
        let (dofs, matrix) = (dofs.as_ref(), matrix.as_ref());
        let n = dofs.len();
        check_element(dofs, matrix, size)?;
        let all = || (0..n * n).map(|k| (dofs[k / n], dofs[k % n], matrix[k]));
        // Total of each group, and total of its dofs that keep mass.
        let mut sums: BTreeMap<usize, [T; 2]> = BTreeMap::new();
        if dofs.iter().any(|&dof| massless[dof]) {
            for (row, column, m) in all().filter(|&(row, column, _)| groups[row] == groups[column]) {
                let [total, kept] = sums.entry(groups[row]).or_default();
                *total += m;
                if !massless[row] && !massless[column] {
                    *kept += m;
                }
            }
        }
        let mut factors: BTreeMap<usize, T> = BTreeMap::new();
        for (group, [total, kept]) in sums {
            let factor = if total == kept { T::one() } else { total / kept };
            if !(factor > T::zero() && factor.is_finite()) {
                let reason = "its mass has no dof of the same group left to go to; list fewer of its dofs as massless";
                return Err(Error::Incompatible { part: format!("element {number}"), reason });
            }
            factors.insert(group, factor);
        }
        let factor = |dof: usize| factors.get(&groups[dof]).copied().unwrap_or(T::one());
        let kept = all().filter(|&(row, column, m)| !massless[row] && !massless[column] && m != T::zero());
        entries.extend(kept.map(|(row, column, m)| {
            let scale = if groups[row] == groups[column] { factor(row) } else { (factor(row) * factor(column)).sqrt() };
            (row, column, scale * m)
        }));
    }
    let mass = assembled(size, entries)?;
    for dof in (0..size).filter(|&dof| !massless[dof]) {
        let m = sparse::entry(mass.as_ref(), dof, dof);
        if m <= T::zero() {
            return Err(Error::Mass { dof, value: m.value() });
        }
    }
    Ok(mass)
}

/// The mass matrix M = Cᵀ D⁻¹ C of a mixed formulation with a separate velocity space, discontinuous between elements
/// (Renard, J. Comput. Appl. Math. 234, 2010; Tkachuk, Wohlmuth, Bischoff 2013).
///
/// With the density ρ, velocity functions ψ_e and displacement functions φ_i: row e of `coupling` (velocity space ×
/// displacement space) is C_ei = ∫ ρ ψ_e φ_i, and `velocity_mass` the diagonal D_e = ∫ ρ ψ_e². The velocities are then
/// D⁻¹ C u̇, and ½ u̇ᵀ M u̇ is their kinetic energy.
///
/// M is symmetric and positive semidefinite, and has the null space of C. A dof whose column of C is empty has no
/// mass: leave contact dofs out of the velocities. If C maps a uniform unit velocity to D 1 (velocities represent
/// constants exactly), the total mass is Σ D_e.
///
/// Every other motion must have a velocity in C. Known failure, which this function does not detect: piecewise
/// constant velocities on linear elements miss the alternating motion, so that a motion of the whole body has no
/// mass.
///
/// # Errors
///
/// [`Error::Dimension`] unless there is one velocity mass per row, [`Error::Mass`] for one that is not positive (its
/// `dof` is the row), [`Error::MatrixNotFinite`] for the coupling, and for the product if it overflows.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::mass;
/// // Two bar elements of mass 4 with one velocity each; that of the first follows its second node alone.
/// let c = [(0, 1, 4.0), (1, 1, 2.0), (1, 2, 2.0)].map(|(e, i, c)| Triplet::new(e, i, c));
/// let c = SparseColMat::try_new_from_triplets(2, 3, &c)?;
/// let m = mass::mixed(c.as_ref(), &[4.0, 4.0])?;
/// assert_eq!(m.val(), [5.0, 1.0, 1.0, 1.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn mixed<T: Real>(coupling: SparseColMatRef<'_, usize, T>, velocity_mass: &[T]) -> Result<SparseColMat<usize, T>> {
    if velocity_mass.len() != coupling.nrows() {
        let what = "mass of the velocity space";
        return Err(Error::Dimension { what, expected: coupling.nrows(), found: velocity_mass.len() });
    }
    super::lump::check_positive(velocity_mass)?;
    sparse::check_pattern("coupling", coupling.symbolic())?;
    let mut rows: Vec<Vec<(usize, T)>> = vec![Vec::new(); coupling.nrows()];
    for column in 0..coupling.ncols() {
        for (&row, &value) in coupling.row_idx_of_col_raw(column).iter().zip(coupling.val_of_col(column)) {
            if !value.is_finite() {
                return Err(Error::MatrixNotFinite { matrix: "coupling", row, column, value: value.value() });
            }
            if value != T::zero() {
                rows[row].push((column, value));
            }
        }
    }
    let mut entries = Vec::new();
    for (row, &d) in rows.iter().zip(velocity_mass) {
        for &(i, x) in row {
            // The product first: it is the same on both sides of the diagonal.
            entries.extend(row.iter().map(|&(j, y)| (i, j, x * y / d)));
        }
    }
    let mass = assembled(coupling.ncols(), entries)?;
    sparse::check_symmetric("mass", mass.as_ref())?;
    Ok(mass)
}
