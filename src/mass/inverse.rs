//! M⁻¹ on the dofs that are free and have mass.

use super::Mass;
use super::consistent::{ConsistentInverse, factor, without_response};
use crate::error::{Error, Result};
use crate::linear_solver::{Automatic, LinearSolver};
use crate::real::Real;
use faer::sparse::SparseColMatRef;

/// M⁻¹ on the free dofs that have mass: other dofs have no response, and their rows and columns are left out of M.
#[derive(Debug)]
pub(crate) enum InverseMass<T: Real> {
    /// 1/m, zero on dofs without response.
    Lumped(Vec<T>),
    Consistent(Box<ConsistentInverse<T>>),
}

impl<T: Real> InverseMass<T> {
    /// Forces act mostly on the dofs `near`, or anywhere if the list is empty.
    pub(crate) fn new(mass: Mass<'_, T>, prescribed: &[usize], near: &[usize]) -> Result<Self> {
        match mass {
            Mass::Lumped(mass) => {
                let mut inverse = Vec::with_capacity(mass.len());
                for (dof, &m) in mass.iter().enumerate() {
                    let free = prescribed.binary_search(&dof).is_err();
                    if free && !(m >= T::zero() && m.is_finite()) {
                        return Err(Error::Mass { dof, value: m.value() });
                    }
                    inverse.push(if free && m > T::zero() { m.recip() } else { T::zero() });
                }
                Ok(Self::Lumped(inverse))
            }
            Mass::Consistent(mass) => Ok(Self::Consistent(Box::new(ConsistentInverse::new(mass, prescribed, near)?))),
        }
    }

    /// The same with a given solver, for consistent masses.
    pub(crate) fn through(solver: &dyn LinearSolver<T>, mass: Mass<'_, T>, prescribed: &[usize]) -> Result<Self> {
        match mass {
            Mass::Lumped(_) => Self::new(mass, prescribed, &[]),
            Mass::Consistent(mass) => {
                Ok(Self::Consistent(Box::new(ConsistentInverse::through(solver, mass, prescribed)?)))
            }
        }
    }

    /// `x ← M⁻¹ x`, zero on dofs without response.
    pub(crate) fn apply(&mut self, x: &mut [T]) -> Result<()> {
        match self {
            Self::Lumped(inverse) => x.iter_mut().zip(inverse).for_each(|(x, i)| *x *= *i),
            Self::Consistent(inverse) => inverse.apply(x)?,
        }
        Ok(())
    }
}

/// Rejects a matrix that is not positive definite on the dofs that are free and have mass.
pub(super) fn check_definite<T: Real>(mass: SparseColMatRef<'_, usize, T>, prescribed: &[usize]) -> Result<()> {
    factor(&Automatic, mass, &without_response(mass, prescribed)).map(|_| ())
}
