//! Several bodies in one system.

use super::body::ReducedBody;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::sparse;
use crate::sparse::assembled;
use crate::system::LinearSystem;
use faer::sparse::SparseColMatRef;
use std::ops::Range;

/// Bodies, reduced or not, in one [`LinearSystem`]: block-diagonal matrices, one body after the other.
///
/// ```
/// use contact_dynamics::System;
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::reduction::{Blocks, Reduction};
///
/// // A free chain of 30 masses, reduced to its rigid motion and four modes, and a single mass.
/// let n = 30;
/// let springs = (1..n).flat_map(|i| [(i - 1, i - 1, 1.0), (i, i, 1.0), (i - 1, i, -1.0), (i, i - 1, -1.0)]);
/// let entries: Vec<_> = springs.map(|(i, j, k)| Triplet::new(i, j, k)).collect();
/// let k = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &entries)?;
/// let masses: Vec<_> = (0..n).map(|i| Triplet::new(i, i, 1.0)).collect();
/// let m = SparseColMat::try_new_from_triplets(n, n, &masses)?;
/// let chain = Reduction::new(m.as_ref(), k.as_ref(), &[0]).modes(5)?;
///
/// let mut blocks = Blocks::new();
/// let first = blocks.reduced(&chain)?;
/// let mass = SparseColMat::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 2.0)])?;
/// let none = SparseColMat::try_new_from_triplets(1, 1, &[])?;
/// let second = blocks.body(mass.as_ref(), none.as_ref(), None)?;
/// assert_eq!((first.len(), second.start), (6, 6));
/// assert_eq!(blocks.system()?.dofs(), 7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Blocks<T> {
    dofs: usize,
    mass: Vec<(usize, usize, T)>,
    stiffness: Vec<(usize, usize, T)>,
    damping: Vec<(usize, usize, T)>,
    /// The constant load of all bodies; `None` if no body has one.
    load: Option<Vec<T>>,
}

impl<T: Real> Blocks<T> {
    /// Without bodies.
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of dofs so far.
    pub fn dofs(&self) -> usize {
        self.dofs
    }

    /// Appends a body with mass, stiffness and damping matrices (both triangles stored), and returns the range of its
    /// dofs.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] unless all are square and of one size; [`system`](Self::system) checks the entries.
    pub fn body(
        &mut self,
        mass: SparseColMatRef<'_, usize, T>,
        stiffness: SparseColMatRef<'_, usize, T>,
        damping: Option<SparseColMatRef<'_, usize, T>>,
    ) -> Result<Range<usize>> {
        let expected = sparse::square("stiffness matrix of a body", stiffness)?;
        let others = [("mass matrix of a body", Some(mass)), ("damping matrix of a body", damping)];
        for (what, matrix) in others {
            let Some(matrix) = matrix else { continue };
            let found = sparse::square(what, matrix)?;
            if found != expected {
                return Err(Error::Dimension { what, expected, found });
            }
        }
        let place = self.dofs..self.dofs + expected;
        append(place.start, mass, &mut self.mass);
        append(place.start, stiffness, &mut self.stiffness);
        if let Some(damping) = damping {
            append(place.start, damping, &mut self.damping);
        }
        self.dofs = place.end;
        if let Some(load) = &mut self.load {
            load.resize(place.end, T::zero());
        }
        Ok(place)
    }

    /// Appends a reduced body with its constant load, and returns the range of its dofs; the contact dofs are the
    /// last.
    ///
    /// # Errors
    ///
    /// None for a body that was built; the signature matches [`body`](Self::body).
    pub fn reduced(&mut self, body: &ReducedBody<T>) -> Result<Range<usize>> {
        let place = self.body(body.mass(), body.stiffness(), body.damping())?;
        if let Some(load) = body.constant_load() {
            self.add_load(place.start, load)?;
        }
        Ok(place)
    }

    /// Adds to the constant load, starting at dof `first`.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] for a load that extends beyond the present dofs.
    pub fn add_load(&mut self, first: usize, load: &[T]) -> Result<()> {
        let end = first.saturating_add(load.len());
        if end > self.dofs {
            let what = "the dofs that a constant load reaches";
            return Err(Error::Dimension { what, expected: self.dofs, found: end });
        }
        let all = self.load.get_or_insert_with(|| vec![T::zero(); self.dofs]);
        all[first..end].iter_mut().zip(load).for_each(|(sum, &x)| *sum += x);
        Ok(())
    }

    /// The system of all bodies, with their constant load. Supports can be added to it; a time-dependent load
    /// replaces the constant one.
    ///
    /// # Errors
    ///
    /// The errors of [`LinearSystem::new`] and [`LinearSystem::damping`].
    pub fn system(&self) -> Result<LinearSystem<'static, T>> {
        let matrix = |entries: &[(usize, usize, T)]| assembled(self.dofs, entries.to_vec());
        let system = LinearSystem::new(matrix(&self.mass)?, matrix(&self.stiffness)?)?;
        let system = match self.damping.is_empty() {
            true => system,
            false => system.damping(matrix(&self.damping)?)?,
        };
        Ok(match self.load.clone() {
            Some(load) => system.load(move |_, out| out.copy_from_slice(&load)),
            None => system,
        })
    }
}

/// Appends the entries of a matrix, shifted to row and column `first`.
fn append<T: Real>(first: usize, a: SparseColMatRef<'_, usize, T>, out: &mut Vec<(usize, usize, T)>) {
    for column in 0..a.ncols() {
        let entries = a.row_idx_of_col_raw(column).iter().zip(a.val_of_col(column));
        out.extend(entries.map(|(&row, &value)| (first + row, first + column, value)));
    }
}
