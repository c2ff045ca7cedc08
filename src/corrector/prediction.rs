//! Data for a corrector before a stage is solved: the predicted displacements and their projection onto the contact
//! conditions.

use super::group_problem::Jumps;
use super::{Buffers, JumpProjection};
use crate::contact::{ContactId, ContactJacobian, ErasedGaps};
use crate::contact_solver::{AdmissibleSet, ContactSolver};
use crate::error::Result;
use crate::real::Real;
use crate::rounding::rounding;
use crate::state::Motion;

/// One stage before it is solved, passed to [`Corrector::predict`](super::Corrector::predict).
#[derive(Debug)]
pub struct Prediction<'a, T: Real> {
    /// Time between the previous state and the state of the stage.
    pub(crate) h: f64,
    pub(crate) t: f64,
    /// Weight of the unknown in the displacements of the balance, relative to its weight in the state.
    pub(crate) balance_share: T,
    pub(crate) g: &'a ContactJacobian<T>,
    pub(crate) projection: &'a mut JumpProjection<T>,
    pub(crate) solver: &'a mut dyn ContactSolver<T>,
    pub(crate) constraints: ErasedGaps<'a, T>,
    /// The previous state.
    pub(crate) start: &'a Motion<T>,
    pub(crate) new: &'a mut Motion<T>,
    pub(crate) balance: Option<&'a mut Motion<T>>,
    pub(crate) was_closed: &'a [bool],
    pub(crate) massless: &'a [usize],
    pub(crate) prescribed: &'a [usize],
    pub(crate) ids: &'a [ContactId],
    pub(crate) buffers: &'a mut Buffers<T>,
    /// u + h v, one entry per dof.
    pub(crate) shifted: &'a mut [T],
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
        self.t
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
        let count = self.ids.len();
        let rigid = |constraints: &ErasedGaps<'_, T>, row: usize| constraints.0.law(row).is_plain();
        let mut rows = std::mem::take(&mut self.buffers.closed);
        let mut mu = std::mem::take(&mut self.buffers.impulses);
        rows.clear();
        mu.clear();
        let mut result;
        loop {
            result = self.advance(&rows, &mu).and_then(|()| self.read_gaps());
            if result.is_err() {
                break;
            }
            let before = rows.len();
            for row in 0..count {
                let takes_part = rigid(&self.constraints, row)
                    && (extent == Extent::All || self.was_closed[row])
                    && (self.massless.is_empty() || !self.g.acts_on(row, self.massless));
                let gap = self.buffers.gaps[row];
                let violated = gap < -rounding(self.g.magnitude(row, self.shifted) + gap.abs());
                if takes_part && (violated || self.constraints.0.law(row).is_equality()) && !rows.contains(&row) {
                    rows.push(row);
                }
            }
            if rows.len() == before {
                break;
            }
            rows.sort_unstable();
            result = self.solve(&rows, &mut mu);
            if result.is_err() {
                break;
            }
        }
        if result.is_ok() {
            result = self.projection.push(self.g, (&rows, &mu), T::one(), &mut self.new.u);
            if let (Ok(()), Some(motion)) = (&result, &mut self.balance) {
                result = self.projection.push(self.g, (&rows, &mu), self.balance_share, &mut motion.u);
            }
        }
        self.buffers.closed = rows;
        self.buffers.impulses = mu;
        result
    }

    /// u + h v + M⁻¹ Gᵀ μ, with prescribed dofs at their new values.
    fn advance(&mut self, rows: &[usize], mu: &[T]) -> Result<()> {
        self.shifted.copy_from_slice(&self.start.u);
        T::axpy(T::of(self.h), &self.start.v, self.shifted);
        for &dof in self.prescribed {
            self.shifted[dof] = self.new.u[dof];
        }
        self.projection.push(self.g, (rows, mu), T::one(), self.shifted)
    }

    /// Gaps at the shifted displacements; curved gaps are linearized there.
    fn read_gaps(&mut self) -> Result<()> {
        let Self { t, start, shifted, buffers, constraints, .. } = self;
        let there = (*t, [&**shifted, &start.v, &start.a]);
        constraints.0.elsewhere(0, there, (start.t, &start.u), &mut buffers.gaps)
    }

    /// μ of the rows, for the gaps at u + h v.
    fn solve(&mut self, rows: &[usize], mu: &mut Vec<T>) -> Result<()> {
        self.advance(&[], &[])?;
        self.read_gaps()?;
        let Self { buffers, projection, constraints, g, shifted, solver, .. } = self;
        let Buffers { group, jump, tolerance, sets, gaps, .. } = &mut **buffers;
        jump.clear();
        tolerance.clear();
        sets.clear();
        for &row in rows {
            jump.push(gaps[row]);
            tolerance.push(rounding(g.magnitude(row, shifted) + gaps[row].abs()));
            sets.push(AdmissibleSet::from(constraints.0.law(row)));
        }
        mu.clear();
        mu.resize(rows.len(), T::zero());
        let (jumps, ids) = (Jumps { rows, sets, jump, tolerance }, self.ids);
        group.solve((g, &mut **projection), &mut **solver, jumps, mu, (self.t, |row| ids[row]))
    }
}
