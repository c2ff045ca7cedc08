//! Mass matrices between lumped and consistent, whose dispersion can cancel the dispersion of the scheme.

use super::inverse::check_definite;
use crate::analysis::period_elongation;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::sparse;
use crate::tableau::Tableau;
use faer::sparse::{SparseColMat, SparseColMatRef};

/// `weight · consistent + (1 − weight) · lumped`: total mass and row sums are kept, the dispersion of waves changes
/// (theory, section 14); [`optimal_weight`] gives the least dispersion.
///
/// A weight in [0, 1] gives a positive definite matrix. A larger weight does too if it is below 1/(1 − θ), with θ the
/// least ratio of consistent to lumped kinetic energy of an element: 3/2 for linear bars, 9/8 and 27/26 for
/// quadrilaterals and hexahedra with constant Jacobian, 4/3 and 5/4 for linear triangles and tetrahedra. Outside [0,
/// 1] the matrix is factorized once to check it. Stiffness is unchanged, and the lumped matrix may be any.
///
/// # Errors
///
/// [`Error::Parameter`] for a weight that is not finite; [`Error::Dimension`], [`Error::MatrixNotFinite`],
/// [`Error::Asymmetric`] for the matrix; [`Error::Dimension`], [`Error::Mass`] for the lumped masses, which must be
/// positive; [`Error::Singular`] if the weight is outside [0, 1] and the blend is not positive definite.
///
/// ```
/// use contact_dynamics::{Error, faer::sparse::{SparseColMat, Triplet}, mass};
/// // One linear bar element of mass 6.
/// let entries = [(0, 0, 2.0), (0, 1, 1.0), (1, 0, 1.0), (1, 1, 2.0)].map(|(i, j, m)| Triplet::new(i, j, m));
/// let consistent = SparseColMat::try_new_from_triplets(2, 2, &entries)?;
/// let blend = |weight| mass::blend(consistent.as_ref(), &[3.0, 3.0], weight);
/// assert_eq!(blend(0.5)?.val(), [2.5, 0.5, 0.5, 2.5]);
/// assert!(blend(1.4).is_ok());
/// assert!(matches!(blend(1.6), Err(Error::Singular { .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn blend<T: Real>(
    consistent: SparseColMatRef<'_, usize, T>,
    lumped: &[T],
    weight: f64,
) -> Result<SparseColMat<usize, T>> {
    if !weight.is_finite() {
        return Err(Error::Parameter { name: "the blending weight", value: weight, range: "finite" });
    }
    sparse::check_symmetric("mass", consistent)?;
    let n = consistent.ncols();
    if lumped.len() != n {
        return Err(Error::Dimension { what: "lumped mass", expected: n, found: lumped.len() });
    }
    super::lump::check_positive(lumped)?;
    let sum = sparse::Combination::new(n, &[], &[consistent.symbolic()])?;
    let mut values = vec![T::zero(); sum.len()];
    sum.fill(&[(T::of(weight), consistent.val())], Some((T::of(1.0 - weight), lumped)), &mut values);
    if !(0.0..=1.0).contains(&weight) {
        check_definite(sum.view(&values), &[])?;
    }
    Ok(sum.into_matrix(values))
}

/// The weight of [`blend`] for which the leading dispersion errors of linear elements in space and of a scheme in time
/// cancel: ½ + 12 p Co², with p of [`period_elongation`] and the Courant number Co = c h/h_e of elements of length h_e
/// (theory, section 14).
///
/// The error of the phase velocity of plane waves along the mesh is then of order κ⁴ instead of κ², with κ = 2π h_e
/// over the wave length. Derived for uniform bars; it also holds for waves along the axes of uniform quadrilaterals
/// and hexahedra, but not for oblique waves or shear waves, which have a Courant number of their own. The damping of
/// the scheme is unchanged.
///
/// Trapezoidal rule: ½ + Co², possible for Co < 1. Central differences: (1 − Co²)/2, which is the lumped mass at Co =
/// 1, where they are exact; for smaller Co a matrix must be factorized. Co → 0 gives ½ for every scheme.
///
/// # Errors
///
/// [`Error::Parameter`] for a Courant number that is negative or not finite, and for a weight of 3/2 or more, for
/// which no blend is positive definite (in two and three dimensions [`blend`] rejects smaller weights);
/// [`Error::Incompatible`] for schemes whose free oscillations have first-order errors; [`Error::Tableau`] for a
/// tableau that defines no step.
///
/// ```
/// use contact_dynamics::{CentralDifference, Newmark, TimeIntegrator, mass};
/// let weight = mass::optimal_weight(&Newmark::trapezoidal().tableau(), 0.5)?;
/// assert!((weight - 0.75).abs() < 1e-12);
/// assert!(mass::optimal_weight(&CentralDifference.tableau(), 1.0)?.abs() < 1e-12);
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn optimal_weight(tableau: &Tableau, courant: f64) -> Result<f64> {
    tableau.check("the scheme of the blending weight")?;
    if !(courant >= 0.0 && courant.is_finite()) {
        let range = "finite and not negative";
        return Err(Error::Parameter { name: "the Courant number", value: courant, range });
    }
    let Some(weight) = dispersion_weight(tableau, courant) else {
        return Err(Error::Incompatible {
            part: "the scheme of the blending weight".into(),
            reason: "its free oscillations err at first order, which no mass matrix makes up for",
        });
    };
    if weight < 1.5 {
        Ok(weight)
    } else {
        let range = "below 3/2, or no blend is positive definite; take a smaller step";
        Err(Error::Parameter { name: "the blending weight for this Courant number", value: weight, range })
    }
}

/// The weight of [`optimal_weight`], even if a blend with it is indefinite; `None` for schemes with first-order
/// errors.
pub(crate) fn dispersion_weight(tableau: &Tableau, courant: f64) -> Option<f64> {
    period_elongation(tableau).map(|elongation| 0.5 + 12.0 * elongation * courant * courant)
}
