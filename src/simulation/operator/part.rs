//! A part of the dofs with a matrix of its own that does not change, factorized. Other dofs do not respond.

use crate::error::{Error, Result};
use crate::linear_solver::{Automatic, Condensation, Factorization, LinearSolver};
use crate::real::Real;
use faer::sparse::{SparseColMat, SparseColMatRef};
use std::sync::Arc;

/// The dofs of a part, and their matrix in their own numbering.
#[derive(Debug)]
pub(crate) struct Part<T> {
    pub(super) matrix: SparseColMat<usize, T>,
    /// Ascending.
    pub(super) dofs: Vec<usize>,
    /// Those that contact may act on: their interface indices, ascending, and their own numbers.
    pub(super) places: Vec<usize>,
    pub(super) touched: Vec<usize>,
    /// Number of all dofs on the interface.
    interface: usize,
}

/// A factor of the matrix of a part that solves for vectors of the whole system, and of its whole interface.
#[derive(Debug)]
pub(crate) struct Embedded<T> {
    inner: Box<dyn Factorization<T>>,
    pub(super) part: Arc<Part<T>>,
    /// Scratch: one entry per own dof, and one per own dof on the interface.
    vector: Vec<T>,
    on_interface: Vec<T>,
}

fn gather<T: Copy>(all: &[T], places: &[usize], some: &mut [T]) {
    for (x, &place) in some.iter_mut().zip(places) {
        *x = all[place];
    }
}

fn scatter<T: Copy>(some: &[T], places: &[usize], all: &mut [T]) {
    for (&x, &place) in some.iter().zip(places) {
        all[place] = x;
    }
}

impl<T: Real> Part<T> {
    /// The matrix of some dofs (ascending), factorized.
    pub(crate) fn factorized(
        matrix: SparseColMat<usize, T>,
        dofs: &[usize],
        interface: &[usize],
    ) -> Result<Embedded<T>> {
        let shared =
            interface.iter().enumerate().filter_map(|(place, dof)| Some((place, dofs.binary_search(dof).ok()?)));
        let (places, touched): (Vec<usize>, Vec<usize>) = shared.unzip();
        let part = Self { matrix, dofs: dofs.to_vec(), places, touched, interface: interface.len() };
        // Without others to eliminate there is no order to keep.
        let last = if part.is_all_touched() { &[] } else { &part.touched[..] };
        let mut factor = Embedded {
            inner: Automatic.analyze(part.matrix.symbolic(), last)?,
            vector: vec![T::zero(); dofs.len()],
            on_interface: vec![T::zero(); part.places.len()],
            part: Arc::new(part),
        };
        let part = factor.part.clone();
        factor.factorize(part.matrix.as_ref())?;
        Ok(factor)
    }

    /// Whether contact may act on all dofs of the part.
    fn is_all_touched(&self) -> bool {
        self.touched.len() == self.dofs.len()
    }

    /// The stiffness of smooth motions, towards the other dofs.
    pub(super) fn sum_of_entries(&self) -> f64 {
        self.matrix.val().iter().map(|x| x.value()).sum()
    }

    /// Whether contact may act on the dof of the part at this place of the interface.
    pub(super) fn has_place(&self, place: usize) -> bool {
        self.places.binary_search(&place).is_ok()
    }

    /// Writes the displacements of the part on the interface; other dofs there do not move.
    pub(super) fn write_on_interface(&self, own: &[T], interface: &mut [T]) {
        interface.fill(T::zero());
        for (&place, &dof) in self.places.iter().zip(&self.touched) {
            interface[place] = own[dof];
        }
    }
}

impl<T: Real> Factorization<T> for Embedded<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let dofs = &self.part.dofs;
        self.inner.factorize(a).map_err(|error| match error {
            Error::Singular { dof, .. } => Error::Singular {
                matrix: "stiffness of the dofs without mass",
                dof: dofs.get(dof).copied().unwrap_or(dof),
            },
            other => other,
        })
    }

    /// Entries of other dofs are left as they are.
    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        gather(rhs, &self.part.dofs, &mut self.vector);
        self.inner.solve(&mut self.vector)?;
        scatter(&self.vector, &self.part.dofs, rhs);
        Ok(())
    }

    fn stored_values(&self) -> usize {
        self.inner.stored_values()
    }

    fn is_symmetric(&self) -> bool {
        self.inner.is_symmetric()
    }

    fn condensation(&mut self) -> Option<&mut dyn Condensation<T>> {
        Some(self)
    }
}

impl<T: Real> Condensation<T> for Embedded<T> {
    fn condense(&mut self, rhs: &[T], interface: &mut [T]) -> Result<()> {
        let Self { inner, part, vector, on_interface } = self;
        gather(rhs, &part.dofs, vector);
        interface.fill(T::zero());
        if part.is_all_touched() || part.places.is_empty() {
            inner.solve(vector)?;
            part.write_on_interface(vector, interface);
        } else if let Some(condensed) = inner.condensation() {
            condensed.condense(vector, on_interface)?;
            scatter(on_interface, &part.places, interface);
        }
        Ok(())
    }

    /// Entries of other dofs are left as they are.
    fn expand(&mut self, interface: &[T], solution: &mut [T]) -> Result<()> {
        let Self { inner, part, vector, on_interface } = self;
        gather(interface, &part.places, on_interface);
        if part.is_all_touched() {
            vector.copy_from_slice(on_interface);
        } else if let Some(condensed) = inner.condensation().filter(|_| !part.places.is_empty()) {
            condensed.expand(on_interface, vector)?;
        }
        scatter(vector, &part.dofs, solution);
        Ok(())
    }

    fn solve(&mut self, forces: &mut [T]) -> Result<()> {
        let Self { inner, part, on_interface, .. } = self;
        for column in forces.chunks_exact_mut(part.interface.max(1)) {
            gather(column, &part.places, on_interface);
            column.fill(T::zero());
            if part.is_all_touched() {
                inner.solve(on_interface)?;
            } else if let Some(condensed) = inner.condensation().filter(|_| !part.places.is_empty()) {
                condensed.solve(on_interface)?;
            }
            scatter(on_interface, &part.places, column);
        }
        Ok(())
    }
}
