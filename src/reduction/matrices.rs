//! The matrices of a reduced body over (η, u_b).

use super::pencil;
use crate::error::Result;
use crate::kernels::dense::{add_product, transposed_product};
use crate::kernels::vector::Accumulate;
use crate::memory;
use crate::real::{Kernels, Real};
use crate::sparse::assembled;
use faer::sparse::{SparseColMat, SparseColMatRef};

/// A dense symmetric matrix under construction.
pub(super) struct Dense {
    size: usize,
    values: Vec<f64>,
}

impl Dense {
    pub(super) fn new(size: usize) -> Result<Self> {
        Ok(Self { size, values: memory::zeros(size, size, "the matrices of a reduced body")? })
    }

    pub(super) fn set(&mut self, i: usize, j: usize, value: f64) {
        self.values[i * self.size + j] = value;
        self.values[j * self.size + i] = value;
    }

    /// Converts to sparse without zero entries.
    pub(super) fn sparse<T: Real>(&self) -> Result<SparseColMat<usize, T>> {
        let size = self.size;
        let entries = self.values.iter().enumerate().filter(|(_, value)| **value != 0.0);
        assembled(size, entries.map(|(k, &value)| (k % size, k / size, T::of(value))).collect())
    }
}

/// M = diag(I, 0) and K = [Ω² + PᵀF⁻¹P, −PᵀF⁻¹; −F⁻¹P, F⁻¹].
/// P and F⁻¹ are given contact dof by contact dof.
pub(super) fn massless(frequencies: &[f64], coupling: &[f64], weights: &[f64]) -> Result<[Dense; 2]> {
    let (count, contacts) = (frequencies.len(), coupling.len() / frequencies.len());
    let (mut mass, mut stiffness) = (Dense::new(count + contacts)?, Dense::new(count + contacts)?);
    // Rows of P are columns of Pᵀ (modes × contact dofs); the same holds for W P.
    let mut weighed = vec![0.0; count * contacts];
    add_product(1.0, count, coupling, weights, &mut weighed);
    let mut pulled = vec![0.0; count * count];
    let transposed =
        |a: &[f64]| -> Vec<f64> { (0..count * contacts).map(|k| a[k % contacts * count + k / contacts]).collect() };
    transposed_product(contacts, &transposed(coupling), &transposed(&weighed), &mut pulled);
    for i in 0..count {
        mass.set(i, i, 1.0);
        for j in 0..=i {
            let own = if i == j { frequencies[i].powi(2) } else { 0.0 };
            stiffness.set(i, j, own + 0.5 * (pulled[i * count + j] + pulled[j * count + i]));
        }
        for contact in 0..contacts {
            stiffness.set(i, count + contact, -weighed[contact * count + i]);
        }
    }
    for i in 0..contacts {
        for j in 0..=i {
            stiffness.set(count + i, count + j, weights[i * contacts + j]);
        }
    }
    Ok([mass, stiffness])
}

/// M and K projected onto the modes with held contact dofs and the static responses to these dofs, given as fields on
/// all dofs.
pub(super) fn with_mass<T: Real>(
    [mass_of_parent, stiffness_of_parent]: [SparseColMatRef<'_, usize, T>; 2],
    frequencies: &[f64],
    [shapes, fields]: [&[f64]; 2],
) -> Result<[Dense; 2]> {
    let n = stiffness_of_parent.nrows();
    let (count, contacts) = (frequencies.len(), fields.len() / n);
    let (mut mass, mut stiffness) = (Dense::new(count + contacts)?, Dense::new(count + contacts)?);
    let project = |a: SparseColMatRef<'_, usize, T>, onto: &[f64]| -> Result<Vec<f64>> {
        let all: Vec<usize> = (0..n).collect();
        let a = pencil::part(a, &all, &all)?;
        let mut products = vec![0.0; fields.len()];
        for (x, y) in fields.chunks_exact(n).zip(products.chunks_exact_mut(n)) {
            f64::symmetric_product(1.0, a.as_ref(), x, y, Accumulate::Replace);
        }
        let mut out = vec![0.0; onto.len() / n * contacts];
        transposed_product(n, onto, &products, &mut out);
        Ok(out)
    };
    let (beside, own) = (project(mass_of_parent, shapes)?, project(mass_of_parent, fields)?);
    let elastic = project(stiffness_of_parent, fields)?;
    for i in 0..count {
        mass.set(i, i, 1.0);
        stiffness.set(i, i, frequencies[i].powi(2));
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

/// C: the modal damping, or Rayleigh damping of all dofs.
pub(super) fn damping(modal: &[f64], rayleigh: Option<[f64; 2]>, [mass, stiffness]: [&Dense; 2]) -> Result<Dense> {
    let mut matrix = Dense::new(mass.size)?;
    match rayleigh {
        Some([of_mass, of_stiffness]) => {
            let entries = mass.values.iter().zip(&stiffness.values);
            matrix.values.iter_mut().zip(entries).for_each(|(c, (m, k))| *c = of_mass * m + of_stiffness * k);
        }
        None => modal.iter().enumerate().for_each(|(k, &c)| matrix.set(k, k, c)),
    }
    Ok(matrix)
}
