//! The pencil K − λM of a body on its free dofs, in `f64`: products, the shifted factor K + σM, counts of eigenvalues.
//!
//! Eigenpairs are computed in `f64` for any scalar of the run: rigid motions are distinguished from elastic ones by
//! rounding, and in `f32` the elastic motions of a long bar could not be distinguished.

use crate::error::{Error, Result};
use crate::kernels::inertia::negative_eigenvalues;
use crate::linear_solver::ordering::symbolic_cholesky;
use crate::linear_solver::{Automatic, Factorization, LinearSolver, Ordering, components};
use crate::memory;
use crate::real::Real;
use crate::rounding::{half_digits, rounding};
use crate::sparse::{self, Combination, Product, Symmetry};
use faer::sparse::{SparseColMat, SparseColMatRef, Triplet};

#[derive(Debug)]
pub(super) struct Pencil {
    /// Dofs of the body, and the free ones among them, ascending.
    pub(super) dofs: usize,
    pub(super) free: Vec<usize>,
    pub(super) mass: Operator,
    pub(super) stiffness: Operator,
    /// The pattern of K + σM and K − μM.
    sum: Combination,
    /// Number of free dofs with mass, which is the number of finite eigenvalues.
    pub(super) rank: usize,
    /// σ, from the median of K_ii/M_ii, the squared frequency of single elements.
    pub(super) shift: f64,
    /// Largest error of an eigenvalue from the rounding of K.
    pub(super) blur: f64,
    factor: Box<dyn Factorization<f64>>,
    /// Factorizations so far.
    pub(super) factorizations: usize,
    /// Right-hand sides solved so far.
    pub(super) solves: usize,
    /// Relative rounding of sums of entries of K.
    relative_rounding: f64,
}

/// A symmetric matrix and the method of its products.
#[derive(Debug)]
pub(super) struct Operator {
    matrix: SparseColMat<usize, f64>,
    product: Product<f64>,
}

impl Operator {
    fn new(matrix: SparseColMat<usize, f64>) -> Result<Self> {
        Ok(Self { product: Product::new(matrix.as_ref(), Symmetry::Symmetric)?, matrix })
    }

    /// The products with vectors, column by column.
    pub(super) fn times(&mut self, x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; x.len()];
        self.times_into(x, &mut out);
        out
    }

    /// Writes the products with vectors, column by column.
    pub(super) fn times_into(&mut self, x: &[f64], out: &mut [f64]) {
        let n = self.matrix.ncols();
        for (x, out) in x.chunks_exact(n).zip(out.chunks_exact_mut(n)) {
            self.product.write(1.0, self.matrix.as_ref(), x, out);
        }
    }
}

/// Checks and lists the free dofs, ascending.
pub(super) fn free_dofs(dofs: usize, fixed: &[usize]) -> Result<Vec<usize>> {
    let mut free = vec![true; dofs];
    for &dof in fixed {
        if dof >= dofs {
            return Err(Error::MissingDof { what: "a support", dof, dofs });
        }
        if !std::mem::replace(&mut free[dof], false) {
            return Err(Error::RepeatedDof { what: "the list of supports", dof });
        }
    }
    let free: Vec<usize> = (0..dofs).filter(|&dof| free[dof]).collect();
    match free.is_empty() {
        true => Err(Error::Empty { what: "the list of free dofs", remedy: "leave some dof without a support" }),
        false => Ok(free),
    }
}

/// Checks sizes, symmetry and diagonal masses of M and K.
pub(super) fn check<T: Real>(
    mass: SparseColMatRef<'_, usize, T>,
    stiffness: SparseColMatRef<'_, usize, T>,
) -> Result<usize> {
    sparse::check_symmetric("mass", mass)?;
    sparse::check_symmetric("stiffness", stiffness)?;
    let dofs = stiffness.nrows();
    if dofs == 0 {
        return Err(Error::Empty { what: "the body", remedy: "give it at least one dof" });
    }
    if mass.nrows() != dofs {
        let what = "the mass (the stiffness matrix counts the dofs)";
        return Err(Error::Dimension { what, expected: dofs, found: mass.nrows() });
    }
    for dof in 0..dofs {
        let m = sparse::entry(mass, dof, dof);
        if m < T::zero() {
            return Err(Error::Mass { dof, value: m.value() });
        }
    }
    Ok(dofs)
}

/// Rows `free` and columns `columns` of a matrix; other entries are dropped.
pub(super) fn part<T: Real>(
    a: SparseColMatRef<'_, usize, T>,
    free: &[usize],
    columns: &[usize],
) -> Result<SparseColMat<usize, f64>> {
    let mut place = vec![usize::MAX; a.nrows()];
    free.iter().enumerate().for_each(|(k, &dof)| place[dof] = k);
    let mut entries = Vec::new();
    for (j, &column) in columns.iter().enumerate() {
        for (&row, value) in a.row_idx_of_col_raw(column).iter().zip(a.val_of_col(column)) {
            if place[row] != usize::MAX {
                entries.push(Triplet::new(place[row], j, value.value()));
            }
        }
    }
    SparseColMat::try_new_from_triplets(free.len(), columns.len(), &entries)
        .map_err(|_| Error::OutOfMemory { what: "the free part of a matrix", bytes: None })
}

impl Pencil {
    /// For checked matrices.
    pub(super) fn new<T: Real>(
        mass: SparseColMatRef<'_, usize, T>,
        stiffness: SparseColMatRef<'_, usize, T>,
        free: Vec<usize>,
    ) -> Result<Self> {
        let dofs = stiffness.nrows();
        let (mass, stiffness) = (part(mass, &free, &free)?, part(stiffness, &free, &free)?);
        let n = free.len();
        let (k, m) = (stiffness.as_ref(), mass.as_ref());
        let masses: Vec<f64> = (0..n).map(|dof| sparse::entry(m, dof, dof)).collect();
        let mut ratios: Vec<f64> =
            (0..n).filter(|&dof| masses[dof] > 0.0).map(|dof| sparse::entry(k, dof, dof) / masses[dof]).collect();
        ratios.sort_by(f64::total_cmp);
        let Some(&median) = ratios.get(ratios.len() / 2) else {
            return Err(Error::Mass { dof: free[0], value: 0.0 });
        };
        let relative_rounding = rounding(T::one()).value();
        // Small compared with the squared frequencies of elastic motions except for very long chains, and large
        // compared with the rounding of K. If all bodies are rigid there is no frequency, and any shift works.
        let shift = if median > 0.0 { median * half_digits::<f64>().max(relative_rounding) } else { 1.0 };
        let sum = Combination::new(n, &[], &[k.symbolic(), m.symbolic()])?;
        let mut pencil = Self {
            dofs,
            rank: ratios.len(),
            shift,
            blur: rounding(median),
            factor: Automatic.analyze(sum.pattern(), &[])?,
            factorizations: 0,
            solves: 0,
            relative_rounding,
            sum,
            free,
            mass: Operator::new(mass)?,
            stiffness: Operator::new(stiffness)?,
        };
        let values = pencil.shifted(shift)?;
        pencil.factor.factorize(pencil.sum.view(&values)).map_err(|error| match error {
            Error::Singular { dof, .. } => {
                Error::Singular { matrix: "stiffness matrix (with a small share of the mass)", dof: pencil.free[dof] }
            }
            other => other,
        })?;
        pencil.factor.release();
        pencil.factorizations += 1;
        Ok(pencil)
    }

    /// Number of free dofs.
    pub(super) fn size(&self) -> usize {
        self.free.len()
    }

    /// Number of unconnected parts.
    pub(super) fn bodies(&self) -> usize {
        components(self.sum.pattern()).1.len()
    }

    /// Values of K + σM.
    fn shifted(&self, shift: f64) -> Result<Vec<f64>> {
        let mut values = memory::zeros(self.sum.len(), 1, "the shifted stiffness matrix")?;
        self.sum.fill(&[(1.0, self.stiffness.matrix.val()), (shift, self.mass.matrix.val())], None, &mut values);
        Ok(values)
    }

    /// `x ← (K + σM)⁻¹ x`, column by column.
    pub(super) fn solve(&mut self, x: &mut [f64]) -> Result<()> {
        self.solves += x.len() / self.size();
        self.factor.solve(x)
    }

    /// Number of eigenvalues below μ, from the signs of the pivots of K − μM (Sylvester's law of inertia); `None` if
    /// that factorization fails.
    pub(super) fn count_below(&mut self, mu: f64) -> Result<Option<usize>> {
        let values = self.shifted(-mu)?;
        let symbolic = symbolic_cholesky(&Ordering::default(), self.sum.pattern(), &[])?;
        self.factorizations += 1;
        // Dofs without mass, on which K is positive definite, add only positive eigenvalues.
        Ok(negative_eigenvalues(&symbolic, self.sum.view(&values)))
    }

    /// The Rayleigh quotient of a motion of unit modal mass. Zero if it is rigid, that is, if its strain energy is
    /// within the rounding of its sum of terms. `product` is K x.
    pub(super) fn quotient(&self, x: &[f64], product: &[f64]) -> f64 {
        let energy: f64 = x.iter().zip(product).map(|(x, f)| x * f).sum();
        let k = self.stiffness.matrix.as_ref();
        let column = |j: usize| -> f64 {
            let entries = k.row_idx_of_col_raw(j).iter().zip(k.val_of_col(j));
            entries.map(|(&i, &value)| (value * x[i]).abs()).sum::<f64>() * x[j].abs()
        };
        let size: f64 = (0..x.len()).map(column).sum();
        if energy.abs() <= self.relative_rounding * size { 0.0 } else { energy }
    }

    /// Extends columns on the free dofs to all dofs.
    pub(super) fn expand(&self, x: &[f64]) -> Vec<f64> {
        let n = self.size();
        let mut out = vec![0.0; x.len() / n * self.dofs];
        for (x, out) in x.chunks_exact(n).zip(out.chunks_exact_mut(self.dofs)) {
            self.free.iter().zip(x).for_each(|(&dof, &x)| out[dof] = x);
        }
        out
    }

    /// Restricts columns on all dofs to the free dofs.
    pub(super) fn restrict(&self, x: &[f64]) -> Vec<f64> {
        x.chunks_exact(self.dofs).flat_map(|x| self.free.iter().map(|&dof| x[dof])).collect()
    }
}
