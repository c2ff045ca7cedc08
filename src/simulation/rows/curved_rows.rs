//! Curved gaps within a stage: the gap condition holds where contact is imposed, the force acts along the rows where
//! the balance holds.
//!
//! Contact is solved with linear rows on the interface. Then the rows are linearized again, at the resulting
//! displacements, and the problem is solved again, until rows and displacements agree. W = F A⁻¹ Fᵀ contains only the
//! force rows F, which keeps it symmetric. Gaps are evaluated without linearization, so the iteration converges to
//! the solution of the unsymmetric G A⁻¹ Fᵀ.

use crate::contact::ContactJacobian;
use crate::real::Real;
use crate::rounding::{ALTERNATING_FORCES, ALTERNATING_GAPS, ALTERNATION, LAST_FORCES, SAME_ROWS, rounding};
use crate::simulation::rows::constraints::Constraints;

/// Maximum number of linearizations of curved rows.
pub(crate) const LINEARIZATIONS: usize = 48;

/// Number of linearizations after which rows may alternate: a node on an edge has the normal of one side or the
/// other, and either pushes it to the other side.
const LONG: usize = 12;

/// Differences of gaps and forces between rows linearized at the result and the rows solved for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Miss {
    /// Difference of the gaps, relative to their change by d.
    pub(crate) gap: f64,
    /// The same, relative to the displacement that contact undoes if this is larger, as in bodies at rest.
    pub(crate) undone: f64,
    /// Difference of the forces, relative to the forces.
    pub(crate) force: f64,
}

/// The largest difference.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Worst {
    pub(crate) row: usize,
    pub(crate) what: &'static str,
    /// The relative difference, and the difference accepted once it no longer decreases.
    pub(crate) change: f64,
    pub(crate) tolerance: f64,
    /// Whether the last linearization is [near enough](Miss::is_bearable) to a result.
    pub(crate) is_bearable: bool,
}

impl Worst {
    pub(crate) fn of(miss: Miss, (row, what): (usize, &'static str)) -> Self {
        let (what, change) = if miss.force > miss.gap { ("the force", miss.force) } else { (what, miss.gap) };
        Self { row, what, change, tolerance: SAME_ROWS, is_bearable: false }
    }
}

impl Miss {
    /// Before the first solution.
    pub(crate) const ALL: Self = Self { gap: f64::INFINITY, undone: f64::INFINITY, force: f64::INFINITY };

    pub(crate) fn largest(self) -> f64 {
        self.gap.max(self.force)
    }

    /// Whether the iteration may end after some `linearizations`: the miss is within rounding; or small and no longer
    /// decreasing; or rows alternate. `before` and `earlier` are the misses of the last two linearizations.
    pub(crate) fn has_converged<T: Real>(self, linearizations: usize, [before, earlier]: [Self; 2]) -> bool {
        let fit = rounding(T::one()).value();
        let within = |gap: f64, force: f64| self.gap <= gap.max(fit) && self.force <= force.max(fit);
        let now = self.largest();
        let stalls =
            within(SAME_ROWS, SAME_ROWS) && (now > 0.25 * before.largest() || linearizations == LINEARIZATIONS);
        let alternates = linearizations > LONG
            && within(ALTERNATING_GAPS, ALTERNATING_FORCES)
            && now >= ALTERNATION * earlier.largest();
        now <= fit || stalls || alternates
    }

    /// Whether rows alternate at the last linearization by so little that this is a result: where bodies come to rest
    /// gaps hardly change, and `undone` is the scale.
    pub(crate) fn is_bearable(self, earlier: Self) -> bool {
        let alternates = self.largest() >= ALTERNATION * earlier.largest();
        alternates && self.undone <= ALTERNATING_GAPS && self.force <= LAST_FORCES
    }
}

/// Memory for curved rows.
pub(crate) struct CurvedRowsWork<T> {
    /// F, if it differs from G: the rows where the balance holds.
    pub(crate) rows: ContactJacobian<T>,
    /// Version of the rows that F is a copy of.
    version: u64,
    /// Whether F differs from G.
    pub(crate) apart: bool,
    /// Gaps evaluated where the balance holds, one per candidate.
    pub(crate) gaps: Vec<T>,
    /// Gaps and slips predicted by the rows of the last solution, one per row.
    pub(crate) predicted: Vec<T>,
    /// The largest difference after the last linearization.
    pub(crate) worst: Worst,
    /// The residual to which a contact problem is solved by products with A.
    pub(crate) residual: f64,
    /// Whether the last problem was solved as far as rounding allows.
    pub(crate) is_exact: bool,
}

impl<T: Real> CurvedRowsWork<T> {
    pub(crate) fn new() -> Self {
        Self {
            rows: ContactJacobian::default(),
            version: 0,
            apart: false,
            gaps: Vec::new(),
            predicted: Vec::new(),
            worst: Worst { row: 0, what: "the gap", change: 0.0, tolerance: SAME_ROWS, is_bearable: false },
            residual: 0.0,
            is_exact: true,
        }
    }

    /// Another problem is solved, by products with A to a residual.
    pub(crate) fn begin(&mut self, residual: f64) {
        (self.residual, self.is_exact) = (residual, true);
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
