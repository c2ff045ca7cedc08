//! The transpose of the corrections of a stage: x ← x − M⁻¹ Gᵀ S⁻¹ (G x − γ), with the damping forces that follow.

use super::Balance;
use super::backward::Back;
use super::conditions::{released, solve_transposed};
use super::turning::Turning;
use crate::contact::ContactJacobian;
use crate::contact_solver::no_response;
use crate::error::Result;
use crate::real::Real;
use crate::simulation::{CompiledStage, Operator};
use crate::state::{Change, ContactState, Guide, Motion, Rule, StageRecord, StepRecord};
use crate::system::System;

/// A corrected stage.
pub(super) struct ChangesBack<'s, 'a, 'b, T: Real> {
    pub(super) system: &'s mut dyn System<T>,
    pub(super) operator: &'s mut Operator<T>,
    pub(super) stage: &'s CompiledStage<T>,
    pub(super) h: f64,
    pub(super) step: &'s StepRecord<T>,
    /// If rows turn.
    pub(super) turning: Option<Turning<'s, 'a, T>>,
    pub(super) back: &'s mut Back<'b, T>,
}

impl<T: Real> ChangesBack<'_, '_, '_, T> {
    /// From the derivatives by the corrected states to those by the states before the corrections, and by raw
    /// multipliers, which are returned. Force and impulse hold the derivatives by the reported values of the contacts.
    pub(super) fn undo(
        &mut self,
        record: &StageRecord<T>,
        (force, impulse): (&[T], &[T]),
        new: &mut Motion<T>,
        past: &mut [Motion<T>],
    ) -> Result<Vec<T>> {
        let mut raw = self.back.zeros(force.len());
        raw.copy_from_slice(force);
        // Derivatives by the totals of the velocity jumps, which give later friction its direction.
        let mut totals = self.back.zeros(force.len());
        for change in record.changes.iter().rev().filter(|change| !change.rows.is_empty()) {
            let damped = if change.damps { Some(self.damped(&new.a)?) } else { None };
            let motion = match change.state {
                0 => &mut *new,
                k => &mut past[k - 1],
            };
            let guides = change.state == 0 && change.field == 1;
            let read = |row: usize| {
                let reported = change.force * force[row] + change.impulse * impulse[row];
                reported + if guides { totals[row] } else { T::zero() }
            };
            let Removed { psi, sigma, w } =
                self.remove(&record.rows, change, motion.field_mut(change.field), damped.as_ref(), read)?;
            if let Some(turning) = &mut self.turning {
                let solved = record.solved.as_ref().unwrap_or(&self.step.state.motion);
                turning.undo_change(change, &sigma, &w, solved, new)?;
            }
            self.back.give([w]);
            for (k, (&row, rule)) in change.rows.iter().zip(&change.rules).enumerate() {
                if guides {
                    raw[row] += change.share * totals[row];
                }
                match *rule {
                    Rule::Closed if change.field == 0 && !record.rows.is_tangential(row) => {
                        *self.back.gaps.entry(self.step.state.contacts.ids[row]).or_insert(T::zero()) -= sigma[k];
                    }
                    // A past displacement is moved to that of the state where the contact sticks.
                    Rule::Closed if change.field == 0 => record.rows.scatter(row, sigma[k], &mut new.u),
                    Rule::Closed => {}
                    Rule::Unloaded => raw[row] -= change.share * psi[k],
                    Rule::Slides { normal, share, turn, by } => {
                        raw[row] -= change.share * psi[k];
                        raw[change.rows[normal]] += share * change.share * psi[k];
                        let turned = change.rows[normal + 1..].iter().zip(turn).filter(|_| by == Guide::Impulse);
                        turned.for_each(|(&row, turn)| totals[row] += turn * psi[k]);
                    }
                }
            }
            let name = |k: usize| self.step.state.contacts.ids[self.step.state.contacts.tangents.owner(change.rows[k])];
            self.back.add_friction(&change.rules, |k| (name(k), psi[k]), |k| change.totals[k]);
        }
        self.back.give([totals]);
        Ok(raw)
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

    /// Undoes a change in the derivatives `x`. `read` are the derivatives by a unit of the multiplier of a row.
    fn remove(
        &mut self,
        g: &ContactJacobian<T>,
        change: &Change<T>,
        x: &mut [T],
        damped: Option<&Damped<T>>,
        read: impl Fn(usize) -> T,
    ) -> Result<Removed<T>> {
        let Self { system, back, .. } = self;
        let Change { rows, rules, multipliers, .. } = change;
        // The derivatives by the change itself.
        let mut w = back.zeros(x.len());
        w.copy_from_slice(x);
        if let Some(damped) = damped {
            back.tangents.add_damping(&**system, -damped.share, &damped.w, &mut w);
        }
        back.projection.apply_inverse(&mut w)?;
        let mut psi: Vec<T> = rows.iter().map(|&row| g.product(row, &w) + read(row)).collect();
        back.solve_jumps((g, rows), rules, &mut psi, &self.step.state.contacts)?;
        let sigma = released(rules, &psi);
        rows.iter().zip(&sigma).for_each(|(&row, &sigma)| g.scatter(row, -sigma, x));
        back.projection.push(g, (rows, &sigma), -T::one(), &mut w)?;
        let mut moved = back.zeros(w.len());
        back.projection.push(g, (rows, multipliers), T::one(), &mut moved)?;
        back.parameters.inertia(&mut **system, &moved, &w)?;
        if let Some(damped) = damped {
            self.differentiate_damping(damped, &moved)?;
        }
        self.back.give([moved]);
        Ok(Removed { psi, sigma, w })
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

/// A change that is undone: ψ of its conditions, σ = Pᵀ ψ, and the derivatives w by M times the change.
struct Removed<T> {
    psi: Vec<T>,
    sigma: Vec<T>,
    w: Vec<T>,
}

/// Damping forces that follow a change of velocities δv: δa = −share (M or A)⁻¹ C δv, as in the correction.
struct Damped<T> {
    follows_mass: bool,
    share: T,
    /// (M or A)⁻¹ times the derivatives by accelerations.
    w: Vec<T>,
}

impl<T: Real> Back<'_, T> {
    /// Solves for ψ of the conditions of jumps, in place of x̄.
    pub(super) fn solve_jumps(
        &mut self,
        (g, rows): (&ContactJacobian<T>, &[usize]),
        rules: &[Rule<T>],
        x: &mut [T],
        contacts: &ContactState<T>,
    ) -> Result<()> {
        let Self { projection, factor, factorized, .. } = self;
        if rules.iter().all(|rule| *rule == Rule::Closed) {
            projection.close(g, rows)?;
            projection.solve(x);
            return Ok(());
        }
        let mut s = Vec::new();
        projection.assemble(g, rows, &mut s)?;
        *factorized = None;
        let (size, t) = (rows.len(), 0.0);
        let refuse = |k: usize| no_response(t, contacts.ids[contacts.tangents.owner(rows[k])]);
        solve_transposed(factor, rules, (|i, j| s[i * size + j], |_| T::zero()), x).map_err(refuse)
    }
}
