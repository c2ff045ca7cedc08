//! Data for a corrector before a stage is solved: the predicted displacements and their projection onto the contact
//! conditions.

use super::jump_problem::{Block, FrictionOf};
use super::{Buffers, JumpProblem, JumpProjection};
use crate::contact::{ContactJacobian, ErasedGaps};
use crate::contact_solver::{AdmissibleSet, ContactSolver};
use crate::error::Result;
use crate::real::Real;
use crate::rounding::rounding;
use crate::state::{ContactState, Motion};

/// One stage before it is solved, passed to [`Corrector::predict`](super::Corrector::predict).
#[derive(Debug)]
pub struct Prediction<'a, T: Real> {
    /// Time between the previous state and the state of the stage.
    pub(crate) h: f64,
    pub(crate) g: &'a ContactJacobian<T>,
    pub(crate) projection: &'a mut JumpProjection<T>,
    pub(crate) solver: &'a mut dyn ContactSolver<T>,
    pub(crate) constraints: ErasedGaps<'a, T>,
    /// The previous state.
    pub(crate) start: &'a Motion<T>,
    pub(crate) new: &'a mut Motion<T>,
    /// The motion of the balance, and the weight of the unknown in its displacements, relative to its weight in the
    /// state.
    pub(crate) balance: Option<(T, &'a mut Motion<T>)>,
    /// The contacts before the stage.
    pub(crate) contacts: &'a ContactState<T>,
    pub(crate) massless: &'a [usize],
    pub(crate) prescribed: &'a [usize],
    pub(crate) buffers: &'a mut Buffers<T>,
}

/// Which contacts project a prediction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Extent {
    /// All contacts that it violates.
    #[default]
    All,
    /// Contacts that were already closed.
    Closed,
}

impl<T: Real> Prediction<'_, T> {
    /// Time of the stage.
    pub fn time(&self) -> f64 {
        self.new.t
    }

    /// Moves u + h v to the nearest admissible point in the mass norm and shifts the displacements at the start of
    /// the stage by the same amount: D = M⁻¹ Gᵀ μ with 0 ≤ g(u + h v + D) ⊥ μ ≥ 0. Contacts on dofs without mass and
    /// contacts under other than rigid laws are left out.
    ///
    /// # Errors
    ///
    /// [`Error::ContactNotFinite`](crate::Error::ContactNotFinite), [`Error::Contact`](crate::Error::Contact),
    /// [`Error::ContradictoryContacts`](crate::Error::ContradictoryContacts).
    pub fn project(&mut self, extent: Extent) -> Result<()> {
        let mut rows = std::mem::take(&mut self.buffers.rows.closed);
        let mut problem = std::mem::take(&mut *self.buffers.problem);
        rows.clear();
        problem.clear();
        let result = self.project_rows(&mut rows, &mut problem, extent);
        self.buffers.rows.closed = rows;
        *self.buffers.problem = problem;
        result
    }

    /// Adds violated rows to the problem until there are no others, and moves the displacements by its solution.
    fn project_rows(&mut self, rows: &mut Vec<usize>, problem: &mut JumpProblem<T>, extent: Extent) -> Result<()> {
        loop {
            self.advance(problem)?;
            self.read_gaps()?;
            let before = rows.len();
            for row in 0..self.contacts.ids.len() {
                let law = self.constraints.0.law(row);
                let takes_part = law.is_plain()
                    && (extent == Extent::All || self.contacts.closed[row])
                    && (self.massless.is_empty() || !self.g.acts_on(row, self.massless));
                let gap = self.buffers.readings.gaps[row];
                let violated = gap < -rounding(self.g.magnitude(row, &self.buffers.shifted) + gap.abs());
                if takes_part && (violated || law.is_equality()) && !problem.rows.contains(&row) {
                    rows.push(row);
                }
            }
            if rows.len() == before {
                break;
            }
            rows.sort_unstable();
            self.solve(rows, problem)?;
        }
        let moves = (&problem.rows[..], &problem.totals[..]);
        self.projection.push(self.g, moves, T::one(), &mut self.new.u)?;
        match &mut self.balance {
            Some((share, motion)) => self.projection.push(self.g, moves, *share, &mut motion.u),
            None => Ok(()),
        }
    }

    /// u + h v + M⁻¹ Gᵀ μ, with prescribed dofs at their new values.
    fn advance(&mut self, problem: &JumpProblem<T>) -> Result<()> {
        let Self { buffers, start, new, projection, g, prescribed, h, .. } = self;
        let shifted = &mut buffers.shifted;
        shifted.copy_from_slice(&start.u);
        T::axpy(T::of(*h), &start.v, shifted);
        for &dof in *prescribed {
            shifted[dof] = new.u[dof];
        }
        projection.push(g, (&problem.rows, &problem.totals), T::one(), shifted)
    }

    /// Gaps at the shifted displacements; curved gaps are linearized there.
    fn read_gaps(&mut self) -> Result<()> {
        let Self { new, start, buffers, constraints, .. } = self;
        let there = (new.t, [&buffers.shifted[..], &start.v, &start.a]);
        constraints.0.elsewhere(0, there, (start.t, &start.u), &mut buffers.readings.gaps)
    }

    /// μ of the rows, for the gaps at u + h v.
    fn solve(&mut self, rows: &[usize], problem: &mut JumpProblem<T>) -> Result<()> {
        problem.clear();
        self.advance(problem)?;
        self.read_gaps()?;
        let Self { buffers, projection, constraints, g, solver, contacts, .. } = self;
        for &row in rows {
            let gap = buffers.readings.gaps[row];
            let error = rounding(g.magnitude(row, &buffers.shifted) + gap.abs());
            problem.add_block(&Block::new(row, 0, AdmissibleSet::from(constraints.0.law(row))));
            problem.add_row(row, gap, error, T::zero());
        }
        problem.solve((g, projection), &mut **solver, FrictionOf::Pressing, (self.new.t, |row| contacts.ids[row]))
    }
}
