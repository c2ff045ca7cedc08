//! Preconditioned conjugate gradients: large bodies at small steps.

mod deflation;
mod parts;

use super::coarse_space;
use super::{Factorization, Fingerprint, LinearSolver, check_analysis};
use crate::error::{Error, Result};
use crate::kernels::conjugate_gradients::{self, Blocks, Iteration, Outcome, Vectors};
use crate::memory;
use crate::real::Real;
use crate::sparse;
use deflation::{Deflation, Places};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use parts::Parts;
use std::ops::Range;

/// Preconditioned conjugate gradients (Hestenes and Stiefel, J. Res. Nat. Bur. Standards 49, 1952) for symmetric
/// positive definite matrices: an iteration instead of a factor, for large solid bodies at small steps.
///
/// The preconditioner is a forward and a backward Gauss–Seidel sweep, (D + L) D⁻¹ (D + Lᵀ), in the form of Eisenstat
/// (SIAM J. Sci. Stat. Comput. 2, 1981), in which an iteration costs little more than a product with A. D are the
/// diagonal blocks of the two or three dofs of a node, if the pattern of the matrix has such blocks.
///
/// At small steps inertia dominates the effective matrix w_ā/h² M + K: its condition number is about 1 + Co² with the
/// Courant number Co of the step, for any size of the body, and few iterations suffice. `docs/performance.md` gives
/// the Courant number below which they are faster than the sweeps over the factor of [`Cholesky`](super::Cholesky).
/// They need the memory of half the matrix; factors of solids need ten to a hundred times as much.
///
/// At Courant numbers of about eight and more, for matrices whose condition number is estimated above 40, directions
/// are kept A-orthogonal to a coarse space, the translations of aggregates of about 125 nodes (deflation: Nicolaides,
/// SIAM J. Numer. Anal. 24, 1987). On blocks twice the Courant number then takes 1.3 to 1.5 times as many iterations
/// (`cargo bench --bench iterative`, in the repository), instead of twice as many. The space needs half as much memory
/// again.
///
/// Every solve starts from zero, or in the coarse space, and uses no data of earlier ones. Steps solve for the
/// increment from the predicted motion, so zero is the prediction itself, and a run resumed from a clone is bitwise the
/// same.
///
/// The residual is measured in the norm of the preconditioner, √(rᵀ P⁻¹ r), relative to the right-hand side. This
/// does not depend on the units of the dofs and is close to the error in the energy norm of A. An iteration ends at
/// the [`tolerance`](Self::tolerance), or when updates become too small for the scalar to resolve, as they always do
/// in `f32` with the default tolerance.
///
/// It offers no [`condensation`](Factorization::condensation): contact is solved by products with A, however few rows
/// press. With [`Assembly::Always`](crate::contact_solver::Assembly::Always) it takes a full solve for each pressed row
/// (kept while rows and matrix are unchanged) and one more per step.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{ConjugateGradients, LinearRows, LinearSystem, Newmark, Simulation};
///
/// // A bar of 100 elements against a wall, at a Courant number of one.
/// let n = 100;
/// let stiffness: Vec<_> = (0..n)
///     .flat_map(|e| [(e, e, 1.0), (e + 1, e + 1, 1.0), (e, e + 1, -1.0), (e + 1, e, -1.0)])
///     .map(|(i, j, k)| Triplet::new(i, j, k))
///     .collect();
/// let stiffness = SparseColMat::<usize, f64>::try_new_from_triplets(n + 1, n + 1, &stiffness)?;
/// let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0; n + 1], stiffness)?, Newmark::trapezoidal(), 1.0)
///     .velocity(vec![0.1; n + 1])
///     .constraint(LinearRows::new().unilateral(&[(n, -1.0)], 0.25))
///     .linear_solver(ConjugateGradients::default())
///     .build()?;
/// run.run_until(50.0, &mut ())?;
/// assert!(run.state().contacts().closed()[0] && run.gaps()[0].abs() < 1e-10);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// A factorization fails as [`Cholesky`](super::Cholesky) does for wrong entries and asymmetry, and with
/// [`Error::Singular`] for diagonal blocks that are not positive definite. A solve fails with
/// [`Error::LinearNotConverged`], and with [`Error::Indefinite`] if it finds a direction in which A is not positive
/// definite: only some right-hand sides detect an indefinite matrix. [`Error::Dimension`] for right-hand sides of
/// another size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConjugateGradients {
    tolerance: f64,
    iterations: usize,
}

impl Default for ConjugateGradients {
    /// Tolerance 1e-10, at most 1000 iterations.
    fn default() -> Self {
        Self { tolerance: 1e-10, iterations: 1000 }
    }
}

impl ConjugateGradients {
    /// The residual at which a solve ends, relative to the right-hand side, both in the norm of the preconditioner;
    /// 1e-10 by default.
    ///
    /// With the default, energy, momentum and displacements of a run with impacts differ from a run with
    /// [`Cholesky`](super::Cholesky) by about a fifth of the tolerance (`cargo bench --bench iterative`), less than
    /// the error of any practical step. Each further digit takes about one more iteration. Errors do not grow with
    /// smaller steps, because each solve is for the increment of its step.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] unless 0 ≤ tolerance < 1. With zero a solve continues to rounding.
    pub fn tolerance(self, tolerance: f64) -> Result<Self> {
        if (0.0..1.0).contains(&tolerance) {
            return Ok(Self { tolerance, ..self });
        }
        let name = "the tolerance of conjugate gradients";
        Err(Error::Parameter { name, value: tolerance, range: "at least zero and less than one" })
    }

    /// The iteration limit of a solve, 1000 by default; at least one iteration is made.
    #[must_use]
    pub fn iterations(self, iterations: usize) -> Self {
        Self { iterations, ..self }
    }

    /// The values of [`tolerance`](Self::tolerance) and [`iterations`](Self::iterations).
    pub(crate) fn limits(self) -> (f64, usize) {
        (self.tolerance, self.iterations)
    }
}

/// A scaled matrix in blocks, and memory for the iteration.
struct Matrix<T: Real> {
    settings: ConjugateGradients,
    dofs: usize,
    fingerprint: Fingerprint,
    /// Dofs of a block: 1, 2 or 3.
    size: usize,
    /// The order of the rows of blocks.
    parts: Parts,
    /// Blocks below the diagonal, row by row: their columns, ascending, and values.
    pointers: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<T>,
    /// C⁻¹ of the diagonal blocks C Cᵀ.
    scaling: Vec<T>,
    /// The coarse space, where its dofs are, and whether the present matrix uses it.
    deflation: Option<Deflation<T>>,
    deflates: bool,
    places: Option<Places>,
    /// Five vectors.
    vectors: Vec<T>,
    /// Memory of the check of symmetry.
    cursor: Vec<usize>,
    state: Ready,
    iterations: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ready {
    No,
    Yes,
}

impl<T: Real> std::fmt::Debug for Matrix<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (dofs, blocks) = (self.dofs, self.columns.len());
        let debug = &mut f.debug_struct("Matrix");
        debug.field("settings", &self.settings).field("dofs", &dofs).field("size", &self.size);
        debug.field("blocks", &blocks).finish_non_exhaustive()
    }
}

/// Pointers and columns of the blocks of `size`² below the diagonal, row by row.
fn blocks(pattern: SymbolicSparseColMatRef<'_, usize>, size: usize) -> Result<(Vec<usize>, Vec<u32>)> {
    let nodes = pattern.ncols() / size;
    let (mut pointers, mut columns) = (Vec::with_capacity(nodes + 1), Vec::<u32>::new());
    pointers.push(0);
    for node in 0..nodes {
        let start = columns.len();
        let others = (node * size..(node + 1) * size).map(|dof| pattern.row_idx_of_col_raw(dof).len()).sum();
        memory::make_room(&mut columns, others, "the blocks of an iterative solver")?;
        // The pattern is symmetric: columns are rows.
        for dof in node * size..(node + 1) * size {
            let others = pattern.row_idx_of_col_raw(dof).iter().map(|other| other / size);
            for other in others.take_while(|other| *other < node) {
                let other =
                    u32::try_from(other).map_err(|_| Error::OutOfMemory { what: "indices of 32 bits", bytes: None })?;
                if columns.len() == start || columns[columns.len() - 1] != other {
                    columns.push(other);
                }
            }
        }
        columns[start..].sort_unstable();
        let mut kept = start;
        for at in start..columns.len() {
            if at == start || columns[at] != columns[kept - 1] {
                columns[kept] = columns[at];
                kept += 1;
            }
        }
        columns.truncate(kept);
        pointers.push(kept);
    }
    Ok((pointers, columns))
}

impl<T: Real> LinearSolver<T> for ConjugateGradients {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<T>>> {
        let dofs = check_analysis(pattern, last)?;
        // The block size that needs the least memory: larger blocks store zeros, smaller ones more indices, each half
        // the size of a scalar.
        let mut best: Option<(usize, Vec<usize>, Vec<u32>)> = None;
        for size in [3, 2, 1].into_iter().filter(|size| dofs.is_multiple_of(*size)) {
            let (pointers, columns) = blocks(pattern, size)?;
            let cost = |size: usize, blocks: usize| blocks * (2 * size * size + 1);
            if best.as_ref().is_none_or(|(other, _, least)| cost(size, columns.len()) < cost(*other, least.len())) {
                best = Some((size, pointers, columns));
            }
        }
        let Some((size, mut pointers, mut columns)) = best else {
            return Err(Error::Empty { what: "the pattern", remedy: "a system has at least one dof" });
        };
        let parts = Parts::find(&pointers, &columns, size)?;
        parts.sort(&mut pointers, &mut columns)?;
        let what = "a matrix in blocks";
        let values = memory::zeros(columns.len(), size * size, what)?;
        let scaling = memory::zeros(dofs, size, what)?;
        Ok(Box::new(Matrix {
            settings: *self,
            dofs,
            fingerprint: Fingerprint::of(pattern),
            size,
            parts,
            pointers,
            columns,
            values,
            scaling,
            deflation: None,
            deflates: false,
            places: None,
            vectors: memory::zeros(dofs, 5, "the vectors of conjugate gradients")?,
            cursor: Vec::with_capacity(dofs),
            state: Ready::No,
            iterations: 0,
        }))
    }
}

impl<T: Real> Matrix<T> {
    /// Copies the entries of a symmetric matrix. Returns an estimate of the condition number of the scaled matrix: the
    /// stiffest motion has twice the sum of the diagonal, a translation the sum of all entries. Rows of prescribed dofs
    /// have a diagonal of one in any unit, and do not count.
    fn fill(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<f64> {
        let Self { size, parts, pointers, columns, values, scaling, .. } = self;
        let size = *size;
        values.fill(T::zero());
        scaling.fill(T::zero());
        let (mut diagonal, mut all) = (T::zero(), T::zero());
        for dof in 0..a.ncols() {
            let (row, place) = (parts.place(dof / size), dof % size);
            let own: Range<usize> = pointers[row]..pointers[row + 1];
            let mut at = own.start;
            let is_coupled = coarse_space::is_coupled(a, dof);
            for (&other, &value) in a.row_idx_of_col_raw(dof).iter().zip(a.val_of_col(dof)) {
                let (column, within) = (parts.place(other / size), other % size);
                if is_coupled && within == place {
                    all += value;
                    diagonal += if other == dof { value } else { T::zero() };
                }
                if column >= row {
                    if column == row {
                        scaling[(row * size + within) * size + place] = value;
                    }
                    continue;
                }
                // Most columns follow in the order in which they are stored.
                if at == own.end || columns[at] as usize != column {
                    at = own.start + columns[own.clone()].partition_point(|&other| (other as usize) < column);
                }
                if at == own.end || columns[at] as usize != column {
                    let part = "conjugate gradients".into();
                    return Err(Error::Incompatible {
                        part,
                        reason: "the matrix has another pattern than was analyzed",
                    });
                }
                values[(at * size + within) * size + place] = value;
                at += usize::from(within + 1 == size);
            }
        }
        Ok((T::of(2.0) * diagonal / all).value())
    }
}

impl<T: Real> Factorization<T> for Matrix<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        self.state = Ready::No;
        self.fingerprint.check(a)?;
        sparse::check_symmetric_in("effective", a, &mut self.cursor)?;
        let condition = self.fill(a)?;
        T::scale_blocks(self.size, (&self.pointers, &self.columns), &mut self.values, &mut self.scaling)
            .map_err(|dof| Error::Singular { matrix: "effective matrix", dof: self.parts.dof(dof, self.size) })?;
        self.deflates = condition > coarse_space::WORTHWHILE && self.form_coarse_space(a)?;
        self.state = Ready::Yes;
        Ok(())
    }

    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        let Self { settings, dofs, size, parts, pointers, columns, values, scaling, vectors, .. } = self;
        let mut deflation = self.deflation.as_mut().filter(|_| self.deflates);
        if self.state == Ready::No {
            let part = "conjugate gradients".into();
            return Err(Error::Incompatible { part, reason: "no matrix has been factorized" });
        }
        if !rhs.len().is_multiple_of(*dofs) {
            return Err(Error::Dimension { what: "right-hand side", expected: *dofs, found: rhs.len() });
        }
        let lower = Blocks { pointers, columns, values };
        let (tolerance, limit) = (settings.tolerance, settings.iterations);
        let resolution = T::epsilon().value();
        let iteration = Iteration { lower, scaling, parts: &parts.ends, tolerance, resolution, limit };
        // At least one, by which contact knows that solves iterate.
        self.iterations = 1;
        for column in rhs.chunks_exact_mut(*dofs) {
            for (row, values) in column.chunks_exact(*size).enumerate() {
                vectors[*dofs + parts.place(row) * *size..][..*size].copy_from_slice(values);
            }
            let space = deflation.as_deref_mut().map(|space| -> &mut dyn conjugate_gradients::Deflation<T> { space });
            let [outcome] = T::conjugate_gradients(*size, &iteration, space, Vectors::of(vectors, *dofs));
            if let Some(error) = deflation.as_deref_mut().and_then(Deflation::failure) {
                return Err(error);
            }
            for (row, values) in column.chunks_exact_mut(*size).enumerate() {
                values.copy_from_slice(&vectors[parts.place(row) * *size..][..*size]);
            }
            let iterations = match outcome {
                Outcome::Converged { iterations } => iterations,
                Outcome::NotConverged { iterations, residual } => {
                    let method = "conjugate gradients";
                    return Err(Error::LinearNotConverged { method, iterations, residual, tolerance });
                }
                Outcome::Indefinite { curvature, dof } => {
                    return Err(Error::Indefinite { curvature, dof: parts.dof(dof, *size) });
                }
            };
            self.iterations = self.iterations.max(iterations);
        }
        Ok(())
    }

    fn is_symmetric(&self) -> bool {
        true
    }

    fn stored_values(&self) -> usize {
        let of_space = self.deflation.as_ref().map_or(0, Deflation::stored_values);
        of_space + [&self.values, &self.scaling, &self.vectors].iter().map(|part| part.len()).sum::<usize>()
    }

    fn iterations(&self) -> usize {
        self.iterations
    }
}
