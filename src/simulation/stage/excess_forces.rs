//! Contacts on dofs without mass that close or open in a stage press for a part of it only: the stage is solved again
//! without the excess of their mean forces.

use crate::contact::{ContactJacobian, ContactLaw};
use crate::corrector::{Gaps, JumpProjection, Switching};
use crate::dense::dot;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::build::program::{CompiledStage, Program};
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::stage::massless::MasslessBlock;
use crate::simulation::stage::vectors::{StageVectors, predict};
use crate::state::{ContactState, Motion};
use crate::system::{Linearity, System};

/// The most often that a stage is solved again.
const PASSES: usize = 8;

/// Which part of the work of all that closes or opens may be left to the velocities.
const LEFT: f64 = 1e-3;

/// Takes from the mean contact forces of a stage, ½ (λ + λ'), what contacts that close or open in it do not exert: δ,
/// by which the energy does not change (theory, section 15.2). For linear systems and schemes that find u and the
/// forces together; δ is in [`Switching`].
#[derive(Debug)]
pub(crate) struct ExcessForces<T: Real> {
    /// The static balance of the dofs without mass.
    statics: MasslessBlock<T>,
    /// Gaps at the end of the stage, one a row.
    gaps: Vec<T>,
    /// What δ is to change by, one a row.
    misses: Vec<T>,
    /// The way of the stage, and that with the mean velocity, which dofs without mass follow statically. One entry a
    /// dof, as all below.
    way: Vec<T>,
    followed: Vec<T>,
    /// −G̃ᵀ δ: forces on the dofs with mass, and on those without, from where they are passed on.
    forces: Vec<T>,
    /// What the forces change the acceleration by with which the stage starts, and that of the stage before; this is
    /// empty if a step has one stage.
    change: Vec<T>,
    carried: Vec<T>,
    /// Whether there is a change in this stage, and whether there was one in the stage before.
    is_shifted: bool,
    is_carried: bool,
    /// How much of an impulse in v is momentum, at the end of a step.
    impulse_weight: T,
}

/// The parts of a constant acceleration in u and v at the end of a stage that moves by means, u through v alone.
fn shares<T: Real>(stage: &CompiledStage<T>, h: f64) -> [T; 2] {
    let length = h * (stage.end - stage.start);
    [0.25 * length * length, 0.5 * length].map(T::of)
}

/// Whether a stage takes the mean of two accelerations to u as a constant one: β = ¼.
fn is_trapezoidal<T: Real>(stage: &CompiledStage<T>) -> bool {
    let ([by_u, _, by_a], length) = (stage.response, stage.end - stage.start);
    (by_u - 0.25 * length * length * by_a).abs() < 1e-12 * by_u.abs()
}

impl<T: Real> ExcessForces<T> {
    /// For a linear system, its dofs without mass, and so many contacts. None where there are no such dofs, or
    /// stiffness alone does not hold them, and for schemes whose forces are not those of the state.
    pub(crate) fn new(
        system: &mut dyn System<T>,
        program: &Program<T>,
        massless: &[usize],
        at: &Motion<T>,
        (interface, rows): (&[usize], usize),
    ) -> Result<Option<Box<Self>>> {
        // (What goes from one stage to the next is a change of the acceleration at the start of the first.)
        let is_alone = program.stages.len() == 1;
        let is_plain = |stage: &CompiledStage<T>| {
            stage.balance.is_none() && !stage.recovery.reads_past(2) && (is_alone || is_trapezoidal(stage))
        };
        let Some(last) = program.stages.last().filter(|_| program.stages.iter().all(is_plain)) else { return Ok(None) };
        if massless.is_empty() || system.linearity() == Linearity::Nonlinear {
            return Ok(None);
        }
        let statics = match MasslessBlock::of_statics(system, massless, at, interface) {
            Ok(statics) => statics,
            Err(Error::Asymmetric { .. } | Error::Singular { .. }) => return Ok(None),
            Err(error) => return Err(error),
        };
        let (dofs, stages) = (system.dofs(), program.stages.len());
        let vector = || vec![T::zero(); dofs];
        Ok(Some(Box::new(Self {
            statics,
            gaps: Vec::with_capacity(rows),
            misses: Vec::with_capacity(rows),
            way: vector(),
            followed: vector(),
            forces: vector(),
            change: vector(),
            carried: if stages > 1 { vector() } else { Vec::new() },
            is_shifted: false,
            is_carried: false,
            impulse_weight: T::of(last.covector[0][1]),
        })))
    }

    /// Room for so many rows.
    pub(crate) fn make_room(&mut self, rows: usize) {
        for values in [&mut self.gaps, &mut self.misses] {
            values.reserve(rows.saturating_sub(values.len()));
        }
    }

    /// Begins a stage, the first of its step or another one, and has it start as the one before has ended.
    pub(crate) fn begin(&mut self, is_first: bool) {
        self.is_carried = !is_first && self.is_shifted;
        if self.is_carried {
            std::mem::swap(&mut self.carried, &mut self.change);
        }
        self.is_shifted = false;
    }

    /// Adds to a predicted motion what the forces of the stage before, and those of this one, do to it.
    pub(crate) fn shift(&self, stage: &CompiledStage<T>, h: f64, new: &mut Motion<T>) {
        if self.is_shifted {
            for (share, out) in shares(stage, h).into_iter().zip([&mut new.u, &mut new.v]) {
                T::axpy(share, &self.change, out);
            }
        }
        if self.is_carried {
            // (The state behind the start of this stage is that at the start of the step.)
            for (share, out) in stage.recovery.shares_of_acceleration(1).into_iter().zip([&mut new.u, &mut new.v]) {
                T::axpy(share, &self.carried, out);
            }
        }
    }

    /// Solves a stage again until contacts that close or open in it leave the energy as it is, or nearly so. Says by
    /// how much the energy has changed by what they exert less.
    pub(crate) fn solve_again(
        &mut self,
        solve: &mut StageSolve<'_, '_, T>,
        (new, past): (&mut Motion<T>, &[Motion<T>]),
        (vectors, contact): (&mut StageVectors<T>, &mut ContactWork<T>),
        (switching, projection): (&mut Switching<T>, &mut JumpProjection<T>),
    ) -> Result<T> {
        let Some(start) = past.first() else { return Ok(T::zero()) };
        let mut part = None;
        for pass in 0.. {
            let left = self.measure(solve, [start, new], &contact.trial, switching)?;
            // (The last pass of those that have come no nearer is the stage as it was.)
            if left <= T::of(LEFT) || pass > PASSES || pass == PASSES && left < T::one() {
                break;
            }
            if pass < PASSES {
                part = Some(switching.move_excess(&self.misses, part));
            } else {
                switching.forget_excess();
            }
            self.press_less(solve.g, projection, &vectors.supports.dofs, &contact.trial, switching)?;
            predict(solve.stage, solve.clock, &mut *solve.system, new, past, vectors)?;
            self.shift(solve.stage, solve.clock.h, new);
            solve.directly(None, new, past, vectors, contact)?;
        }
        Ok(if self.is_shifted { dot(&self.forces, &self.followed) } else { T::zero() })
    }

    /// Books what the contacts of a stage exert less, once their impulses have been booked.
    pub(crate) fn book(
        &self,
        stage: &CompiledStage<T>,
        h: f64,
        switching: &Switching<T>,
        contacts: &mut ContactState<T>,
    ) {
        if self.is_shifted {
            switching.book_excess(self.impulse_weight * T::of(h * (stage.end - stage.start)), contacts);
        }
    }

    /// Finds how far δ is from what the stage asks for, and the work that it leaves undone. Says how much work the
    /// misses make, as a part of that of all contacts that close or open.
    fn measure(
        &mut self,
        solve: &mut StageSolve<'_, '_, T>,
        [start, new]: [&Motion<T>; 2],
        contacts: &ContactState<T>,
        switching: &mut Switching<T>,
    ) -> Result<T> {
        let StageSolve { constraints, g, clock, stage, .. } = solve;
        let Self { statics, gaps, misses, way, followed, .. } = self;
        let (mut missed, mut all) = (T::zero(), T::zero());
        if !switching.switches(contacts) {
            return Ok(T::zero());
        }
        for values in [&mut *gaps, &mut *misses] {
            values.resize(constraints.len(), T::zero());
        }
        constraints.finite_gaps(new.t, &new.u, gaps)?;
        // (The work of a constant force is that along the mean velocity, which β = ¼ makes the way itself.)
        let half = T::of(0.5 * clock.h * (stage.end - stage.start));
        way.fill(T::zero());
        T::axpy(half, &start.v, way);
        T::axpy(half, &new.v, way);
        statics.follow(way, followed)?;
        way.copy_from_slice(&new.u);
        T::axpy(-T::one(), &start.u, way);
        for (row, miss) in misses.iter_mut().enumerate() {
            let at_start = switching.gap(row);
            let (before, after, excess) = switching.forces(row, contacts);
            let closes_or_opens = (before > T::zero()) != (after > T::zero());
            let is_balanced = || constraints.law(row) == ContactLaw::Rigid && g.acts_on(row, &statics.dofs);
            // (What rests may close and open by rounding, in every step.)
            let gap = if before > T::zero() { gaps[row] } else { at_start };
            let is_open = || gap > constraints.gap_rounding(row, g.magnitude(row, &new.u), gap);
            let counts = closes_or_opens && is_balanced() && is_open();
            if !counts && excess.force == T::zero() {
                (*miss, excess.work) = (T::zero(), T::zero());
                continue;
            }
            let moved = gaps[row] - at_start;
            // By how much the gap would have changed if no contact had held the dofs without mass.
            let free = moved - g.product(row, way) + g.product(row, followed);
            excess.work = excess.force * free;
            let (mean, work) = (T::of(0.5) * (before + after), T::of(0.5) * (before + after) * moved);
            let wanted = (work - contacts.dissipated[row]) / free;
            let wanted = if counts && wanted > T::zero() { wanted.min(mean) } else { T::zero() };
            *miss = wanted - excess.force;
            missed += (*miss * free).abs();
            all += if counts { work.abs() } else { T::zero() };
        }
        Ok(if missed > T::zero() { missed / all } else { T::zero() })
    }

    /// Turns δ into a change of the acceleration with which the stage starts.
    fn press_less(
        &mut self,
        g: &ContactJacobian<T>,
        projection: &mut JumpProjection<T>,
        prescribed: &[usize],
        contacts: &ContactState<T>,
        switching: &Switching<T>,
    ) -> Result<()> {
        let Self { statics, forces, change, .. } = self;
        forces.fill(T::zero());
        for (row, force) in switching.excess_forces(contacts) {
            g.scatter(row, -force, forces);
        }
        for &dof in prescribed {
            forces[dof] = T::zero();
        }
        change.copy_from_slice(forces);
        statics.pass_on(change)?;
        projection.apply_inverse(change)?;
        for &dof in statics.dofs.iter().chain(prescribed) {
            change[dof] = T::zero();
        }
        // (The mean of two accelerations has half of each.)
        for x in change.iter_mut() {
            *x = *x + *x;
        }
        self.is_shifted = true;
        Ok(())
    }
}
