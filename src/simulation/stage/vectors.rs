//! Vectors of a stage, and their values before it is solved: the predicted motion and its residual.

use crate::error::Result;
use crate::real::Real;
use crate::simulation::build::program::CompiledStage;
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::supports::{Supports, put_supports};
use crate::state::Motion;
use crate::system::System;

/// Vectors of a stage, one entry a dof.
pub(crate) struct StageVectors<T> {
    /// Residual, then the increment d.
    pub(crate) increment: Vec<T>,
    /// ū, v̄, ā if the balance does not hold at the recovered state.
    pub(crate) balance: Option<Motion<T>>,
    pub(crate) supports: Supports<T>,
    /// In an iteration of Newton's method, the part of d that motions contain already; empty otherwise.
    pub(crate) iterate: Vec<T>,
}

impl<T: Real> StageVectors<T> {
    /// The motion at which the balance holds.
    pub(crate) fn balanced<'m>(&'m self, stage: &CompiledStage<T>, new: &'m Motion<T>) -> &'m Motion<T> {
        match (&stage.balance, &self.balance) {
            (Some(_), Some(balance)) => balance,
            _ => new,
        }
    }

    /// In an iteration of Newton's method, the part of the unknown that motions contain already: d is then measured
    /// from there, and the accelerations contain all of it.
    pub(crate) fn iterate(&self) -> Option<&[T]> {
        (!self.iterate.is_empty()).then_some(&self.iterate)
    }
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Predicts the new motion at d = 0, and the motion of the balance if it differs: displacements and velocities with
    /// the supports in place, and the part of the accelerations that comes from the past.
    pub(crate) fn predict(&mut self) -> Result<()> {
        let Self { stage, clock, host, new, past, .. } = self;
        let StageVectors { balance, supports, .. } = &mut *self.vectors;
        let Supports { dofs: prescribed, state: supports, balance: balance_supports, .. } = supports;
        new.t = clock.at(stage.end);
        stage.recovery.predict(past, &mut [&mut new.u, &mut new.v, &mut new.a]);
        put_supports(host.system, new.t, prescribed, supports, new)?;
        if let (Some(rows), Some(balance)) = (&stage.balance, balance.as_mut()) {
            rows.predict(past, &mut [&mut balance.u, &mut balance.v, &mut balance.a]);
            put_supports(host.system, clock.at(stage.load), prescribed, balance_supports, balance)?;
            if let (true, Some(start)) = (stage.along_path, past.first()) {
                // Supports too are at the mean of both ends, and their velocity is the difference of the ends over the
                // time: the work of a step is force times this difference.
                let per_step = T::of((clock.h * (stage.end - stage.start)).recip());
                for &dof in prescribed.iter() {
                    let (from, to) = (start.u[dof], new.u[dof]);
                    (balance.u[dof], balance.v[dof]) = (T::of(0.5) * (from + to), per_step * (to - from));
                }
            }
        }
        Ok(())
    }

    /// Sets the accelerations of the supports in a solved stage.
    pub(crate) fn set_support_accelerations(&mut self) {
        let Supports { dofs, state, .. } = &self.vectors.supports;
        for (&dof, support) in dofs.iter().zip(state) {
            self.new.a[dof] = support[2];
        }
    }
}

/// Writes f(t̄, ū, v̄) − M ā of a predicted motion to `vectors.increment`.
pub(crate) fn residual<T: Real>(
    stage: &CompiledStage<T>,
    t_balance: f64,
    system: &mut dyn System<T>,
    new: &mut Motion<T>,
    vectors: &mut StageVectors<T>,
) -> Result<()> {
    let StageVectors { increment, balance, supports, .. } = vectors;
    let Supports { dofs: prescribed, state: supports, balance: balance_supports, coupled_mass } = supports;
    let (rows, supports, motion) = match (&stage.balance, balance.as_mut()) {
        (Some(rows), Some(balance)) => (rows, balance_supports, balance),
        _ => (&stage.recovery, supports, new),
    };
    system.force(t_balance, &motion.u, &motion.v, increment)?;
    // ā at d = 0: on free dofs the part that comes from the past (none where the balance holds at the recovered state),
    // on prescribed dofs the acceleration of the supports.
    if rows.reads_past(2) || *coupled_mass {
        if !rows.reads_past(2) {
            motion.a.fill(T::zero());
        }
        for (&dof, support) in prescribed.iter().zip(supports.iter()) {
            motion.a[dof] = support[2];
        }
        system.mass().add_product(-T::one(), &motion.a, increment);
    }
    for &dof in prescribed.iter() {
        increment[dof] = T::zero();
    }
    Ok(())
}
