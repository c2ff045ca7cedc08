//! Dofs without mass in an explicit stage: brought into static balance before the other dofs are solved for.

use crate::corrector::Gaps;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::rows::massless_rows::Problem;
use crate::simulation::stage::massless::MasslessBlock;
use crate::simulation::stage::vectors::StageVectors;
use crate::simulation::stage::{Host, StageSolve};

impl<'a, T: Real> StageSolve<'_, 'a, T> {
    /// Brings dofs without mass into static balance with the predicted displacements of the others, and with contact.
    /// The residual in `vectors.increment` becomes the residual of the other dofs in this configuration. Contacts on
    /// dofs without mass may act on other dofs too: these forces are added to it.
    pub(crate) fn balance_massless(&mut self, block: &mut MasslessBlock<T>) -> Result<()> {
        self.contact.rows.massless.problem = Problem::Static;
        (block.stage.load, block.stage.end) = (self.stage.load, self.stage.end);
        self.sort_rows(block)?;
        block.operator.follow(self.constraints.version());
        let converged = self.of_block(block).solve_linearized()?;
        self.refuse_not_converged(converged)?;
        self.move_massless(block)?;
        self.constraints.follow(self.new.t, &self.new.u, self.g)?;
        let StageVectors { increment, balance, .. } = &mut *self.vectors;
        for &(dof, place) in &block.massive {
            increment[dof] += self.contact.interface.forces[place];
        }
        if let Some(balance) = balance {
            for &dof in &block.dofs {
                balance.u[dof] = self.new.u[dof];
            }
        }
        self.operator.follow(self.constraints.version());
        self.sort_rows(block)
    }

    /// The static balance of the dofs without mass, as a stage of its own.
    fn of_block<'x>(&'x mut self, block: &'x mut MasslessBlock<T>) -> StageSolve<'x, 'a, T> {
        StageSolve {
            stage: &block.stage,
            clock: self.clock,
            host: Host { system: &mut *self.host.system, together: self.host.together },
            operator: &mut block.operator,
            constraints: &mut *self.constraints,
            g: &mut *self.g,
            solver: &mut *self.solver,
            statistics: &mut *self.statistics,
            new: &mut *self.new,
            past: &mut *self.past,
            vectors: &mut *self.vectors,
            contact: &mut *self.contact,
        }
    }

    /// Moves the dofs without mass by the increment, and updates the residual of the others.
    fn move_massless(&mut self, block: &MasslessBlock<T>) -> Result<()> {
        let (increment, u) = (&mut self.vectors.increment, &mut self.new.u);
        for (j, &dof) in block.dofs.iter().enumerate() {
            let d = std::mem::replace(&mut increment[dof], T::zero());
            if !d.is_finite() {
                let (t, h, value) = (self.clock.at(0.0), self.clock.h, d.value());
                return Err(Error::StepNotFinite { t, h, what: "the increment", dof, value });
            }
            u[dof] += d;
            for (row, k) in block.columns.column(j) {
                increment[row] -= k * d;
            }
        }
        Ok(())
    }

    /// Finds the rows that act on dofs without mass. Refuses laws there that depend on more than the gap, and
    /// friction there if the normal force acts on dofs with mass and is found after the static balance.
    fn sort_rows(&mut self, block: &mut MasslessBlock<T>) -> Result<()> {
        if block.sorted == self.constraints.version() {
            return Ok(());
        }
        for (row, on_massless) in self.contact.rows.massless.acts.iter_mut().enumerate().take(self.constraints.len()) {
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

    /// Computes the velocities of dofs without mass from the parabola through their last three displacements. The rows
    /// of a scheme compute v from a, which is zero on such dofs.
    ///
    /// `place` is the number of the stage in its step, `before` the step size before it; `slopes` are the differences
    /// of the displacements over that step, divided by its size.
    pub(crate) fn set_massless_rates(&mut self, place: usize, before: f64, slopes: &[T]) {
        // The state at the start of the step.
        let Some(start) = self.past.get(place) else { return };
        let new = &mut *self.new;
        let now = self.clock.h * self.stage.end;
        let curve = T::of(now / (now + before));
        for (&dof, &slope) in self.contact.rows.massless.dofs.iter().zip(slopes) {
            let newest = (new.u[dof] - start.u[dof]) / T::of(now);
            (new.v[dof], new.a[dof]) = (newest + curve * (newest - slope), T::zero());
        }
    }
}
