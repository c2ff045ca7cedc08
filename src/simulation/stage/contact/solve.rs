//! The contact of a stage: its problem is solved, and solved again with rows linearized at the result, until rows and
//! result agree.

use crate::contact::Candidates;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::operator::Operator;
use crate::simulation::operator::interface::{advance, keep, restore};
use crate::simulation::rows::curved_rows::{FOLLOWED, Miss, SLOW};
use crate::simulation::stage::contact::mixing::ELSEWHERE;
use crate::simulation::stage::contact::{ContactStep, ContactWork};
use crate::simulation::stage::vectors::StageVectors;
use crate::state::Motion;
use crate::system::System;

impl<T: Real> ContactStep<'_, '_, T> {
    /// Finds the multipliers of the stage from d on the interface, adds their response to d, and leaves their forces
    /// in `interface.forces`. Motions are left as predicted. Returns whether curved rows fit the resulting d.
    pub(crate) fn solve(
        &mut self,
        system: &mut dyn System<T>,
        operator: &mut Operator<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<bool> {
        let dofs = self.constraints.interface();
        if self.moves_state() {
            keep(dofs, &new.u, &mut contact.interface.displacement);
        }
        if let (Some(_), Some(balance)) = (&self.stage.balance, &vectors.balance) {
            keep(dofs, &balance.u, &mut contact.interface.balance);
        }
        contact.interface.free.copy_from_slice(&contact.interface.increment);
        self.aim(system, new, past, &vectors.supports.dofs, contact)?;
        let result = self.settle(operator, new, past, vectors, contact);
        let (dofs, interface) = (self.constraints.interface(), &contact.interface);
        if self.moves_state() {
            restore(dofs, &interface.displacement, &mut new.u);
        }
        if let (Some(_), Some(balance)) = (&self.stage.balance, &mut vectors.balance) {
            restore(dofs, &interface.balance, &mut balance.u);
        }
        if let Some(target) = &self.stage.contact {
            advance(dofs, &interface.target, target.row.weight, &interface.increment, &mut contact.rows.target);
        }
        result
    }

    /// Solves with the present rows, then with rows linearized at the result, until rows and result agree.
    pub(crate) fn settle(
        &mut self,
        operator: &mut Operator<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<bool> {
        let mut before = [Miss::ALL; 2];
        for pass in 0..FOLLOWED {
            match pass {
                0 => self.observe(operator, new, past, vectors, contact)?,
                _ => self.step_back(operator, new, vectors, contact)?,
            }
            let needed = self.condition(new, contact);
            match needed {
                true => self.press(operator, new.t, contact)?,
                false => self.release(contact),
            }
            if self.constraints.is_affine() {
                return Ok(true);
            }
            self.foresee(needed, contact);
            if self.follow(new, vectors, contact)? == Candidates::Unchanged {
                return self.refuse_elsewhere(pass, new.t, contact);
            }
            operator.follow(contact.rows.curved.version(self.constraints));
            let miss = self.miss(new, past, contact)?;
            if miss.is_settled::<T>(pass + 1, before, contact.rows.curved.may_halve) {
                return self.refuse_elsewhere(pass, new.t, contact);
            }
            before = [miss, before[0]];
            if (SLOW..FOLLOWED).contains(&(pass + 1)) {
                self.mix(pass + 1 > SLOW, operator, new, past, vectors, contact)?;
            }
        }
        Ok(false)
    }

    /// Rejects the fixed point found by Anderson mixing if it is far from the unmixed iterates and the step can be
    /// halved.
    fn refuse_elsewhere(&self, pass: usize, t: f64, contact: &ContactWork<T>) -> Result<bool> {
        let ContactWork { rows, interface, .. } = contact;
        let mixed = rows.curved.mixing.as_ref().filter(|_| rows.curved.may_halve && pass >= SLOW);
        match mixed.and_then(|mixing| mixing.elsewhere(&interface.increment, &interface.free)) {
            None => Ok(true),
            Some(change) => {
                let (iterations, contact) = (pass + 1, self.constraints.ids[rows.curved.worst.row]);
                let (what, tolerance) = ("the displacement", ELSEWHERE);
                Err(Error::ContactUnsettled { t, iterations, contact, what, change, tolerance })
            }
        }
    }

    /// Relinearizes the rows at the Anderson-mixed iterate instead of the last result. The first call only stores the
    /// result.
    fn mix(
        &mut self,
        knows: bool,
        operator: &mut Operator<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        let ContactWork { rows, interface, .. } = contact;
        let Some(mixing) = &mut rows.curved.mixing else { return Ok(()) };
        match knows {
            false => mixing.begin(&interface.increment),
            true => mixing.learn(&interface.increment),
        }
        if mixing.mix(&mut interface.increment) {
            let mut followed = self.follow(new, vectors, contact);
            if followed.is_err() {
                // A contact that is lost there is not lost at the result.
                let ContactWork { rows, interface, .. } = contact;
                rows.curved.mixing.iter_mut().for_each(|mixing| mixing.give_up(&mut interface.increment));
                followed = self.follow(new, vectors, contact);
            }
            followed?;
            operator.follow(contact.rows.curved.version(self.constraints));
            self.evaluate(new, contact)?;
            self.evaluate_slips(new, past, contact)?;
        }
        let ContactWork { rows, interface, .. } = contact;
        rows.curved.mixing.iter_mut().for_each(|mixing| mixing.begin_at(&interface.increment));
        Ok(())
    }

    /// Evaluates y of every row at d without contact, with the present rows, after the forces of compliant laws that
    /// do not depend on d are applied.
    pub(crate) fn observe(
        &mut self,
        operator: &mut Operator<T>,
        new: &mut Motion<T>,
        past: &[Motion<T>],
        vectors: &mut StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        self.weigh(&mut contact.rows);
        self.place(new, vectors, contact);
        if self.constraints.laws().compliant {
            self.balance_gaps(new, vectors, contact)?;
            self.add_inertia(new, vectors, contact)?;
            self.approach(new, vectors, contact)?;
            if self.press_without_coupling(operator, contact)? {
                self.place(new, vectors, contact);
                self.balance_gaps(new, vectors, contact)?;
                self.add_inertia(new, vectors, contact)?;
                self.approach(new, vectors, contact)?;
            }
        }
        self.evaluate(new, contact)?;
        self.evaluate_slips(new, past, contact)?;
        self.extrapolate(new, contact);
        self.restitution(past, &mut contact.rows)
    }
}
