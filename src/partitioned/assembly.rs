//! Any number of bodies, coupled by rows over their interface dofs.

use super::coupling::Coupling;
use super::problem::{FLEXIBILITY, Problem, check_flexibility, check_length};
use crate::contact_solver::{ActiveSet, AdmissibleSet, ContactSolver, new_version};
use crate::error::{Error, Result};
use crate::memory;
use crate::real::Real;
use crate::rounding::rounding;
use crate::sparse::check_vector;

/// The interface of a body: its flexibility, and its part of the rows.
#[derive(Debug)]
struct Body<T> {
    dofs: usize,
    flexibility: Vec<T>,
    /// The rows that name it, ascending; the entries of the k-th are `starts[k]..starts[k + 1]`.
    rows: Vec<usize>,
    starts: Vec<usize>,
    entries: Vec<(usize, T)>,
}

impl<T: Real> Body<T> {
    /// Without rows.
    fn new(flexibility: &[T]) -> Result<Self> {
        let dofs = flexibility.len().isqrt();
        check_flexibility(flexibility, dofs)?;
        let mut own = memory::reserve(dofs, dofs, FLEXIBILITY)?;
        own.extend_from_slice(flexibility);
        Ok(Self { dofs, flexibility: own, rows: Vec::new(), starts: vec![0], entries: Vec::new() })
    }

    /// Adds its entries of a row.
    fn take(&mut self, row: usize, body: usize, entries: &[(usize, usize, T)]) -> Result<()> {
        for &(_, dof, weight) in entries.iter().filter(|entry| entry.0 == body) {
            if dof >= self.dofs {
                let (part, dofs) = (format!("row {row}, which names interface dof {dof} of body {body},"), self.dofs);
                let part = format!("{part} which has {dofs},");
                return Err(Error::Incompatible { part, reason: "interface dofs are counted for each body from zero" });
            }
            self.entries.push((dof, weight));
        }
        if self.entries.len() > self.starts[self.rows.len()] {
            self.rows.push(row);
            self.starts.push(self.entries.len());
        }
        Ok(())
    }

    /// The rows that name it, with their entries.
    fn rows(&self) -> impl DoubleEndedIterator<Item = (usize, &[(usize, T)])> + Clone {
        let entries = self.starts.windows(2).map(|ends| &self.entries[ends[0]..ends[1]]);
        self.rows.iter().copied().zip(entries)
    }

    /// Adds the flexibility times forces on some dofs.
    fn respond(&self, forces: impl Iterator<Item = (usize, T)>, out: &mut [T]) {
        for (dof, force) in forces {
            T::axpy(force, &self.flexibility[dof * self.dofs..][..self.dofs], out);
        }
    }
}

/// The solution of an [`Assembly`].
#[derive(Clone, Debug, Default)]
pub struct Assembled<T> {
    multipliers: Vec<T>,
    gaps: Vec<T>,
    closed: Vec<bool>,
    forces: Vec<Vec<T>>,
    values: Vec<Vec<T>>,
    iterations: usize,
}

impl<T: Real> Assembled<T> {
    /// The multiplier of each row: positive if pressed, of either sign in ties and after [`Assembly::hold`]. Dependent
    /// rows get the multipliers of least norm; their effect on the bodies is unique.
    pub fn multipliers(&self) -> &[T] {
        &self.multipliers
    }

    /// The gap of each row under the forces, zero to rounding if closed.
    pub fn gaps(&self) -> &[T] {
        &self.gaps
    }

    /// Which rows are closed: ties, and rows pressed by a force or with a gap within the rounding of its terms. After
    /// [`Assembly::hold`]: the held rows.
    pub fn closed(&self) -> &[bool] {
        &self.closed
    }

    /// The forces on the interface dofs of a body, Σ weight · multiplier; empty for a body that does not exist.
    pub fn forces(&self, body: usize) -> &[T] {
        self.forces.get(body).map_or(&[], Vec::as_slice)
    }

    /// The values of the interface dofs of a body under these forces; empty for a body that does not exist.
    pub fn values(&self, body: usize) -> &[T] {
        self.values.get(body).map_or(&[], Vec::as_slice)
    }

    /// Iterations of the contact solver.
    pub fn iterations(&self) -> usize {
        self.iterations
    }
}

/// Any number of bodies in separate codes, joined by rows over their interface dofs: the interface problem of
/// localized Lagrange multipliers (Park, Felippa, Gumaste, Comput. Mech. 24, 2000; with contact Rebel, Park, Felippa,
/// Int. J. Numer. Methods Eng. 54, 2002), or the dual assembly of substructures (de Klerk, Rixen, Voormeeren, AIAA J.
/// 46, 2008) with contact.
///
/// Body s has the values d_s = free_s + F_s p_s under forces p_s on its interface dofs, and the rows G_s. With one
/// multiplier per row,
///
/// ```text
/// p_s = G_sᵀ λ,   g = Σ_s G_s d_s + gap,   0 ≤ g ⊥ λ ≥ 0   (g = 0 in ties)
/// 0 ≤ W λ + Σ_s G_s free_s + gap ⊥ λ ≥ 0,   W = Σ_s G_s F_s G_sᵀ
/// ```
///
/// which any [`ContactSolver`] can solve. Localized multipliers tie each body to a massless frame by its own
/// multipliers l_s; the equilibrium of the frame makes them all equal to λ, which eliminates the frame
/// (`docs/theory.md`, section 17). If k bodies meet in a point, k − 1 independent rows and all k (k − 1)/2 rows
/// between two bodies are equivalent: rows may be dependent.
///
/// A body needs no knowledge of the others or their codes: its step continues with the [`forces`](Assembled::forces).
/// Results equal the monolithic form up to rounding (`tests/partitioned/assemblies.rs`). An explicit or implicit step
/// of the host:
///
/// 1. each body advances without contact, `free`, and solves for unit forces on its interface (once while its matrix
///    is unchanged);
/// 2. [`solve`](Self::solve);
/// 3. each body adds the response to its forces;
/// 4. to make velocities (then accelerations) agree with the contact, as
///    [`PersistencyCorrection`](crate::PersistencyCorrection) does: [`hold`](Self::hold) on the closed rows that are
///    pressed or approach, of a second assembly with the flexibilities of M⁻¹.
///
/// Bodies advance and respond independently, in parallel if there are threads.
///
/// W is dense: R² numbers for R rows. The flexibility of a body with n interface dofs needs n solves once, and n²
/// numbers. This suits some thousand rows.
///
/// ```
/// use contact_dynamics::partitioned::{Assembly, Coupling};
///
/// // Three masses meet in a point: 1 and 2 from the left with v = 3 and −½, 3 from the right with v = −1.
/// let (masses, v) = ([1.0, 2.0, 3.0_f64], [3.0, -0.5, -1.0]);
/// let flexible = masses.map(|m| [1.0 / m]);
/// let rows = [
///     Coupling::unilateral(&[(0, 0, -1.0), (2, 0, 1.0)]),
///     Coupling::unilateral(&[(1, 0, -1.0), (2, 0, 1.0)]),
/// ];
/// let mut assembly = Assembly::new(&[&flexible[0], &flexible[1], &flexible[2]], &rows)?;
/// let found = assembly.solve(&[&v[..1], &v[1..2], &v[2..]], &[0.0; 2])?;
/// // The first one stops the third, (3 − 3)/4 = 0, and the second is left behind.
/// assert!((found.multipliers()[0] - 3.0).abs() < 1e-15 && found.values(2)[0].abs() < 1e-15);
/// assert_eq!((found.forces(0)[0], found.forces(2)[0]), (-found.multipliers()[0], found.multipliers()[0]));
///
/// // A beam of two nodes on a facet of another mesh, a third of the way along it.
/// let beam = [2.0_f64, 0.5, 0.5, 2.0];
/// let facet = Coupling::unilateral(&[(0, 0, -2.0 / 3.0), (0, 1, -1.0 / 3.0), (1, 0, 1.0)]);
/// let mut assembly = Assembly::new(&[&beam, &[1.0]], &[facet])?;
/// let found = assembly.solve(&[&[0.3, 0.0], &[0.1]], &[0.0])?;
/// assert!((found.multipliers()[0] - 0.1 / (1.0 + 12.0 / 9.0)).abs() < 1e-15); // (0.2 − 0.1)/(F_2 + gᵀF_1 g)
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Debug)]
pub struct Assembly<T: Real> {
    bodies: Vec<Body<T>>,
    /// Which rows are ties.
    equalities: Vec<bool>,
    problem: Problem<T>,
    /// Whether the problem has the W of its rows, and the place of each row in the problem.
    formed: bool,
    places: Vec<Option<usize>>,
    /// Offsets of all rows, and their rounding.
    offsets: Vec<T>,
    roundings: Vec<T>,
    /// A response of a body.
    response: Vec<T>,
    assembled: Assembled<T>,
}

impl<T: Real> Assembly<T> {
    /// Bodies with these flexibilities, coupled by rows, solved by [`ActiveSet`].
    ///
    /// Entry i + j n of a flexibility is the change of the value of the body's interface dof i by a unit force on its
    /// dof j (n dofs, symmetric, positive semidefinite). For displacements of an implicit step it is w_u A⁻¹ with the
    /// effective matrix A of the body, for velocities and accelerations M⁻¹ per unit of impulse and force, in the
    /// rows and columns of the interface; all zero for a rigid obstacle.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`], [`Error::NotFinite`], [`Error::Asymmetric`] and [`Error::Singular`] for wrong
    /// flexibilities, [`Error::Incompatible`] for rows that name missing bodies or dofs, [`Error::NotFinite`] for
    /// their weights, [`Error::OutOfMemory`] if the dense problem does not fit.
    pub fn new(flexibilities: &[&[T]], rows: &[Coupling<T>]) -> Result<Self> {
        Self::with_solver(flexibilities, rows, ActiveSet::default())
    }

    /// The same with a solver of the host's choice.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn with_solver(
        flexibilities: &[&[T]],
        rows: &[Coupling<T>],
        solver: impl ContactSolver<T> + 'static,
    ) -> Result<Self> {
        let mut bodies = flexibilities.iter().map(|flexibility| Body::new(flexibility)).collect::<Result<Vec<_>>>()?;
        for (row, Coupling { entries, .. }) in rows.iter().enumerate() {
            if let Some(index) = entries.iter().position(|entry| !entry.2.is_finite()) {
                let value = entries[index].2.value();
                return Err(Error::NotFinite { what: "weights of a row between bodies", index, value });
            }
            let mut named: Vec<usize> = entries.iter().map(|entry| entry.0).collect();
            named.sort_unstable();
            named.dedup();
            for body in named {
                let count = bodies.len();
                let Some(part) = bodies.get_mut(body) else {
                    let part = format!("row {row}, which names body {body} of {count},");
                    return Err(Error::Incompatible { part, reason: "bodies are counted from zero" });
                };
                part.take(row, body, entries)?;
            }
        }
        let count = rows.len();
        let problem = Problem::new(count, Box::new(solver), "an assembly of bodies")?;
        let zero = |n: usize| vec![T::zero(); n];
        let of_bodies = || bodies.iter().map(|body| zero(body.dofs)).collect();
        let assembled = Assembled {
            multipliers: zero(count),
            gaps: zero(count),
            closed: vec![false; count],
            forces: of_bodies(),
            values: of_bodies(),
            iterations: 0,
        };
        Ok(Self {
            equalities: rows.iter().map(|row| row.is_equality).collect(),
            problem,
            formed: false,
            places: vec![None; count],
            offsets: zero(count),
            roundings: zero(count),
            response: zero(bodies.iter().map(|body| body.dofs).max().unwrap_or(0)),
            assembled,
            bodies,
        })
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.equalities.len()
    }

    /// Replaces the flexibility of a body whose matrix has changed; W is kept if it is the same.
    ///
    /// # Errors
    ///
    /// The errors of [`new`](Self::new), also for a body that does not exist; the assembly is then unchanged.
    pub fn set_flexibility(&mut self, number: usize, flexibility: &[T]) -> Result<()> {
        let count = self.bodies.len();
        let Some(body) = self.bodies.get_mut(number) else {
            let part = format!("a flexibility of body {number} of {count}");
            return Err(Error::Incompatible { part, reason: "bodies are counted from zero" });
        };
        check_flexibility(flexibility, body.dofs)?;
        if body.flexibility != flexibility {
            body.flexibility.copy_from_slice(flexibility);
            self.formed = false;
        }
        Ok(())
    }

    /// Contact and ties: forces that press on rows whose gap would close, and forces that keep ties. `free` are the
    /// values of each body without contact, `gaps` the gaps at zero values of all bodies, positive when open.
    ///
    /// The multipliers of the previous call are the initial guess; they may change the work, not the result. W is
    /// formed in the first call, and when a flexibility or the choice of rows has changed. Allocates only if more rows
    /// press than ever before.
    ///
    /// # Errors
    ///
    /// [`Error::Dimension`] and [`Error::NotFinite`] for wrong values, [`Error::Frame`] if no forces were found. The
    /// assembly remains usable.
    pub fn solve(&mut self, free: &[&[T]], gaps: &[T]) -> Result<&Assembled<T>> {
        self.run(free, gaps, None)
    }

    /// Closes the rows with a true `held`, by forces of any sign and size, without force on the others, including
    /// ties. For jumps of velocity or acceleration (`gaps` zero); the multipliers are then impulses or forces.
    ///
    /// With flexibilities M⁻¹ this is the projection of [`JumpProjection`](crate::JumpProjection), S = W: momentum is
    /// conserved, kinetic energy falls.
    ///
    /// # Errors
    ///
    /// As for [`solve`](Self::solve).
    pub fn hold(&mut self, free: &[&[T]], gaps: &[T], held: &[bool]) -> Result<&Assembled<T>> {
        self.run(free, gaps, Some(held))
    }

    /// [`solve`](Self::solve), or [`hold`](Self::hold) for some rows.
    fn run(&mut self, free: &[&[T]], gaps: &[T], held: Option<&[bool]>) -> Result<&Assembled<T>> {
        let rows = self.rows();
        check_vector("gaps of an assembly", gaps, rows)?;
        check_length("the list of rows held", held.map_or(rows, <[bool]>::len), rows)?;
        check_length("the list of free values", free.len(), self.bodies.len())?;
        for (body, free) in self.bodies.iter().zip(free) {
            check_vector("free values of a body", free, body.dofs)?;
        }
        self.choose(held);
        if !self.formed {
            self.form();
        }
        self.measure(free, gaps);
        self.set_up(held.is_some());
        self.assembled.multipliers.fill(T::zero());
        self.assembled.iterations = self.problem.solve()?;
        self.apply_multipliers(free, gaps, held);
        Ok(&self.assembled)
    }

    /// Selects the rows of the problem; W is kept if they are the same as in the previous call.
    fn choose(&mut self, held: Option<&[bool]>) {
        let Self { problem, places, formed, .. } = self;
        let chosen = |row: usize| held.is_none_or(|held| held[row]);
        *formed &= places.iter().enumerate().all(|(row, place)| place.is_some() == chosen(row));
        problem.rows.clear();
        problem.rows.extend((0..places.len()).filter(|&row| chosen(row)));
        places.fill(None);
        for (place, &row) in problem.rows.iter().enumerate() {
            places[row] = Some(place);
        }
    }

    /// Forms W of the selected rows, body by body.
    fn form(&mut self) {
        let Self { bodies, problem, places, response, formed, .. } = self;
        let size = problem.rows.len();
        problem.delassus.clear();
        problem.delassus.resize(size * size, T::zero());
        for body in bodies.iter() {
            let response = &mut response[..body.dofs];
            for (k, (row, entries)) in body.rows().enumerate() {
                let Some(column) = places[row] else { continue };
                response.fill(T::zero());
                body.respond(entries.iter().copied(), response);
                for (row, entries) in body.rows().take(k + 1) {
                    let Some(place) = places[row] else { continue };
                    let value = combined(entries, response);
                    problem.delassus[place * size + column] += value;
                    if place != column {
                        problem.delassus[column * size + place] += value;
                    }
                }
            }
        }
        problem.version = new_version();
        *formed = true;
    }

    /// Computes the gaps without forces, and their rounding.
    fn measure(&mut self, free: &[&[T]], gaps: &[T]) {
        self.offsets.copy_from_slice(gaps);
        for (rounding, gap) in self.roundings.iter_mut().zip(gaps) {
            *rounding = gap.abs();
        }
        for (body, free) in self.bodies.iter().zip(free) {
            for (row, entries) in body.rows() {
                self.offsets[row] += combined(entries, free);
                self.roundings[row] += entries.iter().map(|&(dof, weight)| (weight * free[dof]).abs()).sum::<T>();
            }
        }
        for size in &mut self.roundings {
            *size = rounding(*size);
        }
    }

    /// Sets up the contact problem, starting from the multipliers of the previous call.
    fn set_up(&mut self, hold: bool) {
        let Self { problem, equalities, offsets, roundings, assembled, .. } = self;
        let Problem { rows, multipliers, offset, tolerance, sets, .. } = problem;
        offset.clear();
        offset.extend(rows.iter().map(|&row| offsets[row]));
        tolerance.clear();
        tolerance.extend(rows.iter().map(|&row| roundings[row]));
        multipliers.clear();
        multipliers.extend(rows.iter().map(|&row| assembled.multipliers[row]));
        sets.clear();
        sets.extend(rows.iter().map(|&row| match hold || equalities[row] {
            true => AdmissibleSet::Free,
            false => AdmissibleSet::NonNegative,
        }));
    }

    /// Computes the effect of the multipliers on the bodies.
    fn apply_multipliers(&mut self, free: &[&[T]], gaps: &[T], held: Option<&[bool]>) {
        let Assembled { multipliers, gaps: open, closed, forces, values, .. } = &mut self.assembled;
        for (&row, &multiplier) in self.problem.rows.iter().zip(&self.problem.multipliers) {
            multipliers[row] = multiplier;
        }
        open.copy_from_slice(gaps);
        let outcomes = forces.iter_mut().zip(values);
        for ((body, free), (forces, values)) in self.bodies.iter().zip(free).zip(outcomes) {
            forces.fill(T::zero());
            for (row, entries) in body.rows() {
                for &(dof, weight) in entries {
                    forces[dof] += weight * multipliers[row];
                }
            }
            values.copy_from_slice(free);
            let acting = forces.iter().copied().enumerate().filter(|(_, force)| *force != T::zero());
            body.respond(acting, values);
            for (row, entries) in body.rows() {
                open[row] += combined(entries, values);
            }
        }
        for (row, closed) in closed.iter_mut().enumerate() {
            *closed = match held {
                Some(held) => held[row],
                None => self.equalities[row] || multipliers[row] > T::zero() || open[row] <= self.roundings[row],
            };
        }
    }
}

/// Σ weight · value.
fn combined<T: Real>(entries: &[(usize, T)], values: &[T]) -> T {
    entries.iter().map(|&(dof, weight)| weight * values[dof]).sum()
}
