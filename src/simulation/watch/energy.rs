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
use crate::simulation::watch::StepData;
use crate::simulation::watch::impacts::Impacts;
use crate::state::State;
use crate::system::System;
use std::ops::Range;

/// Accumulates [`Works`]. Each step costs one load, one product with C, the gaps and their rates at the start and,
/// with supports, one evaluation of f.
#[derive(Debug)]
pub(crate) struct Ledger<T: Real> {
    together: Together<T>,
    works: Works<T>,
    /// The total energy at the start of the run.
    start: T,
    /// Displacements at the start of the step.
    old_u: Vec<T>,
    residual: Vec<T>,
    /// Whether there are supports, on any rank: their forces are computed from the balance.
    is_supported: bool,
    before: Forces<T>,
    after: Forces<T>,
    impacts: Impacts<T>,
    /// Reported forces along the rows where they act.
    row_forces: Vec<T>,
    /// Works at the end of a step that is not accepted yet.
    next_works: Works<T>,
}

/// Forces at one end of a step, one entry a dof.
#[derive(Debug)]
struct Forces<T> {
    load: Vec<T>,
    /// Of the supports, one entry a prescribed dof.
    reactions: Vec<T>,
    /// Gᵀ λ along the gaps.
    contact: Vec<T>,
    /// The same for friction, and for springs with dashpots; empty as long as there are none.
    friction: Vec<T>,
    damped: Vec<T>,
    /// The energy stored in these springs, and the power of damping.
    stored: T,
    power: T,
}

impl<T: Real> Forces<T> {
    fn new(dofs: usize, supports: usize) -> Self {
        let [load, contact] = [(); 2].map(|()| vec![T::zero(); dofs]);
        let (reactions, zero) = (vec![T::zero(); supports], T::zero());
        Self { load, reactions, contact, friction: Vec::new(), damped: Vec::new(), stored: zero, power: zero }
    }

    /// Memory for the forces that these constraints have.
    fn make_room(&mut self, constraints: &Constraints<'_, T>) {
        let dofs = self.contact.len();
        if !constraints.tangents().is_empty() {
            self.friction.resize(dofs, T::zero());
        }
        if constraints.laws().damped {
            self.damped.resize(dofs, T::zero());
        }
    }

    /// Sets the forces of contact to zero.
    fn clear(&mut self) {
        for forces in [&mut self.contact, &mut self.friction, &mut self.damped] {
            forces.fill(T::zero());
        }
        self.stored = T::zero();
    }

    /// Adds the force of a row of `g`.
    fn add(&mut self, (constraints, g): Rows<'_, '_, T>, row: usize, force: T, gap: impl Fn() -> T) {
        let forces = if g.is_tangential(row) {
            &mut self.friction
        } else if constraints.laws()[row].is_damped() {
            self.stored += constraints.laws()[row].stored(gap());
            &mut self.damped
        } else {
            &mut self.contact
        };
        g.scatter(row, force, forces);
    }
}

/// The constraints and their rows of G.
pub(crate) type Rows<'r, 'a, T> = (&'r Constraints<'a, T>, &'r ContactJacobian<T>);

impl<T: Real> Ledger<T> {
    pub(crate) fn new(
        system: &mut dyn System<T>,
        (together, solver): (&Together<T>, &dyn LinearSolver<T>),
        state: &State<T>,
        rows: Rows<'_, '_, T>,
    ) -> Result<Self> {
        let projection = start::projection(system, rows.0, (together, solver))?;
        let (dofs, supports) = (system.dofs(), system.prescribed().len());
        let [supports_of_all] = together.max(Ok([supports as f64]))?;
        let energy = energy(system, together, state, None);
        energy.check(state.time())?;
        let mut ledger = Self {
            together: together.clone(),
            works: Works::default(),
            start: energy.total(),
            old_u: vec![T::zero(); dofs],
            residual: vec![T::zero(); dofs],
            is_supported: supports_of_all > 0.0,
            before: Forces::new(dofs, supports),
            after: Forces::new(dofs, supports),
            impacts: Impacts::new(projection),
            row_forces: Vec::new(),
            next_works: Works::default(),
        };
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
        let (t, contacts) = (state.time(), &state.contacts);
        self.after.make_room(rows.0);
        self.after.clear();
        // Without supports a state is evaluated neither in a step nor here: a run continues with stored data.
        if self.is_supported {
            self.after.reactions = reactions(system, state, rows)?;
        }
        self.after.power = self.damping_power(system, state.displacement(), state.velocity())?;
        system.external_load(t, &mut self.after.load)?;
        finite(t, "the force of the supports", self.after.reactions.iter().copied().sum::<T>())?;
        finite(t, "the power of damping", self.after.power)?;
        finite(t, "the load", self.after.load.iter().copied().sum::<T>())?;
        for (contact, row) in rows.0.all_rows_of(contacts) {
            self.after.add(rows, row, contacts.lambda[contact], || contacts.gap[contact]);
        }
        std::mem::swap(&mut self.before, &mut self.after);
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
        data: &StepData<'_, T>,
    ) -> Result<()> {
        self.evaluate_end(system, constraints, data)?;
        let Self { together, before, after, old_u, .. } = &*self;
        let half = T::of(0.5);
        let [u, v, _] = data.motion;
        // On ranks, each sum holds the part of this rank.
        let mut by_supports = T::zero();
        for ((&old, &new), &dof) in before.reactions.iter().zip(&after.reactions).zip(system.prescribed()) {
            if together.owns(dof) {
                by_supports += half * (old + new) * (u[dof] - old_u[dof]);
            }
        }
        let ends = [&old_u[..], u];
        let by_loads = together.part_of_work(ends, |dof| half * (before.load[dof] + after.load[dof]));
        // The force in the middle of the step, on the line through the forces of two steps.
        let newest = T::of(1.5 - data.load);
        let work = |old: &[T], new: &[T]| match new.is_empty() {
            true => T::zero(),
            false => together.part_of_work(ends, |dof| old[dof] + newest * (new[dof] - old[dof])),
        };
        let by_contact = work(&before.contact, &after.contact);
        let by_friction = work(&before.friction, &after.friction);
        let by_damped = work(&before.damped, &after.damped);
        // The work of springs that is not stored elastically belongs to the dashpots.
        let kept = after.stored - before.stored;
        let parts = [by_supports, by_loads, by_contact, by_friction, by_damped].map(T::value);
        let [by_supports, by_loads, by_contact, by_friction, by_damped] = together.sum(Ok(parts))?.map(T::of);
        let hidden = self.impacts.works(constraints, data, &self.row_forces, (&self.old_u, newest))?;
        self.after.power = self.damping_power(system, u, v)?;
        let mut works = self.works;
        works.supports += by_supports;
        works.load += by_loads;
        works.contact += by_contact + hidden.contact - kept;
        works.friction += by_friction + hidden.friction;
        works.impacts += hidden.impacts;
        works.corrections += data.corrections;
        works.damping += half * (self.before.power + self.after.power) * T::of(data.h) + by_damped + kept;
        self.next_works = works;
        works.check(data.t)
    }

    /// Evaluates the forces at the end of a step, except damping.
    fn evaluate_end(
        &mut self,
        system: &mut dyn System<T>,
        constraints: &Constraints<'_, T>,
        data: &StepData<'_, T>,
    ) -> Result<()> {
        let Self { before, after, residual, row_forces, .. } = self;
        if self.is_supported {
            balance_residual(system, data.t, data.motion, &data.contacts.lambda, data.g, residual)?;
            after.reactions.iter_mut().zip(system.prescribed()).for_each(|(force, &dof)| *force = residual[dof]);
        }
        system.external_load(data.t, &mut after.load)?;
        before.make_room(constraints);
        after.make_room(constraints);
        after.clear();
        row_forces.clone_from(&data.contacts.lambda);
        let tangents = &data.contacts.tangents;
        tangents.turn([data.g, data.forces], &mut row_forces[tangents.all()]);
        for (row, &force) in row_forces.iter().enumerate() {
            after.add((constraints, data.forces), row, force, || data.contacts.gap[row]);
        }
        Ok(())
    }

    /// Stores the results of [`prepare`](Self::prepare) for an accepted step.
    pub(crate) fn end(&mut self) {
        self.works = self.next_works;
        std::mem::swap(&mut self.before, &mut self.after);
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
