//! Rows on dofs without mass in an explicit stage: they are solved first, with the static balance of these dofs.

use crate::contact::{ContactJacobian, Tangents};
use crate::real::Real;

/// The contact problem that is being solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Problem {
    /// All rows: dofs without mass are solved together with the others, or there are none.
    Whole,
    /// Rows that act on dofs without mass, in their static balance.
    Static,
    /// The other rows, solved after these.
    Dynamic,
}

/// The dofs without mass, the rows that act on them, and the problem that is being solved.
#[derive(Debug)]
pub(crate) struct MasslessRows {
    pub(crate) problem: Problem,
    /// Free dofs without mass.
    pub(crate) dofs: Vec<usize>,
    /// Whether a row acts on these dofs; empty where they are solved together with the others.
    pub(crate) acts: Vec<bool>,
}

impl MasslessRows {
    pub(crate) fn new() -> Self {
        Self { problem: Problem::Whole, dofs: Vec::new(), acts: Vec::new() }
    }

    /// Whether every row is in the present problem.
    pub(crate) fn is_whole(&self) -> bool {
        self.problem == Problem::Whole
    }

    /// Whether a row is in the present problem.
    pub(crate) fn contains(&self, row: usize) -> bool {
        match self.problem {
            Problem::Whole => true,
            Problem::Static => self.acts[row],
            Problem::Dynamic => !self.acts[row],
        }
    }

    /// Whether the slip of a contact is static: its friction acts on dofs without mass or, where these are solved
    /// together with the others, its gap does.
    pub(crate) fn has_static_slip<T: Real>(&self, tangents: &Tangents, g: &ContactJacobian<T>, row: usize) -> bool {
        match self.problem {
            Problem::Whole => tangents.act_on(g, row, &self.dofs),
            Problem::Static | Problem::Dynamic => tangents.rub_on(g, row, &self.dofs),
        }
    }

    /// Whether the friction of a contact on dofs without mass acts on dofs with mass only. It is not part of the
    /// static balance, where nothing would respond to it. It is found afterwards, when its normal force is known.
    pub(crate) fn has_later_friction<T: Real>(&self, tangents: &Tangents, g: &ContactJacobian<T>, row: usize) -> bool {
        !self.is_whole() && self.acts[row] && !self.has_static_slip(tangents, g, row)
    }

    /// Whether the present problem solves for the friction of a contact that carries a normal force in it, or in an
    /// earlier problem.
    pub(crate) fn solves_friction<T: Real>(
        &self,
        tangents: &Tangents,
        g: &ContactJacobian<T>,
        row: usize,
        has_normal_force: bool,
    ) -> bool {
        match self.has_later_friction(tangents, g, row) {
            true => self.problem == Problem::Dynamic,
            false => has_normal_force,
        }
    }
}
