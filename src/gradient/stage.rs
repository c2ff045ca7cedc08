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

use super::backward::Back;
use super::{Balance, CompliantContact};
use crate::contact::ContactJacobian;
use crate::contact_solver::no_response;
use crate::error::Result;
use crate::real::Real;
use crate::simulation::{CompiledStage, Operator};
use crate::state::{Compliance, Held, Motion, StageRecord};
use crate::system::System;

/// A solved stage.
pub(super) struct StageBack<'s, 'b, T: Real> {
    pub(super) system: &'s mut dyn System<T>,
    pub(super) operator: &'s mut Operator<T>,
    pub(super) stage: &'s CompiledStage<T>,
    pub(super) record: &'s StageRecord<T>,
    pub(super) back: &'s mut Back<'b, T>,
    /// The number of Delassus operators so far.
    pub(super) versions: &'s mut u64,
}

impl<T: Real> StageBack<'_, '_, T> {
    /// From the derivatives by the new state, by reported forces and by impulses to those by past states, gaps and
    /// parameters.
    pub(super) fn undo(
        &mut self,
        (force, impulse): (&[T], &[T]),
        new: &Motion<T>,
        past: &mut [Motion<T>],
    ) -> Result<()> {
        let record = self.record;
        let read: Vec<T> =
            record.held.iter().map(|held| force[held.row] + record.impulse * impulse[held.row]).collect();
        let mut d = vec![T::zero(); new.u.len()];
        for (field, weight) in self.stage.recovery.weights().into_iter().enumerate() {
            T::axpy(weight, new.field(field), &mut d);
        }
        self.back.prescribed.iter().for_each(|&dof| d[dof] = T::zero());
        let q = self.solve(&read, &mut d)?;
        let w = d;

        let Self { system, stage, back, .. } = self;
        let Motion { t, u, v, a } = &record.balance;
        back.parameters.force(&mut **system, &Balance { t: *t, displacement: u, velocity: v, acceleration: a }, &w)?;
        back.parameters.inertia(&mut **system, a, &w)?;

        let mut predicted = Motion::zero(w.len());
        back.tangents.add_stiffness(&**system, -T::one(), &w, &mut predicted.u);
        back.tangents.add_damping(&**system, -T::one(), &w, &mut predicted.v);
        system.mass().add_product(-T::one(), &w, &mut predicted.a);
        let mut target = vec![T::zero(); w.len()];
        // Contact on velocities does not read the gap.
        let reads_gap = stage.contact.as_ref().is_none_or(|target| target.forecast.is_none());
        for (held, &q) in record.held.iter().zip(&q) {
            match held.compliance {
                None => record.rows.scatter(held.row, -q, &mut target),
                Some(Compliance { by_force, lag, law, gap, rate, force }) => {
                    record.rows.scatter(held.row, -q, &mut predicted.u);
                    record.rows.scatter(held.row, -q * lag, &mut predicted.v);
                    let contact = CompliantContact { id: held.id, law, gap, rate, force };
                    back.parameters.contact(&contact, q * by_force);
                }
            }
            if held.compliance.is_some() || reads_gap {
                *back.gaps.entry(held.id).or_insert(T::zero()) -= q;
            }
        }
        let mut recovered = Motion::zero(0);
        match &stage.contact {
            Some(contact) => contact.row.transpose(&target, past),
            // Contact is imposed on the displacements of the state.
            None => {
                recovered.u = new.u.clone();
                T::axpy(T::one(), &target, &mut recovered.u);
            }
        }
        let moved = if stage.contact.is_some() { &new.u } else { &recovered.u };
        stage.recovery.transpose([moved, &new.v, &new.a], past);
        stage.balanced().transpose([&predicted.u, &predicted.v, &predicted.a], past);
        Ok(())
    }

    /// c/τ of a row.
    fn compliance(&self, held: &Held<T>) -> T {
        held.compliance.map_or(T::zero(), |compliance| compliance.by_force / self.weight(held))
    }

    /// τ of a row.
    fn weight(&self, held: &Held<T>) -> T {
        let Self { stage, .. } = self;
        match (&stage.contact, held.compliance) {
            (_, Some(compliance)) => {
                let [by_u, by_v, _] = stage.balanced().weights();
                by_u + compliance.lag * by_v
            }
            (Some(contact), None) => contact.row.weight,
            (None, None) => stage.recovery.weights()[0],
        }
    }

    /// Factorizes W + c/τ of some rows, unless that was the last one factorized.
    fn factorize(&mut self, g: &ContactJacobian<T>, rows: &[usize], compliance: impl Fn(usize) -> T) -> Result<()> {
        let Self { operator, back: Back { factor, factorized, .. }, versions, record, .. } = self;
        let (w, version) = operator.delassus(g, rows, compliance, versions)?;
        if *factorized == Some(version) {
            return Ok(());
        }
        *factorized = None;
        let size = rows.len();
        let t = record.balance.t;
        let refuse = |row: usize| no_response(t, record.held[row].id);
        factor.factorize(size, |i, j| w[i * size + j]).map_err(refuse)?;
        *factorized = Some(version);
        Ok(())
    }

    /// d̄ becomes w; returns q/τ, the derivatives by δs.
    fn solve(&mut self, read: &[T], d: &mut [T]) -> Result<Vec<T>> {
        let StageRecord { rows: g, held, .. } = self.record;
        let mut q = vec![T::zero(); held.len()];
        let solved: Vec<usize> = (0..held.len()).filter(|&k| self.weight(&held[k]) != T::zero()).collect();
        let rows: Vec<usize> = solved.iter().map(|&k| held[k].row).collect();
        let size = self.operator.interface();
        let [mut interface, mut response, mut forces] = [0; 3].map(|_| vec![T::zero(); size]);
        self.operator.begin(d, &mut interface)?;
        if !rows.is_empty() {
            let mut multipliers: Vec<T> =
                solved.iter().map(|&k| read[k] + g.interface_product(held[k].row, &interface)).collect();
            let compliances: Vec<T> = solved.iter().map(|&k| self.compliance(&held[k])).collect();
            self.factorize(g, &rows, |k| compliances[k])?;
            self.back.factor.solve(&mut multipliers);
            self.operator.answer(g, (&rows, &multipliers), &mut forces, &mut response);
            T::axpy(-T::one(), &response, &mut interface);
            forces.iter_mut().for_each(|force| *force = -*force);
            for (&k, &multiplier) in solved.iter().zip(&multipliers) {
                q[k] = multiplier / self.weight(&held[k]);
            }
        }
        self.operator.finish(d, &interface, &forces)?;
        // A force that depends on known displacements alone: c δλ = δs.
        for (k, held) in held.iter().enumerate().filter(|(_, held)| self.weight(held) == T::zero()) {
            q[k] = held.compliance.map_or(T::zero(), |known| (read[k] + g.product(held.row, d)) / known.by_force);
        }
        Ok(q)
    }
}
