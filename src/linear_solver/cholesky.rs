//! Sparse Cholesky: faer's simplicial L D Lᵀ for chains (with sweeps of this crate), a supernodal L Lᵀ otherwise.

use super::ordering::{self, Ordering};
use super::shared::Analyses;
use super::{Condensation, Factorization, Fingerprint, LinearSolver, check_analysis};
use crate::error::{Error, Result};
use crate::kernels::cholesky::{RightHandSide, Simplicial, Supernodal};
use crate::kernels::elimination::Elimination;
use crate::kernels::forest::Forest;
use crate::kernels::interleaved_sweep::WIDEST;
use crate::kernels::supernodal::{Problem, Workspace};
use crate::real::Real;
use crate::rounding::rounding;
use crate::threads::PerThread;
use crate::{memory, sparse};
use faer::dyn_stack::{MemBuffer, StackReq};
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use faer::sparse::linalg::cholesky::{SymbolicCholesky, SymbolicCholeskyRaw};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use std::ops::Range;
use std::sync::Arc;

/// Sparse Cholesky factorization of symmetric positive definite matrices. The contact dofs are eliminated last, the
/// others in an order with little fill ([`Ordering`]).
///
/// faer chooses between a simplicial factor (long thin structures) and a supernodal one (plates, solids). A matrix
/// that is not positive definite is rejected with the dof of the failing pivot, an unsymmetric one with its worst
/// entry. In `f32` fill entries far from the diagonal may become subnormal and slow a factorization down several
/// times; see `docs/design.md`.
///
/// With the feature `rayon` the threads of the caller's pool compute and sweep large factors. Results are bitwise the
/// same for any number of threads.
///
/// [`analyze`](LinearSolver::analyze) also rejects an order that does not fit the pattern: [`Error::Dimension`],
/// [`Error::MissingDof`], [`Error::RepeatedDof`], [`Error::NotFinite`].
#[derive(Clone, Debug, Default)]
pub struct Cholesky {
    ordering: Ordering,
    shared: Option<Analyses>,
}

impl Cholesky {
    /// With the given ordering; `default()` is [`Ordering::Automatic`].
    ///
    /// ```
    /// use contact_dynamics::Cholesky;
    /// use contact_dynamics::linear_solver::Ordering;
    ///
    /// // Two nodes with three dofs each.
    /// let nodes = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
    /// let places = nodes.iter().flat_map(|&node| [node; 3]).collect();
    /// let solver = Cholesky::ordered(Ordering::Coordinates(places));
    /// # let _ = solver;
    /// ```
    pub fn ordered(ordering: Ordering) -> Self {
        Self { ordering, shared: None }
    }

    /// Shares analyses among all clones of this value: a run whose matrix has the pattern of an earlier one reuses
    /// its elimination order and the memory for it. For studies of many runs, in parallel or in sequence; the factors
    /// are bitwise the same as without sharing. The last sixteen analyses are kept as long as a clone exists.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{Cholesky, LinearSystem, Newmark, Simulation};
    ///
    /// let solver = Cholesky::default().sharing();
    /// let mut last = Vec::new();
    /// for stiffness in [1.0, 4.0, 9.0] {
    ///     // Two masses on a spring: the first run analyzes, the others do not.
    ///     let entries = [(0, 0, 1.0), (1, 1, 1.0), (0, 1, -1.0), (1, 0, -1.0)];
    ///     let k = entries.map(|(i, j, k)| Triplet::new(i, j, stiffness * k));
    ///     let k = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &k)?;
    ///     let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0; 2], k)?, Newmark::trapezoidal(), 0.01)
    ///         .velocity(vec![1.0, 0.0])
    ///         .linear_solver(solver.clone())
    ///         .build()?;
    ///     run.run_until(1.0, &mut ())?;
    ///     last.push(run.state().displacement()[0]);
    /// }
    /// assert!(last.iter().is_sorted_by(|softer, stiffer| softer > stiffer));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn sharing(self) -> Self {
        Self { shared: Some(self.shared.unwrap_or_default()), ..self }
    }

    fn symbolic(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Arc<SymbolicCholesky<usize>>> {
        match &self.shared {
            Some(analyses) => analyses.symbolic(&self.ordering, pattern, last),
            None => Ok(Arc::new(ordering::symbolic_cholesky(&self.ordering, pattern, last)?)),
        }
    }

    /// Number of scalars in the factor of a pattern (both triangles) with `last` (ascending) eliminated last, without
    /// allocating the factor; equals the later [`Factorization::stored_values`].
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{Cholesky, Factorization, LinearSolver};
    ///
    /// let entries: Vec<_> = (0..9).flat_map(|i| [(i, i, 2.0), (i, i + 1, -1.0), (i + 1, i, -1.0)]).collect();
    /// let entries: Vec<_> = entries.into_iter().chain([(9, 9, 2.0)]).map(|(i, j, x)| Triplet::new(i, j, x)).collect();
    /// let chain = SparseColMat::<usize, f64>::try_new_from_triplets(10, 10, &entries)?;
    /// let solver = Cholesky::default();
    /// let scalars = solver.estimate(chain.symbolic(), &[9])?;
    /// assert_eq!(scalars, 19); // ten pivots, nine entries below them
    /// let factor: Box<dyn Factorization<f64>> = solver.analyze(chain.symbolic(), &[9])?;
    /// assert_eq!(factor.stored_values(), scalars);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// The errors of [`analyze`](LinearSolver::analyze); [`Error::OutOfMemory`] only if the analysis itself runs out
    /// of memory.
    pub fn estimate(&self, pattern: SymbolicSparseColMatRef<'_, usize>, last: &[usize]) -> Result<usize> {
        check_analysis(pattern, last)?;
        Ok(self.symbolic(pattern, last)?.len_val())
    }

    /// The elimination order of the dofs of a pattern, with `last` (ascending) after the others: the first entry is
    /// the dof eliminated first. It can be stored with a model: with [`Ordering::Given`] a later run skips the search
    /// and gets the same factor.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::Cholesky;
    /// use contact_dynamics::linear_solver::Ordering;
    ///
    /// // A star: its center last, so that nothing fills in.
    /// let entries: Vec<_> = (0..5).flat_map(|i| [(i, i, 2.0), (i, 5, -1.0), (5, i, -1.0)]).collect();
    /// let entries: Vec<_> = entries.into_iter().chain([(5, 5, 9.0)]).map(|(i, j, x)| Triplet::new(i, j, x)).collect();
    /// let star = SparseColMat::<usize, f64>::try_new_from_triplets(6, 6, &entries)?;
    /// let order = Cholesky::default().order(star.symbolic(), &[])?;
    /// assert!(order[4..].contains(&5)); // with the last arm of the star it is as good
    ///
    /// let kept = Cholesky::ordered(Ordering::Given(order.clone()));
    /// assert_eq!(kept.order(star.symbolic(), &[])?, order);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// The errors of [`estimate`](Self::estimate).
    pub fn order(&self, pattern: SymbolicSparseColMatRef<'_, usize>, last: &[usize]) -> Result<Vec<usize>> {
        check_analysis(pattern, last)?;
        let symbolic = self.symbolic(pattern, last)?;
        Ok(symbolic.perm().map_or_else(|| (0..pattern.nrows()).collect(), |perm| perm.arrays().0.to_vec()))
    }
}

struct Factor<T: Real> {
    fingerprint: Fingerprint,
    symbolic: Arc<SymbolicCholesky<usize>>,
    values: Vec<T>,
    method: Method<T>,
    /// Pivots in the numbering of the matrix.
    pivots: Vec<T>,
    /// One right-hand side in the order of elimination; its entries in the forest are in the work vectors.
    sweep: Vec<T>,
    /// The dofs eliminated last, by their number in the list of contact dofs, in the order of elimination.
    interface: Vec<usize>,
    /// One column on the interface in the order of elimination.
    trailing: Vec<T>,
    /// Memory for the rows of any supernode.
    below: Vec<T>,
    /// Memory of the check of symmetry.
    cursor: Vec<usize>,
}

/// How the factor is computed and swept.
#[expect(clippy::large_enum_variant, reason = "one of them a factor")]
enum Method<T> {
    /// A simplicial L D Lᵀ, with the scratch of its factorization.
    Simplicial(Option<MemBuffer>),
    /// A supernodal L Lᵀ.
    Supernodal(Supernodes<T>),
}

/// The data of a supernodal factor.
struct Supernodes<T> {
    elimination: Elimination,
    /// Workspaces of threads for a factorization.
    workspaces: Option<PerThread<Workspace<T>>>,
    /// Memory of solves for several right-hand sides.
    together: Vec<T>,
    /// The interior, and the work vectors of its supernodes.
    forest: Forest,
    work: Vec<T>,
    /// The largest number of rows of a supernode, which bounds the rows below any part of its columns.
    tallest: usize,
}

/// In a matrix with `n` dofs a pivot below this share of its diagonal entry is zero up to rounding.
pub(crate) fn negligible<T: Real>(n: usize) -> T {
    rounding(T::of((n as f64).sqrt()))
}

impl<T: Real> std::fmt::Debug for Factor<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Factor").field("values", &self.values.len()).finish_non_exhaustive()
    }
}

impl<T: Real> LinearSolver<T> for Cholesky {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<T>>> {
        check_analysis(pattern, last)?;
        let symbolic = self.symbolic(pattern, last)?;
        let values = memory::zeros(symbolic.len_val(), 1, "a sparse Cholesky factor")?;
        let n = symbolic.nrows();
        let first = n - last.len();
        let place = |dof: usize| symbolic.perm().map_or(dof, |perm| perm.arrays().1[dof]);
        let mut interface = vec![0; last.len()];
        last.iter().enumerate().for_each(|(number, &dof)| interface[place(dof) - first] = number);
        let method = match symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(_) => Method::Simplicial(Some(buffer(T::cholesky_scratch(&symbolic))?)),
            SymbolicCholeskyRaw::Supernodal(raw) => Method::Supernodal(Supernodes::new(raw, first)?),
        };
        let tallest = match &method {
            Method::Simplicial(_) => 0,
            Method::Supernodal(supernodes) => supernodes.tallest,
        };
        Ok(Box::new(Factor {
            fingerprint: Fingerprint::of(pattern),
            symbolic,
            values,
            method,
            pivots: vec![T::zero(); n],
            sweep: vec![T::zero(); n],
            interface,
            trailing: vec![T::zero(); last.len()],
            below: vec![T::zero(); tallest],
            cursor: Vec::new(),
        }))
    }
}

/// Scratch of faer's kernels.
fn buffer(size: StackReq) -> Result<MemBuffer> {
    let bytes = Some(size.unaligned_bytes_required());
    MemBuffer::try_new(size).map_err(|_| Error::OutOfMemory { what: "sparse Cholesky scratch", bytes })
}

/// Workspaces of the threads of the current pool for a factorization.
fn workspaces<T: Real>(dofs: usize) -> Result<PerThread<Workspace<T>>> {
    PerThread::new(|| T::supernodal_workspace(dofs))
        .ok_or(Error::OutOfMemory { what: "sparse Cholesky scratch", bytes: None })
}

impl<T: Real> Supernodes<T> {
    /// For a factor whose columns from `first` on are the interface.
    fn new(raw: &SymbolicSupernodalCholesky<usize>, first: usize) -> Result<Self> {
        let forest = Forest::new(raw, first)?;
        let height = |s: usize| {
            let columns = raw.supernode_end()[s] - raw.supernode_begin()[s];
            columns + raw.supernode(s).pattern().len()
        };
        let tallest = (0..raw.n_supernodes()).map(height).max().unwrap_or(0);
        let mut supernodes = Self {
            elimination: Elimination::new(raw)?,
            workspaces: Some(workspaces(raw.nrows())?),
            together: Vec::new(),
            work: memory::zeros(forest.work(), 1, "the sweeps of a sparse Cholesky factor")?,
            forest,
            tallest,
        };
        let rows = supernodes.rows(raw.nrows() - first);
        supernodes.together = memory::zeros(rows, WIDEST, "the interface of a sparse Cholesky factor")?;
        Ok(supernodes)
    }

    /// Rows of memory for solving several right-hand sides on the interface together.
    fn rows(&self, interface: usize) -> usize {
        if interface > 0 { interface + self.tallest } else { 0 }
    }
}

impl<T: Real> Factor<T> {
    fn size(&self) -> usize {
        self.symbolic.nrows()
    }

    /// Columns of the interface in the order of elimination; the columns of the interior precede them.
    fn trailing(&self) -> Range<usize> {
        self.size() - self.interface.len()..self.size()
    }

    /// Reads a right-hand side, and sweeps forward over the columns before `end`.
    fn forward(&mut self, rhs: &[T], end: usize) {
        let Self { symbolic, values, method, sweep: x, below, .. } = self;
        let order = symbolic.perm().map(|perm| perm.arrays().0);
        let behind = match method {
            Method::Simplicial(_) => 0,
            Method::Supernodal(supernodes) => supernodes.forest.end,
        };
        let x = &mut x[behind..];
        match order {
            Some(order) => x.iter_mut().zip(&order[behind..]).for_each(|(x, &dof)| *x = rhs[dof]),
            None => x.copy_from_slice(&rhs[behind..]),
        }
        if let (Method::Supernodal(Supernodes { forest, work, .. }), SymbolicCholeskyRaw::Supernodal(symbolic)) =
            (method, symbolic.raw())
        {
            T::forest_forward(Supernodal { symbolic, values }, forest, rhs, order, work);
            for &root in &forest.roots {
                for (&place, &change) in forest.places(root).iter().zip(&work[forest.update(root)]) {
                    x[place] += change;
                }
            }
        }
        sweep(Sweep::Forward, (symbolic, values), behind..end, x, behind, below);
    }

    /// Sweeps backward over the columns before `end`; later columns are already solved. Writes the solution in the
    /// order of the matrix.
    fn backward(&mut self, end: usize, solution: &mut [T]) {
        let Self { symbolic, values, method, sweep: x, below, .. } = self;
        let order = symbolic.perm().map(|perm| perm.arrays().0);
        let mut put = |columns: Range<usize>, x: &[T]| match order {
            Some(order) => x.iter().zip(&order[columns]).for_each(|(&x, &dof)| solution[dof] = x),
            None => solution[columns.clone()].copy_from_slice(&x[..columns.len()]),
        };
        let (Method::Supernodal(Supernodes { forest, work, .. }), SymbolicCholeskyRaw::Supernodal(raw)) =
            (method, symbolic.raw())
        else {
            sweep(Sweep::Backward, (symbolic, values), 0..end, x, 0, below);
            return put(0..x.len(), x);
        };
        let (behind, size) = (forest.end, x.len());
        let x = &mut x[behind..];
        sweep(Sweep::Backward, (symbolic, values), behind..end, x, behind, below);
        put(behind..size, x);
        for &root in &forest.roots {
            for (&place, known) in forest.places(root).iter().zip(&mut work[forest.update(root)]) {
                *known = x[place];
            }
        }
        T::forest_backward(Supernodal { symbolic: raw, values }, forest, work);
        for s in 0..forest.count() {
            put(forest.columns(s), &work[forest.offsets[s]..]);
        }
    }

    fn solve_one(&mut self, column: &mut [T]) {
        let size = self.size();
        self.forward(column, size);
        self.backward(size, column);
    }

    /// Solves for several columns together with the trailing block that starts at column `first`; returns whether the
    /// factor is supernodal.
    fn solve_together(&mut self, first: usize, columns: &mut [T]) -> Result<bool> {
        let Self { symbolic, values, method, interface, .. } = self;
        let (Method::Supernodal(Supernodes { together, tallest, .. }), SymbolicCholeskyRaw::Supernodal(raw)) =
            (method, symbolic.raw())
        else {
            return Ok(false);
        };
        let rows = raw.nrows() - first + *tallest;
        if together.len() < rows * WIDEST {
            memory::grow(together, rows, WIDEST, "right-hand sides of a sparse Cholesky factor")?;
        }
        let order = if first > 0 { Some(&interface[..]) } else { symbolic.perm().map(|perm| perm.arrays().0) };
        T::supernodal_solve(&Supernodal { symbolic: raw, values }, first, order, columns, together);
        Ok(true)
    }

    /// Solves S x = f for one column in `trailing`, in the order of elimination.
    fn solve_trailing(&mut self) {
        let columns = self.trailing();
        let Self { symbolic, values, below, trailing: x, .. } = self;
        for direction in [Sweep::Forward, Sweep::Backward] {
            sweep(direction, (symbolic, values), columns.clone(), x, columns.start, below);
        }
    }
}

/// Direction of a sweep over columns of the factor; the forward sweep of a simplicial factor includes the division by
/// D.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sweep {
    Forward,
    Backward,
}

/// Sweeps over `columns` for a right-hand side in the order of elimination, without its first `skipped` entries.
fn sweep<T: Real>(
    direction: Sweep,
    (symbolic, factor): (&SymbolicCholesky<usize>, &[T]),
    columns: Range<usize>,
    values: &mut [T],
    skipped: usize,
    scratch: &mut [T],
) {
    if columns.is_empty() {
        return;
    }
    match symbolic.raw() {
        SymbolicCholeskyRaw::Supernodal(symbolic) => {
            let factor = Supernodal { symbolic, values: factor };
            let x = RightHandSide { values, skipped, scratch };
            match direction {
                Sweep::Forward => T::supernodal_forward(&factor, columns, x),
                Sweep::Backward => T::supernodal_backward(&factor, columns, x),
            }
        }
        SymbolicCholeskyRaw::Simplicial(raw) => {
            let factor = Simplicial { pointers: raw.col_ptr(), rows: raw.row_idx(), values: factor, skipped };
            match direction {
                Sweep::Forward => T::simplicial_forward(&factor, columns, values),
                Sweep::Backward => T::simplicial_backward(&factor, columns, values),
            }
        }
    }
}

impl<T: Real> Factorization<T> for Factor<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let Self { fingerprint, symbolic, values, method, pivots, cursor, .. } = self;
        fingerprint.check(a)?;
        sparse::check_symmetric_in("effective", a, cursor)?;
        let singular = |dof| Error::Singular { matrix: "effective matrix", dof };
        let factorized = match (method, symbolic.raw()) {
            (Method::Supernodal(supernodes), SymbolicCholeskyRaw::Supernodal(raw)) => {
                let workspaces = match &mut supernodes.workspaces {
                    Some(workspaces) => workspaces,
                    none => none.insert(workspaces(pivots.len())?),
                };
                let order = symbolic.perm().map(PermRef::arrays);
                let problem = Problem { symbolic: raw, elimination: &supernodes.elimination, a, order, workspaces };
                T::supernodal_cholesky(&problem, values, pivots)
            }
            (Method::Simplicial(memory), _) => {
                let memory = match memory {
                    Some(memory) => memory,
                    none => none.insert(buffer(T::cholesky_scratch(symbolic))?),
                };
                T::simplicial_cholesky(symbolic, a, values, pivots, memory)
            }
            (Method::Supernodal(_), _) => return Err(Error::Poisoned),
        };
        factorized.map_err(singular)?;
        let negligible = negligible::<T>(pivots.len());
        // Written so that NaN is rejected too.
        let sound = |(dof, &pivot): (usize, &T)| pivot > negligible * sparse::entry(a, dof, dof);
        match pivots.iter().enumerate().position(|pivot| !sound(pivot)) {
            Some(dof) => Err(singular(dof)),
            None => Ok(()),
        }
    }

    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        let size = self.size();
        for columns in rhs.chunks_mut((size * WIDEST).max(1)) {
            if columns.len() == size || !self.solve_together(0, columns)? {
                columns.chunks_exact_mut(size).for_each(|column| self.solve_one(column));
            }
        }
        Ok(())
    }

    fn release(&mut self) {
        self.cursor = Vec::new();
        match &mut self.method {
            Method::Simplicial(memory) => *memory = None,
            Method::Supernodal(supernodes) => {
                supernodes.workspaces = None;
                // Steps solve on the interface without allocating.
                supernodes.together.truncate(supernodes.rows(self.interface.len()) * WIDEST);
                supernodes.together.shrink_to_fit();
            }
        }
    }

    fn is_symmetric(&self) -> bool {
        true
    }

    fn stored_values(&self) -> usize {
        self.values.len()
    }

    fn condensation(&mut self) -> Option<&mut dyn Condensation<T>> {
        Some(self)
    }
}

impl<T: Real> Condensation<T> for Factor<T> {
    fn condense(&mut self, rhs: &[T], interface: &mut [T]) -> Result<()> {
        let trailing = self.trailing();
        self.forward(rhs, trailing.start);
        self.trailing.copy_from_slice(&self.sweep[trailing]);
        self.solve_trailing();
        self.interface.iter().zip(&self.trailing).for_each(|(&number, &x)| interface[number] = x);
        Ok(())
    }

    fn expand(&mut self, interface: &[T], solution: &mut [T]) -> Result<()> {
        let first = self.trailing().start;
        self.interface.iter().zip(&mut self.sweep[first..]).for_each(|(&number, x)| *x = interface[number]);
        self.backward(first, solution);
        Ok(())
    }

    fn solve(&mut self, forces: &mut [T]) -> Result<()> {
        let (first, height) = (self.trailing().start, self.interface.len());
        for columns in forces.chunks_mut((height * WIDEST).max(1)) {
            // One column too: a response must not depend on the others that are solved for with it.
            if self.solve_together(first, columns)? {
                continue;
            }
            for column in columns.chunks_exact_mut(height) {
                self.interface.iter().zip(&mut self.trailing).for_each(|(&number, x)| *x = column[number]);
                self.solve_trailing();
                self.interface.iter().zip(&self.trailing).for_each(|(&number, &x)| column[number] = x);
            }
        }
        Ok(())
    }
}
