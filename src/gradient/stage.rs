//! The transpose of the solution of a stage: of its balance and contact conditions, and of its rows.
//!
//! Forward, with the weights w of d in the rows and τ in the quantity that contact constrains,
//!
//! ```text
//! A δd − Gᵀ δλ = δr          τ G δd + c δλ = δs          (τ = w_ū + `lag` w_v̄ for a compliant law)
//! ```
//!
//! Back, from the derivatives d̄ and λ̄, with W = G A⁻¹ Gᵀ:
//!
//! ```text
//! (W + c/τ) q = λ̄ + G A⁻¹ d̄          w = A⁻¹ (d̄ − Gᵀ q)          dJ = wᵀ δr + (q/τ)ᵀ δs
//! ```
//!
//! With friction the conditions are those of `conditions`.

use super::backward::Back;
use super::conditions::{released, solve_transposed};
use super::turning::{Path, Turning};
use super::{Balance, CompliantContact};
use crate::contact_solver::no_response;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::half_digits;
use crate::simulation::{CompiledStage, Operator, SlipSource, slip_source};
use crate::state::{Compliance, Held, Motion, Rule, StageRecord};
use crate::system::System;

/// Largest number of solutions of a stage whose rows turn; each gains about as many digits as the angle is small.
const ITERATIONS: usize = 40;

/// A solved stage.
pub(super) struct StageBack<'s, 'a, 'b, T: Real> {
    pub(super) system: &'s mut dyn System<T>,
    pub(super) operator: &'s mut Operator<T>,
    pub(super) stage: &'s CompiledStage<T>,
    pub(super) record: &'s StageRecord<T>,
    /// If rows turn.
    pub(super) turning: Option<Turning<'s, 'a, T>>,
    pub(super) back: &'s mut Back<'b, T>,
}

impl<T: Real> StageBack<'_, '_, '_, T> {
    /// From the derivatives by the new state, by raw multipliers and by impulses to those by past states, gaps and
    /// parameters.
    pub(super) fn undo(
        &mut self,
        (raw, impulse): (&[T], &[T]),
        new: &mut Motion<T>,
        past: &mut [Motion<T>],
    ) -> Result<()> {
        let record = self.record;
        let read: Vec<T> = record.held.iter().map(|held| raw[held.row] + record.impulse * impulse[held.row]).collect();
        let mut w = self.back.zeros(new.u.len());
        for (field, weight) in self.stage.recovery.weights().into_iter().enumerate() {
            T::axpy(weight, new.field(field), &mut w);
        }
        self.back.prescribed.iter().for_each(|&dof| w[dof] = T::zero());
        let q = if self.turning.is_some() && !record.held.is_empty() {
            self.solve_turning(&read, &mut w)?
        } else {
            self.solve(&read, &mut w)?
        };

        let Self { system, back, .. } = self;
        let Motion { t, u, v, a } = &record.balance;
        back.parameters.force(&mut **system, &Balance { t: *t, displacement: u, velocity: v, acceleration: a }, &w)?;
        back.parameters.inertia(&mut **system, a, &w)?;
        let mut predicted = back.zero_motion(w.len());
        back.tangents.add_stiffness(&**system, -T::one(), &w, &mut predicted.u);
        back.tangents.add_damping(&**system, -T::one(), &w, &mut predicted.v);
        system.mass().add_product(-T::one(), &w, &mut predicted.a);
        self.add_turned_forces(&w, T::one(), &mut predicted.u)?;
        let record = self.record;
        if !record.held.is_empty() {
            self.undo_conditions(&q, new, &mut predicted, past);
        }
        self.stage.recovery.transpose([&new.u, &new.v, &new.a], past);
        self.stage.balanced().transpose([&predicted.u, &predicted.v, &predicted.a], past);
        self.back.give([w, predicted.u, predicted.v, predicted.a]);
        Ok(())
    }

    /// From the derivatives q by δs to those by the gaps, and by the motions that the conditions read: the predicted
    /// motion of the balance, the new state and the past.
    fn undo_conditions(&mut self, q: &[T], new: &mut Motion<T>, predicted: &mut Motion<T>, past: &mut [Motion<T>]) {
        let Self { stage, record, back, .. } = self;
        let [mut target, mut slip] = [0; 2].map(|_| back.zeros(new.u.len()));
        // Contact on velocities does not read the gap.
        let reads_gap = stage.contact.as_ref().is_none_or(|target| target.forecast.is_none());
        for (held, &q) in record.held.iter().zip(q) {
            match held.compliance {
                _ if held.is_slip => {
                    record.rows.scatter(held.row, -q, &mut slip);
                    continue;
                }
                None => record.rows.scatter(held.row, -q, &mut target),
                Some(Compliance { by_force, lag, law, gap, rate }) => {
                    record.forces.scatter(held.row, -q, &mut predicted.u);
                    record.forces.scatter(held.row, -q * lag, &mut predicted.v);
                    let contact = CompliantContact { id: held.id, law, gap, rate, force: held.force };
                    back.parameters.contact(&contact, q * by_force);
                }
            }
            if held.compliance.is_some() || reads_gap {
                *back.gaps.entry(held.id).or_insert(T::zero()) -= q;
            }
        }
        match &stage.contact {
            Some(contact) => contact.row.transpose(&target, past),
            // Contact is imposed on the displacements of the state.
            None => T::axpy(T::one(), &target, &mut new.u),
        }
        if record.held.iter().any(|held| held.is_slip) {
            match (slip_source(stage, false).0, &stage.contact) {
                (SlipSource::Velocity(scale), _) => T::axpy(scale, &slip, &mut new.v),
                (SlipSource::Target, Some(contact)) => contact.row.transpose(&slip, past),
                (SlipSource::Target | SlipSource::WayAhead | SlipSource::Way, _) => stage.way.transpose(&slip, past),
            }
        }
        back.give([target, slip]);
    }

    /// `out += c ∂(Gᵀ λ)/∂ū w`: forces turn with the rows that they act along.
    fn add_turned_forces(&mut self, w: &[T], c: T, out: &mut [T]) -> Result<()> {
        let Self { record, turning, .. } = self;
        let Some(turning) = turning.as_mut().filter(|_| !record.held.is_empty()) else { return Ok(()) };
        let (rows, forces): (Vec<usize>, Vec<T>) = record.held.iter().map(|held| (held.row, held.force)).unzip();
        let path = Path { from: (record.balance.t, &record.balance.u), rates: (0.0, w) };
        turning.add_derivative(1, path, (&rows, &forces), c, out)
    }

    /// [`solve`](Self::solve) with rows that turn: the matrix has the stiffness of turning forces, and rigid forces act
    /// along other rows F than those G whose gaps they close,
    ///
    /// ```text
    /// (A − w_ū ∂(Fᵀ λ)/∂ū) w + Gᵀ τ q = d̄          −F w + c q = λ̄
    /// ```
    ///
    /// Both differences are small, and are brought to the right.
    fn solve_turning(&mut self, read: &[T], d: &mut [T]) -> Result<Vec<T>> {
        let [by_u, ..] = self.stage.balanced().weights();
        let (known, record) = (d.to_vec(), self.record);
        let mut w = vec![T::zero(); d.len()];
        let mut q = vec![T::zero(); read.len()];
        for _ in 0..ITERATIONS {
            d.copy_from_slice(&known);
            self.add_turned_forces(&w, by_u, d)?;
            for (held, &q) in record.held.iter().zip(&q).filter(|(held, _)| held.compliance.is_none()) {
                let multiplier = self.weight(held) * q;
                record.forces.scatter(held.row, multiplier, d);
                record.rows.scatter(held.row, -multiplier, d);
            }
            self.back.prescribed.iter().for_each(|&dof| d[dof] = T::zero());
            q = self.solve(read, d)?;
            let change = d.iter().zip(&w).fold(T::zero(), |most, (&new, &old)| (new - old).abs().max(most));
            w.copy_from_slice(d);
            if change <= half_digits::<T>() * T::largest(d) {
                return Ok(q);
            }
        }
        let (part, reason) =
            ("the gradient through rows that turn".into(), "they turn too much in a step: choose smaller ones");
        Err(Error::Incompatible { part, reason })
    }

    /// d̄ becomes w; returns the derivatives by δs: q/τ, or Pᵀ ψ.
    fn solve(&mut self, read: &[T], d: &mut [T]) -> Result<Vec<T>> {
        let size = self.operator.interface();
        let [mut interface, mut response, mut forces] = [0; 3].map(|_| self.back.zeros(size));
        self.operator.begin(d, &mut interface)?;
        let held = &self.record.held;
        let weights: Vec<T> = held.iter().map(|held| self.weight(held)).collect();
        // A force that depends on known displacements alone follows below, unless it has friction.
        let has_slip = held.iter().any(|held| held.is_slip);
        let solved: Vec<usize> = (0..held.len()).filter(|&k| has_slip || weights[k] != T::zero()).collect();
        let rows: Vec<usize> = solved.iter().map(|&k| held[k].row).collect();
        let mut q = vec![T::zero(); held.len()];
        if !rows.is_empty() {
            let g = &*self.record.forces;
            let mut multipliers: Vec<T> =
                solved.iter().map(|&k| read[k] + g.interface_product(held[k].row, &interface)).collect();
            match has_slip {
                true => self.solve_with_friction(&rows, &weights, &mut multipliers)?,
                false => self.solve_closed(&rows, &weights, &solved, &mut multipliers)?,
            }
            for (&k, multiplier) in solved.iter().zip(&mut multipliers) {
                q[k] = *multiplier;
                *multiplier *= weights[k];
            }
            self.operator.answer(g, (&rows, &multipliers), &mut forces, &mut response);
            T::axpy(-T::one(), &response, &mut interface);
            for force in &mut forces {
                *force = -*force;
            }
        }
        self.operator.finish(d, &interface, &forces)?;
        self.back.give([interface, response, forces]);
        if !has_slip {
            // c δλ = δs.
            let g = &*self.record.forces;
            for (k, held) in held.iter().enumerate().filter(|&(k, _)| weights[k] == T::zero()) {
                q[k] = held.compliance.map_or(T::zero(), |known| (read[k] + g.product(held.row, d)) / known.by_force);
            }
        }
        Ok(q)
    }

    /// Solves (W + c/τ) q = x for closed rows; x becomes q/τ. W is factorized unless it was the last one.
    fn solve_closed(&mut self, rows: &[usize], weights: &[T], solved: &[usize], x: &mut [T]) -> Result<()> {
        let Self { operator, record, back: Back { factor, factorized, .. }, .. } = self;
        let compliance = |k: usize| {
            let known = record.held[solved[k]].compliance;
            known.map_or(T::zero(), |known| known.by_force / weights[solved[k]])
        };
        let (w, version) = operator.delassus(&record.forces, rows, compliance)?;
        if *factorized != Some(version) {
            *factorized = None;
            let size = rows.len();
            let refuse = |row: usize| no_response(record.balance.t, record.held[solved[row]].id);
            factor.factorize(size, |i, j| w[i * size + j]).map_err(refuse)?;
            *factorized = Some(version);
        }
        factor.solve(x);
        solved.iter().zip(x).for_each(|(&k, x)| *x /= weights[k]);
        Ok(())
    }

    /// Solves for ψ of all rows that carried a force; x becomes Pᵀ ψ.
    fn solve_with_friction(&mut self, rows: &[usize], weights: &[T], x: &mut [T]) -> Result<()> {
        let Self { operator, record, back, .. } = self;
        let (w, _) = operator.delassus(&record.forces, rows, |_| T::zero())?;
        let (size, held) = (rows.len(), &record.held);
        let rules: Vec<Rule<T>> = held.iter().map(|held| held.rule).collect();
        let entry = |i: usize, j: usize| weights[i] * w[i * size + j];
        let compliance = |k: usize| held[k].compliance.map_or(T::zero(), |known| known.by_force);
        back.factorized = None;
        let refuse = |row: usize| no_response(record.balance.t, held[row].id);
        solve_transposed(&mut back.factor, &rules, (entry, compliance), x).map_err(refuse)?;
        back.add_friction(&rules, |k| (held[k].id, x[k]), |k| held[k].force);
        let released = released(&rules, x);
        x.copy_from_slice(&released);
        Ok(())
    }

    /// τ of a row.
    fn weight(&self, held: &Held<T>) -> T {
        let Self { stage, .. } = self;
        match (&stage.contact, held.compliance) {
            _ if held.is_slip => slip_source(stage, false).1,
            (_, Some(compliance)) => {
                let [by_u, by_v, _] = stage.balanced().weights();
                by_u + compliance.lag * by_v
            }
            (Some(contact), None) => contact.row.weight,
            (None, None) => stage.recovery.weights()[0],
        }
    }
}
