//! A separate factorization for each body, that is, for each connected component of a matrix.

use super::selection::Selection;
use super::{Automatic, COLUMNS, Condensation, Diagonal, Factorization, Fingerprint, LinearSolver, check_analysis};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::threads;
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};

/// Factorizes each body separately.
///
/// Bodies are the connected components of the matrix. Contact and ties by multipliers do not couple them, so bodies
/// in contact stay separate in the effective matrix; bodies that share a dof, a spring or a penalty in K are one.
/// Each is ordered, factorized and solved separately, with one solver for all or with its own solver
/// ([`body`](Self::body)). Results equal a single factorization up to rounding.
///
/// Dofs that are coupled to no other (prescribed dofs, point masses, a whole diagonal matrix) form one diagonal part
/// for any solver; their entries must be positive. Condensation is offered if every body with contact dofs is
/// condensed by its own solver.
///
/// Symmetry and rounding are checked for each body, relative to its own entries, so a soft body next to a stiff one
/// is checked at its own scale. Errors name dofs of the whole system.
///
/// ```
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::{Automatic, ByBody, Cholesky, LinearSolver};
///
/// // Two bodies of two dofs each, numbered alternately.
/// let entries = [(0, 0, 2.0), (0, 2, -1.0), (2, 0, -1.0), (2, 2, 1.0),
///     (1, 1, 4.0), (1, 3, -2.0), (3, 1, -2.0), (3, 3, 4.0)];
/// let entries = entries.map(|(i, j, a)| Triplet::new(i, j, a));
/// let a = SparseColMat::<usize, f64>::try_new_from_triplets(4, 4, &entries)?;
/// let solver = ByBody::new(Automatic).body([1], Cholesky::default());
/// let mut factor = solver.analyze(a.symbolic(), &[])?;
/// factor.factorize(a.as_ref())?;
/// let mut x = [1.0, 0.0, 0.0, 6.0];
/// factor.solve(&mut x)?;
/// assert!(x.iter().zip([1.0, 1.0, 1.0, 2.0]).all(|(x, exact)| (x - exact).abs() < 1e-15));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ByBody<'a, T: Real> {
    others: Box<dyn LinearSolver<T> + 'a>,
    chosen: Vec<(Vec<usize>, Box<dyn LinearSolver<T> + 'a>)>,
}

impl<T: Real> Default for ByBody<'_, T> {
    fn default() -> Self {
        Self::new(Automatic)
    }
}

impl<'a, T: Real> ByBody<'a, T> {
    /// One solver for all bodies that are not given their own.
    pub fn new(solver: impl LinearSolver<T> + 'a) -> Self {
        Self { others: Box::new(solver), chosen: Vec::new() }
    }

    /// Sets the solver of each body that has any of these dofs: give one of its dofs, or the range of all its dofs,
    /// some of which may be prescribed.
    ///
    /// The analysis rejects dofs that do not exist ([`Error::MissingDof`]) and bodies with two solvers
    /// ([`Error::Incompatible`]).
    #[must_use]
    pub fn body(mut self, dofs: impl IntoIterator<Item = usize>, solver: impl LinearSolver<T> + 'a) -> Self {
        self.chosen.push((dofs.into_iter().collect(), Box::new(solver)));
        self
    }

    /// The solver of each of `count` bodies.
    fn solvers(&self, body_of: &[usize], count: usize) -> Result<Vec<&(dyn LinearSolver<T> + 'a)>> {
        let mut choice = vec![None; count];
        for (number, (dofs, _)) in self.chosen.iter().enumerate() {
            for &dof in dofs {
                let Some(&body) = body_of.get(dof) else {
                    return Err(Error::MissingDof { what: "the choice of a body's solver", dof, dofs: body_of.len() });
                };
                if choice[body].is_some_and(|other| other != number) {
                    let part = format!("another solver for the body of dof {dof}");
                    return Err(Error::Incompatible { part, reason: "the body has been given a solver already" });
                }
                choice[body] = Some(number);
            }
        }
        Ok(choice.into_iter().map(|number| number.map_or(&*self.others, |number| &*self.chosen[number].1)).collect())
    }
}

impl<T: Real> LinearSolver<T> for ByBody<'_, T> {
    fn analyze(
        &self,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
    ) -> Result<Box<dyn Factorization<T>>> {
        let n = check_analysis(pattern, last)?;
        let (body_of, mut bodies) = components(pattern);
        let solvers = self.solvers(&body_of, bodies.len())?;
        if let [body] = &bodies[..] {
            return if body.len() > 1 { solvers[0].analyze(pattern, last) } else { Diagonal.analyze(pattern, last) };
        }
        let mut single: Vec<usize> = bodies.iter().filter(|body| body.len() == 1).map(|body| body[0]).collect();
        if single.len() == n {
            return Diagonal.analyze(pattern, last);
        }
        single.sort_unstable();
        let mut places = vec![0; n];
        let mut parts = Vec::new();
        if !single.is_empty() {
            parts.push(Part::new(single, pattern, last, &Diagonal, &mut places)?);
        }
        for (body, solver) in bodies.drain(..).zip(solvers).filter(|(body, _)| body.len() > 1) {
            parts.push(Part::new(body, pattern, last, solver, &mut places)?);
        }
        let widest = parts.iter().map(|part| part.interface.len()).max().unwrap_or(0);
        let on_interface = vec![T::zero(); COLUMNS * widest];
        let fingerprint = Fingerprint::of(pattern);
        let apart = threads::worthwhile(parts.iter().map(|part| part.factor.stored_values()));
        Ok(Box::new(Factors {
            parts,
            size: n,
            height: last.len(),
            fingerprint,
            columns: Vec::new(),
            on_interface,
            apart,
        }))
    }
}

/// The smallest dof of a tree; shortens the path to it.
fn root(above: &mut [usize], mut dof: usize) -> usize {
    while above[dof] != dof {
        above[dof] = above[above[dof]];
        dof = above[dof];
    }
    dof
}

/// The component of each dof, and the dofs of each component, both ascending. The pattern need not be symmetric.
pub(crate) fn components(pattern: SymbolicSparseColMatRef<'_, usize>) -> (Vec<usize>, Vec<Vec<usize>>) {
    let n = pattern.ncols();
    // A forest: every dof points toward the smallest one of its tree.
    let mut above: Vec<usize> = (0..n).collect();
    for column in 0..n {
        for &row in pattern.row_idx_of_col_raw(column) {
            let (a, b) = (root(&mut above, row), root(&mut above, column));
            above[a.max(b)] = a.min(b);
        }
    }
    let (mut body_of, mut bodies) = (vec![0; n], Vec::<Vec<usize>>::new());
    for dof in 0..n {
        let first = root(&mut above, dof);
        if first == dof {
            body_of[dof] = bodies.len();
            bodies.push(Vec::new());
        } else {
            body_of[dof] = body_of[first];
        }
        bodies[body_of[dof]].push(dof);
    }
    (body_of, bodies)
}

/// One body, or all dofs that are coupled to no other.
#[derive(Debug)]
struct Part<T: Real> {
    dofs: Selection,
    pattern: SymbolicSparseColMat<usize>,
    /// Places of its entries among the entries of the whole matrix.
    entries: Selection,
    /// Its entries, if they are not contiguous in the whole matrix.
    values: Vec<T>,
    factor: Box<dyn Factorization<T>>,
    /// Places of its contact dofs on the interface of the system.
    interface: Selection,
    /// A column of its dofs, and its solution.
    column: Vec<T>,
    /// A column of its contact dofs.
    on_interface: Vec<T>,
}

impl<T: Real> Part<T> {
    /// `places` is scratch, one entry for each dof of the system.
    fn new(
        dofs: Vec<usize>,
        pattern: SymbolicSparseColMatRef<'_, usize>,
        last: &[usize],
        solver: &dyn LinearSolver<T>,
        places: &mut [usize],
    ) -> Result<Self> {
        for (place, &dof) in dofs.iter().enumerate() {
            places[dof] = place;
        }
        let (mut pointers, mut rows, mut entries) = (vec![0], Vec::new(), Vec::new());
        for &dof in &dofs {
            entries.extend(pattern.col_range(dof));
            rows.extend(pattern.row_idx_of_col_raw(dof).iter().map(|&row| places[row]));
            pointers.push(rows.len());
        }
        let own = SymbolicSparseColMatRef::new_checked(dofs.len(), dofs.len(), &pointers, None, &rows)
            .to_owned()
            .map_err(|_| Error::OutOfMemory { what: "the pattern of a body", bytes: None })?;
        let of_body = |(_, dof): &(usize, &usize)| dofs.binary_search(dof).is_ok();
        let (interface, own_last): (Vec<usize>, Vec<usize>) =
            last.iter().enumerate().filter(of_body).map(|(at, &dof)| (at, places[dof])).unzip();
        let factor = match solver.analyze(own.as_ref(), &own_last) {
            Ok(factor) => factor,
            Err(error) => return Err(in_system(error, |dof| dofs[dof])),
        };
        let (column, on_interface) = (vec![T::zero(); dofs.len()], vec![T::zero(); interface.len()]);
        let entries = Selection::new(entries);
        let values = vec![T::zero(); if entries.range().is_some() { 0 } else { entries.len() }];
        let (dofs, interface) = (Selection::new(dofs), Selection::new(interface));
        Ok(Self { dofs, pattern: own, entries, values, factor, interface, column, on_interface })
    }

    fn factorize(&mut self, values: &[T]) -> Result<()> {
        let Self { dofs, pattern, entries, values: own, factor, .. } = self;
        let a = SparseColMatRef::new(pattern.as_ref(), entries.read(values, own));
        factor.factorize(a).map_err(|error| in_system(error, |dof| dofs.at(dof)))
    }

    /// Solves for its dofs of a right-hand side; the solution is in `column`.
    fn solve(&mut self, rhs: &[T]) -> Result<()> {
        let Self { dofs, factor, column, .. } = self;
        dofs.gather(rhs, column);
        factor.solve(column).map_err(|error| in_system(error, |dof| dofs.at(dof)))
    }

    /// Condenses a part with contact dofs; the solution on its part of the interface is in `on_interface`. Other
    /// parts are solved.
    fn condense(&mut self, rhs: &[T]) -> Result<()> {
        if !self.touches() {
            return self.solve(rhs);
        }
        let Self { dofs, factor, column, on_interface, .. } = self;
        let Some(condensed) = factor.condensation() else { return Ok(()) };
        let condensed = condensed.condense(dofs.read(rhs, column), on_interface);
        condensed.map_err(|error| in_system(error, |dof| dofs.at(dof)))
    }

    /// Completes the solution in `column`.
    fn expand(&mut self, interface: &[T]) -> Result<()> {
        let Self { dofs, factor, interface: places, column, on_interface, .. } = self;
        let Some(condensed) = factor.condensation().filter(|_| places.len() > 0) else { return Ok(()) };
        let expanded = condensed.expand(places.read(interface, on_interface), column);
        expanded.map_err(|error| in_system(error, |dof| dofs.at(dof)))
    }

    fn touches(&self) -> bool {
        self.interface.len() > 0
    }
}

/// The same error with dofs of the whole system.
fn in_system(error: Error, whole: impl Fn(usize) -> usize) -> Error {
    match error {
        // The host need not know that the matrix of this part is diagonal.
        Error::Singular { dof, .. } => Error::Singular { matrix: "effective matrix", dof: whole(dof) },
        Error::Indefinite { curvature, dof } => Error::Indefinite { curvature, dof: whole(dof) },
        Error::Mass { dof, value } => Error::Mass { dof: whole(dof), value },
        Error::MatrixNotFinite { matrix, row, column, value } => {
            Error::MatrixNotFinite { matrix, row: whole(row), column: whole(column), value }
        }
        Error::Asymmetric { matrix, row, column, value, mirrored } => {
            Error::Asymmetric { matrix, row: whole(row), column: whole(column), value, mirrored }
        }
        other => other,
    }
}

#[derive(Debug)]
struct Factors<T: Real> {
    parts: Vec<Part<T>>,
    /// Number of dofs, number of contact dofs, and fingerprint of the whole pattern.
    size: usize,
    height: usize,
    fingerprint: Fingerprint,
    /// Columns of a part and of its interface: memory for the largest number solved so far, for the interface at
    /// least for `COLUMNS`.
    columns: Vec<T>,
    on_interface: Vec<T>,
    /// Whether threads are worthwhile.
    apart: bool,
}

/// A slice of `size` values; allocates if `scratch` is shorter.
fn room<T: Real>(scratch: &mut Vec<T>, size: usize) -> &mut [T] {
    if scratch.len() < size {
        scratch.resize(size, T::zero());
    }
    &mut scratch[..size]
}

impl<T: Real> Factorization<T> for Factors<T> {
    fn factorize(&mut self, a: SparseColMatRef<'_, usize, T>) -> Result<()> {
        self.fingerprint.check(a)?;
        self.each(|part| part.factorize(a.val()))
    }

    fn solve(&mut self, rhs: &mut [T]) -> Result<()> {
        if rhs.len() == self.size {
            self.each(|part| part.solve(rhs))?;
            self.parts.iter().for_each(|part| part.dofs.scatter(&part.column, rhs));
            return Ok(());
        }
        let Self { parts, size, columns, .. } = self;
        for Part { dofs, factor, .. } in parts {
            let height = dofs.len();
            let columns = room(columns, rhs.len() / *size * height);
            for (rhs, column) in rhs.chunks_exact(*size).zip(columns.chunks_exact_mut(height)) {
                dofs.gather(rhs, column);
            }
            factor.solve(columns).map_err(|error| in_system(error, |dof| dofs.at(dof)))?;
            for (rhs, column) in rhs.chunks_exact_mut(*size).zip(columns.chunks_exact(height)) {
                dofs.scatter(column, rhs);
            }
        }
        Ok(())
    }

    fn release(&mut self) {
        self.parts.iter_mut().for_each(|part| part.factor.release());
    }

    fn is_symmetric(&self) -> bool {
        self.parts.iter().all(|part| part.factor.is_symmetric())
    }

    fn stored_values(&self) -> usize {
        self.parts.iter().map(|part| part.factor.stored_values()).sum()
    }

    fn condensation(&mut self) -> Option<&mut dyn Condensation<T>> {
        let condenses = |part: &mut Part<T>| !part.touches() || part.factor.condensation().is_some();
        if self.parts.iter_mut().all(condenses) { Some(self) } else { None }
    }
}

impl<T: Real> Factors<T> {
    /// Calls `act` on every part, on several threads if that is worthwhile.
    fn each(&mut self, act: impl Fn(&mut Part<T>) -> Result<()> + Sync) -> Result<()> {
        match self.apart {
            true => threads::try_each(&mut self.parts, &act),
            false => self.parts.iter_mut().try_for_each(act),
        }
    }
}

/// Parts with contact dofs are condensed; `condensation` has checked that they can be. The others are solved.
impl<T: Real> Condensation<T> for Factors<T> {
    fn condense(&mut self, rhs: &[T], interface: &mut [T]) -> Result<()> {
        self.each(|part| part.condense(rhs))?;
        for part in &self.parts {
            part.interface.scatter(&part.on_interface, interface);
        }
        Ok(())
    }

    fn expand(&mut self, interface: &[T], solution: &mut [T]) -> Result<()> {
        self.each(|part| part.expand(interface))?;
        self.parts.iter().for_each(|part| part.dofs.scatter(&part.column, solution));
        Ok(())
    }

    fn solve(&mut self, forces: &mut [T]) -> Result<()> {
        let Self { parts, height, on_interface, .. } = self;
        for part in parts.iter_mut().filter(|part| part.touches()) {
            let own = part.interface.len();
            let columns = room(on_interface, forces.len() / *height * own);
            for (forces, column) in forces.chunks_exact(*height).zip(columns.chunks_exact_mut(own)) {
                part.interface.gather(forces, column);
            }
            // A contact row acts on two bodies; all others have no force and are skipped.
            if columns.iter().all(|force| *force == T::zero()) {
                continue;
            }
            if let Some(condensed) = part.factor.condensation() {
                let solved = condensed.solve(columns);
                solved.map_err(|error| in_system(error, |dof| part.dofs.at(dof)))?;
            }
            for (forces, column) in forces.chunks_exact_mut(*height).zip(columns.chunks_exact(own)) {
                part.interface.scatter(column, forces);
            }
        }
        Ok(())
    }
}
