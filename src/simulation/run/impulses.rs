//! Impulses of contact and of its corrections on each dof in a step.

use crate::contact::ContactJacobian;
use crate::real::Real;
use crate::simulation::run::Simulation;
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

    pub(crate) fn accept(&mut self) {
        std::mem::swap(&mut self.trial, &mut self.last);
        std::mem::swap(&mut self.trial_pushes, &mut self.last_pushes);
    }
}

impl<T: Real> Simulation<'_, T> {
    /// The impulses of all contacts on each dof (force × time), friction and corrections included, in the last step
    /// that this simulation has made; empty without constraints.
    ///
    /// Their sum over the dofs of a body along a direction is the impulse of contact on that body: under no other
    /// force along that direction it is the change of the body's [`momentum`](Self::momentum), to rounding. Over two
    /// bodies that touch only each other the sum is zero.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{Composite, LinearRows, LinearSystem, Simulation};
    ///
    /// // Two free masses, of which the first runs into the second with speed 2.
    /// let none = [Triplet::new(0, 0, 0.0), Triplet::new(1, 1, 0.0)];
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &none)?;
    /// let system = LinearSystem::lumped(vec![1.0; 2], free)?;
    /// let gap = LinearRows::new().unilateral(&[(0, -1.0), (1, 1.0)], 0.05);
    /// let mut run = Simulation::builder(system, Composite, 0.1).velocity(vec![2.0, 0.0]).constraint(gap).build()?;
    /// run.step()?;
    /// let [first, second] = run.impulses_on_dofs() else { panic!("two dofs") };
    /// assert!((first + 1.0).abs() < 1e-12 && (second - 1.0).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn impulses_on_dofs(&self) -> &[T] {
        &self.work.contact.impulses.last
    }
}
