//! The entries of an effective matrix w_ū K + w_v̄/h C + w_ā/h² M in one fixed pattern.

use crate::error::{Error, Result};
use crate::mass::{self, Mass};
use crate::memory;
use crate::real::Real;
use crate::simulation::operator::tangent::{At, TangentOf};
use crate::sparse::Combination;
use crate::system::{Linearity, System, TangentWeights};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};

const VALUES: &str = "the values of the effective matrix";

/// Whether K and C enter an effective matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tangent {
    /// Only M: an explicit stage without damping.
    Absent,
    /// w_ū K + w_v̄/h C in the pattern of the effective matrix.
    Present,
}

/// The pattern of an effective matrix, and its values while they are needed.
#[derive(Debug)]
pub(crate) struct EffectiveMatrix<T> {
    /// (w_ū, w_v̄, w_ā): stages with the same weights share the matrix.
    weights: [f64; 3],
    tangent: Tangent,
    linearity: Linearity,
    combination: Combination,
    /// Values of the system's tangent and of the effective matrix, kept where the tangent changes.
    part: Vec<T>,
    /// The part of the tangent that is evaluated at the end of a path.
    end: Vec<T>,
    values: Vec<T>,
}

impl<T: Real> EffectiveMatrix<T> {
    /// The pattern for a system.
    pub(crate) fn new(system: &mut dyn System<T>, weights: [f64; 3]) -> Result<Self> {
        let (tangent, combination) = pattern(system, weights)?;
        Ok(Self { linearity: system.linearity(), ..Self::of(weights, tangent, combination) })
    }

    /// For a factor that is never formed again.
    pub(crate) fn none() -> Result<Self> {
        Ok(Self::of([f64::NAN; 3], Tangent::Absent, Combination::diagonal(0, &[], &[])?))
    }

    fn of(weights: [f64; 3], tangent: Tangent, combination: Combination) -> Self {
        let (part, end, values) = (Vec::new(), Vec::new(), Vec::new());
        Self { weights, tangent, linearity: Linearity::Linear, combination, part, end, values }
    }

    pub(crate) fn has_weights(&self, weights: [f64; 3]) -> bool {
        self.weights.map(f64::to_bits) == weights.map(f64::to_bits)
    }

    /// Whether the matrix changes with u and v.
    pub(crate) fn varies(&self) -> bool {
        self.tangent == Tangent::Present && self.linearity == Linearity::Nonlinear
    }

    /// The factor of M.
    pub(crate) fn inertia(&self, h: f64) -> f64 {
        self.weights[2] / (h * h)
    }

    pub(crate) fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.combination.pattern()
    }

    /// Frees a pattern that the system has too.
    pub(crate) fn leave_pattern(&mut self) {
        if self.tangent == Tangent::Present && !self.varies() {
            self.combination.leave_pattern();
        }
    }

    /// Frees the values after the factorization of a matrix that does not change.
    pub(crate) fn free_values(&mut self) {
        self.values = Vec::new();
    }

    /// Forms the matrix for the step size h with the tangent at a motion. Where it varies, only the first call
    /// allocates.
    pub(crate) fn assemble(&mut self, system: &mut dyn System<T>, h: f64, at: At<'_, T>) -> Result<()> {
        let Self { weights, tangent, linearity, combination, part, end: at_end, values } = self;
        check_sources(&*system, *tangent, combination)?;
        memory::grow(values, combination.len(), 1, VALUES)?;
        if *tangent == Tangent::Present {
            memory::grow(part, system.pattern().row_idx().len(), 1, VALUES)?;
            let weights = TangentWeights { stiffness: T::of(weights[0]), damping: T::of(weights[1] / h) };
            match at.of {
                TangentOf::State => system.tangent(at.t, at.u, at.v, weights, part)?,
                TangentOf::Path(path) => match system.path_force() {
                    Some(own) => own.tangent_along(at.t, path, at.v, weights, part)?,
                    None => system.tangent(at.t, path.mean, at.v, weights, part)?,
                },
                TangentOf::Simpson { end } => {
                    // Twice the derivative of ⅙ f(u) + ⅔ f(½ (u + u')) + ⅙ f(u') by u', in which the middle term
                    // counts half: ⅔ K in the middle and ⅓ K at the end.
                    let third = weights.stiffness / T::of(3.0);
                    memory::grow(at_end, part.len(), 1, VALUES)?;
                    let of_end = TangentWeights { stiffness: third, damping: T::zero() };
                    system.tangent(at.t, end, at.v, of_end, at_end)?;
                    let of_middle = TangentWeights { stiffness: third + third, ..weights };
                    system.tangent(at.t, at.u, at.v, of_middle, part)?;
                    T::axpy(T::one(), at_end, part);
                }
            }
        }
        let inertia = T::of(weights[2] / (h * h));
        let own = (T::one(), &part[..]);
        match (system.mass(), *tangent) {
            (Mass::Lumped(mass), Tangent::Present) => combination.fill(&[own], Some((inertia, mass)), values),
            (Mass::Lumped(mass), Tangent::Absent) => combination.fill(&[], Some((inertia, mass)), values),
            (Mass::Consistent(mass), Tangent::Present) => combination.fill(&[own, (inertia, mass.val())], None, values),
            (Mass::Consistent(mass), Tangent::Absent) => combination.fill(&[(inertia, mass.val())], None, values),
        }
        // The factorization takes the most memory of a build: values that are not read again are freed before.
        if *tangent == Tangent::Absent || *linearity == Linearity::Linear {
            *part = Vec::new();
        }
        if let Some(at) = values.iter().position(|value| !value.is_finite()) {
            let pattern = combination.shape(system.pattern());
            let column = pattern.col_ptr().partition_point(|&p| p <= at) - 1;
            let (row, value) = (pattern.row_idx()[at], values[at].value());
            return Err(Error::MatrixNotFinite { matrix: "effective", row, column, value });
        }
        Ok(())
    }

    /// The matrix that was [assembled](Self::assemble).
    pub(crate) fn view<'m>(&'m self, system: &'m dyn System<T>) -> SparseColMatRef<'m, usize, T> {
        SparseColMatRef::new(self.combination.shape(system.pattern()), &self.values)
    }
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
