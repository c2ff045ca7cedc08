//! The kinetic energy lost in impacts, for the energy balance.
//!
//! Impulses J along closed rows that change their gap rates from r to r' do the work ½ Jᵀ (r + r'), with
//! J = S⁻¹ (r' − r), S = G M⁻¹ Gᵀ (Kelvin and Tait's theorem). It depends neither on the scheme and its step, nor on
//! the instant of the impact within the step. The works of an impact that a scheme spreads over several steps add up
//! to the same. The displacement of a gap that closes under the force of the scheme is then no work of contact.

use crate::contact::{ContactJacobian, GapRates};
use crate::contact_solver::no_response;
use crate::corrector::JumpProjection;
use crate::error::Result;
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::watch::StepData;
use crate::state::State;

/// Contacts at the start of a step, and memory for their changes in it.
#[derive(Debug)]
pub(crate) struct Impacts<T: Real> {
    projection: JumpProjection<T>,
    /// Version of the rows for which the projection was made.
    version: u64,
    /// Gaps; gap rates, followed by the tangential rates of the bodies; and forces along all rows.
    gaps: Vec<T>,
    rates: Vec<T>,
    forces: Vec<T>,
    own: Vec<GapRates<T>>,
    /// Changes of the rates of closed rows, and the sums of their rates before and after.
    changes: Vec<T>,
    sums: Vec<T>,
}

/// Works of a step that the reported forces do not contain.
#[derive(Clone, Copy)]
pub(crate) struct Hidden<T> {
    pub(crate) impacts: T,
    pub(crate) contact: T,
    pub(crate) friction: T,
}

impl<T: Real> Impacts<T> {
    pub(crate) fn new(projection: JumpProjection<T>) -> Self {
        let [gaps, rates, forces, changes, sums] = [(); 5].map(|()| Vec::new());
        Self { projection, version: 0, gaps, rates, forces, own: Vec::new(), changes, sums }
    }

    /// Evaluates the contacts of the state that a step starts from; `forces` are the forces of its rows.
    pub(crate) fn begin(
        &mut self,
        (constraints, g): (&mut Constraints<'_, T>, &ContactJacobian<T>),
        state: &State<T>,
        forces: &[T],
    ) -> Result<()> {
        let (count, t, u, v) = (constraints.len(), state.time(), state.displacement(), state.velocity());
        let Self { gaps, rates, own, .. } = self;
        self.forces.clear();
        self.forces.extend_from_slice(forces);
        gaps.resize(count, T::zero());
        own.resize(count, GapRates::default());
        constraints.finite_gaps(t, u, gaps)?;
        constraints.finite_rates(t, u, v, own)?;
        rates.clear();
        rates.extend((0..g.rows()).map(|row| g.product(row, v)));
        rates.iter_mut().zip(&*own).for_each(|(rate, own)| *rate += own.rate);
        Ok(())
    }

    /// The works of a step that started from displacements `from`, over which forces are old + `newest` (new − old).
    /// `lambda` are the forces at its end, along the rows where they act.
    pub(crate) fn works(
        &mut self,
        constraints: &mut Constraints<'_, T>,
        data: &StepData<'_, T>,
        lambda: &[T],
        (from, newest): (&[T], T),
    ) -> Result<Hidden<T>> {
        let mut works = Hidden { impacts: T::zero(), contact: T::zero(), friction: T::zero() };
        let StepData { t, motion: [u, v, _], contacts, g, forces, closed, closed_at_start, is_corrected, h, .. } =
            *data;
        if constraints.len() == 0 || closed.is_empty() {
            return Ok(works);
        }
        constraints.finite_rates(t, u, v, &mut self.own)?;
        let Self { projection, changes, sums, rates, own, .. } = self;
        changes.clear();
        sums.clear();
        let mut jumps = false;
        for &row in closed {
            let (before, own) = (rates[row], own[row].rate);
            let rate = g.product(row, v) + own;
            jumps |= (rate - before).abs() > rounding(g.magnitude(row, v) + own.abs() + before.abs());
            changes.push(rate - before);
            sums.push(rate + before);
        }
        if jumps {
            if self.version != constraints.version() {
                self.version = constraints.version();
                projection.reset();
            }
            projection.close_rows(g, closed, |row| no_response(t, constraints.ids[row]))?;
            projection.solve(changes);
            works.impacts = T::of(0.5) * changes.iter().zip(&*sums).map(|(&impulse, &sum)| impulse * sum).sum::<T>();
        }
        let displacement = |row| forces.row(row).map(|(dof, weight)| weight * (u[dof] - from[dof])).sum::<T>();
        for &row in closed {
            let force = |row: usize| self.forces[row] + newest * (lambda[row] - self.forces[row]);
            let change = contacts.gap[row] - self.gaps[row];
            works.contact -= force(row) * change;
            // Corrected forces do not contain the impulse of the impact.
            if is_corrected && !closed_at_start[row] {
                works.contact += (contacts.impulse[row] / T::of(h) - force(row)) * (displacement(row) - change);
                for k in constraints.tangents().of(row) {
                    let mean = T::of(0.5) * (self.rates[k] + g.product(k, v));
                    works.friction += contacts.impulse[k] * mean - force(k) * displacement(k);
                }
            }
        }
        Ok(works)
    }
}
