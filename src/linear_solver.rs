//! Linear solvers: analyze a pattern once, factorize values many times, solve in place.

mod by_body;
mod cholesky;
pub(crate) mod coarse_space;
mod conjugate_gradients;
mod diagonal;
mod dissection;
mod elimination_tree;
mod graph;
mod lu;
mod minimum_degree;
pub(crate) mod ordering;
mod quotient;
mod selection;
mod shared;
mod tridiagonal;

pub use by_body::ByBody;
pub(crate) use by_body::components;
pub use cholesky::Cholesky;
pub(crate) use cholesky::negligible;
pub use conjugate_gradients::ConjugateGradients;
pub use diagonal::Diagonal;
pub use lu::Lu;
pub use ordering::Ordering;
pub use tridiagonal::Tridiagonal;

use crate::error::{Error, Result};
use crate::real::Real;
use crate::sparse;
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};

/// A method to solve `A x = b` with sparse A; a small value, whose data are in the [`Factorization`].
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{Cholesky, LinearSolver};
///
/// let a = SparseColMat::try_new_from_triplets(
///     2, 2, &[Triplet::new(0, 0, 4.0), Triplet::new(0, 1, 1.0), Triplet::new(1, 0, 1.0), Triplet::new(1, 1, 3.0)],
/// )?;
/// let solver: Box<dyn LinearSolver<f64>> = Box::new(Cholesky::default());
/// let mut factor = solver.analyze(a.symbolic(), &[])?;
/// factor.factorize(a.as_ref())?;
/// let mut x = [1.0, 2.0];
/// factor.solve(&mut x)?;
/// assert!((x[0] - 1.0 / 11.0).abs() < 1e-15 && (x[1] - 7.0 / 11.0).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait LinearSolver<T: Real>: std::fmt::Debug + Send {
    /// Analyzes a pattern (both triangles) and allocates all memory that a factorization needs.
    ///
    /// `last` (ascending) are the dofs on which contact may act. A solver that eliminates them last, in any order,
    /// can offer [`Factorization::condensation`]; others ignore them.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfMemory`], [`Error::Incompatible`] for a pattern that the solver cannot handle; the solvers of
    /// this crate also return [`Error::MissingDof`], [`Error::RepeatedDof`] and [`Error::Incompatible`] if `last`
    /// names missing dofs, names a dof twice, or does not ascend.
    fn analyze(&self, pattern: SymbolicSparseColMatRef<'_, usize>, last: &[usize])
    -> Result<Box<dyn Factorization<T>>>;

    /// Whether it solves for the rows of all [`Ranks`](crate::ranks::Ranks), each of which passes its own rows.
    /// Default: no; a run over ranks then rejects it, except for diagonal matrices. All ranks call all methods of
    /// such a solver at the same time, and an error on one rank must be an error on all.
    fn spans_ranks(&self) -> bool {
        false
    }
}

impl<T: Real, L: LinearSolver<T> + ?Sized> LinearSolver<T> for Box<L> {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<T>>> {
        (**self).analyze(pattern, last)
    }

    fn spans_ranks(&self) -> bool {
        (**self).spans_ranks()
    }
}

/// The data of a [`LinearSolver`] for one pattern; several may exist at once.
pub trait Factorization<T: Real>: std::fmt::Debug + Send {
    /// Factorizes a matrix with the analyzed pattern.
    ///
    /// # Errors
    ///
    /// [`Error::Singular`] with the failing dof; the solvers of this crate also return [`Error::Dimension`] and
    /// [`Error::Incompatible`] for a matrix of another size or pattern. The factorization is then unusable until the
    /// next success.
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()>;

    /// Solves in place; `rhs` holds one or more columns of the system's size, one after the other.
    ///
    /// Does not allocate for a single column. Call only after a successful [`factorize`](Self::factorize). A
    /// right-hand side that is not finite is no error: its solution is not finite either, and the step reports that.
    ///
    /// # Errors
    ///
    /// [`Error::LinearNotConverged`] or [`Error::Indefinite`] of an iteration; [`Error::Host`] or, if a smaller step
    /// may help, [`Error::Inadmissible`] of a host's own solver. `rhs` is then undefined, and the step is undone.
    /// Direct factorizations fail here only with [`Error::OutOfMemory`] for several columns.
    fn solve(&mut self, rhs: &mut [T]) -> Result<()>;

    /// Frees memory that only factorizations need, for a matrix that stays unchanged for long; the next factorization
    /// allocates it again. Default: frees no memory.
    fn release(&mut self) {}

    /// Number of stored values: the memory of the factor, in scalars.
    fn stored_values(&self) -> usize;

    /// Whether it takes matrices as symmetric, so that products may do the same. Default: no.
    fn is_symmetric(&self) -> bool {
        false
    }

    /// Iterations of the last solve, the largest number of its columns and at least one; zero for direct solvers. Over
    /// ranks the same number on all.
    fn iterations(&self) -> usize {
        0
    }

    /// The factorization as a static condensation onto the dofs given as `last`, if the solver offers it.
    ///
    /// With it a step in contact costs one forward and one backward sweep, as without contact, plus work on the
    /// interface only. Without it contact needs full solves: one for each pressed contact, and one more per step; or,
    /// if the solver iterates on symmetric matrices, products with A instead.
    fn condensation(&mut self) -> Option<&mut dyn Condensation<T>> {
        None
    }
}

/// Static condensation: `A x = b` with the interior eliminated, `S x_c = r_c` on the interface c, which are the dofs
/// given as `last` to [`LinearSolver::analyze`].
///
/// Vectors on the interface have one entry for each of these dofs, in that order. S = A_cc − A_ci A_ii⁻¹ A_ic is the
/// Schur complement; S⁻¹ is the block of A⁻¹ on the interface.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{Cholesky, LinearSolver};
///
/// // A chain of three springs and masses; contact may push dof 2.
/// let entries = [(0, 0, 3.0), (1, 1, 3.0), (2, 2, 2.0), (0, 1, -1.0), (1, 0, -1.0), (1, 2, -1.0), (2, 1, -1.0)];
/// let entries = entries.map(|(i, j, a)| Triplet::new(i, j, a));
/// let a = SparseColMat::<usize, f64>::try_new_from_triplets(3, 3, &entries)?;
/// let mut factor = Cholesky::default().analyze(a.symbolic(), &[2])?;
/// factor.factorize(a.as_ref())?;
/// let condensed = factor.condensation().ok_or("Cholesky condenses")?;
///
/// let mut x = [1.0, 0.0, -4.0];
/// let mut interface = [0.0];
/// condensed.condense(&x, &mut interface)?; // x_c without contact force
/// let mut response = [1.0];
/// condensed.solve(&mut response)?; // x_c for a unit force on the interface
/// let force = -interface[0] / response[0]; // the force that brings dof 2 to zero
/// interface[0] += force * response[0];
/// condensed.expand(&interface, &mut x)?;
/// assert!(x[2] == 0.0 && (x[0] - 3.0 / 8.0).abs() < 1e-15 && (x[1] - 1.0 / 8.0).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Condensation<T: Real> {
    /// Eliminates the interior for a right-hand side, stores the data for [`expand`](Self::expand), and writes the
    /// solution on the interface. Does not allocate.
    ///
    /// # Errors
    ///
    /// The errors of [`Factorization::solve`], if a solver iterates, runs elsewhere, or has parts that do ([`ByBody`]
    /// solves for bodies without contact with their given solver). The step is then undone. The direct factorizations
    /// of this crate never fail in these three methods.
    fn condense(&mut self, rhs: &[T], interface: &mut [T]) -> Result<()>;

    /// Completes the solution of the last [`condense`](Self::condense) with the given interface values, which forces
    /// on the interface may have changed; `solution` contains them bitwise. Does not allocate.
    ///
    /// # Errors
    ///
    /// As [`condense`](Self::condense); `solution` is then undefined.
    fn expand(&mut self, interface: &[T], solution: &mut [T]) -> Result<()>;

    /// `f ← S⁻¹ f` for one or more columns of forces on the interface. Does not allocate for up to 16 columns.
    ///
    /// # Errors
    ///
    /// As [`condense`](Self::condense); `forces` is then undefined.
    fn solve(&mut self, forces: &mut [T]) -> Result<()>;
}

/// The part, of `count` parts, of each dof of a pattern; `None` if the pattern is not symmetric or too large.
pub(crate) fn parts(pattern: SymbolicSparseColMatRef<'_, usize>, count: usize) -> Result<Option<Vec<usize>>> {
    quotient::Quotient::new(pattern, &[])?.map(|quotient| dissection::parts(&quotient, count)).transpose()
}

/// Checks the input of an analysis and returns the number of dofs.
fn check_analysis(pattern: SymbolicSparseColMatRef<'_, usize>, last: &[usize]) -> Result<usize> {
    let (dofs, what) = (sparse::check_effective_pattern(pattern)?, "the list of contact dofs");
    if let Some(&dof) = last.iter().find(|&&dof| dof >= dofs) {
        return Err(Error::MissingDof { what, dof, dofs });
    }
    match last.windows(2).find(|pair| pair[0] >= pair[1]) {
        None => Ok(dofs),
        Some(&[dof, next]) if dof == next => Err(Error::RepeatedDof { what, dof }),
        Some(_) => Err(Error::Incompatible { part: what.into(), reason: "it is not ascending" }),
    }
}

/// A fingerprint of the analyzed pattern, to compare with a matrix; the pattern itself can be as large as a factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Fingerprint {
    dofs: usize,
    entries: usize,
    mixed: u64,
}

impl Fingerprint {
    fn of(pattern: SymbolicSparseColMatRef<'_, usize>) -> Self {
        // An order-dependent hash: the odd factor mixes the bits, the rotation makes each position matter.
        let mix = |mixed: u64, index: usize| (mixed.rotate_left(5) ^ index as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let (mut entries, mut mixed) = (0, 0);
        for column in 0..pattern.ncols() {
            let rows = pattern.row_idx_of_col_raw(column);
            entries += rows.len();
            mixed = rows.iter().fold(mix(mixed, rows.len()), |mixed, &row| mix(mixed, row));
        }
        Self { dofs: pattern.ncols(), entries, mixed }
    }

    /// Rejects a matrix with another pattern.
    fn check<T: Real>(&self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        let what = "effective matrix";
        let found = sparse::square(what, a)?;
        if found != self.dofs {
            return Err(Error::Dimension { what, expected: self.dofs, found });
        }
        let own = Self::of(a.symbolic());
        if own.entries != self.entries {
            let what = "the entries of the effective matrix";
            return Err(Error::Dimension { what, expected: self.entries, found: own.entries });
        }
        match own == *self {
            true => Ok(()),
            false => Err(Error::Incompatible {
                part: "the effective matrix".into(),
                reason: "its pattern is not the one that was analyzed; analyze it again",
            }),
        }
    }
}

/// Number of columns of interface forces that are solved at once without allocating.
pub(crate) const COLUMNS: usize = 16;

/// Selects a solver by the pattern: [`Diagonal`] without off-diagonal entries, [`Tridiagonal`] for strings with
/// contact at one end each, otherwise [`Cholesky`].
///
/// It never selects [`ConjugateGradients`]: which of the two is faster depends on the step and on the number of
/// pressed contacts, which a pattern does not determine, and a factorization is exact to rounding at any step. It
/// never selects [`Lu`]: a pattern does not determine whether the values are symmetric.
#[derive(Clone, Copy, Debug, Default)]
pub struct Automatic;

impl<T: Real> LinearSolver<T> for Automatic {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<T>>> {
        check_analysis(pattern, last)?;
        match diagonal::is_diagonal(pattern) {
            true => Diagonal.analyze(pattern, last),
            false => match tridiagonal::try_analyze(pattern, last) {
                Some(analyzed) => analyzed,
                None => Cholesky::default().analyze(pattern, last),
            },
        }
    }
}
