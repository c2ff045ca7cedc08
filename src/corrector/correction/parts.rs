//! Data of a stage for correctors (rows, motion, forces, coefficients of the scheme), and the results that they may
//! set directly.

use super::Correction;
use crate::real::Real;
use crate::state::ContactState;

impl<'a, T: Real> Correction<'a, T> {
    /// Dofs and weights of a row of G.
    pub fn row(&self, row: usize) -> impl Iterator<Item = (usize, T)> + use<'a, T> {
        self.g.row(row)
    }
}

impl<T: Real> Correction<'_, T> {
    /// Step size.
    pub fn step_size(&self) -> f64 {
        self.scheme.h
    }

    /// Time of the stage.
    pub fn time(&self) -> f64 {
        self.new.t
    }

    /// Closed rows, as indices into the contacts of the state.
    pub fn closed(&self) -> &[usize] {
        &self.buffers.rows.closed
    }

    /// Engaged rows; valid after [`solve_velocity_jumps`](Self::solve_velocity_jumps).
    pub fn engaged(&self) -> &[usize] {
        &self.buffers.rows.engaged
    }

    /// Rows that were closed before this stage and are open now.
    pub fn opened(&self) -> &[usize] {
        &self.buffers.rows.opened
    }

    /// In the last stage of a step, the rows that were closed in this step or at its start and are open at its end;
    /// none in other stages. Not every scheme reads velocities between stages again, so lasting changes are made to
    /// the state at the end.
    pub fn released(&self) -> &[usize] {
        &self.buffers.rows.released
    }

    /// Reported force of a row before this stage, or when it was last closed in this step.
    pub fn previous_force(&self, row: usize) -> T {
        self.buffers.rows.reported[row]
    }

    /// Displacements of the stage.
    pub fn displacement(&self) -> &[T] {
        &self.new.u
    }

    /// Velocities of the stage.
    pub fn velocity(&self) -> &[T] {
        &self.new.v
    }

    /// Accelerations of the stage.
    pub fn acceleration(&self) -> &[T] {
        &self.new.a
    }

    /// The accelerations, to be edited directly. Nothing is booked: the corrector must [book](Self::book_impulse) the
    /// momentum change. [`apply_forces`](Self::apply_forces) pushes and books.
    pub fn acceleration_mut(&mut self) -> &mut [T] {
        &mut self.new.a
    }

    /// Change of (u, h v, h² a) of the stage by a unit multiplier on a unit mass, over h².
    pub fn response(&self) -> [f64; 3] {
        self.scheme.response
    }

    /// w_ā/w_a: the change of the force on a row in the balance of the stage per unit force applied to a.
    pub fn force_share(&self) -> f64 {
        self.scheme.balance / self.scheme.acceleration
    }

    /// Change of momentum, in the form that the scheme conserves, per unit change of u, v and a of the new state of a
    /// unit mass.
    pub fn momentum_weights(&self) -> [f64; 3] {
        let [u, v, a] = self.scheme.covector[0];
        [u / self.scheme.h, v, a * self.scheme.h]
    }

    /// Books an impulse of a contact, for a change made through [`acceleration_mut`](Self::acceleration_mut).
    pub fn book_impulse(&mut self, row: usize, impulse: T) {
        self.contacts.impulse[row] += impulse;
    }

    /// Sets the reported force of a row; the raw force, which decides release, is unchanged.
    pub fn report_force(&mut self, row: usize, force: T) {
        self.contacts.lambda[row] = force;
    }

    /// Contacts of the stage.
    pub fn contacts(&self) -> &ContactState<T> {
        self.contacts
    }

    /// Impulses of the [closed](Self::closed) rows, in their order; valid after
    /// [`solve_velocity_jumps`](Self::solve_velocity_jumps).
    pub fn jump_impulses(&self) -> &[T] {
        &self.buffers.impulses.normal
    }

    /// Forces of the [engaged](Self::engaged) rows, in their order; valid after
    /// [`solve_acceleration_jumps`](Self::solve_acceleration_jumps).
    pub fn jump_forces(&self) -> &[T] {
        &self.buffers.forces.normal
    }
}
