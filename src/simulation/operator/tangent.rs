//! The entries of an effective matrix: its pattern, and the motion at which its tangent is evaluated.

use crate::error::Result;
use crate::mass::{self, Mass};
use crate::real::Real;
use crate::sparse::Combination;
use crate::state::Motion;
use crate::system::{Linearity, Path, System, TangentWeights};

/// Where a tangent is evaluated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct At<'m, T> {
    pub(crate) t: f64,
    pub(crate) u: &'m [T],
    pub(crate) v: &'m [T],
    pub(crate) of: TangentOf<'m, T>,
}

impl<'m, T> At<'m, T> {
    /// A motion and the force there.
    pub(crate) fn state(motion: &'m Motion<T>) -> Self {
        Self { t: motion.t, u: &motion.u, v: &motion.v, of: TangentOf::State }
    }
}

/// The force that a tangent belongs to.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TangentOf<'m, T> {
    /// The force of the motion.
    State,
    /// The system's own force along a path.
    Path(Path<'m, T>),
    /// Simpson's mean over a path with this end, whose middle is the motion.
    Simpson { end: &'m [T] },
}

/// Whether K and C enter an effective matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tangent {
    /// Only M: an explicit stage without damping.
    Absent,
    /// w_ū K + w_v̄/h C in the pattern of the effective matrix.
    Present,
}

/// Refuses a pattern or a mass of another size than when the run was built: their entries would be misplaced.
pub(crate) fn check_sources<T: Real>(
    system: &dyn System<T>,
    tangent: Tangent,
    combination: &Combination,
) -> Result<()> {
    let (mass, diagonal) = match system.mass() {
        Mass::Lumped(mass) => (None, mass.len()),
        Mass::Consistent(mass) => (Some(mass.val().len()), system.dofs()),
    };
    let own = (tangent == Tangent::Present).then(|| system.pattern().row_idx().len());
    let what = [
        own.map(|found| ("the pattern of the tangent (entries)", found)),
        mass.map(|found| ("the mass matrix (entries)", found)),
    ];
    combination.check(diagonal, what.into_iter().flatten())
}

/// The pattern of an effective matrix: the union of the patterns of K, C and M that enter it.
pub(crate) fn pattern<T: Real>(system: &mut dyn System<T>, weights: [f64; 3]) -> Result<(Tangent, Combination)> {
    let dofs = system.dofs();
    let damped = weights[1] != 0.0 && system.damping_force().is_some();
    let tangent = match weights[0] != 0.0 || damped {
        true => Tangent::Present,
        false => Tangent::Absent,
    };
    // Damping proportional to a lumped mass keeps the matrix of an explicit scheme diagonal.
    let diagonal = tangent == Tangent::Present
        && weights[0] == 0.0
        && system.linearity() == Linearity::Linear
        && has_diagonal_damping(system)?;
    let own = (tangent == Tangent::Present).then_some(system.pattern());
    let mut fixed = system.prescribed().to_vec();
    if weights[0] == 0.0 {
        // Dofs without mass have been moved before: here they do not respond.
        fixed.append(&mut mass::massless(system.mass(), system.prescribed()));
        fixed.sort_unstable();
    }
    let combination = match system.mass() {
        Mass::Lumped(_) if diagonal => Combination::diagonal(dofs, &fixed, &[system.pattern()])?,
        Mass::Lumped(_) => Combination::new(dofs, &fixed, own.as_slice())?,
        Mass::Consistent(mass) => {
            let sources: Vec<_> = own.into_iter().chain([mass.symbolic()]).collect();
            Combination::new(dofs, &fixed, &sources)?
        }
    };
    Ok((tangent, combination))
}

/// Whether C has no entry off the diagonal.
fn has_diagonal_damping<T: Real>(system: &mut dyn System<T>) -> Result<bool> {
    let mut values = vec![T::zero(); system.pattern().row_idx().len()];
    let still = vec![T::zero(); system.dofs()];
    system.tangent(0.0, &still, &still, TangentWeights { stiffness: T::zero(), damping: T::one() }, &mut values)?;
    let pattern = system.pattern();
    let on_diagonal = |column: usize| {
        let rows = pattern.row_idx_of_col_raw(column).iter().zip(&values[pattern.col_range(column)]);
        rows.into_iter().all(|(&row, &value)| row == column || value == T::zero())
    };
    Ok((0..pattern.ncols()).all(on_diagonal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::system::LinearSystem;
    use faer::sparse::{SparseColMat, Triplet};

    /// A scheme whose matrix is the mass alone gets no larger pattern, whether the system is damped or not.
    #[test]
    fn what_a_scheme_does_not_read_is_not_in_its_pattern() {
        let entries = [(0, 0, 2.0), (1, 0, -1.0), (0, 1, -1.0), (1, 1, 1.0)].map(|(i, j, x)| Triplet::new(i, j, x));
        let k = SparseColMat::try_new_from_triplets(2, 2, &entries).unwrap();
        let system = LinearSystem::<f64>::lumped(vec![1.0, 2.0], k).unwrap();
        let mut damped = system.rayleigh(0.0, 0.1).unwrap();
        for (weights, expected) in [([0.0, 0.0, 1.0], false), ([0.0, 0.5, 1.0], true), ([0.3, 0.0, 1.0], true)] {
            let (tangent, _) = pattern(&mut damped, weights).unwrap();
            assert_eq!(tangent == Tangent::Present, expected, "{weights:?}");
        }
    }
}
