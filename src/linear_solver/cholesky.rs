//! Sparse Cholesky: faer's simplicial L D Lᵀ for chains (with sweeps of this crate), a supernodal L Lᵀ otherwise.

use super::ordering::{self, Ordering};
use super::shared::Analyses;
use super::{COLUMNS, Condensation, Factorization, Fingerprint, LinearSolver, check_analysis};
use crate::error::{Error, Result};
use crate::kernels::cholesky::{Columns, Factorization as Kind, Simplicial, Supernodal};
use crate::kernels::elimination::Elimination;
use crate::kernels::forest::Forest;
use crate::kernels::interleaved_sweep::{self, WIDEST};
use crate::kernels::supernodal::{Problem, Workspace};
use crate::real::Real;
use crate::threads::PerThread;
use crate::{memory, sparse};
use faer::dyn_stack::{MemBuffer, StackReq};
use faer::perm::PermRef;
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
    kind: Kind,
    values: Vec<T>,
    memory: Option<MemBuffer>,
    /// How a supernodal factor is computed, and the workspaces of threads for it.
    elimination: Option<Elimination>,
    workspaces: Option<PerThread<Workspace<T>>>,
    /// Memory of solves for several right-hand sides.
    together: Vec<T>,
    /// Pivots in the numbering of the matrix.
    pivots: Vec<T>,
    /// The interior of a supernodal factor, and the work vectors of its supernodes.
    forest: Option<Forest>,
    work: Vec<T>,
    /// One right-hand side in the order of elimination; its entries in the forest are in `work`.
    sweep: Vec<T>,
    /// The place of each interface dof among those eliminated last.
    interface: Vec<usize>,
    /// Columns on the interface in the order of elimination; capacity for `COLUMNS`, or the largest number solved so
    /// far.
    trailing: Vec<T>,
    /// Memory for the rows below any supernode, for as many columns.
    below: Vec<T>,
    /// Memory of the check of symmetry.
    cursor: Vec<usize>,
}

/// In a matrix with `n` dofs a pivot below this share of its diagonal entry is zero up to rounding.
pub(super) fn negligible<T: Real>(n: usize) -> T {
    T::of(16.0 * (n as f64).sqrt()) * T::epsilon()
}

impl<T: Real> std::fmt::Debug for Factor<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Factor").field("kind", &self.kind).field("values", &self.values.len()).finish_non_exhaustive()
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
        let (kind, below) = match symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(_) => (Kind::Ldlt, 0),
            SymbolicCholeskyRaw::Supernodal(raw) => (Kind::Llt, tallest(raw)),
        };
        let memory = match kind {
            Kind::Ldlt => Some(buffer(T::cholesky_scratch(&symbolic))?),
            Kind::Llt => None,
        };
        let n = symbolic.nrows();
        let first = n - last.len();
        let place = |dof: usize| symbolic.perm().map_or(dof, |perm| perm.arrays().1[dof]);
        let interface: Vec<usize> = last.iter().map(|&dof| place(dof) - first).collect();
        let (forest, elimination, workspaces) = match symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(_) => (None, None, None),
            SymbolicCholeskyRaw::Supernodal(raw) => {
                (Some(Forest::new(raw, first)?), Some(Elimination::new(raw)?), Some(workspaces(n)?))
            }
        };
        let work = memory::zeros(forest.as_ref().map_or(0, Forest::work), 1, "the sweeps of a sparse Cholesky factor")?;
        let (pivots, sweep) = (vec![T::zero(); n], vec![T::zero(); n]);
        let what = "the interface of a sparse Cholesky factor";
        let trailing = memory::zeros(COLUMNS, last.len(), what)?;
        // Without an interface, sweeps over one right-hand side still need memory.
        let below = memory::zeros(if last.is_empty() { 1 } else { COLUMNS }, below, what)?;
        Ok(Box::new(Factor {
            fingerprint: Fingerprint::of(pattern),
            symbolic,
            kind,
            values,
            memory,
            elimination,
            workspaces,
            together: Vec::new(),
            pivots,
            forest,
            work,
            sweep,
            interface,
            trailing,
            below,
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

/// The largest number of rows of a supernode, which bounds the rows below any part of its columns.
fn tallest(raw: &faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky<usize>) -> usize {
    let height = |s: usize| {
        let columns = raw.supernode_end()[s] - raw.supernode_begin()[s];
        columns + raw.supernode(s).pattern().len()
    };
    (0..raw.n_supernodes()).map(height).max().unwrap_or(0)
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
        let Self { symbolic, values, forest, work, sweep: x, below, .. } = self;
        let order = symbolic.perm().map(|perm| perm.arrays().0);
        let mut behind = 0;
        if let (Some(forest), SymbolicCholeskyRaw::Supernodal(symbolic)) = (&*forest, symbolic.raw()) {
            T::forest_forward(Supernodal { symbolic, values }, forest, rhs, order, work);
            behind = forest.end;
        }
        let x = &mut x[behind..];
        match order {
            Some(order) => x.iter_mut().zip(&order[behind..]).for_each(|(x, &dof)| *x = rhs[dof]),
            None => x.copy_from_slice(&rhs[behind..]),
        }
        if let Some(forest) = forest {
            for &root in &forest.roots {
                for (&place, &change) in forest.places(root).iter().zip(&work[forest.update(root)]) {
                    x[place] += change;
                }
            }
        }
        sweep(Sweep::Forward, (symbolic, values), behind..end, x, behind, below);
    }

    /// Sweeps backward over the columns before `end`; later columns are already solved.
    fn backward(&mut self, end: usize) {
        let Self { symbolic, values, forest, work, sweep: x, below, .. } = self;
        let behind = forest.as_ref().map_or(0, |forest| forest.end);
        let x = &mut x[behind..];
        sweep(Sweep::Backward, (symbolic, values), behind..end, x, behind, below);
        if let (Some(forest), SymbolicCholeskyRaw::Supernodal(symbolic)) = (forest, symbolic.raw()) {
            for &root in &forest.roots {
                for (&place, known) in forest.places(root).iter().zip(&mut work[forest.update(root)]) {
                    *known = x[place];
                }
            }
            T::forest_backward(Supernodal { symbolic, values }, forest, work);
        }
    }

    fn solve_one(&mut self, column: &mut [T]) {
        let size = self.size();
        self.forward(column, size);
        self.backward(size);
        self.give(column);
    }

    /// Solves for several columns together with a supernodal factor.
    fn solve_together(&mut self, columns: &mut [T]) -> Result<()> {
        let Self { symbolic, values, together, .. } = self;
        let SymbolicCholeskyRaw::Supernodal(raw) = symbolic.raw() else { return Ok(()) };
        let room = interleaved_sweep::room(symbolic.nrows(), tallest(raw));
        memory::grow(together, room, WIDEST, "right-hand sides of a sparse Cholesky factor")?;
        let order = symbolic.perm().map(|perm| perm.arrays().0);
        T::supernodal_solve(&Supernodal { symbolic: raw, values }, order, columns, together);
        Ok(())
    }

    /// Writes the solution in the order of the matrix.
    fn give(&self, solution: &mut [T]) {
        let Self { symbolic, forest, work, sweep: x, .. } = self;
        let order = symbolic.perm().map(|perm| perm.arrays().0);
        let mut put = |columns: Range<usize>, x: &[T]| match order {
            Some(order) => x.iter().zip(&order[columns]).for_each(|(&x, &dof)| solution[dof] = x),
            None => solution[columns.clone()].copy_from_slice(&x[..columns.len()]),
        };
        let mut behind = 0;
        if let Some(forest) = forest {
            for s in 0..forest.count() {
                put(forest.columns(s), &work[forest.offsets[s]..]);
            }
            behind = forest.end;
        }
        put(behind..x.len(), &x[behind..]);
    }
}

/// Direction of a sweep over columns of the factor; the forward sweep of a simplicial factor includes the division by
/// D.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sweep {
    Forward,
    Backward,
}

/// Sweeps over `columns` for right-hand sides in the order of elimination, each without its first `skipped` entries.
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
            let x = Columns { values, skipped, scratch };
            match direction {
                Sweep::Forward => T::supernodal_forward(&factor, columns, x),
                Sweep::Backward => T::supernodal_backward(&factor, columns, x),
            }
        }
        SymbolicCholeskyRaw::Simplicial(raw) => {
            let factor = Simplicial { pointers: raw.col_ptr(), rows: raw.row_idx(), values: factor, skipped };
            for x in values.chunks_exact_mut(symbolic.nrows() - skipped) {
                match direction {
                    Sweep::Forward => T::simplicial_forward(&factor, columns.clone(), x),
                    Sweep::Backward => T::simplicial_backward(&factor, columns.clone(), x),
                }
            }
        }
    }
}

impl<T: Real> Factorization<T> for Factor<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let Self { fingerprint, symbolic, values, pivots, memory, elimination, workspaces: threads, cursor, .. } = self;
        fingerprint.check(a)?;
        sparse::check_symmetric_in("effective", a, cursor)?;
        let singular = |dof| Error::Singular { matrix: "effective matrix", dof };
        let factorized =
            if let (SymbolicCholeskyRaw::Supernodal(raw), Some(elimination)) = (symbolic.raw(), elimination) {
                let workspaces = match threads {
                    Some(workspaces) => workspaces,
                    None => threads.insert(workspaces(pivots.len())?),
                };
                let order = symbolic.perm().map(PermRef::arrays);
                let problem = Problem { symbolic: raw, elimination, a, order, workspaces };
                T::supernodal_cholesky(&problem, values, pivots)
            } else {
                let memory = match memory {
                    Some(memory) => memory,
                    None => memory.insert(buffer(T::cholesky_scratch(symbolic))?),
                };
                T::simplicial_cholesky(symbolic, a, values, pivots, memory)
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
            match self.symbolic.raw() {
                SymbolicCholeskyRaw::Supernodal(_) if columns.len() > size => self.solve_together(columns)?,
                _ => columns.chunks_exact_mut(size).for_each(|column| self.solve_one(column)),
            }
        }
        Ok(())
    }

    fn release(&mut self) {
        (self.memory, self.workspaces) = (None, None);
        (self.cursor, self.together) = (Vec::new(), Vec::new());
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
        let Self { symbolic, values, sweep: x, below, trailing: on_interface, interface: places, .. } = self;
        let on_interface = &mut on_interface[..places.len()];
        on_interface.copy_from_slice(&x[trailing.clone()]);
        sweep(Sweep::Forward, (symbolic, values), trailing.clone(), on_interface, trailing.start, below);
        sweep(Sweep::Backward, (symbolic, values), trailing.clone(), on_interface, trailing.start, below);
        for (x, &place) in interface.iter_mut().zip(places.iter()) {
            *x = on_interface[place];
        }
        Ok(())
    }

    fn expand(&mut self, interface: &[T], solution: &mut [T]) -> Result<()> {
        let first = self.trailing().start;
        for (&value, &place) in interface.iter().zip(&self.interface) {
            self.sweep[first + place] = value;
        }
        self.backward(first);
        self.give(solution);
        Ok(())
    }

    fn solve(&mut self, forces: &mut [T]) -> Result<()> {
        let trailing = self.trailing();
        let height = trailing.len();
        if height == 0 {
            return Ok(());
        }
        let Self { symbolic, values, below, trailing: x, interface: places, .. } = self;
        let columns = forces.len() / height;
        if x.len() < forces.len() {
            let what = "the interface of a sparse Cholesky factor";
            memory::grow(x, forces.len(), 1, what)?;
            let tall = match symbolic.raw() {
                SymbolicCholeskyRaw::Simplicial(_) => 0,
                SymbolicCholeskyRaw::Supernodal(raw) => tallest(raw),
            };
            memory::grow(below, tall, columns, what)?;
        }
        let x = &mut x[..forces.len()];
        for (forces, x) in forces.chunks_exact(height).zip(x.chunks_exact_mut(height)) {
            for (&force, &place) in forces.iter().zip(places.iter()) {
                x[place] = force;
            }
        }
        sweep(Sweep::Forward, (symbolic, values), trailing.clone(), x, trailing.start, below);
        sweep(Sweep::Backward, (symbolic, values), trailing.clone(), x, trailing.start, below);
        for (forces, x) in forces.chunks_exact_mut(height).zip(x.chunks_exact(height)) {
            for (force, &place) in forces.iter_mut().zip(places.iter()) {
                *force = x[place];
            }
        }
        Ok(())
    }
}
