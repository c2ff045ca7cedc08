//! Vectors of a stage, and their values before it is solved: the predicted motion and its residual.

use crate::error::Result;
use crate::real::Real;
use crate::simulation::build::program::CompiledStage;
use crate::simulation::stage::supports::{Supports, put_supports};
use crate::state::{Clock, Motion};
use crate::system::System;

/// Vectors of a stage, one entry a dof.
pub(crate) struct StageVectors<T> {
    /// Residual, then the increment d.
    pub(crate) increment: Vec<T>,
    /// ū, v̄, ā if the balance does not hold at the recovered state.
    pub(crate) balance: Option<Motion<T>>,
    pub(crate) supports: Supports<T>,
}

/// Predicts the new motion at d = 0, and the motion of the balance if it differs: displacements and velocities with
/// the supports in place, and the part of the accelerations that comes from the past.
pub(crate) fn predict<T: Real>(
    stage: &CompiledStage<T>,
    clock: Clock,
    system: &mut dyn System<T>,
    new: &mut Motion<T>,
    past: &[Motion<T>],
    vectors: &mut StageVectors<T>,
) -> Result<()> {
    let StageVectors { balance, supports, .. } = vectors;
    let Supports { dofs: prescribed, state: supports, balance: balance_supports, .. } = supports;
    stage.recovery.predict(past, &mut [&mut new.u, &mut new.v, &mut new.a]);
    put_supports(system, new.t, prescribed, supports, new)?;
    if let (Some(rows), Some(balance)) = (&stage.balance, balance.as_mut()) {
        rows.predict(past, &mut [&mut balance.u, &mut balance.v, &mut balance.a]);
        put_supports(system, clock.at(stage.load), prescribed, balance_supports, balance)?;
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

/// Writes f(t̄, ū, v̄) − M ā of a predicted motion to `vectors.increment`.
pub(crate) fn residual<T: Real>(
    stage: &CompiledStage<T>,
    t_balance: f64,
    system: &mut dyn System<T>,
    new: &mut Motion<T>,
    vectors: &mut StageVectors<T>,
) -> Result<()> {
    let StageVectors { increment, balance, supports } = vectors;
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
