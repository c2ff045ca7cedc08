//! Energy of a state, the energy balance of a run, and the forces of the supports.

use crate::contact::ContactJacobian;
use crate::error::Result;
use crate::linear_solver::LinearSolver;
use crate::mass::Mass;
use crate::ranks::Together;
use crate::real::Real;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::run::results::{Energy, Works, finite};
use crate::simulation::start;
use crate::simulation::watch::impacts::Impacts;
use crate::state::{ContactState, State};
use crate::system::System;
use std::ops::Range;

/// Accumulates [`Works`]. Each step costs one load, one product with C, the gaps and their rates at the start and,
/// with supports, one evaluation of f.
#[derive(Debug)]
pub(crate) struct Ledger<T: Real> {
    together: Together<T>,
    works: Works<T>,
    start: T,
    load: Vec<T>,
    old_load: Vec<T>,
    old_u: Vec<T>,
    residual: Vec<T>,
    power: T,
    /// Whether there are supports, on any rank: their forces are computed from the balance.
    is_supported: bool,
    reactions: Vec<T>,
    next_reactions: Vec<T>,
    /// Gᵀ λ at the start and at the end of a step, one entry a dof.
    contact: Vec<T>,
    next_contact: Vec<T>,
    /// The same for friction; empty as long as there is none.
    friction: Vec<T>,
    next_friction: Vec<T>,
    impacts: Impacts<T>,
    /// Reported forces along the rows where they act.
    forces: Vec<T>,
    /// The same for springs with dashpots; empty as long as there are none.
    damped: Vec<T>,
    next_damped: Vec<T>,
    /// The energy stored in these springs at the start of a step.
    stored: T,
    /// Works, damping power and stored energy at the end of a step that is not accepted yet.
    next: (Works<T>, T, T),
}

/// The constraints and their rows of G.
pub(crate) type Rows<'r, 'a, T> = (&'r Constraints<'a, T>, &'r ContactJacobian<T>);

/// The data of a step that the ledger reads.
pub(crate) struct StepBooks<'a, T> {
    pub(crate) t: f64,
    /// u, v and a at the time of the state.
    pub(crate) motion: [&'a [T]; 3],
    pub(crate) contacts: &'a ContactState<T>,
    /// The rows of the gaps, and the rows along which the reported forces act.
    pub(crate) g: &'a ContactJacobian<T>,
    pub(crate) forces: &'a ContactJacobian<T>,
    /// The fraction of the step at which those forces act.
    pub(crate) load: f64,
    /// The closed contacts with mass that leave jumps, which contacts were closed at the start of the step, and whether
    /// correctors remove the jumps.
    pub(crate) closed: &'a [usize],
    pub(crate) closed_at_start: &'a [bool],
    pub(crate) is_corrected: bool,
    pub(crate) corrections: T,
    pub(crate) h: f64,
}

impl<T: Real> Ledger<T> {
    pub(crate) fn new(
        system: &mut dyn System<T>,
        (together, solver): (&Together<T>, &dyn LinearSolver<T>),
        state: &State<T>,
        rows: Rows<'_, '_, T>,
    ) -> Result<Self> {
        let projection = start::projection(system, rows.0, (together, solver))?;
        let zero = || vec![T::zero(); system.dofs()];
        let [supports] = together.max(Ok([system.prescribed().len() as f64]))?;
        let mut ledger = Self {
            together: together.clone(),
            works: Works::default(),
            start: T::zero(),
            load: zero(),
            old_load: zero(),
            old_u: zero(),
            residual: zero(),
            power: T::zero(),
            is_supported: supports > 0.0,
            reactions: vec![T::zero(); system.prescribed().len()],
            next_reactions: vec![T::zero(); system.prescribed().len()],
            contact: zero(),
            next_contact: zero(),
            friction: Vec::new(),
            next_friction: Vec::new(),
            impacts: Impacts::new(projection, rows.0.room()),
            forces: Vec::new(),
            damped: Vec::new(),
            next_damped: Vec::new(),
            stored: T::zero(),
            next: (Works::default(), T::zero(), T::zero()),
        };
        let energy = energy(system, together, state, None);
        energy.check(state.time())?;
        ledger.start = energy.total();
        ledger.restart(system, state, rows)?;
        Ok(ledger)
    }

    /// Evaluates forces and powers of a state at which a run begins, or continues after a discontinuity.
    pub(crate) fn restart(
        &mut self,
        system: &mut dyn System<T>,
        state: &State<T>,
        rows: Rows<'_, '_, T>,
    ) -> Result<()> {
        // Without supports a state is evaluated neither in a step nor here: a run continues with stored data.
        let reactions = if self.is_supported { reactions(system, state, rows)? } else { Vec::new() };
        let power = self.damping_power(system, state.displacement(), state.velocity())?;
        system.external_load(state.time(), &mut self.old_load)?;
        let sums = [reactions.iter().copied().sum(), power, self.old_load.iter().copied().sum()];
        for (what, value) in ["the force of the supports", "the power of damping", "the load"].into_iter().zip(sums) {
            finite(state.time(), what, value)?;
        }
        (self.reactions, self.power) = (reactions, power);
        std::mem::swap(&mut self.load, &mut self.old_load);
        let (constraints, g) = rows;
        self.contact.fill(T::zero());
        if !constraints.tangents().is_empty() {
            self.friction.resize(self.contact.len(), T::zero());
        }
        self.friction.fill(T::zero());
        if constraints.laws().damped {
            self.damped.resize(self.contact.len(), T::zero());
        }
        self.damped.fill(T::zero());
        self.stored = T::zero();
        for (contact, row) in constraints.all_rows_of(&state.contacts) {
            let forces = if g.is_tangential(row) {
                &mut self.friction
            } else if constraints.laws()[row].is_damped() {
                self.stored += constraints.laws()[row].stored(state.contacts.gap[contact]);
                &mut self.damped
            } else {
                &mut self.contact
            };
            g.scatter(row, state.contacts.lambda[contact], forces);
        }
        Ok(())
    }

    fn damping_power(&mut self, system: &mut dyn System<T>, u: &[T], v: &[T]) -> Result<T> {
        let Some(damping) = system.damping_force() else { return Ok(T::zero()) };
        damping.evaluate(u, v, &mut self.residual)?;
        Ok(-self.together.dot(&self.residual, v)?)
    }

    /// Stores the displacements and the contacts at the start of a step; `forces` are the forces of the rows.
    pub(crate) fn begin(
        &mut self,
        rows: (&mut Constraints<'_, T>, &ContactJacobian<T>),
        state: &State<T>,
        forces: &[T],
    ) -> Result<()> {
        self.old_u.copy_from_slice(state.displacement());
        self.impacts.begin(rows, state, forces)
    }

    /// Computes the works of a step before it is accepted. This may fail.
    pub(crate) fn prepare(
        &mut self,
        system: &mut dyn System<T>,
        constraints: &mut Constraints<'_, T>,
        books: &StepBooks<'_, T>,
    ) -> Result<()> {
        if self.is_supported {
            balance_residual(system, books.t, books.motion, &books.contacts.lambda, books.g, &mut self.residual)?;
        }
        let half = T::of(0.5);
        let [u, v, _] = books.motion;
        let mut works = self.works;
        // On ranks, each sum holds the part of this rank.
        let mut by_supports = T::zero();
        for ((&reaction, next), &dof) in self.reactions.iter().zip(&mut self.next_reactions).zip(system.prescribed()) {
            *next = self.residual[dof];
            let mean = half * (reaction + *next);
            if self.together.owns(dof) {
                by_supports += mean * (u[dof] - self.old_u[dof]);
            }
        }
        // The load at the end is kept in the spare vector until the step is accepted.
        system.external_load(books.t, &mut self.old_load)?;
        let way = [&self.old_u[..], u];
        let by_loads = self.together.part_of_work(way, |dof| half * (self.load[dof] + self.old_load[dof]));
        if !books.contacts.tangents.is_empty() && self.friction.is_empty() {
            self.friction.resize(u.len(), T::zero());
        }
        if constraints.laws().damped && self.damped.is_empty() {
            self.damped.resize(u.len(), T::zero());
        }
        self.next_friction.resize(self.friction.len(), T::zero());
        self.next_damped.resize(self.damped.len(), T::zero());
        self.next_contact.fill(T::zero());
        self.next_friction.fill(T::zero());
        self.next_damped.fill(T::zero());
        let mut stored = T::zero();
        self.forces.clone_from(&books.contacts.lambda);
        let tangents = &books.contacts.tangents;
        tangents.turn([books.g, books.forces], &mut self.forces[tangents.all()]);
        for (row, &force) in self.forces.iter().enumerate() {
            let forces = if books.forces.is_tangential(row) {
                &mut self.next_friction
            } else if constraints.laws()[row].is_damped() {
                stored += constraints.laws()[row].stored(books.contacts.gap[row]);
                &mut self.next_damped
            } else {
                &mut self.next_contact
            };
            books.forces.scatter(row, force, forces);
        }
        // The force in the middle of the step, on the line through the forces of two steps.
        let newest = T::of(1.5 - books.load);
        let work = |old: &[T], new: &[T]| match new.is_empty() {
            true => T::zero(),
            false => self.together.part_of_work(way, |dof| old[dof] + newest * (new[dof] - old[dof])),
        };
        let (by_contact, by_friction) =
            (work(&self.contact, &self.next_contact), work(&self.friction, &self.next_friction));
        let by_damped = work(&self.damped, &self.next_damped);
        let parts = [by_supports, by_loads, by_contact, by_friction, by_damped].map(T::value);
        let [by_supports, by_loads, by_contact, by_friction, by_damped] = self.together.sum(Ok(parts))?.map(T::of);
        works.supports += by_supports;
        works.load += by_loads;
        let hidden = self.impacts.works(constraints, books, &self.forces, (&self.old_u, newest))?;
        // The work of springs that is not stored elastically belongs to the dashpots.
        let kept = stored - self.stored;
        works.contact += by_contact + hidden.contact - kept;
        works.friction += by_friction + hidden.friction;
        works.impacts += hidden.impacts;
        works.corrections += books.corrections;
        let power = self.damping_power(system, u, v)?;
        works.damping += half * (self.power + power) * T::of(books.h) + by_damped + kept;
        self.next = (works, power, stored);
        works.check(books.t)
    }

    /// Stores the results of [`prepare`](Self::prepare) for an accepted step.
    pub(crate) fn end(&mut self) {
        (self.works, self.power, self.stored) = self.next;
        std::mem::swap(&mut self.load, &mut self.old_load);
        std::mem::swap(&mut self.reactions, &mut self.next_reactions);
        std::mem::swap(&mut self.contact, &mut self.next_contact);
        std::mem::swap(&mut self.friction, &mut self.next_friction);
        std::mem::swap(&mut self.damped, &mut self.next_damped);
    }

    fn works(&self, total: T) -> Works<T> {
        let Works { load, supports, damping, contact, friction, impacts, corrections, .. } = self.works;
        let remainder = total - self.start - (load + supports + damping + contact + friction + impacts + corrections);
        Works { remainder, ..self.works }
    }
}

/// Energy of a state, with the balance of a ledger. All ranks must call it; if they cannot be reached the energy is
/// not finite.
pub(crate) fn energy<T: Real>(
    system: &mut dyn System<T>,
    together: &Together<T>,
    state: &State<T>,
    ledger: Option<&Ledger<T>>,
) -> Energy<T> {
    let v = state.velocity();
    let twice = match system.mass() {
        Mass::Lumped(mass) => {
            let own = |part: Range<usize>| mass[part.clone()].iter().zip(&v[part]).map(|(&m, &v)| m * v * v).sum::<T>();
            together.owned(v.len()).map(own).sum::<T>()
        }
        consistent @ Mass::Consistent(_) => {
            let mut momentum = vec![T::zero(); v.len()];
            consistent.add_product(T::one(), v, &mut momentum);
            together.part_of_dot(&momentum, v)
        }
    };
    let kinetic = together.sum(Ok([twice.value()])).map_or(T::nan(), |[twice]| T::of(0.5) * T::of(twice));
    let energy = Energy { kinetic, potential: system.potential_energy(state.displacement()), works: None };
    Energy { works: ledger.map(|ledger| ledger.works(energy.total())), ..energy }
}

/// R = M a − f − Gᵀ λ on the prescribed dofs.
pub(crate) fn reactions<T: Real>(
    system: &mut dyn System<T>,
    state: &State<T>,
    (constraints, g): Rows<'_, '_, T>,
) -> Result<Vec<T>> {
    let mut forces = vec![T::zero(); constraints.len() + constraints.tangents().len()];
    for (contact, row) in constraints.all_rows_of(&state.contacts) {
        forces[row] = state.contacts.lambda[contact];
    }
    let mut residual = vec![T::zero(); system.dofs()];
    let motion = [state.displacement(), state.velocity(), state.acceleration()];
    balance_residual(system, state.time(), motion, &forces, g, &mut residual)?;
    Ok(system.prescribed().iter().map(|&dof| residual[dof]).collect())
}

/// M a − f − Gᵀ λ on all dofs: on prescribed dofs the force of the support.
fn balance_residual<T: Real>(
    system: &mut dyn System<T>,
    t: f64,
    [u, v, a]: [&[T]; 3],
    forces: &[T],
    g: &ContactJacobian<T>,
    residual: &mut [T],
) -> Result<()> {
    system.force(t, u, v, residual)?;
    for (row, &force) in forces.iter().enumerate() {
        g.scatter(row, force, residual);
    }
    for r in residual.iter_mut() {
        *r = -*r;
    }
    system.mass().add_product(T::one(), a, residual);
    Ok(())
}
