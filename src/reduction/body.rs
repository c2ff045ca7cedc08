//! A reduced body, and the maps from fields of the parent to (η, u_b) and back.

use crate::error::{Error, Result};
use crate::kernels::vector::Accumulate;
use crate::real::Real;
use crate::system::LinearSystem;
use faer::sparse::{SparseColMat, SparseColMatRef};
use std::ops::Range;

/// The interface between modes and contact dofs.
///
/// `docs/reduction.md` measures all variants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Boundary {
    /// Massless contact dofs on the residual flexibility, with the modes tapered toward the highest: the contact
    /// force is smooth. Statically slightly softer than the body; see [`Accuracy`]. For parents with a regular mass
    /// matrix. It is too soft if contact dofs of the parent are already massless, or if contacts are small and grow
    /// slowly.
    #[default]
    Tapered,
    /// Massless contact dofs on the residual flexibility (MacNeal, Comput. Struct. 1, 1971, without the second-order
    /// term of Rubin, AIAA J. 13, 1975; with contact: Monjaraz-Tec, Gross, Krack, Nonlinear Dyn. 2022). Statically
    /// exact. Known failure: the abrupt end of the modes makes the contact force ring, after a front by 0.8 of it. It
    /// does not ring if contacts grow slowly, as Hertz's do, or if contact dofs of the parent have no mass and there
    /// are many times more modes than contact dofs.
    Untapered,
    /// Modes of the body with its contact dofs held, and static responses to them (Craig and Bampton, AIAA J. 6,
    /// 1968). Statically exact; contact dofs have mass. Known failure: at an impact that mass makes the force ring
    /// and jump, as with any scheme on dofs with mass; use a corrector.
    CraigBampton,
}

/// Distance of a reduced body from its parent, as far as the build can determine it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Accuracy {
    /// The share of the static compliance at a contact dof, without rigid motion, that the modes do not contain: the
    /// largest over all contact dofs. `None` for [`Boundary::CraigBampton`], whose modes do not move the contact
    /// dofs.
    pub residual: Option<f64>,
    /// Relative excess of that compliance over the parent's: [`Reduction::softening`] times the residual if tapered,
    /// otherwise zero.
    ///
    /// [`Reduction::softening`]: crate::reduction::Reduction::softening
    pub compliance: f64,
    /// The first circular frequency not in the modes (1/time). The force of a contact of duration T is resolved to
    /// times of about 1/ω: observed mean errors were about 2/(ω T) for bodies that touch at a point.
    pub cutoff: f64,
    /// The longest step of a scheme that resolves the modes up to the cutoff, 2.5/ω. With longer steps the observed
    /// overshoot of the force behind a front grew, due to the step and not to the modes. Infinite for a rigid body.
    pub longest_step: f64,
}

/// A body reduced to normal modes η and contact dofs u_b, built by [`Reduction`](super::Reduction).
///
/// Its dofs are the modal coordinates, rigid motions first (unit: length · √mass), then the contact dofs in the order
/// in which they were given (the parent's displacements). [`system`](Self::system) has mass, stiffness, damping and
/// constant load; [`Blocks`](super::Blocks) combines several bodies, reduced or not, in one system.
///
/// Fields of the parent are Φ Σ η + S F⁻¹ (u_b − P η), so a recovered field has exactly u_b at the contact dofs.
/// Loads are mapped by the transpose: a load on a contact dof of the parent becomes a load on u_b only. States are
/// projected by Σ Φᵀ M: rigid motions exactly, with all momenta, and a state of static rest under a load to a state
/// of rest. Elastic vibrations are tapered once in recovery and once in excitation.
#[derive(Clone, Debug)]
pub struct ReducedBody<T: Real> {
    pub(super) parent: Parent<T>,
    pub(super) boundary: Boundary,
    pub(super) frequencies: Vec<f64>,
    pub(super) rigid: usize,
    /// σ_k.
    pub(super) sigma: Vec<T>,
    /// Φ and S on all dofs of the parent, column by column.
    pub(super) shapes: Vec<T>,
    pub(super) fields: Vec<T>,
    /// F⁻¹ row by row, empty if contact dofs have mass; P by contact dof.
    pub(super) weights: Vec<T>,
    pub(super) coupling: Vec<T>,
    pub(super) matrices: Matrices<T>,
    pub(super) accuracy: Accuracy,
    pub(super) factorizations: usize,
}

/// The body that was reduced.
#[derive(Clone, Debug)]
pub(super) struct Parent<T: Real> {
    pub(super) dofs: usize,
    pub(super) contact: Vec<usize>,
    pub(super) fixed: Vec<usize>,
    pub(super) mass: SparseColMat<usize, T>,
    /// The column of K for each fixed dof.
    pub(super) at_supports: Vec<Vec<(usize, T)>>,
    pub(super) load: Option<Vec<T>>,
    /// The static response to the load that modes and contact dofs do not contain; empty without load.
    pub(super) rest: Vec<T>,
}

/// The matrices and the load over the reduced dofs.
#[derive(Clone, Debug)]
pub(super) struct Matrices<T: Real> {
    pub(super) mass: SparseColMat<usize, T>,
    pub(super) stiffness: SparseColMat<usize, T>,
    pub(super) damping: Option<SparseColMat<usize, T>>,
    pub(super) load: Option<Vec<T>>,
}

fn check<T>(what: &'static str, x: &[T], expected: usize) -> Result<()> {
    match x.len() == expected {
        true => Ok(()),
        false => Err(Error::Dimension { what, expected, found: x.len() }),
    }
}

impl<T: Real> ReducedBody<T> {
    /// Number of dofs: modes and contact dofs.
    pub fn dofs(&self) -> usize {
        self.frequencies.len() + self.parent.contact.len()
    }

    /// Number of dofs of the parent, including supports.
    pub fn parent_dofs(&self) -> usize {
        self.parent.dofs
    }

    /// Range of the contact dofs, in the order in which they were given.
    pub fn contact_dofs(&self) -> Range<usize> {
        self.frequencies.len()..self.dofs()
    }

    /// Number of rigid motions, the first modal coordinates.
    pub fn rigid(&self) -> usize {
        self.rigid
    }

    /// Circular frequencies of the modes (1/time).
    pub fn frequencies(&self) -> &[f64] {
        &self.frequencies
    }

    /// Distance from the parent, as far as the build can determine it.
    pub fn accuracy(&self) -> Accuracy {
        self.accuracy
    }

    /// Number of sparse factorizations during the build.
    pub fn factorizations(&self) -> usize {
        self.factorizations
    }

    /// The mass matrix: diag(I, 0), or the one of Craig and Bampton.
    pub fn mass(&self) -> SparseColMatRef<'_, usize, T> {
        self.matrices.mass.as_ref()
    }

    /// The stiffness matrix.
    pub fn stiffness(&self) -> SparseColMatRef<'_, usize, T> {
        self.matrices.stiffness.as_ref()
    }

    /// The damping matrix, if there is damping.
    pub fn damping(&self) -> Option<SparseColMatRef<'_, usize, T>> {
        self.matrices.damping.as_ref().map(SparseColMat::as_ref)
    }

    /// The reduced constant load, if there is one.
    pub fn constant_load(&self) -> Option<&[T]> {
        self.matrices.load.as_deref()
    }

    /// The system of this body alone.
    ///
    /// # Errors
    ///
    /// The errors of [`LinearSystem::new`].
    pub fn system(&self) -> Result<LinearSystem<'static, T>> {
        let system = LinearSystem::new(self.matrices.mass.clone(), self.matrices.stiffness.clone())?;
        let system = match &self.matrices.damping {
            Some(damping) => system.damping(damping.clone())?,
            None => system,
        };
        Ok(match self.matrices.load.clone() {
            Some(load) => system.load(move |_, out| out.copy_from_slice(&load)),
            None => system,
        })
    }

    /// Converts a load on the dofs of the parent (forces; those on supports are dropped) to one on the reduced dofs.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`].
    pub fn load(&self, load: &[T]) -> Result<Vec<T>> {
        check("a load on the parent of a reduced body", load, self.parent.dofs)?;
        let count = self.frequencies.len();
        let mut out = self.along(&self.shapes, load);
        let moved = self.along(&self.fields, load);
        // For Craig and Bampton the fields are responses to displacements.
        let forces = self.contact_forces(&moved);
        for (x, &sigma) in out.iter_mut().zip(&self.sigma) {
            *x *= sigma;
        }
        if self.boundary != Boundary::CraigBampton {
            for (row, &force) in self.coupling.chunks_exact(count).zip(&forces) {
                T::axpy(-force, row, &mut out);
            }
        }
        out.extend(forces);
        Ok(out)
    }

    /// Converts a displacement of the parent to the reduced dofs.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`].
    pub fn displacement(&self, u: &[T]) -> Result<Vec<T>> {
        check("a displacement of the parent of a reduced body", u, self.parent.dofs)?;
        Ok(self.project(u))
    }

    /// Converts a velocity of the parent to the reduced dofs.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`].
    pub fn velocity(&self, v: &[T]) -> Result<Vec<T>> {
        check("a velocity of the parent of a reduced body", v, self.parent.dofs)?;
        Ok(self.project(v))
    }

    fn project(&self, u: &[T]) -> Vec<T> {
        let at_contact: Vec<T> = self.parent.contact.iter().map(|&dof| u[dof]).collect();
        let mut modal = u.to_vec();
        if self.boundary == Boundary::CraigBampton {
            self.fields.chunks_exact(self.parent.dofs).zip(&at_contact).for_each(|(f, &x)| T::axpy(-x, f, &mut modal));
        }
        let mut momentum = vec![T::zero(); self.parent.dofs];
        T::symmetric_product(T::one(), self.parent.mass.as_ref(), &modal, &mut momentum, Accumulate::Replace);
        let mut out = self.along(&self.shapes, &momentum);
        for (x, &sigma) in out.iter_mut().zip(&self.sigma) {
            *x *= sigma;
        }
        out.extend(at_contact);
        out
    }

    /// The displacement of the parent, zero at supports, including the static response to the constant load.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`].
    pub fn recover_displacement(&self, u: &[T]) -> Result<Vec<T>> {
        let mut field = self.recover(u)?;
        if !self.parent.rest.is_empty() {
            T::axpy(T::one(), &self.parent.rest, &mut field);
            self.set_contact(u, &mut field);
        }
        Ok(field)
    }

    /// The velocity of the parent; accelerations are recovered in the same way.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`].
    pub fn recover_velocity(&self, v: &[T]) -> Result<Vec<T>> {
        self.recover(v)
    }

    fn recover(&self, x: &[T]) -> Result<Vec<T>> {
        check("a state of a reduced body", x, self.dofs())?;
        let (modal, contact) = x.split_at(self.frequencies.len());
        let mut apart = contact.to_vec();
        if self.boundary != Boundary::CraigBampton {
            let moved = self.coupling.chunks_exact(modal.len()).map(|row| crate::dense::dot(row, modal));
            apart.iter_mut().zip(moved).for_each(|(u, moved)| *u -= moved);
        }
        let forces = self.contact_forces(&apart);
        let mut field = vec![T::zero(); self.parent.dofs];
        for ((shape, &x), &sigma) in self.shapes.chunks_exact(self.parent.dofs).zip(modal).zip(&self.sigma) {
            T::axpy(sigma * x, shape, &mut field);
        }
        for (shape, &force) in self.fields.chunks_exact(self.parent.dofs).zip(&forces) {
            T::axpy(force, shape, &mut field);
        }
        self.set_contact(x, &mut field);
        Ok(field)
    }

    /// Sets the contact dofs exactly, which recovery reproduces only to rounding.
    fn set_contact(&self, x: &[T], field: &mut [T]) {
        self.parent.contact.iter().zip(&x[self.frequencies.len()..]).for_each(|(&dof, &u)| field[dof] = u);
    }

    /// The forces of the supports on the body, one for each fixed dof in the order in which they were given, from
    /// displacements and accelerations of the reduced dofs: M a + K u − f at these dofs. Damping forces are left out.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`].
    pub fn support_forces(&self, u: &[T], a: &[T]) -> Result<Vec<T>> {
        let (u, a) = (self.recover_displacement(u)?, self.recover(a)?);
        let mut inertia = vec![T::zero(); self.parent.dofs];
        T::symmetric_product(T::one(), self.parent.mass.as_ref(), &a, &mut inertia, Accumulate::Replace);
        let force = |(&dof, column): (&usize, &Vec<(usize, T)>)| {
            let elastic: T = column.iter().map(|&(row, k)| k * u[row]).sum();
            let load = self.parent.load.as_ref().map_or(T::zero(), |load| load[dof]);
            inertia[dof] + elastic - load
        };
        Ok(self.parent.fixed.iter().zip(&self.parent.at_supports).map(force).collect())
    }

    /// Products of columns on the dofs of the parent with a vector there.
    fn along(&self, columns: &[T], x: &[T]) -> Vec<T> {
        columns.chunks_exact(self.parent.dofs).map(|column| crate::dense::dot(column, x)).collect()
    }

    /// F⁻¹ x; x itself if contact dofs have mass.
    fn contact_forces(&self, x: &[T]) -> Vec<T> {
        match self.weights.is_empty() {
            true => x.to_vec(),
            false => self.weights.chunks_exact(x.len()).map(|row| crate::dense::dot(row, x)).collect(),
        }
    }
}
