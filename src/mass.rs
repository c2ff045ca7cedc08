//! Mass matrices: lumping, blending, redistribution, singular ones, the Courant numbers of a mesh, and M⁻¹ on the
//! dofs that are free and have mass.

mod assembly;
mod bipenalty;
mod blend;
mod consistent;
mod courant;
mod inverse;
mod layers;
mod lump;
mod redistribute;
mod singular;

pub use bipenalty::bipenalty;
pub(crate) use blend::dispersion_weight;
pub use blend::{blend, optimal_weight};
pub(crate) use consistent::ConsistentInverse;
pub use courant::courant;
pub(crate) use inverse::InverseMass;
pub use lump::{lump, lump_diagonal};
pub use redistribute::{Redistribution, affine_motions, redistribute, redistribute_consistent};
pub use singular::{mixed, singular};

use crate::error::{Error, Result};
use crate::kernels::vector::Accumulate;
use crate::real::Real;
use crate::sparse;
use faer::sparse::SparseColMatRef;

/// A view of a mass matrix.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Mass<'a, T> {
    /// Diagonal: one mass per dof.
    Lumped(&'a [T]),
    /// Symmetric, both triangles stored.
    Consistent(SparseColMatRef<'a, usize, T>),
}

impl<T: Real> Mass<'_, T> {
    /// `y += c M x`.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] unless x and y have one entry per dof, and for a matrix that is not square.
    pub fn product(&self, c: T, x: &[T], y: &mut [T]) -> Result<()> {
        let expected = match *self {
            Self::Lumped(mass) => mass.len(),
            Self::Consistent(m) => sparse::square("the mass matrix", m)?,
        };
        for found in [x.len(), y.len()] {
            if found != expected {
                return Err(Error::Dimension { what: "a vector in a product with M", expected, found });
            }
        }
        self.add_product(c, x, y);
        Ok(())
    }

    /// `y += c M x` for vectors of checked size.
    pub(crate) fn add_product(&self, c: T, x: &[T], y: &mut [T]) {
        match *self {
            Self::Lumped(mass) => {
                for ((y, &x), &m) in y.iter_mut().zip(x).zip(mass) {
                    *y += c * m * x;
                }
            }
            Self::Consistent(m) => T::symmetric_product(c, m, x, y, Accumulate::Add),
        }
    }
}

/// The free dofs without mass, ascending: the dofs with zero rows of M.
pub(crate) fn massless<T: Real>(mass: Mass<'_, T>, prescribed: &[usize]) -> Vec<usize> {
    let is_massless = |dof: usize| match mass {
        Mass::Lumped(mass) => mass[dof] == T::zero(),
        Mass::Consistent(mass) => mass.val_of_col(dof).iter().all(|&m| m == T::zero()),
    };
    let dofs = match mass {
        Mass::Lumped(mass) => mass.len(),
        Mass::Consistent(mass) => mass.ncols(),
    };
    (0..dofs).filter(|dof| prescribed.binary_search(dof).is_err() && is_massless(*dof)).collect()
}
