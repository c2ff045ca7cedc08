//! Impulses of contact and of its corrections on each dof in a step.

use crate::contact::ContactJacobian;
use crate::real::Real;
use crate::state::ContactState;

/// Impulses on the dofs (force × time), one entry a dof; empty without constraints.
pub(crate) struct Impulses<T> {
    /// Impulses of the step that is being tried, and of the last accepted step.
    trial: Vec<T>,
    last: Vec<T>,
    /// Whether these may have nonzero entries.
    trial_pushes: bool,
    last_pushes: bool,
    /// Impulses along the rows before corrections.
    before: Vec<T>,
}

impl<T: Real> Impulses<T> {
    /// For `dofs` dofs, 0 without constraints.
    pub(crate) fn new(dofs: usize) -> Self {
        let [trial, last] = [(); 2].map(|()| vec![T::zero(); dofs]);
        Self { trial, last, trial_pushes: false, last_pushes: false, before: Vec::new() }
    }

    /// Begins a step.
    pub(crate) fn begin(&mut self) {
        if std::mem::take(&mut self.trial_pushes) {
            self.trial.fill(T::zero());
        }
    }

    /// Adds the impulse of a multiplier that acts for `time` along the rows `forces`.
    pub(crate) fn push(&mut self, forces: &ContactJacobian<T>, multipliers: &[T], time: T) {
        for (row, &multiplier) in multipliers.iter().enumerate().filter(|(_, multiplier)| **multiplier != T::zero()) {
            self.trial_pushes = true;
            forces.scatter(row, time * multiplier, &mut self.trial);
        }
    }

    /// Stores the impulses along the rows before corrections.
    pub(crate) fn note(&mut self, contacts: &ContactState<T>) {
        self.before.clone_from(&contacts.impulse);
    }

    /// Adds the impulses along the rows that corrections have added since [`note`](Self::note).
    pub(crate) fn push_corrections(&mut self, g: &ContactJacobian<T>, contacts: &ContactState<T>) {
        for (row, (&after, &before)) in contacts.impulse.iter().zip(&self.before).enumerate() {
            if after != before {
                self.trial_pushes = true;
                g.scatter(row, after - before, &mut self.trial);
            }
        }
    }

    /// Of the last accepted step.
    pub(crate) fn last(&self) -> &[T] {
        &self.last
    }

    pub(crate) fn accept(&mut self) {
        std::mem::swap(&mut self.trial, &mut self.last);
        std::mem::swap(&mut self.trial_pushes, &mut self.last_pushes);
    }
}
