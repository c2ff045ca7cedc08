//! Where it is decided whether a row may carry a force in a stage, takes part in the contact problem, and is closed at
//! the end.

use crate::contact::{ContactLaw, Measure};
use crate::corrector::Gaps;
use crate::real::Real;
use crate::rounding::{rounding, touching};
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::rows::contact_rows::{ContactRowsWork, RowState};
use crate::simulation::rows::massless_rows::Problem;
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::laws::{course, slows};

/// Whether a row whose rate is constrained may carry a force: its forecast `gap` touches, or its law acts on open
/// contacts too. `approach` is the change of the gap in the step. The second value is the gap beyond its `rounding` by
/// which the row may close.
pub(crate) fn state_of_forecast<T: Real>(law: &ContactLaw, gap: T, rounding: T, approach: T) -> (RowState, T) {
    if law.is_equality() || law.is_compliant() {
        return (RowState::Open, T::zero());
    }
    match gap <= rounding + touching(approach) {
        true => (RowState::Open, (gap - rounding).max(T::zero())),
        false => (RowState::Disabled, T::zero()),
    }
}

/// Decides which quantity rows constrain whose law reads the gap at the start of the stage. y holds the gaps of the
/// motion without contact.
pub(crate) fn decide_measures<T: Real>(rows: &mut ContactRowsWork<T>, constraints: &Constraints<'_, T>) {
    if !constraints.laws().read_start {
        return;
    }
    let ContactRowsWork { y, start, .. } = rows;
    for (row, &y) in y.iter().enumerate().take(constraints.len()) {
        if start.measure[row] != Measure::Undecided {
            continue;
        }
        // The gap of a resting contact is small compared with the displacement that its force prevents, from the gap
        // at the start to the gap of the free motion.
        let closed = start.gap[row] <= start.tolerance[row] + touching((y - start.gap[row]).abs());
        start.measure[row] = constraints.law(row).measure(closed);
    }
}

impl<T: Real> ContactRowsWork<T> {
    /// Whether a contact that carries the force `multiplier` in a finished stage is closed.
    pub(crate) fn is_closed(&self, row: usize, law: &ContactLaw, multiplier: T) -> bool {
        let touches = self.state[row].is_enabled() && self.y[row] <= self.tolerance[row] && !law.is_compliant();
        multiplier > T::zero() || touches || law.is_equality()
    }
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Decides which rows the contact problem begins with. Returns whether it must be solved: for a violated row, an
    /// equality row, or friction under a known normal force.
    pub(crate) fn decide_problem(&mut self) -> bool {
        let uniform = self.constraints.laws().are_uniform();
        let mut needed = false;
        self.clear_friction();
        for row in 0..self.constraints.len() {
            let law = self.constraints.law(row);
            let demands_force = !uniform && self.apply_law(row, &law) || law.is_equality();
            let ContactRowsWork { y, tolerance, weight, state, laws, .. } = &mut self.contact.rows;
            let multiplier = &mut self.contact.trial.lambda_raw[row];
            let enabled = state[row].is_enabled();
            let violated = enabled && y[row] < -tolerance[row] || demands_force;
            state[row] = RowState::enabled_if(enabled);
            if weight[row] > T::zero() {
                needed |= violated;
                if violated || enabled && *multiplier > T::zero() {
                    state[row] = RowState::InProblem;
                    let course = course(self.stage, self.clock.h, laws.balance(row));
                    laws.set(row, law.linearized(y[row], tolerance[row], T::zero(), course));
                } else {
                    *multiplier = T::zero();
                }
            }
        }
        needed | self.add_known_forces()
    }

    /// Sets the friction forces to zero that this problem finds, or a later one.
    fn clear_friction(&mut self) {
        let (rows, tangents) = (&self.contact.rows, self.constraints.tangents());
        let is_static = rows.massless.problem == Problem::Static;
        for row in tangents.all() {
            if rows.weight[row] > T::zero() || is_static && rows.massless.acts[tangents.owner(row)] {
                self.contact.trial.lambda_raw[row] = T::zero();
            }
        }
    }

    /// Sets y, tolerance and weight of a row from its law, and disables a row that constrains nothing in this stage.
    /// Returns whether the law demands a force at any y.
    fn apply_law(&mut self, row: usize, law: &ContactLaw) -> bool {
        let (h, slows) = (T::of(self.clock.h), slows(self.stage, law));
        let Self { stage, constraints, g, new, contact, clock, .. } = self;
        let rows = &mut contact.rows;
        if !law.is_compliant() {
            let own = rows.own_weight(stage, clock.h, row).filter(|_| rows.massless.contains(row));
            rows.weight[row] = own.unwrap_or(rows.weight[row]);
            if rows.start.measure[row] == Measure::Nothing {
                rows.state[row] = RowState::Disabled;
            }
            return false;
        }
        let gap = rows.laws.balance_gap[row];
        if slows {
            // The known gap decides whether there is a force.
            rows.state[row] = RowState::enabled_if(gap < T::zero());
            rows.y[row] = -h * rows.laws.approach[row];
            rows.tolerance[row] = rounding(h * g.magnitude(row, &new.v));
            return gap < T::zero();
        }
        rows.y[row] = match law.is_predictive() {
            // The mean gap of the coming step, minus the mean penetration of the last step if there was any.
            true => {
                let half = T::of(0.5);
                half * (rows.y[row] + gap) - (-half * (gap + rows.start.gap[row])).max(T::zero())
            }
            false => gap,
        };
        rows.tolerance[row] = constraints.gap_rounding(row, g.magnitude(row, &new.u), gap);
        false
    }

    /// Adds contacts with a known normal force to the problem, for their friction. Returns whether there are any.
    fn add_known_forces(&mut self) -> bool {
        let (rows, tangents) = (&mut self.contact.rows, self.constraints.tangents());
        let mut any = false;
        for row in tangents.contacts() {
            let slides = rows.weight[tangents.of(row).start] > T::zero();
            if rows.weight[row] == T::zero() && slides && self.contact.trial.lambda_raw[row] > T::zero() {
                (rows.state[row], any) = (RowState::Known, true);
            }
        }
        any
    }
}
