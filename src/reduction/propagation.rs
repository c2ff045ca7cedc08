//! Reduced bodies without a time scheme: each mode is solved exactly within a step.

use super::body::{Boundary, ReducedBody};
use super::exact_step::ExactStep;
use crate::contact::{ContactConstraint, LinearRows};
use crate::contact_id::ContactId;
use crate::contact_solver::{ActiveSet, AdmissibleSet, ContactProblem, ContactSolver, contact_error, new_version};
use crate::dense::{DenseCholesky, dot};
use crate::error::{Error, Result};
use crate::memory;
use crate::real::Real;
use crate::rounding::{half_digits, rounding};
use crate::sparse::check_vector;
use crate::system::check_step_size;
use std::f64::consts::PI;
use std::ops::Range;

type Load<'a, T> = Box<dyn FnMut(f64, &mut [T]) + Send + 'a>;

/// Reduced bodies, propagated exactly: within a step every mode follows its equation under a contact force that is
/// linear in time.
///
/// ```math
/// \begin{aligned}
/// & \ddot\eta + 2 \xi \omega \dot\eta + \omega^2 \eta = P^T \left( \lambda_n + (\lambda_{n+1} - \lambda_n) \, t / h
///   \right) + \ldots \\
/// & u_b = P \eta_{n+1} + F \lambda_{n+1}, \qquad 0 \le G u_b + g_0 \perp \lambda_{n+1} \ge 0
/// \end{aligned}
/// ```
///
/// Each mode uses the recurrence of Nigam and Jennings (Bull. Seism. Soc. Am. 59, 1969), also known as the piecewise
/// exact method; contact is imposed at the end of the step. It is no [`TimeIntegrator`](crate::TimeIntegrator): its
/// coefficients differ from mode to mode, which a tableau cannot express. Dofs are numbered as in
/// [`Blocks`](super::Blocks): one body after the other, its modes, then its contact dofs.
///
/// * Free motion is exact, damped or not, in steps of any length up to the limit below, and so is motion under loads
///   that are linear in each step. In contact the force is second-order accurate where it is smooth.
/// * The step is limited to ω_r h ≤ π, with ω_r the largest frequency of the modes: one value of the force does not
///   control a mode that turns by more than half a circle in a step. Bodies that are not tapered have a quarter of
///   that limit: in tests they gained energy with longer steps.
/// * Energy in contact is not proven to be conserved or bounded; `docs/reduction.md` has measurements.
/// * The given modes are exact: modes of a mesh are delayed by its dispersion, which no scheme compensates here. Use
///   a sufficiently fine parent (`docs/reduction.md`).
/// * No friction, bonds or compliant laws; G is constant (the obstacle may move).
///
/// ```
/// use contact_dynamics::LinearRows;
/// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
/// use contact_dynamics::reduction::{ModalPropagation, Reduction};
///
/// // A free chain of 400 springs and masses flies at a wall: k = m = 1, and the wall presses with √(k m) v.
/// let n = 400;
/// let springs = (1..=n).flat_map(|i| [(i - 1, i - 1, 1.0), (i, i, 1.0), (i - 1, i, -1.0), (i, i - 1, -1.0)]);
/// let entries: Vec<_> = springs.map(|(i, j, k)| Triplet::new(i, j, k)).collect();
/// let k = SparseColMat::<usize, f64>::try_new_from_triplets(n + 1, n + 1, &entries)?;
/// let masses: Vec<_> = (0..=n).map(|i| Triplet::new(i, i, 1.0)).collect();
/// let m = SparseColMat::try_new_from_triplets(n + 1, n + 1, &masses)?;
/// let body = Reduction::new(m.as_ref(), k.as_ref(), &[0]).modes(40)?;
///
/// let wall = LinearRows::new().unilateral(&[(body.contact_dofs().start, 1.0)], 0.02);
/// let mut run = ModalPropagation::builder(&[&body], 4.0)
///     .velocity(body.velocity(&vec![-0.01; n + 1])?)
///     .constraint(wall)
///     .build()?;
/// let before = run.kinetic_energy() + run.elastic_energy();
/// run.run_until(400.0)?;
/// assert!((run.forces()[0] / 0.01 - 1.0).abs() < 0.02);
/// run.run_until(2000.0)?;
/// let after = run.kinetic_energy() + run.elastic_energy();
/// assert!((after / before - 1.0).abs() < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ModalPropagation<'a, T: Real> {
    h: f64,
    start: f64,
    steps: u64,
    bodies: Vec<Body<T>>,
    loads: Loads<'a, T>,
    contact: Contact<'a, T>,
    state: Motion<T>,
    /// The result of a step; it becomes the state if nothing fails.
    next: Motion<T>,
}

/// Builds a [`ModalPropagation`]; everything is checked by [`build`](Self::build).
#[derive(Debug)]
pub struct ModalPropagationBuilder<'a, T: Real> {
    bodies: Vec<&'a ReducedBody<T>>,
    h: f64,
    start: f64,
    displacement: Option<Vec<T>>,
    velocity: Option<Vec<T>>,
    rows: LinearRows<'a, T>,
    load: Option<LoadFunction<'a, T>>,
    solver: Box<dyn ContactSolver<T> + 'a>,
}

/// A time-dependent load.
struct LoadFunction<'a, T>(Load<'a, T>);

impl<T> std::fmt::Debug for LoadFunction<'_, T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("LoadFunction")
    }
}

/// A body: its dofs and the response of its modes.
#[derive(Debug)]
struct Body<T> {
    modes: Range<usize>,
    contact: Range<usize>,
    /// P, contact dof by contact dof, and F.
    coupling: Vec<T>,
    flexibility: Vec<T>,
    squares: Vec<T>,
    steps: Vec<ModeStep<T>>,
}

/// [`ExactStep`] in the scalar of the run.
#[derive(Clone, Copy, Debug)]
struct ModeStep<T> {
    motion: [[T; 2]; 2],
    force: [[T; 2]; 2],
}

#[derive(Debug)]
struct Loads<'a, T> {
    function: Option<LoadFunction<'a, T>>,
    /// Load on all dofs: the constant one, or the one at the end of the step.
    values: Vec<T>,
}

#[derive(Debug)]
struct Contact<'a, T: Real> {
    rows: LinearRows<'a, T>,
    /// G over all dofs.
    entries: Vec<Vec<(usize, T)>>,
    sets: Vec<AdmissibleSet>,
    /// W of a step, and its version.
    delassus: Vec<T>,
    version: u64,
    offset: Vec<T>,
    tolerance: Vec<T>,
    /// Contact forces of the step on all dofs, and a zero displacement for evaluating the gap offsets.
    forces: Vec<T>,
    at_rest: Vec<T>,
    solver: Box<dyn ContactSolver<T> + 'a>,
}

/// A state, on all dofs.
#[derive(Clone, Debug)]
struct Motion<T> {
    displacement: Vec<T>,
    velocity: Vec<T>,
    /// Forces on modes and contact dofs, including contact forces.
    force: Vec<T>,
    multipliers: Vec<T>,
    gaps: Vec<T>,
}

impl<'a, T: Real> ModalPropagationBuilder<'a, T> {
    /// The time at the start; default 0.
    #[must_use]
    pub fn start_time(self, start: f64) -> Self {
        Self { start, ..self }
    }

    /// Displacements of all dofs at the start ([`ReducedBody::displacement`]); zero by default. Contact dofs are
    /// computed from the modes, loads and contact.
    #[must_use]
    pub fn displacement(self, displacement: Vec<T>) -> Self {
        Self { displacement: Some(displacement), ..self }
    }

    /// Velocities of all dofs at the start ([`ReducedBody::velocity`]); zero by default. Contact dofs are computed.
    #[must_use]
    pub fn velocity(self, velocity: Vec<T>) -> Self {
        Self { velocity: Some(velocity), ..self }
    }

    /// The contact rows, over contact dofs of the bodies; rigid or equality rows only.
    #[must_use]
    pub fn constraint(self, rows: LinearRows<'a, T>) -> Self {
        Self { rows, ..self }
    }

    /// A load on all dofs that replaces the constant loads of the bodies: the closure writes the load at t into
    /// zeros. It is interpolated linearly within a step.
    #[must_use]
    pub fn load(self, load: impl FnMut(f64, &mut [T]) + Send + 'a) -> Self {
        Self { load: Some(LoadFunction(Box::new(load))), ..self }
    }

    /// The solver of the contact problems; default [`ActiveSet`].
    #[must_use]
    pub fn contact_solver(self, solver: impl ContactSolver<T> + 'a) -> Self {
        Self { solver: Box::new(solver), ..self }
    }

    /// The propagation, with contact at the start solved.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for a step size that is not positive and finite, and for one with ω_r h > π, for untapered
    /// bodies π/4 (the error has the product); [`Error::Empty`] without a body; [`Error::Incompatible`] for
    /// [`Boundary::CraigBampton`], whose contact dofs have mass, for rows on other dofs, with other laws, friction or
    /// bonds, and for a solver that does not support the rows; [`Error::Dimension`] and [`Error::NotFinite`] for
    /// displacements, velocities and loads; contact errors as in a [`step`](ModalPropagation::step).
    pub fn build(self) -> Result<ModalPropagation<'a, T>> {
        check_step_size::<T>(self.h)?;
        if self.bodies.is_empty() {
            return Err(Error::Empty { what: "the list of reduced bodies", remedy: "give at least one" });
        }
        if !self.start.is_finite() {
            return Err(Error::Parameter { name: "the start time", value: self.start, range: "finite" });
        }
        let (mut bodies, mut constant, mut dofs) = (Vec::new(), Vec::new(), 0);
        for &body in &self.bodies {
            bodies.push(Body::new(body, dofs, self.h)?);
            constant.extend_from_slice(body.constant_load().unwrap_or(&vec![T::zero(); body.dofs()]));
            dofs += body.dofs();
        }
        let contact = Contact::new(self.rows, self.solver, &bodies, dofs)?;
        let start = |what, given: Option<Vec<T>>| -> Result<Vec<T>> {
            let values = given.unwrap_or_else(|| vec![T::zero(); dofs]);
            check_vector(what, &values, dofs)?;
            Ok(values)
        };
        let state = Motion {
            displacement: start("the displacements at the start", self.displacement)?,
            velocity: start("the velocities at the start", self.velocity)?,
            force: vec![T::zero(); dofs],
            multipliers: vec![T::zero(); contact.sets.len()],
            gaps: vec![T::zero(); contact.sets.len()],
        };
        let mut run = ModalPropagation {
            h: self.h,
            start: self.start,
            steps: 0,
            bodies,
            loads: Loads { function: self.load, values: constant },
            contact,
            next: state.clone(),
            state,
        };
        run.begin()?;
        Ok(run)
    }
}

impl<'a, T: Real> ModalPropagation<'a, T> {
    /// A builder for these bodies with step h; see [`ModalPropagationBuilder`] for the options.
    pub fn builder(bodies: &[&'a ReducedBody<T>], h: f64) -> ModalPropagationBuilder<'a, T> {
        ModalPropagationBuilder {
            bodies: bodies.to_vec(),
            h,
            start: 0.0,
            displacement: None,
            velocity: None,
            rows: LinearRows::new(),
            load: None,
            solver: Box::new(ActiveSet::default()),
        }
    }

    /// Time.
    pub fn time(&self) -> f64 {
        self.start + self.steps as f64 * self.h
    }

    /// The step size h.
    pub fn step_size(&self) -> f64 {
        self.h
    }

    /// Displacements of all dofs: for each body its modes, then its contact dofs.
    pub fn displacement(&self) -> &[T] {
        &self.state.displacement
    }

    /// Velocities of all dofs; for contact dofs P η̇ + F λ̇, with λ̇ of the last step.
    pub fn velocity(&self) -> &[T] {
        &self.state.velocity
    }

    /// The contact forces λ of all rows, at the present time.
    pub fn forces(&self) -> &[T] {
        &self.state.multipliers
    }

    /// The gaps of all rows.
    pub fn gaps(&self) -> &[T] {
        &self.state.gaps
    }

    /// Kinetic energy.
    pub fn kinetic_energy(&self) -> T {
        let modes = self.bodies.iter().flat_map(|body| &self.state.velocity[body.modes.clone()]);
        T::of(0.5) * modes.map(|&v| v * v).sum::<T>()
    }

    /// Elastic energy of the modes and of the static response to contact forces.
    pub fn elastic_energy(&self) -> T {
        let of_body = |body: &Body<T>| {
            let modes = self.state.displacement[body.modes.clone()].iter().zip(&body.squares);
            let force = &self.state.force[body.contact.clone()];
            let rows = body.flexibility.chunks_exact(force.len()).zip(force);
            modes.map(|(&x, &square)| square * x * x).sum::<T>() + rows.map(|(row, &f)| f * dot(row, force)).sum::<T>()
        };
        T::of(0.5) * self.bodies.iter().map(of_body).sum::<T>()
    }

    /// Steps until the time is reached or passed, within rounding of the step.
    ///
    /// # Errors
    ///
    /// As [`step`](Self::step); the state is the one after the last successful step.
    pub fn run_until(&mut self, time: f64) -> Result<()> {
        while time - self.time() > half_digits::<f64>() * self.h {
            self.step()?;
        }
        Ok(())
    }

    /// One step.
    ///
    /// # Errors
    ///
    /// [`Error::NotFinite`] for a load, [`Error::StepNotFinite`], [`Error::Contact`] and
    /// [`Error::ContradictoryContacts`]; the state is then unchanged.
    pub fn step(&mut self) -> Result<()> {
        let time = self.start + (self.steps + 1) as f64 * self.h;
        self.loads.evaluate(time)?;
        let Self { bodies, state, next, loads, contact, h, .. } = self;
        for body in bodies.iter() {
            body.convert_loads(&loads.values, &mut next.force);
            body.advance_modes(state, next);
            body.evaluate_contact_dofs(&next.force, &mut next.displacement);
        }
        next.multipliers.copy_from_slice(&state.multipliers);
        contact.solve(time, None, next)?;
        let rate = T::of(1.0 / *h);
        contact.apply_multipliers(&next.multipliers);
        for body in bodies.iter() {
            body.add_response(&mut contact.forces, next);
            body.evaluate_contact_dofs(&next.force, &mut next.displacement);
            // λ̇ replaces λ.
            for dof in body.contact.clone() {
                contact.forces[dof] = rate * (next.force[dof] - state.force[dof]);
            }
            body.evaluate_contact_dofs(&contact.forces, &mut next.velocity);
        }
        for (what, values) in [("displacement", &next.displacement), ("velocity", &next.velocity)] {
            if let Some(dof) = values.iter().position(|x| !x.is_finite()) {
                let value = values[dof].value();
                return Err(Error::StepNotFinite { t: time - *h, h: *h, what, dof, value });
            }
        }
        contact.gaps(time, next)?;
        std::mem::swap(&mut self.state, &mut self.next);
        self.steps += 1;
        Ok(())
    }

    /// Computes contact dofs and forces at the start from the modes, statically.
    fn begin(&mut self) -> Result<()> {
        self.loads.evaluate(self.start)?;
        let Self { bodies, state, loads, contact, .. } = self;
        for body in bodies.iter() {
            body.convert_loads(&loads.values, &mut state.force);
            body.evaluate_contact_dofs(&state.force, &mut state.displacement);
        }
        let delassus = contact.delassus(bodies, |body| body.flexibility.clone())?;
        contact.solve(self.start, Some(&delassus), state)?;
        contact.apply_multipliers(&state.multipliers);
        for body in bodies.iter() {
            body.add_contact_forces(&contact.forces[body.contact.clone()], &mut state.force);
            body.evaluate_contact_dofs(&state.force, &mut state.displacement);
            contact.forces[body.contact.clone()].fill(T::zero());
            body.evaluate_contact_dofs(&contact.forces, &mut state.velocity);
        }
        contact.gaps(self.start, state)
    }
}

impl<T: Real> Loads<'_, T> {
    fn evaluate(&mut self, time: f64) -> Result<()> {
        let Some(LoadFunction(load)) = &mut self.function else { return Ok(()) };
        self.values.fill(T::zero());
        load(time, &mut self.values);
        check_vector("the load on reduced bodies", &self.values, self.values.len())
    }
}

impl<T: Real> Body<T> {
    fn new(body: &ReducedBody<T>, first: usize, h: f64) -> Result<Self> {
        if body.boundary == Boundary::CraigBampton {
            return Err(Error::Incompatible {
                part: "a reduced body by Craig and Bampton".into(),
                reason: "its contact dofs have mass; propagate a tapered or an untapered one",
            });
        }
        let omegas = body.frequencies();
        let (count, contacts) = (omegas.len(), body.dofs() - omegas.len());
        let value = omegas.last().map_or(0.0, |omega| omega * h);
        let (limit, range) = match body.boundary {
            Boundary::Untapered => (0.25 * PI, "at most π/4: take smaller steps, fewer modes, or a tapered body"),
            _ => (PI, "at most π: take smaller steps, or fewer modes"),
        };
        if value > limit {
            let name = "the highest circular frequency of the modes times the step size";
            return Err(Error::Parameter { name, value, range });
        }
        let damping = |k: usize| body.damping().map_or(0.0, |c| crate::sparse::entry(c, k, k).value());
        let scalars = |rows: [[f64; 2]; 2]| rows.map(|row| row.map(T::of));
        let step = |(k, &omega): (usize, &f64)| {
            let step = ExactStep::new(damping(k), omega * omega, h);
            ModeStep { motion: scalars(step.motion), force: scalars(step.force) }
        };
        // F from its inverse.
        let mut factor = DenseCholesky::default();
        let singular = || Error::Incompatible {
            part: "the flexibility of a reduced body".into(),
            reason: "it is singular to rounding; take fewer modes",
        };
        factor.factorize(contacts, |i, j| body.weights[i * contacts + j]).map_err(|_| singular())?;
        if factor.is_singular() {
            return Err(singular());
        }
        let mut flexibility = memory::zeros(contacts, contacts, "the flexibility of a reduced body")?;
        for (k, column) in flexibility.chunks_exact_mut(contacts).enumerate() {
            column[k] = T::one();
            factor.solve(column);
        }
        symmetrize(contacts, &mut flexibility);
        Ok(Self {
            modes: first..first + count,
            contact: first + count..first + count + contacts,
            coupling: body.coupling.clone(),
            flexibility,
            squares: omegas.iter().map(|omega| T::of(omega * omega)).collect(),
            steps: omegas.iter().enumerate().map(step).collect(),
        })
    }

    /// The compliance of the contact dofs over a step: P D Pᵀ + F, with D the diagonal of the modes' responses to a
    /// unit force at the end of the step.
    fn compliance(&self) -> Vec<T> {
        let (count, contacts) = (self.modes.len(), self.contact.len());
        let mut out = self.flexibility.clone();
        for (i, row) in out.chunks_exact_mut(contacts).enumerate() {
            let own = &self.coupling[i * count..(i + 1) * count];
            let moved: Vec<T> = own.iter().zip(&self.steps).map(|(&p, step)| p * step.force[0][1]).collect();
            for (x, other) in row.iter_mut().zip(self.coupling.chunks_exact(count)) {
                *x += dot(&moved, other);
            }
        }
        symmetrize(contacts, &mut out);
        out
    }

    /// Converts loads to forces on modes and contact dofs.
    fn convert_loads(&self, loads: &[T], force: &mut [T]) {
        force[self.modes.clone()].copy_from_slice(&loads[self.modes.clone()]);
        force[self.contact.clone()].fill(T::zero());
        self.add_contact_forces(&loads[self.contact.clone()], force);
    }

    /// Adds forces on the contact dofs, and the resulting forces on the modes.
    fn add_contact_forces(&self, forces: &[T], out: &mut [T]) {
        let (modes, contact) = (self.modes.clone(), self.contact.clone());
        for (row, &force) in self.coupling.chunks_exact(modes.len()).zip(forces) {
            T::axpy(force, row, &mut out[modes.clone()]);
        }
        T::axpy(T::one(), forces, &mut out[contact]);
    }

    /// The modes at the end of a step without contact forces at that time.
    fn advance_modes(&self, state: &Motion<T>, next: &mut Motion<T>) {
        for (dof, step) in self.modes.clone().zip(&self.steps) {
            let (u, v, forces) = (state.displacement[dof], state.velocity[dof], [state.force[dof], next.force[dof]]);
            let row = |k: usize| {
                let ([by_u, by_v], [by_start, by_end]) = (step.motion[k], step.force[k]);
                by_u * u + by_v * v + by_start * forces[0] + by_end * forces[1]
            };
            (next.displacement[dof], next.velocity[dof]) = (row(0), row(1));
        }
    }

    /// Adds the response to contact forces at the end of the step. `forces` has the forces on the contact dofs; the
    /// forces on the modes are written to it.
    fn add_response(&self, forces: &mut [T], next: &mut Motion<T>) {
        let (before, contact) = forces.split_at_mut(self.contact.start);
        let (pushed, contact) = (&mut before[self.modes.clone()], &contact[..self.contact.len()]);
        pushed.fill(T::zero());
        for (row, &force) in self.coupling.chunks_exact(pushed.len()).zip(contact) {
            T::axpy(force, row, pushed);
        }
        for ((dof, step), &force) in self.modes.clone().zip(&self.steps).zip(&*pushed) {
            next.displacement[dof] += step.force[0][1] * force;
            next.velocity[dof] += step.force[1][1] * force;
        }
        self.add_contact_forces(contact, &mut next.force);
    }

    /// u_b = P η + F f, both over all dofs.
    fn evaluate_contact_dofs(&self, forces: &[T], values: &mut [T]) {
        let forces = &forces[self.contact.clone()];
        let (modes, contact) = values.split_at_mut(self.contact.start);
        let modes = &modes[self.modes.clone()];
        let rows = self.coupling.chunks_exact(modes.len()).zip(self.flexibility.chunks_exact(forces.len()));
        for (u, (p, f)) in contact[..forces.len()].iter_mut().zip(rows) {
            *u = dot(p, modes) + dot(f, forces);
        }
    }
}

fn symmetrize<T: Real>(size: usize, a: &mut [T]) {
    for i in 0..size {
        for j in 0..i {
            let mean = T::of(0.5) * (a[i * size + j] + a[j * size + i]);
            (a[i * size + j], a[j * size + i]) = (mean, mean);
        }
    }
}

impl<'a, T: Real> Contact<'a, T> {
    fn new(
        rows: LinearRows<'a, T>,
        solver: Box<dyn ContactSolver<T> + 'a>,
        bodies: &[Body<T>],
        dofs: usize,
    ) -> Result<Self> {
        let plain = rows.plain()?.into_iter().map(|(entries, law)| (entries, AdmissibleSet::from(law)));
        let (entries, sets): (Vec<_>, Vec<AdmissibleSet>) = plain.unzip();
        for (dof, row) in entries.iter().enumerate().flat_map(|(row, of)| of.iter().map(move |&(dof, _)| (dof, row))) {
            if !bodies.iter().any(|body| body.contact.contains(&dof)) {
                return Err(Error::Incompatible {
                    part: format!("dof {dof} of contact row {row} ({dofs} dofs in all)"),
                    reason: "it is no contact dof of a reduced body",
                });
            }
        }
        if let Some(set) = sets.iter().find(|&&set| !solver.admits(set)) {
            return Err(Error::Incompatible {
                part: "the contact solver".into(),
                reason: match set {
                    AdmissibleSet::Free => "it takes no equality rows; use ActiveSet or GaussSeidel",
                    _ => "it takes no unilateral rows; use ActiveSet or GaussSeidel",
                },
            });
        }
        let size = sets.len();
        let (offset, tolerance) = (vec![T::zero(); size], vec![T::zero(); size]);
        let (forces, at_rest) = (vec![T::zero(); dofs], vec![T::zero(); rows.dofs().len()]);
        let (delassus, version) = (Vec::new(), new_version());
        let mut contact = Self { rows, entries, sets, delassus, version, offset, tolerance, forces, at_rest, solver };
        contact.delassus = contact.delassus(bodies, Body::compliance)?;
        Ok(contact)
    }

    /// G C Gᵀ, C the compliances of the bodies.
    fn delassus(&self, bodies: &[Body<T>], compliance: impl Fn(&Body<T>) -> Vec<T>) -> Result<Vec<T>> {
        let size = self.sets.len();
        let mut out = memory::zeros(size, size, "the Delassus operator")?;
        for body in bodies {
            let (contacts, first) = (body.contact.len(), body.contact.start);
            let compliance = compliance(body);
            let of_body = |row: &'_ [(usize, T)]| -> Vec<(usize, T)> {
                let entries = row.iter().filter(|(dof, _)| body.contact.contains(dof));
                entries.map(|&(dof, weight)| (dof - first, weight)).collect()
            };
            let rows: Vec<Vec<(usize, T)>> = self.entries.iter().map(|row| of_body(row)).collect();
            for (i, row) in rows.iter().enumerate() {
                let mut moved = vec![T::zero(); contacts];
                for &(place, weight) in row {
                    T::axpy(weight, &compliance[place * contacts..(place + 1) * contacts], &mut moved);
                }
                for (x, other) in out[i * size..=i * size + i].iter_mut().zip(&rows) {
                    *x += other.iter().map(|&(place, weight)| weight * moved[place]).sum::<T>();
                }
            }
        }
        for i in 0..size {
            for j in 0..i {
                out[j * size + i] = out[i * size + j];
            }
        }
        Ok(out)
    }

    /// G u + g0, and for each row the magnitude of its terms.
    fn gaps(&mut self, time: f64, motion: &mut Motion<T>) -> Result<()> {
        self.rows.gaps(time, &self.at_rest, &mut motion.gaps)?;
        for ((gap, size), entries) in motion.gaps.iter_mut().zip(&mut self.tolerance).zip(&self.entries) {
            let terms = || entries.iter().map(|&(dof, weight)| weight * motion.displacement[dof]);
            *size = gap.abs() + terms().map(T::abs).sum::<T>();
            *gap += terms().sum::<T>();
        }
        Ok(())
    }

    /// The multipliers at the end of a step, from displacements without contact; at the start with another W.
    fn solve(&mut self, time: f64, delassus: Option<&[T]>, motion: &mut Motion<T>) -> Result<()> {
        self.gaps(time, motion)?;
        self.tolerance.iter_mut().for_each(|size| *size = rounding(*size));
        self.offset.copy_from_slice(&motion.gaps);
        let (matrix, version) = match delassus {
            Some(delassus) => (delassus, 0),
            None => (&self.delassus[..], self.version),
        };
        let problem = ContactProblem::new(matrix, &self.offset, &self.sets, &self.tolerance)?.with_version(version);
        let id = |feature: usize| ContactId { feature, ..ContactId::default() };
        match self.solver.solve(&problem, &mut motion.multipliers) {
            Ok(_) => Ok(()),
            Err(failure) => Err(contact_error(time, failure, id)),
        }
    }

    /// Writes Gᵀ λ into the forces.
    fn apply_multipliers(&mut self, multipliers: &[T]) {
        self.forces.fill(T::zero());
        for (row, &multiplier) in self.entries.iter().zip(multipliers) {
            for &(dof, weight) in row {
                self.forces[dof] += weight * multiplier;
            }
        }
    }
}
