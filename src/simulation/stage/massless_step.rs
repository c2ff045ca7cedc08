//! Dofs without mass in an explicit stage: brought into static balance before the other dofs are solved for.

use crate::contact::Candidates;
use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::rows::contact_rows::Part;
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::{ContactStep, ContactWork};
use crate::simulation::stage::massless::MasslessBlock;
use crate::simulation::stage::vectors::StageVectors;
use crate::state::Motion;

/// Maximum number of linearizations of rows.
const LINEARIZATIONS: usize = 20;

impl<T: Real> StageSolve<'_, '_, T> {
    /// Brings dofs without mass into static balance with the predicted displacements of the others, and with contact.
    /// The residual in `vectors.increment` becomes the residual of the other dofs in this configuration. Contacts on
    /// dofs without mass may act on other dofs too: these forces are added to it.
    ///
    /// The balance is linear, gaps may be curved: rows are linearized again until the displacements converge.
    pub(crate) fn settle(
        &mut self,
        block: &mut MasslessBlock<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        (block.stage.load, block.stage.end) = (self.stage.load, self.stage.end);
        let mut first = T::zero();
        for pass in 0..LINEARIZATIONS {
            self.sort_rows(block, &mut contact.rows.on_massless)?;
            block.operator.follow(self.constraints.version());
            block.operator.begin(&mut vectors.increment, &mut contact.interface.increment)?;
            self.statistics.linear_solves += 1;
            contact.interface.forces.fill(T::zero());
            if self.constraints.len() > 0 && T::all_finite(&contact.interface.increment) {
                let Self { clock, system, constraints, g, solver, statistics, .. } = self;
                let (stage, solver, part) = (&block.stage, &mut **solver, Part::Massless);
                let mut step =
                    ContactStep { stage, clock: *clock, constraints, g, solver, statistics, iterate: None, part };
                let settled = step.solve(&mut **system, &mut block.operator, new, past, vectors, contact)?;
                self.refuse_unsettled(settled, new.t, &contact.rows.curved)?;
            }
            let (StageVectors { increment, balance, .. }, interface) = (&mut *vectors, &contact.interface);
            block.operator.finish(increment, &interface.increment, &interface.forces)?;
            let (mut largest, mut scale) = (T::zero(), T::zero());
            for (j, &dof) in block.dofs.iter().enumerate() {
                let d = increment[dof];
                if !d.is_finite() {
                    let (t, h, value) = (self.clock.at(0.0), self.clock.h, d.value());
                    return Err(Error::StepNotFinite { t, h, what: "the increment", dof, value });
                }
                new.u[dof] += d;
                (largest, scale) = (largest.max(d.abs()), scale.max(new.u[dof].abs()));
                for (row, k) in block.columns.column(j) {
                    increment[row] -= k * d;
                }
                increment[dof] = T::zero();
            }
            if pass == 0 {
                first = largest;
            }
            let moved = self.constraints.follow(new.t, &new.u, self.g)?;
            let settled = pass > 0 && largest <= rounding(scale) + T::of(1e-9) * first;
            if moved == Candidates::Unchanged || settled {
                for &(dof, place) in &block.massive {
                    increment[dof] += interface.forces[place];
                }
                if let Some(balance) = balance {
                    for &dof in &block.dofs {
                        balance.u[dof] = new.u[dof];
                    }
                }
                self.operator.follow(self.constraints.version());
                return self.sort_rows(block, &mut contact.rows.on_massless);
            }
            // The residual without contact is the negative of the contact forces that balance it.
            for (&dof, &place) in block.dofs.iter().zip(&block.places) {
                increment[dof] = if place < interface.forces.len() { -interface.forces[place] } else { T::zero() };
            }
        }
        let (t, h) = (self.clock.at(0.0), self.clock.h);
        Err(Error::NewtonNotConverged {
            t,
            h,
            iterations: LINEARIZATIONS,
            residual: 0.0,
            increment: if first > T::zero() { 1.0 } else { 0.0 },
            dof: block.dofs[0],
        })
    }

    /// Finds the rows that act on dofs without mass. Refuses laws there that depend on more than the gap, and
    /// friction there if the normal force acts on dofs with mass and is found after the static balance.
    fn sort_rows(&self, block: &mut MasslessBlock<T>, on_massless: &mut [bool]) -> Result<()> {
        if block.sorted == self.constraints.version() {
            return Ok(());
        }
        for (row, on_massless) in on_massless.iter_mut().enumerate().take(self.constraints.len()) {
            *on_massless = self.g.acts_on(row, &block.dofs);
            let (law, tangents) = (self.constraints.law(row), self.constraints.tangents());
            let rubs = tangents.friction(row) > 0.0 && tangents.rub_on(self.g, row, &block.dofs);
            if rubs && !*on_massless {
                return Err(Error::Incompatible {
                    part: format!("friction of contact {} on dofs without mass", self.constraints.ids[row]),
                    reason: "its normal force acts on dofs with mass, and explicit stages find that after the balance \
                             of those without; choose an implicit scheme, or take the mass from the normal direction \
                             of a contact, or from all",
                });
            }
            if *on_massless && (law.rebounds() || law.inertia() > 0.0 || law.is_damped()) {
                return Err(Error::Incompatible {
                    part: format!("{law:?} of contact {} on dofs without mass", self.constraints.ids[row]),
                    reason: "such dofs stop and start at once; choose a law that reads the gap alone, or give them a \
                             mass",
                });
            }
        }
        block.sorted = self.constraints.version();
        Ok(())
    }
}

/// Computes the velocity of dofs without mass from the parabola through their last three displacements. The rows of a
/// scheme compute v from a, which is zero on such dofs.
///
/// `now` is the time since the `start` of the step, `before` the time interval before it; `slopes` are the
/// differences of the displacements over that interval, divided by it.
pub(crate) fn difference<T: Real>(
    massless: &[usize],
    slopes: &[T],
    start: &[T],
    [now, before]: [f64; 2],
    new: &mut Motion<T>,
) {
    let curve = T::of(now / (now + before));
    for (&dof, &slope) in massless.iter().zip(slopes) {
        let newest = (new.u[dof] - start[dof]) / T::of(now);
        (new.v[dof], new.a[dof]) = (newest + curve * (newest - slope), T::zero());
    }
}
