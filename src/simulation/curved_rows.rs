//! Curved gaps within a stage: the gap is met where contact is imposed, the force acts along the rows where the balance
//! holds.
//!
//! Contact is solved with rows that are linear on the interface. Afterwards rows are linearized again, at the
//! displacements that came out, and the problem is solved once more, until they fit. W = F A⁻¹ Fᵀ is made of the force
//! rows F alone, which keeps it symmetric; gaps are evaluated as they are, so that the point that is reached is that of
//! the unsymmetric G A⁻¹ Fᵀ.

use super::constraints::Constraints;
use crate::contact::ContactJacobian;
use crate::real::Real;

/// Linearizations of curved rows in a contact problem, at most, and those after which forces that go to and fro are
/// borne with.
pub(super) const FOLLOWED: usize = 40;
const LONG: usize = 12;

/// The relative miss of gaps and forces at which rows fit, in roundings, and that which is accepted where it falls no
/// more.
const FIT: f64 = 64.0;
pub(super) const NEAR: f64 = 1e-8;

/// Tolerances of a gap that it may miss, where nothing gets better.
pub(super) const NOISE: f64 = 8.0;

/// Share of the forces that may go to and fro: a node on an edge has the normal of either side.
const EDGE: f64 = 1e-5;

/// By how much rows miss what was solved with them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Miss {
    /// Of gaps, relative to what d moves them.
    pub(super) gap: f64,
    /// Of forces, relative to these.
    pub(super) force: f64,
}

impl Miss {
    /// Before anything was solved.
    pub(super) const ALL: Self = Self { gap: f64::INFINITY, force: f64::INFINITY };

    pub(super) fn largest(self) -> f64 {
        self.gap.max(self.force)
    }

    /// Whether rows fit, or nothing gets better and they nearly do, after so many passes and with this miss before.
    pub(super) fn is_settled<T: Real>(self, passes: usize, before: Self) -> bool {
        let fit = FIT * T::epsilon().value();
        let force = if passes > LONG { EDGE } else { NEAR };
        let near = self.gap <= NEAR.max(fit) && self.force <= force.max(fit);
        self.largest() <= fit || near && (self.largest() > 0.25 * before.largest() || passes == FOLLOWED)
    }
}

/// Memory for curved rows.
pub(super) struct CurvedRowsWork<T> {
    /// F, if it is not G: the rows where the balance holds.
    pub(super) rows: ContactJacobian<T>,
    /// Version of the constraints' rows that F is a copy of.
    version: u64,
    /// Whether F is not G.
    pub(super) apart: bool,
    /// Gaps where the balance holds, with the rows of that place; one a candidate.
    pub(super) gaps: Vec<T>,
    /// What the rows that were solved with make of the gaps; one a candidate.
    pub(super) foreseen: Vec<T>,
    /// The miss of gaps and forces after the last linearization, relative; the row that misses its gap most, and by how
    /// much.
    pub(super) miss: f64,
    pub(super) worst: (usize, T),
}

impl<T: Real> CurvedRowsWork<T> {
    /// Memory for `rows` contacts with `entries` weights.
    pub(super) fn new(rows: usize, entries: usize) -> Self {
        Self {
            rows: ContactJacobian::with_capacity(rows, entries),
            version: 0,
            apart: false,
            gaps: vec![T::zero(); rows],
            foreseen: vec![T::zero(); rows],
            miss: 0.0,
            worst: (0, T::zero()),
        }
    }

    /// Takes the rows of the gaps for those of the forces: a stage begins.
    pub(super) fn forget(&mut self) {
        self.apart = false;
    }

    /// The rows along which forces act.
    pub(super) fn forces<'r>(&'r self, g: &'r ContactJacobian<T>) -> &'r ContactJacobian<T> {
        if self.apart { &self.rows } else { g }
    }

    /// Keeps the rows of the forces where those of the gaps are about to move on.
    pub(super) fn hold(&mut self, g: &ContactJacobian<T>, constraints: &Constraints<'_, T>) {
        if !self.apart && self.version != constraints.version() {
            self.version = constraints.version();
            self.rows.copy_from(g);
        }
    }

    /// Says that the rows of the gaps may have moved on since [`hold`](Self::hold).
    pub(super) fn release(&mut self, constraints: &Constraints<'_, T>) {
        self.apart = self.version != constraints.version();
    }

    /// The version of those rows.
    pub(super) fn version(&self, constraints: &Constraints<'_, T>) -> u64 {
        if self.apart { self.version } else { constraints.version() }
    }
}
