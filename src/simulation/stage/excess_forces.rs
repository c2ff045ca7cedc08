//! Contacts on dofs without mass that close or open in a stage exert a force for a part of it only: the stage is
//! solved again without the excess of their mean forces.

use crate::contact::{ContactJacobian, ContactLaw};
use crate::corrector::{Gaps, JumpProjection, Switching};
use crate::dense::dot;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::build::program::{CompiledStage, Program};
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::massless::MasslessBlock;
use crate::state::{ContactState, Motion};
use crate::system::{Linearity, System};

/// Maximum number of repeated solutions of a stage.
const PASSES: usize = 8;

/// The share of the work of all closing and opening contacts that may be left to the velocities.
const LEFT: f64 = 1e-3;

/// Subtracts from the mean contact forces of a stage, ½ (λ + λ'), the part δ that contacts which close or open in it
/// do not exert, so that the energy does not change (theory, section 15.2). For linear systems and schemes that find
/// u and the forces together; δ is stored in [`Switching`].
#[derive(Debug)]
pub(crate) struct ExcessForces<T: Real> {
    /// The static balance of the dofs without mass.
    statics: MasslessBlock<T>,
    /// Gaps at the end of the stage, one a row.
    gaps: Vec<T>,
    /// The required change of δ, one entry per row.
    misses: Vec<T>,
    /// The displacement in the stage, and the displacement at the mean velocity that dofs without mass follow
    /// statically. One entry a dof, as all below.
    way: Vec<T>,
    followed: Vec<T>,
    /// −G̃ᵀ δ: forces on all dofs. Dofs without mass pass them on.
    forces: Vec<T>,
    /// Changes of the acceleration at the start of this stage by these forces, and of the stage before; the latter is
    /// empty if a step has one stage.
    change: Vec<T>,
    carried: Vec<T>,
    /// Whether there is a change in this stage, and whether there was one in the stage before.
    is_shifted: bool,
    is_carried: bool,
    /// The share of an impulse in v that is momentum at the end of a step.
    impulse_weight: T,
}

/// The weights in u and v of a change of the acceleration at the start of a stage: v changes by the mean
/// acceleration, u by the mean of v.
fn shares<T: Real>(stage: &CompiledStage<T>, h: f64) -> [T; 2] {
    let length = h * (stage.end - stage.start);
    [0.25 * length * length, 0.5 * length].map(T::of)
}

/// Whether u depends on the mean of two accelerations as on a constant acceleration: β = ¼.
fn is_trapezoidal<T: Real>(stage: &CompiledStage<T>) -> bool {
    let ([by_u, _, by_a], length) = (stage.response, stage.end - stage.start);
    (by_u - 0.25 * length * length * by_a).abs() < 1e-12 * by_u.abs()
}

impl<T: Real> ExcessForces<T> {
    /// For a linear system and its dofs without mass. None if there are no such dofs or their
    /// stiffness alone does not hold them, and for schemes whose forces are not the forces of the state.
    pub(crate) fn new(
        system: &mut dyn System<T>,
        program: &Program<T>,
        massless: &[usize],
        at: &Motion<T>,
        interface: &[usize],
    ) -> Result<Option<Box<Self>>> {
        // Between stages only a change of the acceleration at the start of the first stage is passed on.
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
            gaps: Vec::new(),
            misses: Vec::new(),
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

    /// Begins a stage, the first of its step or a later one, which takes over the change of the stage before.
    pub(crate) fn begin(&mut self, is_first: bool) {
        self.is_carried = !is_first && self.is_shifted;
        if self.is_carried {
            std::mem::swap(&mut self.carried, &mut self.change);
        }
        self.is_shifted = false;
    }

    /// Adds the effects of the forces of the stage before, and of this one, to a predicted motion.
    pub(crate) fn shift(&self, stage: &CompiledStage<T>, h: f64, new: &mut Motion<T>) {
        if self.is_shifted {
            for (share, out) in shares(stage, h).into_iter().zip([&mut new.u, &mut new.v]) {
                T::axpy(share, &self.change, out);
            }
        }
        if self.is_carried {
            // The state before the start of this stage is the state at the start of the step.
            for (share, out) in stage.recovery.shares_of_acceleration(1).into_iter().zip([&mut new.u, &mut new.v]) {
                T::axpy(share, &self.carried, out);
            }
        }
    }

    /// Solves a stage again until contacts that close or open in it leave the energy nearly unchanged. Returns the
    /// change of energy by the forces not exerted.
    pub(crate) fn solve_again(
        &mut self,
        solve: &mut StageSolve<'_, '_, T>,
        switching: &mut Switching<T>,
        projection: &mut JumpProjection<T>,
    ) -> Result<T> {
        let mut part = None;
        for pass in 0.. {
            let left = self.measure(solve, switching)?;
            // If the iteration does not improve, the last solution is the stage without any excess.
            if left <= T::of(LEFT) || pass > PASSES || pass == PASSES && left < T::one() {
                break;
            }
            if pass < PASSES {
                part = Some(switching.move_excess(&self.misses, part));
            } else {
                switching.forget_excess();
            }
            self.press_less(solve.g, projection, &solve.vectors.supports.dofs, &solve.contact.trial, switching)?;
            solve.predict()?;
            self.shift(solve.stage, solve.clock.h, solve.new);
            solve.solve(None, None)?;
        }
        Ok(if self.is_shifted { dot(&self.forces, &self.followed) } else { T::zero() })
    }

    /// Books the excess forces of a stage, once the impulses of its contacts have been booked.
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

    /// Finds the required change of δ, and the work that δ does not do. Returns the work of the required changes as a
    /// share of the work of all contacts that close or open.
    fn measure(&mut self, solve: &mut StageSolve<'_, '_, T>, switching: &mut Switching<T>) -> Result<T> {
        let StageSolve { constraints, g, clock, stage, new, past, contact, .. } = solve;
        let Some(start) = past.first() else { return Ok(T::zero()) };
        let contacts = &contact.trial;
        let Self { statics, gaps, misses, way, followed, .. } = self;
        let (mut missed, mut all) = (T::zero(), T::zero());
        if !switching.switches(contacts) {
            return Ok(T::zero());
        }
        for values in [&mut *gaps, &mut *misses] {
            values.resize(constraints.len(), T::zero());
        }
        constraints.finite_gaps(new.t, &new.u, gaps)?;
        // The work of a constant force is its work along the mean velocity, for β = ¼ along the displacement itself.
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
            // A resting contact may close and open by rounding in every step.
            let gap = if before > T::zero() { gaps[row] } else { at_start };
            let is_open = || gap > constraints.gap_rounding(row, g.magnitude(row, &new.u), gap);
            let counts = closes_or_opens && is_balanced() && is_open();
            if !counts && excess.force == T::zero() {
                (*miss, excess.work) = (T::zero(), T::zero());
                continue;
            }
            let moved = gaps[row] - at_start;
            // The change of the gap if no contact had held the dofs without mass.
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

    /// Converts δ to a change of the acceleration with which the stage starts.
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
        // The mean of two accelerations contains half of each.
        for x in change.iter_mut() {
            *x = *x + *x;
        }
        self.is_shifted = true;
        Ok(())
    }
}
