//! The multipliers of the contact problem of a stage.

use crate::contact::{ContactJacobian, Course};
use crate::contact_solver::{Assembly, ContactFailure, ContactProblem, Outcome, RowData};
use crate::corrector::{Gaps, contact_error};
use crate::error::{Error, Result};
use crate::memory;
use crate::real::Real;
use crate::rounding::{half_digits, projected_residual, rounding};
use crate::simulation::operator::interface::InterfaceWork;
use crate::simulation::operator::tangent::{At, TangentOf};
use crate::simulation::rows::contact_rows::ContactRowsWork;
use crate::simulation::rows::contact_rows::RowState;
use crate::simulation::rows::problem_rows::ProblemRows;
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::ContactWork;
use crate::simulation::stage::contact::laws::{course, slows};

/// Maximum number of linearizations of nonlinear laws in a stage.
const LINEARIZATIONS: usize = 100;

/// How far the laws of a problem are from its solution.
struct LawMiss<T> {
    /// The row with the largest residual beyond tolerance, and this residual (length).
    worst: (usize, T),
    /// The largest penetration of a nonlinear law.
    deepest: T,
    /// Whether a multiplier is to be augmented.
    augments: bool,
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Solves for the multipliers. Nonlinear laws are linearized again until they hold.
    pub(crate) fn solve_problem(&mut self) -> Result<()> {
        let limit = LINEARIZATIONS + self.constraints.laws().augmentations;
        let mut before = (0, T::infinity());
        for iteration in 0..limit {
            self.solve_linear_laws()?;
            let LawMiss { worst, deepest, augments } = self.linearize_laws(iteration);
            let ContactWork { rows, trial, .. } = &mut *self.contact;
            for (&row, &lambda) in rows.problem.rows.iter().zip(&rows.problem.multipliers) {
                if rows.weight[row] > T::zero() {
                    trial.lambda_raw[row] = lambda;
                }
            }
            // Newton's method ends when an iteration does not reduce a small residual: this residual comes from an
            // iterative contact solver, as for friction.
            let stagnates = worst.1 <= half_digits::<T>() * deepest && worst.1 > T::of(0.75) * before.1;
            if (worst.1 == T::zero() || stagnates) && !augments {
                return self.add_response();
            }
            before = worst;
        }
        let failure = ContactFailure::NotConverged { iterations: limit, row: before.0, residual: before.1 };
        Err(contact_error(self.new.t, failure, |row| self.constraints.ids[row]))
    }

    /// Compares nonlinear laws with the solution of their linearization, and linearizes them there.
    fn linearize_laws(&mut self, iteration: usize) -> LawMiss<T> {
        let Self { stage, clock, constraints, g, contact, .. } = &mut *self;
        let ContactWork { rows, interface, .. } = &mut **contact;
        let ContactRowsWork { y, tolerance, weight, laws, curved, problem, .. } = rows;
        let forces = curved.forces(g);
        let mut miss = LawMiss { worst: (0, T::zero()), deepest: T::zero(), augments: false };
        for (&row, &lambda) in problem.rows.iter().zip(&problem.multipliers) {
            if g.is_tangential(row) || weight[row] == T::zero() {
                continue;
            }
            let law = constraints.law(row);
            // At a known gap the force is linear in the rate.
            if law.is_nonlinear() && !slows(stage, &law) {
                let gap = y[row] + weight[row] * forces.interface_product(row, &interface.response);
                let course = course(stage, clock.h, laws.balance(row));
                let (c, s) = law.linearized(gap, tolerance[row], lambda, course);
                let left = gap + c * lambda + s;
                let residual = if lambda > T::zero() { left.abs() } else { -left };
                miss.deepest = miss.deepest.max(-gap);
                let size = gap.abs().max((c * lambda).abs()).max(s.abs());
                if residual > tolerance[row] + rounding(size) && residual > miss.worst.1 {
                    miss.worst = (row, residual);
                }
                laws.set(row, (c, s));
            } else if iteration < law.augmentations() {
                miss.augments = true;
                laws.set(row, law.linearized(T::zero(), T::zero(), lambda, Course::at_rest()));
            }
        }
        miss
    }
    /// Adds the forces of the solved problem to the forces on the interface, and their response to d.
    fn add_response(&mut self) -> Result<()> {
        let ContactWork { rows, interface, .. } = &mut *self.contact;
        let forces = rows.curved.forces(self.g);
        for (&row, &lambda) in rows.problem.rows.iter().zip(&rows.problem.multipliers) {
            if !lambda.is_finite() {
                let (contact, value) = (self.constraints.id_of(row), lambda.value());
                return Err(Error::ContactNotFinite { t: self.new.t, what: "the multiplier", contact, value });
            }
            forces.interface_scatter(row, lambda, &mut interface.forces);
        }
        T::axpy(T::one(), &interface.response, &mut interface.increment);
        Ok(())
    }

    /// Solves for the rows in the problem with laws as linearized, and leaves the response in `interface.response`.
    /// Rows whose gaps this response closes join the problem, and it is solved again. This ends, as rows only join.
    fn solve_linear_laws(&mut self) -> Result<()> {
        loop {
            self.contact.rows.list_problem(self.constraints, self.g, self.operator);
            match self.solve_by_products()? {
                Some(products) => self.statistics.contact_products += products as u64,
                None => self.statistics.contact_iterations += self.solve_by_delassus()? as u64,
            }
            self.statistics.contact_solves += 1;
            if !self.add_violated_rows() {
                return Ok(());
            }
        }
    }

    /// Writes the multipliers of the last step or iteration as the guess of a contact solver.
    fn guess_multipliers(&mut self) {
        let ContactWork { rows, trial, .. } = &mut *self.contact;
        let ProblemRows { rows, multipliers, .. } = &mut rows.problem;
        multipliers.clear();
        multipliers.extend(rows.iter().map(|&row| trial.lambda_raw[row]));
    }

    /// Solves a problem by products with A, if that is less work than forming W and the solver leaves the choice.
    /// Returns the number of products.
    fn solve_by_products(&mut self) -> Result<Option<usize>> {
        let assembly = self.solver.assembly();
        if !self.operator.multiplies(assembly, self.contact.rows.problem.rows.len()) {
            return Ok(None);
        }
        self.guess_multipliers();
        let Self { stage, clock, host, new, g, operator, contact, .. } = self;
        let ContactWork { rows, interface, .. } = &mut **contact;
        let ContactRowsWork { laws, weight, curved, problem, .. } = rows;
        let ProblemRows { rows, own, offset, sets, tolerance, multipliers, .. } = problem;
        own.clear();
        // A row with a known force has no weight, and with this no finite compliance.
        own.extend(rows.iter().map(|&row| laws.compliance[row] / weight[row]));
        let at = At { t: clock.at(stage.load), u: &new.u, v: &new.v, of: TangentOf::State };
        let InterfaceWork { problem_forces, response, .. } = interface;
        // Friction follows the normal forces from look to look: it needs all their digits.
        let exact = projected_residual::<T>().value();
        let residual = if sets.len() < rows.len() { exact } else { curved.residual };
        let solved = operator.solve_by_products(
            (&mut *host.system, host.together),
            (clock.h, at),
            (assembly, residual),
            RowData { g: curved.forces(g), rows, compliance: own, offset, tolerance, sets, along: &[], holds: false },
            multipliers,
            [problem_forces, response],
        )?;
        match solved {
            Some(Outcome { products, is_solved: true, .. }) => {
                curved.is_exact = residual <= exact;
                Ok(Some(products))
            }
            Some(Outcome { products, residual, .. }) if assembly == Assembly::Never => Err(Error::LinearNotConverged {
                method: "projected conjugate gradients for contact (`Assembly::Automatic` forms W where they fail)",
                iterations: products,
                residual,
                tolerance: exact,
            }),
            _ => Ok(None),
        }
    }

    /// Solves the problem with W formed, group by group. Returns the most iterations of a group.
    fn solve_by_delassus(&mut self) -> Result<usize> {
        self.guess_multipliers();
        let mut iterations = 0;
        let mut first_set = 0;
        for group in 0..self.operator.groups().len() {
            let range = self.operator.groups().range(group);
            self.check_memory(range.len())?;
            let Self { constraints, g, operator, solver, contact, new, .. } = &mut *self;
            let ContactWork { rows, trial, .. } = &mut **contact;
            let ContactRowsWork { laws, weight, curved, problem, .. } = rows;
            let forces = curved.forces(g);
            let own = &problem.rows[range.clone()];
            let is_known = |row: usize| weight[row] == T::zero();
            let compliance = |k: usize| match is_known(own[k]) {
                true => T::zero(),
                false => laws.compliance[own[k]] / weight[own[k]],
            };
            let (delassus, version) = operator.delassus(forces, own, compliance)?;
            // A contact with friction is one block of several rows.
            let blocks = own.iter().filter(|&&row| !forces.is_tangential(row)).count();
            let sets = &problem.sets[first_set..first_set + blocks];
            first_set += blocks;
            let (offset, tolerance) = (&problem.offset[range.clone()], &problem.tolerance[range.clone()]);
            let mut data = ContactProblem::of(delassus, offset, sets, tolerance, version);
            let any_known = !constraints.tangents().is_empty() && own.iter().any(|&row| is_known(row));
            if any_known {
                data = problem.known.pose(&data, |k| is_known(own[k]).then(|| trial.lambda_raw[own[k]]));
            }
            let multipliers = &mut problem.multipliers[range];
            let solved = solver.solve(&data, multipliers);
            if any_known {
                // The motion already contains the effect of known forces.
                let of_known = multipliers.iter_mut().zip(own).filter(|(_, row)| is_known(**row));
                of_known.for_each(|(multiplier, _)| *multiplier = T::zero());
            }
            let spent = solved.map_err(|failure| contact_error(new.t, failure, |i| constraints.id_of(own[i])))?;
            iterations = iterations.max(spent);
        }
        let ContactWork { rows, interface, .. } = &mut *self.contact;
        let InterfaceWork { problem_forces, response, .. } = interface;
        let (forces, problem) = (rows.curved.forces(self.g), &rows.problem);
        self.operator.answer(forces, (&problem.rows, &problem.multipliers), problem_forces, response);
        Ok(iterations)
    }

    /// Checks that there is memory for the contact solver, which cannot report that there is none: for a group of
    /// `rows` rows it needs two matrices as large as W.
    fn check_memory(&mut self, rows: usize) -> Result<()> {
        /// Up to so many rows it is not checked.
        const FEW: usize = 128;
        let checked = &mut self.contact.rows.problem.checked;
        if rows > FEW.max(*checked) {
            memory::probe::<T>(rows, 3 * rows, "the contact solver")?;
            *checked = rows;
        }
        Ok(())
    }

    /// Adds the rows to the problem whose gaps the response closes. Returns whether there are any.
    fn add_violated_rows(&mut self) -> bool {
        let Self { stage, clock, constraints, g, contact, .. } = self;
        let ContactWork { rows, interface, .. } = &mut **contact;
        let ContactRowsWork { y, tolerance, weight, state, laws, curved, .. } = rows;
        let forces: &ContactJacobian<T> = curved.forces(g);
        // An upper bound of all responses, over the weights of their rows.
        let reach = forces.largest_row() * T::largest(&interface.response);
        let mut any = false;
        for row in 0..constraints.len() {
            let joins = state[row] == RowState::Open && weight[row] > T::zero();
            if joins && y[row] - weight[row] * reach < -tolerance[row] {
                let gap = y[row] + weight[row] * forces.interface_product(row, &interface.response);
                if gap < -tolerance[row] {
                    (state[row], any) = (RowState::InProblem, true);
                    let course = course(stage, clock.h, laws.balance(row));
                    laws.set(row, constraints.law(row).linearized(gap, tolerance[row], T::zero(), course));
                }
            }
        }
        any
    }

    /// Sets the multipliers of all rows whose y depends on d to zero.
    pub(crate) fn clear_multipliers(&mut self) {
        let ContactWork { rows, trial, .. } = &mut *self.contact;
        for row in (0..self.constraints.len()).filter(|&row| rows.weight[row] > T::zero()) {
            trial.lambda_raw[row] = T::zero();
        }
    }
}
