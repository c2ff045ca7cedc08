//! The transpose of the corrections of a stage: x ← x − M⁻¹ Gᵀ S⁻¹ (G x − γ), with the damping forces that follow.

use super::Balance;
use super::backward::Back;
use crate::contact::{ContactId, ContactJacobian};
use crate::error::Result;
use crate::real::Real;
use crate::simulation::{CompiledStage, Operator};
use crate::state::{Change, Motion, StageRecord};
use crate::system::System;

/// A corrected stage.
pub(super) struct ChangesBack<'s, 'b, T: Real> {
    pub(super) system: &'s mut dyn System<T>,
    pub(super) operator: &'s mut Operator<T>,
    pub(super) stage: &'s CompiledStage<T>,
    pub(super) h: f64,
    pub(super) back: &'s mut Back<'b, T>,
}

impl<T: Real> ChangesBack<'_, '_, T> {
    /// From the derivatives by the corrected states to those by the states before the corrections. Force and impulse
    /// hold the derivatives by the reported values of the contacts, which have the names `ids`.
    pub(super) fn undo(
        &mut self,
        record: &StageRecord<T>,
        (force, impulse, ids): (&[T], &[T], &[ContactId]),
        new: &mut Motion<T>,
        past: &mut [Motion<T>],
    ) -> Result<()> {
        for change in record.changes.iter().rev().filter(|change| !change.rows.is_empty()) {
            let damped = if change.damps { Some(self.damped(&new.a)?) } else { None };
            let motion = match change.state {
                0 => &mut *new,
                k => &mut past[k - 1],
            };
            let read = |row: usize| change.force * force[row] + change.impulse * impulse[row];
            let sigma = self.remove(&record.rows, change, motion.field_mut(change.field), damped.as_ref(), read)?;
            if change.field == 0 {
                for (&row, &sigma) in change.rows.iter().zip(&sigma) {
                    *self.back.gaps.entry(ids[row]).or_insert(T::zero()) -= sigma;
                }
            }
        }
        Ok(())
    }

    /// The derivatives by the damping forces that follow from those by accelerations.
    fn damped(&mut self, a: &[T]) -> Result<Damped<T>> {
        let follows_mass = self.stage.keeps_balance || !self.stage.reads_acceleration;
        let mut damped = Damped { follows_mass, w: a.to_vec(), share: T::one() };
        self.back.prescribed.iter().for_each(|&dof| damped.w[dof] = T::zero());
        if !follows_mass {
            damped.share = T::of(self.stage.balance_acceleration / (self.h * self.h));
        }
        self.respond(follows_mass, &mut damped.w)?;
        Ok(damped)
    }

    /// `x ← M⁻¹ x`, or A⁻¹ x.
    fn respond(&mut self, follows_mass: bool, x: &mut [T]) -> Result<()> {
        match follows_mass {
            true => self.back.projection.apply_inverse(x),
            false => self.operator.solve(x),
        }
    }

    /// Undoes a change in the derivatives `x`; returns σ, the derivatives by γ. `read` are the derivatives by a unit
    /// of the multiplier of a row.
    fn remove(
        &mut self,
        g: &ContactJacobian<T>,
        change: &Change<T>,
        x: &mut [T],
        damped: Option<&Damped<T>>,
        read: impl Fn(usize) -> T,
    ) -> Result<Vec<T>> {
        let Self { system, back, .. } = self;
        let Change { rows, multipliers, .. } = change;
        // The derivatives by the change itself.
        let mut w = x.to_vec();
        if let Some(damped) = damped {
            back.tangents.add_damping(&**system, -damped.share, &damped.w, &mut w);
        }
        back.projection.apply_inverse(&mut w)?;
        back.projection.close(g, rows)?;
        let mut sigma: Vec<T> = rows.iter().map(|&row| g.product(row, &w) + read(row)).collect();
        back.projection.solve(&mut sigma);
        rows.iter().zip(&sigma).for_each(|(&row, &sigma)| g.scatter(row, -sigma, x));
        back.projection.push(g, (rows, &sigma), -T::one(), &mut w)?;
        let mut moved = vec![T::zero(); w.len()];
        back.projection.push(g, (rows, multipliers), T::one(), &mut moved)?;
        back.parameters.inertia(&mut **system, &moved, &w)?;
        if let Some(damped) = damped {
            self.differentiate_damping(damped, &moved)?;
        }
        Ok(sigma)
    }

    /// The derivatives by the parameters in (M, or A h²/w_ā) δa = −C δv.
    fn differentiate_damping(&mut self, damped: &Damped<T>, moved: &[T]) -> Result<()> {
        let &Damped { follows_mass, share, ref w } = damped;
        let mut a = vec![T::zero(); w.len()];
        self.back.tangents.add_damping(&*self.system, -share, moved, &mut a);
        self.back.prescribed.iter().for_each(|&dof| a[dof] = T::zero());
        self.respond(follows_mass, &mut a)?;
        let [by_u, by_v, by_a] = match follows_mass {
            true => [T::zero(), T::zero(), T::one()],
            false => self.stage.balanced().weights(),
        };
        let scaled = |c: T| a.iter().map(|&a| c * a).collect::<Vec<T>>();
        let (u, mut v) = (scaled(by_u), scaled(by_v));
        T::axpy(share, moved, &mut v);
        let (rest, t) = (vec![T::zero(); w.len()], 0.0);
        let opposite: Vec<T> = w.iter().map(|&w| -w).collect();
        // Forces are linear in u and v: the difference is −K u − C v, without loads.
        let at = |u, v| Balance { t, displacement: u, velocity: v, acceleration: &rest };
        self.back.parameters.force(&mut *self.system, &at(&u, &v), w)?;
        self.back.parameters.force(&mut *self.system, &at(&rest, &rest), &opposite)?;
        self.back.parameters.inertia(&mut *self.system, &scaled(by_a), w)
    }
}

/// Damping forces that follow a change of velocities δv: δa = −share (M or A)⁻¹ C δv, as in the correction.
struct Damped<T> {
    follows_mass: bool,
    share: T,
    /// (M or A)⁻¹ times the derivatives by accelerations.
    w: Vec<T>,
}
