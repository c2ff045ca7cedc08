//! The contact problem of a stage: which rows take part, and their multipliers.

use crate::contact::{Course, Measure};
use crate::contact_solver::{ContactFailure, ContactProblem};
use crate::corrector::{Gaps, contact_error};
use crate::error::{Error, Result};
use crate::memory;
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::operator::Operator;
use crate::simulation::operator::interface::InterfaceWork;
use crate::simulation::rows::contact_rows::{ContactRowsWork, Part};
use crate::simulation::stage::contact::applied_rows::AppliedRows;
use crate::simulation::stage::contact::{ContactStep, ContactWork, course};
use crate::state::Motion;

/// Maximum number of linearizations of nonlinear laws in a stage.
const LINEARIZATIONS: usize = 100;

impl<T: Real> ContactStep<'_, '_, T> {
    /// Decides which rows the problem begins with. Returns whether it must be solved: for a violated row, an equality
    /// row, or friction under a known normal force.
    pub(crate) fn condition(&mut self, new: &Motion<T>, contact: &mut ContactWork<T>) -> bool {
        let Self { stage, clock, constraints, g, part, .. } = &*self;
        let ContactWork { trial, rows, .. } = contact;
        let mut needed = false;
        let tangents = constraints.tangents();
        for row in tangents.all() {
            // Friction that is found after the static balance is zero in it.
            if rows.weight[row] > T::zero() || *part == Part::Massless && rows.on_massless[tangents.owner(row)] {
                trial.lambda_raw[row] = T::zero();
            }
        }
        let laws = constraints.laws();
        for row in 0..constraints.len() {
            let law = &laws[row];
            let equality = laws.equality && law.is_equality();
            let mut presses = equality;
            if laws.compliant && law.is_compliant() {
                let gap = rows.balance_gap[row];
                rows.y[row] = match law.is_predictive() {
                    // The mean gap of the coming step, minus the mean penetration of the last step if there was any.
                    true => {
                        T::of(0.5) * (rows.y[row] + gap) - (-T::of(0.5) * (gap + rows.start_gap[row])).max(T::zero())
                    }
                    false => gap,
                };
                rows.tolerance[row] = constraints.gap_rounding(row, g.magnitude(row, &new.u), gap);
                if self.slows(law) {
                    // The known gap decides whether there is a force.
                    rows.enabled[row] = gap < T::zero();
                    rows.y[row] = -T::of(clock.h) * rows.approach[row];
                    rows.tolerance[row] = rounding(T::of(clock.h) * g.magnitude(row, &new.v));
                    presses = rows.enabled[row];
                }
            } else if !laws.are_uniform() {
                let own = rows.own_weight(stage, clock.h, row).filter(|_| part.takes(&rows.on_massless, row));
                rows.weight[row] = own.unwrap_or(rows.weight[row]);
                rows.enabled[row] &= rows.measure[row] != Measure::Nothing;
            }
            let coupled = rows.weight[row] > T::zero();
            let violated = rows.enabled[row] && rows.y[row] < -rows.tolerance[row] || presses;
            rows.in_problem[row] = coupled && (violated || rows.enabled[row] && trial.lambda_raw[row] > T::zero());
            if rows.in_problem[row] {
                let course = course(stage, clock.h, [rows.balance_gap[row], rows.approach[row]]);
                let linearized = law.linearized(rows.y[row], rows.tolerance[row], T::zero(), course);
                (rows.compliance[row], rows.shift[row]) = linearized;
            } else if coupled {
                trial.lambda_raw[row] = T::zero();
            }
            needed |= coupled && violated;
        }
        needed | self.rub_known(contact)
    }

    /// Adds contacts with a known normal force to the problem, for their friction. Returns whether there are any.
    fn rub_known(&self, contact: &mut ContactWork<T>) -> bool {
        let (ContactWork { trial, rows, .. }, tangents) = (contact, self.constraints.tangents());
        let mut any = false;
        for row in tangents.contacts() {
            let slides = rows.weight[tangents.of(row).start] > T::zero();
            if rows.weight[row] == T::zero() && slides && trial.lambda_raw[row] > T::zero() {
                (rows.in_problem[row], any) = (true, true);
            }
        }
        any
    }

    /// Solves for the multipliers. Nonlinear laws are linearized again until they hold.
    pub(crate) fn press(&mut self, operator: &mut Operator<T>, t: f64, contact: &mut ContactWork<T>) -> Result<()> {
        let augmentations = self.constraints.laws().augmentations;
        let limit = LINEARIZATIONS + augmentations;
        // The residual of the laws after the last iteration.
        let mut before = T::infinity();
        for pass in 0..limit {
            self.press_linearized(operator, t, contact)?;
            let ContactWork { rows, trial, interface, .. } = &mut *contact;
            let ContactRowsWork { problem, multipliers, weight, y, tolerance, compliance, shift, curved, .. } = rows;
            let (gaps, approach) = (&rows.balance_gap, &rows.approach);
            let forces = curved.forces(self.g);
            // The laws at the solution.
            let (mut worst, mut deepest, mut augments) = ((0, T::zero()), T::zero(), false);
            for (&row, &lambda) in problem.iter().zip(multipliers.iter()) {
                if self.g.is_tangential(row) || weight[row] == T::zero() {
                    continue;
                }
                let law = self.constraints.law(row);
                // At a known gap the force is linear in the rate.
                if law.is_nonlinear() && !self.slows(&law) {
                    let gap = y[row] + weight[row] * forces.interface_product(row, &interface.response);
                    let (depth, rounded) = ((-gap).max(T::zero()), T::of(64.0) * T::epsilon());
                    let course = course(self.stage, self.clock.h, [gaps[row], approach[row]]);
                    let (c, s) = law.linearized(gap, tolerance[row], lambda, course);
                    let left = gap + c * lambda + s;
                    let miss = if lambda > T::zero() { left.abs() } else { -left };
                    deepest = deepest.max(depth);
                    let size = gap.abs().max((c * lambda).abs()).max(s.abs());
                    if miss > tolerance[row] + rounded * size && miss > worst.1 {
                        worst = (row, miss);
                    }
                    (compliance[row], shift[row]) = (c, s);
                } else if pass < law.augmentations() {
                    augments = true;
                    (compliance[row], shift[row]) = law.linearized(T::zero(), T::zero(), lambda, Course::at_rest());
                }
            }
            for (&row, &lambda) in problem.iter().zip(multipliers.iter()) {
                if weight[row] > T::zero() {
                    trial.lambda_raw[row] = lambda;
                }
            }
            // Newton's method ends when an iteration does not reduce a small residual: this residual comes from an
            // iterative contact solver, as for friction.
            let ends = worst.1 <= T::epsilon().sqrt() * deepest && worst.1 > T::of(0.75) * before;
            before = worst.1;
            let met = worst.1 == T::zero() || ends;
            if met && !augments {
                for (&row, &lambda) in problem.iter().zip(multipliers.iter()) {
                    if !lambda.is_finite() {
                        let (contact, value) = (self.constraints.id_of(row), lambda.value());
                        return Err(Error::ContactNotFinite { t, what: "the multiplier", contact, value });
                    }
                    forces.interface_scatter(row, lambda, &mut interface.forces);
                }
                T::axpy(T::one(), &interface.response, &mut interface.increment);
                return Ok(());
            }
            if pass + 1 == limit {
                let failure = ContactFailure::NotConverged { iterations: pass, row: worst.0, residual: worst.1 };
                return Err(contact_error(t, failure, |row| self.constraints.ids[row]));
            }
        }
        Ok(())
    }

    /// Solves for the rows in the problem, and leaves the response in `interface.response`. Rows whose gaps this
    /// response closes join the problem, and it is solved again. This ends, as rows only join.
    pub(crate) fn press_linearized(
        &mut self,
        operator: &mut Operator<T>,
        t: f64,
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        let (stage, h) = (self.stage, self.clock.h);
        let Self { constraints, g, solver, statistics, .. } = self;
        let ContactWork { rows, trial, interface, .. } = contact;
        let count = constraints.len();
        loop {
            rows.list_problem(constraints, g, operator);
            let (y, tolerance, weight, enabled) = (&rows.y, &rows.tolerance, &rows.weight, &rows.enabled);
            let (compliance, shift, in_problem) = (&mut rows.compliance, &mut rows.shift, &mut rows.in_problem);
            let (problem, offset, problem_tolerance) = (&rows.problem, &rows.offset, &rows.problem_tolerance);
            let (own, scale, versions) = (&mut rows.own, &mut rows.scale, &mut rows.versions);
            let (reserved, most) = (&mut rows.reserved, &mut rows.most);
            let (sets, multipliers, known, forces) =
                (&rows.sets, &mut rows.multipliers, &mut rows.known, rows.curved.forces(g));
            let guess = |problem: &[usize], multipliers: &mut Vec<T>| {
                multipliers.clear();
                multipliers.extend(problem.iter().map(|&row| trial.lambda_raw[row]));
            };
            let InterfaceWork { pressing, response, .. } = &mut *interface;
            let mut solved = None;
            if operator.applies(problem.len()) && constraints.tangents().is_empty() {
                own.clear();
                own.extend(problem.iter().map(|&row| compliance[row] / weight[row]));
                guess(problem, multipliers);
                let problem = AppliedRows { g: forces, rows: problem, own, offset, sets, tolerance: problem_tolerance };
                solved = problem.solve(operator, &mut **solver, [pressing, response], scale, multipliers)?;
            }
            if let Some(iterations) = solved {
                statistics.contact_iterations += iterations as u64;
            } else {
                guess(problem, multipliers);
                let (mut iterations, mut first_set) = (0, 0);
                for group in 0..operator.groups().len() {
                    let range = operator.groups().range(group);
                    if range.len() > *most {
                        // Beside W solvers need two matrices as large, and cannot report missing memory.
                        let rows = if range.len() > *reserved { range.len().next_power_of_two() } else { range.len() };
                        memory::probe::<T>(rows, 3 * rows, "the contact solver")?;
                        *most = rows;
                        if rows > *reserved {
                            *reserved = rows;
                            solver.reserve(rows);
                        }
                    }
                    let own = &problem[range.clone()];
                    let is_known = |row: &usize| weight[*row] == T::zero();
                    let compliance_of = |k: usize| match is_known(&own[k]) {
                        true => T::zero(),
                        false => compliance[own[k]] / weight[own[k]],
                    };
                    let (delassus, version) = operator.delassus(forces, own, compliance_of, versions)?;
                    // A contact with friction is one block of several rows.
                    let blocks = own.iter().filter(|&&row| !forces.is_tangential(row)).count();
                    let (offset, sets) = (&offset[range.clone()], &sets[first_set..first_set + blocks]);
                    first_set += blocks;
                    let tolerance = &problem_tolerance[range.clone()];
                    let mut data = ContactProblem::of(delassus, offset, sets, tolerance, version);
                    let knows = !constraints.tangents().is_empty() && own.iter().any(is_known);
                    if knows {
                        data = known.pose(&data, |k| is_known(&own[k]).then(|| trial.lambda_raw[own[k]]));
                    }
                    let multipliers = &mut multipliers[range];
                    let solved = solver.solve(&data, multipliers);
                    if knows {
                        // The motion already contains the effect of known forces.
                        let own = multipliers.iter_mut().zip(own).filter(|(_, row)| is_known(row));
                        own.for_each(|(multiplier, _)| *multiplier = T::zero());
                    }
                    let spent = solved.map_err(|failure| contact_error(t, failure, |i| constraints.id_of(own[i])));
                    iterations = iterations.max(spent?);
                }
                statistics.contact_iterations += iterations as u64;
                operator.answer(forces, (problem, multipliers), pressing, response);
            }
            statistics.contact_solves += 1;
            let mut grown = false;
            // An upper bound of all responses, over the weights of their rows.
            let reach = forces.largest_row() * T::largest(&interface.response);
            for row in 0..count {
                let near = y[row] - weight[row] * reach < -tolerance[row];
                if near && enabled[row] && !in_problem[row] && weight[row] > T::zero() {
                    let pushed = y[row] + weight[row] * forces.interface_product(row, &interface.response);
                    if pushed < -tolerance[row] {
                        (in_problem[row], grown) = (true, true);
                        let course = course(stage, h, [rows.balance_gap[row], rows.approach[row]]);
                        let law = constraints.law(row);
                        (compliance[row], shift[row]) = law.linearized(pushed, tolerance[row], T::zero(), course);
                    }
                }
            }
            if !grown {
                return Ok(());
            }
        }
    }

    /// Sets the multipliers of all rows whose y depends on d to zero.
    pub(crate) fn release(&self, contact: &mut ContactWork<T>) {
        let ContactWork { rows, trial, .. } = contact;
        for row in (0..self.constraints.len()).filter(|&row| rows.weight[row] > T::zero()) {
            trial.lambda_raw[row] = T::zero();
        }
    }
}
