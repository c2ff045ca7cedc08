//! Curved gaps within a stage: the gap condition holds where contact is imposed, the force acts along the rows where
//! the balance holds.
//!
//! Contact is solved with linear rows on the interface. Afterwards rows are linearized again, at the resulting
//! displacements, and the problem is solved once more, until rows and displacements fit. W = F A⁻¹ Fᵀ is made of the
//! force rows F alone, which keeps it symmetric. Gaps are evaluated without linearization, so the iteration converges
//! to the solution of the unsymmetric G A⁻¹ Fᵀ.

use crate::contact::ContactJacobian;
use crate::real::Real;
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::stage::contact::mixing::Mixing;

/// The most linearizations of curved rows in a contact problem.
pub(crate) const FOLLOWED: usize = 48;

/// The number of linearizations after which rows may alternate: a node on an edge has the normal of one side or the
/// other, and either pushes it to the other side.
const LONG: usize = 12;

/// The number of linearizations after which they are mixed. Nearly all stages fit by then, or alternate.
pub(crate) const SLOW: usize = 18;

/// The relative miss of gaps and forces at which rows fit, in units of the rounding.
const FIT: f64 = 64.0;

/// The relative miss that is accepted where it falls no more.
pub(crate) const NEAR: f64 = 1e-8;

/// The miss of a gap, in its tolerances, that is accepted where it falls no more.
pub(crate) const NOISE: f64 = 8.0;

/// Share of the forces that they may miss then where gaps miss no more than [`NEAR`].
const TIRED: f64 = 1e-5;

/// Share of the forces that may alternate then, which is the angle between the sides: both normals are right there.
const EDGE: f64 = 0.1;

/// Share of the miss of the pass before the last that tells what alternates from what converges, however slowly.
const AGAIN: f64 = 0.999;

/// The relative miss of gaps that tells such a node, which stays at the edge, from rows that find no rest on a curve:
/// these miss gaps as they miss forces.
const AT_EDGE: f64 = 1e-6;

/// How much the gaps and forces of rows linearized at the result differ from those that were solved for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Miss {
    /// Difference of the gaps, relative to their change by d.
    pub(crate) gap: f64,
    /// Difference of the forces, relative to the forces.
    pub(crate) force: f64,
}

/// What differs most.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Worst {
    /// The contact.
    pub(crate) row: usize,
    pub(crate) what: &'static str,
    /// By how much, relative, and how much is accepted where it falls no more.
    pub(crate) change: f64,
    pub(crate) tolerance: f64,
}

impl Worst {
    pub(crate) fn of(miss: Miss, (row, what): (usize, &'static str)) -> Self {
        match miss.force > miss.gap {
            true => Self { row, what: "the force", change: miss.force, tolerance: TIRED },
            false => Self { row, what, change: miss.gap, tolerance: NEAR },
        }
    }
}

impl Miss {
    /// Before anything was solved.
    pub(crate) const ALL: Self = Self { gap: f64::INFINITY, force: f64::INFINITY };

    pub(crate) fn largest(self) -> f64 {
        self.gap.max(self.force)
    }

    /// Whether rows fit, or nearly fit and miss no less than in the passes before, that `before` this one and the
    /// `earlier` one, after so many `passes`; or are as near as they come where no smaller step may be taken instead.
    pub(crate) fn is_settled<T: Real>(self, passes: usize, [before, earlier]: [Self; 2], may_halve: bool) -> bool {
        let fit = FIT * T::epsilon().value();
        let within = |gap: f64, force: f64| self.gap <= gap.max(fit) && self.force <= force.max(fit);
        let now = self.largest();
        let force = if passes > LONG { TIRED } else { NEAR };
        let near = within(NEAR, force) && (now > 0.25 * before.largest() || passes == FOLLOWED);
        // (Passes that are mixed may miss as much as before by chance.)
        let alternates =
            (LONG + 1..=SLOW).contains(&passes) && within(AT_EDGE, EDGE) && now >= AGAIN * earlier.largest();
        let as_near_as_may_be = passes == FOLLOWED && !may_halve && within(AT_EDGE, TIRED);
        now <= fit || near || alternates || as_near_as_may_be
    }
}

/// Memory for curved rows.
pub(crate) struct CurvedRowsWork<T> {
    /// F, if it is not G: the rows where the balance holds.
    pub(crate) rows: ContactJacobian<T>,
    /// Version of the constraints' rows that F is a copy of.
    version: u64,
    /// Whether F is not G.
    pub(crate) apart: bool,
    /// Gaps where the balance holds, evaluated there; one a candidate.
    pub(crate) gaps: Vec<T>,
    /// The gaps that the rows which were solved with foresee; one a candidate.
    pub(crate) foreseen: Vec<T>,
    /// What missed most after the last linearization.
    pub(crate) worst: Worst,
    /// What finds rest where passes come nearer slowly; there if rows may move within a step.
    pub(crate) mixing: Option<Box<Mixing<T>>>,
    /// Whether a smaller step may be taken instead of this one.
    pub(crate) may_halve: bool,
}

impl<T: Real> CurvedRowsWork<T> {
    pub(crate) fn new() -> Self {
        Self {
            rows: ContactJacobian::default(),
            version: 0,
            apart: false,
            gaps: Vec::new(),
            foreseen: Vec::new(),
            worst: Worst { row: 0, what: "the gap", change: 0.0, tolerance: NEAR },
            mixing: None,
            may_halve: false,
        }
    }

    /// Memory for so many rows, of so many weights.
    pub(crate) fn make_room(&mut self, rows: usize, entries: usize) {
        self.gaps.resize(rows, T::zero());
        self.foreseen.resize(rows, T::zero());
        if self.rows.rows() == 0 {
            self.rows = ContactJacobian::with_capacity(rows, entries);
        }
    }

    /// Begins a stage: F is G.
    pub(crate) fn forget(&mut self) {
        self.apart = false;
    }

    /// The rows along which forces act.
    pub(crate) fn forces<'r>(&'r self, g: &'r ContactJacobian<T>) -> &'r ContactJacobian<T> {
        if self.apart { &self.rows } else { g }
    }

    /// Copies G to F before G is linearized elsewhere.
    pub(crate) fn hold(&mut self, g: &ContactJacobian<T>, constraints: &Constraints<'_, T>) {
        if !self.apart && self.version != constraints.version() {
            self.version = constraints.version();
            self.rows.copy_from(g);
        }
    }

    /// Notes whether G has changed since [`hold`](Self::hold).
    pub(crate) fn release(&mut self, constraints: &Constraints<'_, T>) {
        self.apart = self.version != constraints.version();
    }

    /// The version of the rows along which forces act.
    pub(crate) fn version(&self, constraints: &Constraints<'_, T>) -> u64 {
        if self.apart { self.version } else { constraints.version() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forces that do not settle as well as gaps are accepted after many linearizations, not before.
    #[test]
    fn forces_may_miss_more_once_rows_are_tired() {
        let miss = |force| Miss { gap: 1e-9, force };
        let settled = |force, passes| miss(force).is_settled::<f64>(passes, [miss(2.0 * force), miss(force)], true);
        for passes in [1, 2, LONG] {
            assert!(settled(0.5 * NEAR, passes) && !settled(0.5 * TIRED, passes), "{passes}");
        }
        for passes in [SLOW + 1, FOLLOWED] {
            assert!(settled(0.5 * TIRED, passes) && !settled(2.0 * TIRED, passes), "{passes}");
        }
        // Unless they still fall by more than a quarter from pass to pass.
        assert!(!miss(0.5 * TIRED).is_settled::<f64>(SLOW + 1, [miss(0.1), miss(0.2)], true));
    }
}
