//! The contact of a stage: its problem is solved, and solved again with rows linearized at the result, until rows and
//! result agree.

use crate::contact::Candidates;
use crate::error::Result;
use crate::real::Real;
use crate::rounding::{FIRST_RESIDUAL, RESIDUAL_BY_MISS, projected_residual};
use crate::simulation::operator::interface::{advance, keep, restore};
use crate::simulation::rows::curved_rows::{LINEARIZATIONS, Miss};
use crate::simulation::stage::StageSolve;

impl<T: Real> StageSolve<'_, '_, T> {
    /// Finds the multipliers of the stage from d on the interface, adds their response to d, and leaves their forces
    /// in `interface.forces`. Motions are left as predicted. Returns whether curved rows fit the resulting d.
    pub(crate) fn solve_contact(&mut self) -> Result<bool> {
        self.operator.begin_stage();
        self.keep_motion();
        let result = self.predict_target().and_then(|()| self.iterate_contact());
        self.restore_motion();
        result
    }

    /// Solves with the present rows, then with rows linearized at the result, until rows and result agree.
    fn iterate_contact(&mut self) -> Result<bool> {
        let exact = projected_residual::<T>().value();
        // Problems by products with A are solved as well as their rows fit, and at last as far as rounding allows.
        let mut residual = if self.constraints.is_affine() { exact } else { FIRST_RESIDUAL };
        let mut before = [Miss::ALL; 3];
        for iteration in 1..=LINEARIZATIONS {
            self.contact.rows.curved.begin(residual.max(exact));
            match iteration {
                1 => self.evaluate_without_contact()?,
                _ => self.extrapolate_without_contact()?,
            }
            let needed = self.decide_problem();
            match needed {
                true => self.solve_problem()?,
                false => self.clear_multipliers(),
            }
            if self.constraints.is_affine() {
                return Ok(true);
            }
            self.predict_gaps(needed);
            let fits = self.linearize_rows()? == Candidates::Unchanged;
            if fits && self.contact.rows.curved.is_exact {
                return Ok(true);
            }
            self.operator.follow(self.contact.rows.curved.version(self.constraints));
            let miss = self.measure_miss()?;
            let fits = fits || miss.has_converged::<T>(iteration, [before[0], before[1]]);
            if fits && self.contact.rows.curved.is_exact {
                return Ok(true);
            }
            residual = if fits { exact } else { residual.min(RESIDUAL_BY_MISS * miss.largest()) };
            before = [miss, before[0], before[1]];
        }
        let [last, _, earlier] = before;
        self.contact.rows.curved.worst.is_bearable = last.is_bearable(earlier);
        Ok(false)
    }

    /// Evaluates y of every row at d without contact, with the present rows, after the forces of compliant laws that
    /// do not depend on d are applied.
    fn evaluate_without_contact(&mut self) -> Result<()> {
        self.set_weights();
        self.evaluate_laws(Self::evaluate_balance_gaps)?;
        self.add_increment();
        self.evaluate_rows()?;
        self.extrapolate_along_forces();
        self.add_restitution()
    }

    /// Keeps the values of the predicted motions on the interface, and d without contact.
    fn keep_motion(&mut self) {
        let (moves_state, dofs) = (self.moves_state(), self.constraints.interface());
        let interface = &mut self.contact.interface;
        if moves_state {
            keep(dofs, &self.new.u, &mut interface.displacement);
        }
        if let (Some(_), Some(balance)) = (&self.stage.balance, &self.vectors.balance) {
            keep(dofs, &balance.u, &mut interface.balance);
        }
        interface.free.copy_from_slice(&interface.increment);
    }

    /// Restores the predicted motions, and leaves the target at the resulting d.
    fn restore_motion(&mut self) {
        let (moves_state, dofs) = (self.moves_state(), self.constraints.interface());
        let interface = &self.contact.interface;
        if moves_state {
            restore(dofs, &interface.displacement, &mut self.new.u);
        }
        if let (Some(_), Some(balance)) = (&self.stage.balance, &mut self.vectors.balance) {
            restore(dofs, &interface.balance, &mut balance.u);
        }
        if let Some(target) = &self.stage.contact {
            let values = &mut self.contact.rows.target.values;
            advance(dofs, &interface.target, target.row.weight, &interface.increment, values);
        }
    }
}
