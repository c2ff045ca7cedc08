//! The Courant numbers of a mesh, from its matrices alone.

use super::{
    Mass,
    lump::{check_positive, lump},
};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::sparse;
use faer::sparse::SparseColMatRef;

/// An estimate of the Courant number c h/h_e at every dof, from mass, stiffness and step: ½ h √(Σ_j |K_ij| / m_i),
/// with m the lumped mass (row sums of a consistent one).
///
/// Exact at every node of a uniform bar of linear elements, including its ends. In general it is a bound by
/// Gershgorin's circles: all modes of the lumped system have Ω = ωh at most twice the largest value, so central
/// differences are stable if all values are at most 1, and a step for explicit schemes may be chosen from it. For
/// dofs of different units (rotations) single values have no meaning, but the bound holds.
///
/// In solids it exceeds the Courant number of dilatational waves along the edges of an element: on blocks of equal
/// square quadrilaterals (plane strain) with ν = 0.3 by 9 to 20 %, of cubic hexahedra by 17 to 37 %, while the
/// highest mode is 2 % and 4 % above that number (tests/mass/blend.rs). For [`optimal_weight`](super::optimal_weight)
/// use c h/h_e itself, if known.
///
/// # Errors
///
/// [`Error::Parameter`] unless h is positive and finite; [`Error::Dimension`] for sizes that do not agree;
/// [`Error::MatrixNotFinite`], [`Error::Asymmetric`] for the stiffness; [`Error::Mass`] for a (lumped) mass that is not
/// positive.
///
/// ```
/// use contact_dynamics::{faer::sparse::{SparseColMat, Triplet}, mass::{self, Mass}};
/// // Two bar elements with stiffness 100 and mass 4 each: c/h_e = √(100/4) = 5.
/// let k = [(0, 0, 100.0), (0, 1, -100.0), (1, 0, -100.0), (1, 1, 200.0), (1, 2, -100.0), (2, 1, -100.0),
///     (2, 2, 100.0)];
/// let k = SparseColMat::try_new_from_triplets(3, 3, &k.map(|(i, j, k)| Triplet::new(i, j, k)))?;
/// assert_eq!(mass::courant(Mass::Lumped(&[2.0, 4.0, 2.0]), k.as_ref(), 0.1)?, [0.5; 3]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn courant<T: Real>(mass: Mass<'_, T>, stiffness: SparseColMatRef<'_, usize, T>, h: f64) -> Result<Vec<f64>> {
    if !(h > 0.0 && h.is_finite()) {
        return Err(Error::Parameter { name: "the step size", value: h, range: "positive and finite" });
    }
    sparse::check_symmetric("stiffness", stiffness)?;
    let lumped;
    let mass = match mass {
        Mass::Lumped(mass) => mass,
        Mass::Consistent(mass) => {
            lumped = lump(mass)?;
            &lumped
        }
    };
    let n = stiffness.ncols();
    if mass.len() != n {
        return Err(Error::Dimension { what: "mass", expected: n, found: mass.len() });
    }
    check_positive(mass)?;
    // Columns are rows.
    let radius = |dof: usize| stiffness.val_of_col(dof).iter().map(|k| k.value().abs()).sum::<f64>();
    Ok(mass.iter().enumerate().map(|(dof, m)| 0.5 * h * (radius(dof) / m.value()).sqrt()).collect())
}
