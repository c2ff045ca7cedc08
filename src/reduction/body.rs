//! A reduced body: its matrices over (η, u_b), and the maps from fields of the parent and back.

use super::builder::{Accuracy, Boundary};
use crate::error::{Error, Result};
use crate::kernels::dense::{add_product, transposed_product};
use crate::kernels::vector::Accumulate;
use crate::mass::assembled;
use crate::memory;
use crate::real::{Kernels, Real};
use crate::system::LinearSystem;
use faer::sparse::{SparseColMat, SparseColMatRef};
use std::ops::Range;

/// The data of a reduced body.
pub(super) struct Parts<'a, T: Real> {
    pub(super) contact: Vec<usize>,
    pub(super) fixed: Vec<usize>,
    pub(super) boundary: Boundary,
    pub(super) frequencies: Vec<f64>,
    pub(super) rigid: usize,
    pub(super) sigma: Vec<f64>,
    /// Φ and S on all dofs of the parent, column by column.
    pub(super) shapes: Vec<f64>,
    pub(super) fields: Vec<f64>,
    /// F⁻¹; empty if contact dofs have mass.
    pub(super) weights: Vec<f64>,
    pub(super) accuracy: Accuracy,
    /// Coefficients of the modes; empty without damping.
    pub(super) damping: Vec<f64>,
    /// Rayleigh's coefficients, for contact dofs with mass.
    pub(super) rayleigh: Option<[f64; 2]>,
    pub(super) load: Option<Vec<T>>,
    /// The static response to the load that modes and contact dofs do not contain; empty without load.
    pub(super) rest: Vec<f64>,
    pub(super) mass: SparseColMatRef<'a, usize, T>,
    pub(super) stiffness: SparseColMatRef<'a, usize, T>,
    pub(super) factorizations: usize,
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
    parent: usize,
    contact: Vec<usize>,
    fixed: Vec<usize>,
    pub(super) boundary: Boundary,
    frequencies: Vec<f64>,
    rigid: usize,
    /// σ_k.
    sigma: Vec<T>,
    shapes: Vec<T>,
    fields: Vec<T>,
    /// F⁻¹ row by row, P by contact dof.
    pub(super) weights: Vec<T>,
    pub(super) coupling: Vec<T>,
    mass: SparseColMat<usize, T>,
    stiffness: SparseColMat<usize, T>,
    damping: Option<SparseColMat<usize, T>>,
    load: Option<Vec<T>>,
    rest: Vec<T>,
    parent_mass: SparseColMat<usize, T>,
    parent_load: Option<Vec<T>>,
    /// The parent's column of K for each fixed dof.
    at_supports: Vec<Vec<(usize, T)>>,
    accuracy: Accuracy,
    factorizations: usize,
}

fn check<T>(what: &'static str, x: &[T], expected: usize) -> Result<()> {
    match x.len() == expected {
        true => Ok(()),
        false => Err(Error::Dimension { what, expected, found: x.len() }),
    }
}

/// A dense symmetric matrix under construction.
struct Dense {
    size: usize,
    values: Vec<f64>,
}

impl Dense {
    fn new(size: usize) -> Result<Self> {
        Ok(Self { size, values: memory::zeros(size, size, "the matrices of a reduced body")? })
    }

    fn set(&mut self, i: usize, j: usize, value: f64) {
        self.values[i * self.size + j] = value;
        self.values[j * self.size + i] = value;
    }

    /// Converts to sparse without zero entries.
    fn sparse<T: Real>(&self) -> Result<SparseColMat<usize, T>> {
        let size = self.size;
        let entries = self.values.iter().enumerate().filter(|(_, value)| **value != 0.0);
        assembled(size, entries.map(|(k, &value)| (k % size, k / size, T::of(value))).collect())
    }
}

fn scalars<T: Real>(values: &[f64]) -> Vec<T> {
    values.iter().map(|&x| T::of(x)).collect()
}

fn owned<T: Real>(a: SparseColMatRef<'_, usize, T>) -> Result<SparseColMat<usize, T>> {
    let pattern =
        a.symbolic().to_owned().map_err(|_| Error::OutOfMemory { what: "the mass of the parent", bytes: None })?;
    Ok(SparseColMat::new(pattern, a.val().to_vec()))
}

impl<T: Real> ReducedBody<T> {
    pub(super) fn assemble(parts: Parts<'_, T>) -> Result<Self> {
        let parent = parts.stiffness.nrows();
        let (count, contacts) = (parts.frequencies.len(), parts.contact.len());
        let held = parts.boundary == Boundary::CraigBampton;
        // P, one row per contact dof.
        let mut coupling = vec![0.0; contacts * count];
        if !held {
            for (row, &dof) in coupling.chunks_exact_mut(count).zip(&parts.contact) {
                for (k, p) in row.iter_mut().enumerate() {
                    *p = parts.sigma[k] * parts.shapes[k * parent + dof];
                }
            }
        }
        let [mass, stiffness] = if held { with_mass(&parts)? } else { massless(&parts, &coupling)? };
        let damping = if parts.damping.is_empty() { None } else { Some(damping(&parts, [&mass, &stiffness])?) };
        let column = |&dof: &usize| {
            let k = parts.stiffness;
            k.row_idx_of_col_raw(dof).iter().copied().zip(k.val_of_col(dof).iter().copied()).collect()
        };
        let mut body = Self {
            parent,
            at_supports: parts.fixed.iter().map(column).collect(),
            contact: parts.contact,
            fixed: parts.fixed,
            boundary: parts.boundary,
            frequencies: parts.frequencies,
            rigid: parts.rigid,
            sigma: scalars(&parts.sigma),
            shapes: scalars(&parts.shapes),
            fields: scalars(&parts.fields),
            weights: scalars(&parts.weights),
            coupling: scalars(&coupling),
            mass: mass.sparse()?,
            stiffness: stiffness.sparse()?,
            damping,
            load: None,
            rest: scalars(&parts.rest),
            parent_mass: owned(parts.mass)?,
            parent_load: None,
            accuracy: parts.accuracy,
            factorizations: parts.factorizations,
        };
        if let Some(load) = parts.load {
            body.load = Some(body.load(&load)?);
            body.parent_load = Some(load);
        }
        Ok(body)
    }

    /// Number of dofs: modes and contact dofs.
    pub fn dofs(&self) -> usize {
        self.frequencies.len() + self.contact.len()
    }

    /// Number of dofs of the parent, including supports.
    pub fn parent_dofs(&self) -> usize {
        self.parent
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
        self.mass.as_ref()
    }

    /// The stiffness matrix.
    pub fn stiffness(&self) -> SparseColMatRef<'_, usize, T> {
        self.stiffness.as_ref()
    }

    /// The damping matrix, if there is damping.
    pub fn damping(&self) -> Option<SparseColMatRef<'_, usize, T>> {
        self.damping.as_ref().map(SparseColMat::as_ref)
    }

    /// The reduced constant load, if there is one.
    pub fn constant_load(&self) -> Option<&[T]> {
        self.load.as_deref()
    }

    /// The system of this body alone.
    ///
    /// # Errors
    ///
    /// The errors of [`LinearSystem::new`].
    pub fn system(&self) -> Result<LinearSystem<'static, T>> {
        let system = LinearSystem::new(self.mass.clone(), self.stiffness.clone())?;
        let system = match &self.damping {
            Some(damping) => system.damping(damping.clone())?,
            None => system,
        };
        Ok(match self.load.clone() {
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
        check("a load on the parent of a reduced body", load, self.parent)?;
        let count = self.frequencies.len();
        let mut out = self.along(&self.shapes, load);
        let moved = self.along(&self.fields, load);
        // For Craig and Bampton the fields are responses to displacements.
        let forces = self.weigh(&moved);
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
        check("a displacement of the parent of a reduced body", u, self.parent)?;
        Ok(self.project(u))
    }

    /// Converts a velocity of the parent to the reduced dofs.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`].
    pub fn velocity(&self, v: &[T]) -> Result<Vec<T>> {
        check("a velocity of the parent of a reduced body", v, self.parent)?;
        Ok(self.project(v))
    }

    fn project(&self, u: &[T]) -> Vec<T> {
        let at_contact: Vec<T> = self.contact.iter().map(|&dof| u[dof]).collect();
        let mut modal = u.to_vec();
        if self.boundary == Boundary::CraigBampton {
            self.fields.chunks_exact(self.parent).zip(&at_contact).for_each(|(f, &x)| T::axpy(-x, f, &mut modal));
        }
        let mut momentum = vec![T::zero(); self.parent];
        T::symmetric_product(T::one(), self.parent_mass.as_ref(), &modal, &mut momentum, Accumulate::Replace);
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
        if !self.rest.is_empty() {
            T::axpy(T::one(), &self.rest, &mut field);
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
        let forces = self.weigh(&apart);
        let mut field = vec![T::zero(); self.parent];
        for ((shape, &x), &sigma) in self.shapes.chunks_exact(self.parent).zip(modal).zip(&self.sigma) {
            T::axpy(sigma * x, shape, &mut field);
        }
        for (shape, &force) in self.fields.chunks_exact(self.parent).zip(&forces) {
            T::axpy(force, shape, &mut field);
        }
        self.set_contact(x, &mut field);
        Ok(field)
    }

    /// Sets the contact dofs exactly, which recovery reproduces only to rounding.
    fn set_contact(&self, x: &[T], field: &mut [T]) {
        self.contact.iter().zip(&x[self.frequencies.len()..]).for_each(|(&dof, &u)| field[dof] = u);
    }

    /// The forces of the supports on the body, one for each fixed dof in the order in which they were given, from
    /// displacements and accelerations of the reduced dofs: M a + K u − f at these dofs. Damping forces are left out.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`].
    pub fn support_forces(&self, u: &[T], a: &[T]) -> Result<Vec<T>> {
        let (u, a) = (self.recover_displacement(u)?, self.recover(a)?);
        let mut inertia = vec![T::zero(); self.parent];
        T::symmetric_product(T::one(), self.parent_mass.as_ref(), &a, &mut inertia, Accumulate::Replace);
        let force = |(&dof, column): (&usize, &Vec<(usize, T)>)| {
            let elastic: T = column.iter().map(|&(row, k)| k * u[row]).sum();
            let load = self.parent_load.as_ref().map_or(T::zero(), |load| load[dof]);
            inertia[dof] + elastic - load
        };
        Ok(self.fixed.iter().zip(&self.at_supports).map(force).collect())
    }

    /// Products of columns on the dofs of the parent with a vector there.
    fn along(&self, columns: &[T], x: &[T]) -> Vec<T> {
        columns.chunks_exact(self.parent).map(|column| crate::dense::dot(column, x)).collect()
    }

    /// F⁻¹ x; x itself if contact dofs have mass.
    fn weigh(&self, x: &[T]) -> Vec<T> {
        match self.weights.is_empty() {
            true => x.to_vec(),
            false => self.weights.chunks_exact(x.len()).map(|row| crate::dense::dot(row, x)).collect(),
        }
    }
}

/// M = diag(I, 0) and K = [Ω² + PᵀF⁻¹P, −PᵀF⁻¹; −F⁻¹P, F⁻¹].
fn massless<T: Real>(parts: &Parts<'_, T>, coupling: &[f64]) -> Result<[Dense; 2]> {
    let (count, contacts) = (parts.frequencies.len(), parts.contact.len());
    let (mut mass, mut stiffness) = (Dense::new(count + contacts)?, Dense::new(count + contacts)?);
    // Rows of P are columns of Pᵀ (modes × contact dofs); the same holds for W P.
    let mut weighed = vec![0.0; count * contacts];
    add_product(1.0, count, coupling, &parts.weights, &mut weighed);
    let mut pulled = vec![0.0; count * count];
    let transposed =
        |a: &[f64]| -> Vec<f64> { (0..count * contacts).map(|k| a[k % contacts * count + k / contacts]).collect() };
    transposed_product(contacts, &transposed(coupling), &transposed(&weighed), &mut pulled);
    for i in 0..count {
        mass.set(i, i, 1.0);
        for j in 0..=i {
            let own = if i == j { parts.frequencies[i].powi(2) } else { 0.0 };
            stiffness.set(i, j, own + 0.5 * (pulled[i * count + j] + pulled[j * count + i]));
        }
        for contact in 0..contacts {
            stiffness.set(i, count + contact, -weighed[contact * count + i]);
        }
    }
    for i in 0..contacts {
        for j in 0..=i {
            stiffness.set(count + i, count + j, parts.weights[i * contacts + j]);
        }
    }
    Ok([mass, stiffness])
}

/// M and K projected onto the modes with held contact dofs and the static responses to these dofs.
fn with_mass<T: Real>(parts: &Parts<'_, T>) -> Result<[Dense; 2]> {
    let (count, contacts, n) = (parts.frequencies.len(), parts.contact.len(), parts.stiffness.nrows());
    let (mut mass, mut stiffness) = (Dense::new(count + contacts)?, Dense::new(count + contacts)?);
    let project = |a: SparseColMatRef<'_, usize, T>, onto: &[f64]| -> Result<Vec<f64>> {
        let all: Vec<usize> = (0..n).collect();
        let a = super::pencil::part(a, &all, &all)?;
        let mut products = vec![0.0; parts.fields.len()];
        for (x, y) in parts.fields.chunks_exact(n).zip(products.chunks_exact_mut(n)) {
            f64::symmetric_product(1.0, a.as_ref(), x, y, Accumulate::Replace);
        }
        let mut out = vec![0.0; onto.len() / n * contacts];
        transposed_product(n, onto, &products, &mut out);
        Ok(out)
    };
    let (beside, own) = (project(parts.mass, &parts.shapes)?, project(parts.mass, &parts.fields)?);
    let elastic = project(parts.stiffness, &parts.fields)?;
    for i in 0..count {
        mass.set(i, i, 1.0);
        stiffness.set(i, i, parts.frequencies[i].powi(2));
        for contact in 0..contacts {
            mass.set(i, count + contact, beside[contact * count + i]);
        }
    }
    for i in 0..contacts {
        for j in 0..=i {
            let mean = |a: &[f64]| 0.5 * (a[i * contacts + j] + a[j * contacts + i]);
            mass.set(count + i, count + j, mean(&own));
            stiffness.set(count + i, count + j, mean(&elastic));
        }
    }
    Ok([mass, stiffness])
}

/// C: the modal damping, or Rayleigh damping of all dofs if contact dofs have mass.
fn damping<T: Real>(parts: &Parts<'_, T>, [mass, stiffness]: [&Dense; 2]) -> Result<SparseColMat<usize, T>> {
    let mut matrix = Dense::new(mass.size)?;
    if let (Boundary::CraigBampton, Some([of_mass, of_stiffness])) = (parts.boundary, parts.rayleigh) {
        let entries = mass.values.iter().zip(&stiffness.values);
        matrix.values.iter_mut().zip(entries).for_each(|(c, (m, k))| *c = of_mass * m + of_stiffness * k);
    } else {
        parts.damping.iter().enumerate().for_each(|(k, &c)| matrix.set(k, k, c));
    }
    matrix.sparse()
}
