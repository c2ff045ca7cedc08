//! Static balance at the start: of dofs without mass, or of all dofs of a run that starts at rest, with the other
//! dofs, the load and contact. Contact on dofs without mass has its forces from here.

use crate::contact::{Candidates, Course};
use crate::contact_solver::ContactProblem;
use crate::corrector::{Gaps, contact_error};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::operator::Operator;
use crate::simulation::operator::responses::Unit;
use crate::simulation::stage::massless::Columns;
use crate::simulation::start::parts::{bodies_at_rest, by_damping, factorize, joined, parts};
use crate::simulation::start::problem::StartImpact;
use crate::simulation::start::{Origin, Start};
use crate::state::{ContactState, Motion};

/// How dofs without mass, or all dofs of a run that [starts at rest](crate::SimulationBuilder::start_at_rest), were
/// moved when a simulation was built, before its first step, and how an impact changed their velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StartAdjustment<T> {
    /// Change of the potential energy, with the potential of the load (minus its force times the displacement); not
    /// positive. The run would have lost this energy in a jump. None if the system has no potential.
    pub energy: Option<T>,
    /// The largest change of a displacement (length).
    pub largest: T,
    /// The dof that has moved most; 0 if none has moved.
    pub dof: usize,
    /// The impact that stopped the slip of a contact, if friction jammed one. It changed velocities.
    pub impact: Option<StartImpact<T>>,
}

/// The matrix in the error of a run that cannot start at rest.
const AT_REST: &str = "stiffness matrix, with which the run was to start at rest (contact does not hold a body there),";

/// Maximum number of iterations of a balance. Linear systems take two.
const ITERATIONS: usize = 30;

/// The unknowns of a balance.
#[derive(Clone, Copy, Debug)]
enum Unknown<'r> {
    /// Displacements, by the stiffness; contact constrains gaps.
    Displacements,
    /// Velocities, by the damping; contact constrains the gap rates of these rows.
    Velocities { rows: &'r [usize] },
}

impl Unknown<'_> {
    fn of<'m, T: Real>(&self, motion: &'m mut Motion<T>) -> &'m mut Vec<T> {
        match self {
            Self::Displacements => &mut motion.u,
            Self::Velocities { .. } => &mut motion.v,
        }
    }
}

/// The result of a balance.
pub(super) struct Balanced<T> {
    /// Whether dofs have moved; they had been in balance to rounding otherwise.
    is_moved: bool,
    /// What rounding adds to the quantity that contact constrains.
    pub(super) tolerance: T,
    /// Contact forces, one per row of G.
    pub(super) forces: Vec<T>,
}

/// The quantities that contact constrains in a balance, one entry per row of G.
struct Level<T> {
    /// Gaps and displacements along the tangents, or their rates, without contact forces.
    free: Vec<T>,
    tolerance: Vec<T>,
    compliance: Vec<T>,
    /// The rows that may carry a force.
    candidates: Vec<usize>,
}

impl<T: Real> Start<'_, '_, T> {
    /// Brings dofs without mass into static balance, or all dofs of the bodies at rest: f_b + Gᵀ λ = 0,
    /// 0 ≤ g ⊥ λ ≥ 0, and friction in its cone against the displacement from the given positions. Dofs that are in
    /// balance to rounding stay unchanged, bit for bit. So do massless dofs under damping, whose displacements are
    /// independent initial values, and dofs without a symmetric positive definite stiffness: the step decides whether
    /// the scheme can treat these.
    pub(super) fn balance_displacements(
        &mut self,
        motion: &mut Motion<T>,
        contacts: &mut ContactState<T>,
    ) -> Result<(Balanced<T>, Option<StartAdjustment<T>>)> {
        let [_, mut dofs] = by_damping(&mut *self.system, self.massless)?;
        if self.is_at_rest() {
            dofs.extend(bodies_at_rest(&*self.system, self.together, &motion.v)?);
            dofs.sort_unstable();
            dofs.dedup();
        }
        let given = motion.u.clone();
        let balanced = self.balance(Unknown::Displacements, &dofs, motion, contacts)?;
        let kept = Balanced { is_moved: false, tolerance: T::zero(), forces: vec![T::zero(); self.g.rows()] };
        let balanced = balanced.unwrap_or(kept);
        let adjustment = if balanced.is_moved { Some(self.adjustment(motion, &given)?) } else { None };
        Ok((balanced, adjustment))
    }

    /// How far dofs have moved from given displacements.
    fn adjustment(&mut self, motion: &Motion<T>, given: &[T]) -> Result<StartAdjustment<T>> {
        let [before, after] = [given, &motion.u].map(|u| self.system.potential_energy(u));
        let mut load = vec![T::zero(); given.len()];
        self.system.external_load(motion.t, &mut load)?;
        let (mut work, mut dof, mut largest) = (T::zero(), 0, T::zero());
        for (other, (&new, &old)) in motion.u.iter().zip(given).enumerate() {
            work += load[other] * (new - old);
            if (new - old).abs() > largest {
                (dof, largest) = (other, (new - old).abs());
            }
        }
        let energy = before.zip(after).map(|(before, after)| after - before - work);
        Ok(StartAdjustment { energy, largest, dof, impact: None })
    }

    /// Computes the velocities of massless dofs under damping from their balance, f_b(t, u, v) + Gᵀ λ = 0 with
    /// 0 ≤ ġ ⊥ λ ≥ 0 in contacts that touch, and the forces of springs: the displacements of these dofs are initial
    /// values, their velocities are not. With other velocities the damping force would not be in balance, and would
    /// accelerate the dofs with mass, as no internal force does. Velocities stay as given where the part of C is not
    /// symmetric positive definite.
    pub(super) fn balance_velocities(
        &mut self,
        touching: &[bool],
        motion: &mut Motion<T>,
        contacts: &mut ContactState<T>,
    ) -> Result<()> {
        self.compress_springs(motion, contacts)?;
        if self.system.pattern().row_idx().is_empty() {
            return Ok(());
        }
        let [damped, undamped] = by_damping(&mut *self.system, self.massless)?;
        let has_rate = |&row: &usize| touching[row] && self.g.acts_on(row, &damped) && !self.g.acts_on(row, &undamped);
        let rows: Vec<usize> = (0..self.constraints.len()).filter(has_rate).collect();
        let known = contacts.lambda.clone();
        let mut all = Vec::new();
        self.constraints.tangents().expand(rows.iter().copied(), &mut all);
        for &row in &all {
            contacts.lambda[row] = T::zero();
        }
        match self.balance(Unknown::Velocities { rows: &rows }, &damped, motion, contacts)? {
            Some(Balanced { forces, .. }) => all.into_iter().for_each(|row| contacts.lambda[row] = forces[row]),
            None => contacts.lambda = known,
        }
        Ok(())
    }

    /// The forces of springs, which exert them from the start if they are compressed.
    fn compress_springs(&mut self, motion: &Motion<T>, contacts: &mut ContactState<T>) -> Result<()> {
        if !self.constraints.laws().compliant {
            return Ok(());
        }
        let rates = self.rates(motion.t, motion)?;
        for (row, rates) in rates.iter().enumerate().take(self.constraints.len()) {
            let law = self.constraints.law(row);
            if law.is_spring() {
                let approach = -(self.g.product(row, &motion.v) + rates.rate);
                contacts.lambda[row] = law.force(contacts.gap[row], approach);
                contacts.closed[row] = contacts.lambda[row] > T::zero();
            }
        }
        Ok(())
    }

    fn is_at_rest(&self) -> bool {
        matches!(self.origin, Origin::Initial { is_at_rest: true, .. })
    }

    /// Balances the parts of some dofs whose matrix is symmetric positive definite. None if there is no such part; this
    /// is an error if the run is to start at rest.
    fn balance(
        &mut self,
        unknown: Unknown<'_>,
        dofs: &[usize],
        motion: &mut Motion<T>,
        contacts: &mut ContactState<T>,
    ) -> Result<Option<Balanced<T>>> {
        let mut parts = parts(&*self.system, dofs);
        let given = unknown.of(motion).clone();
        while !parts.is_empty() {
            let reason = match self.balance_parts(unknown, &mut parts, &given, motion, contacts) {
                Err(reason @ (Error::Asymmetric { .. } | Error::Singular { .. })) => reason,
                balanced => return balanced.map(Some),
            };
            unknown.of(motion).clone_from(&given);
            if let Unknown::Displacements = unknown {
                self.search(motion)?;
                if parts.is_empty() && self.is_at_rest() {
                    return Err(match reason {
                        Error::Singular { dof, .. } => Error::Singular { matrix: AT_REST, dof },
                        other => other,
                    });
                }
            }
        }
        Ok(None)
    }

    /// Balances some parts together, as contacts may couple them, by Newton's method. If their matrix is not symmetric
    /// positive definite, `parts` keeps the parts that are left to balance.
    fn balance_parts(
        &mut self,
        unknown: Unknown<'_>,
        parts: &mut Vec<Vec<usize>>,
        given: &[T],
        motion: &mut Motion<T>,
        contacts: &mut ContactState<T>,
    ) -> Result<Balanced<T>> {
        let (t, h, dofs) = (motion.t, self.h, joined(parts));
        let interface = self.constraints.interface().to_vec();
        let mut increment = vec![T::zero(); given.len()];
        let mut on_interface = vec![T::zero(); interface.len()];
        let (mut before, mut is_moved, mut is_searched, mut worst) = (T::infinity(), false, true, dofs[0]);
        for _ in 0..ITERATIONS {
            let Self { system, g, .. } = &mut *self;
            system.force(t, &motion.u, &motion.v, &mut increment)?;
            let columns = match unknown {
                Unknown::Displacements => Columns::of(&mut **system, &dofs, motion)?,
                Unknown::Velocities { .. } => {
                    (0..g.rows()).for_each(|row| g.scatter(row, contacts.lambda[row], &mut increment));
                    Columns::of_damping(&mut **system, &dofs, motion)?
                }
            };
            let factor = factorize(&columns, &dofs, parts, &interface)?;
            let mut operator = Operator::of_part(factor, &interface, Unit::Row)?;
            operator.begin(&mut increment, &mut on_interface)?;
            let level = match unknown {
                Unknown::Displacements => self.gaps(&dofs, given, motion, &on_interface)?,
                Unknown::Velocities { rows } => self.gap_rates(rows, motion, &on_interface)?,
            };
            let mut at_contacts = vec![T::zero(); interface.len()];
            let (forces, noise) =
                self.solve_contact(&level, &dofs, t, &mut operator, [&mut on_interface, &mut at_contacts])?;
            operator.finish(&mut increment, &on_interface, &at_contacts)?;
            let mut size = T::zero();
            for &dof in &dofs {
                let change = increment[dof].abs();
                if change > size || change.is_nan() {
                    (size, worst) = (change, dof);
                }
            }
            if !size.is_finite() {
                let (dof, value) = (worst, size.value());
                return Err(Error::StepNotFinite { t, h, what: "the motion in static balance", dof, value });
            }
            let values = unknown.of(motion);
            let scale = T::largest(values).max(T::largest(given));
            // The next increment, if it falls by the same factor, would be rounding. Gaps are met within their own
            // rounding, which may exceed the rounding of displacements: they are computed from coordinates.
            let bound = rounding(scale) + noise;
            let is_balanced = size <= bound || before.is_finite() && size / before * size <= bound;
            before = size;
            let tolerance = noise + self.g.largest_row() * (size + rounding(scale));
            if is_balanced && is_searched {
                return Ok(Balanced { is_moved, tolerance, forces });
            }
            for &dof in &dofs {
                values[dof] += increment[dof];
            }
            (is_moved, is_searched) = (true, is_balanced);
            let rows = match unknown {
                Unknown::Velocities { .. } => {
                    self.compress_springs(motion, contacts)?;
                    Candidates::Unchanged
                }
                Unknown::Displacements if is_balanced => self.search(motion)?,
                Unknown::Displacements => self.constraints.follow(t, &motion.u, self.g)?,
            };
            if is_balanced && rows == Candidates::Unchanged {
                return Ok(Balanced { is_moved, tolerance, forces });
            }
        }
        Err(Error::StartNotBalanced { iterations: ITERATIONS, dof: worst })
    }

    /// Gaps, and displacements along the tangents from given positions, with the laws linearized there.
    fn gaps(&mut self, dofs: &[usize], given: &[T], motion: &Motion<T>, on_interface: &[T]) -> Result<Level<T>> {
        let Self { constraints, g, .. } = self;
        let (u, rows) = (&motion.u, constraints.len());
        let mut free = vec![T::zero(); rows];
        constraints.finite_gaps(motion.t, u, &mut free)?;
        let mut tolerance: Vec<T> =
            (0..rows).map(|row| constraints.gap_rounding(row, g.magnitude(row, u), free[row])).collect();
        let mut compliance = vec![T::zero(); g.rows()];
        for row in 0..rows {
            tolerance[row] += rounding(g.interface_magnitude(row, on_interface));
            let law = constraints.law(row);
            if law.is_compliant() {
                let (slope, shift) = law.linearized(free[row], tolerance[row], T::zero(), Course::at_rest());
                compliance[row] = slope;
                free[row] += shift;
            }
        }
        for row in constraints.tangents().all() {
            free.push(g.row(row).map(|(dof, weight)| weight * (u[dof] - given[dof])).sum::<T>());
            tolerance.push(rounding(g.magnitude(row, u)));
        }
        let candidates = (0..rows).filter(|&row| g.acts_on(row, dofs)).collect();
        Ok(Level { free, tolerance, compliance, candidates })
    }

    /// Gap rates, and slip rates.
    fn gap_rates(&mut self, rows: &[usize], motion: &Motion<T>, on_interface: &[T]) -> Result<Level<T>> {
        let rates = self.rates(motion.t, motion)?;
        let (g, v) = (&self.g, &motion.v);
        let noise = |(row, own): (usize, T)| g.magnitude(row, v) + own.abs() + g.interface_magnitude(row, on_interface);
        let own = || rates.iter().map(|rates| rates.rate).enumerate();
        Ok(Level {
            free: own().map(|(row, own)| g.product(row, v) + own).collect(),
            tolerance: own().map(|row| rounding(noise(row))).collect(),
            compliance: vec![T::zero(); g.rows()],
            candidates: rows.to_vec(),
        })
    }

    /// Solves the contact problem of an iteration: adds its response to the increment on the interface, and its forces
    /// `at_contacts`. Returns the forces of all rows, and the largest tolerance of a row that carries one. Rows are
    /// assumed to have unit weights: a gap is then as long as the displacement that closes it.
    fn solve_contact(
        &mut self,
        level: &Level<T>,
        dofs: &[usize],
        t: f64,
        operator: &mut Operator<T>,
        [on_interface, at_contacts]: [&mut Vec<T>; 2],
    ) -> Result<(Vec<T>, T)> {
        let Self { constraints, g, contact_solver, .. } = self;
        let free: Vec<T> =
            level.free.iter().enumerate().map(|(row, y)| *y + g.interface_product(row, on_interface)).collect();
        let (mut contacts, mut rows) = (Vec::new(), Vec::new());
        let (mut lambda, mut response) = (Vec::new(), vec![T::zero(); on_interface.len()]);
        loop {
            let is_pressed = |&row: &usize| {
                let y = free[row] + g.interface_product(row, &response);
                !contacts.contains(&row) && (y < -level.tolerance[row] || constraints.law(row).is_equality())
            };
            let joining: Vec<usize> = level.candidates.iter().copied().filter(is_pressed).collect();
            if joining.is_empty() {
                break;
            }
            contacts.extend(joining);
            contacts.sort_unstable();
            rows.clear();
            let mut sets = Vec::new();
            for &row in &contacts {
                // Friction on dofs with mass alone moves none of these dofs.
                let tangents = constraints.tangents();
                let has_friction = !constraints.law(row).is_compliant() && tangents.rub_on(g, row, dofs);
                let own = if has_friction { tangents.of(row) } else { 0..0 };
                sets.push(if has_friction { constraints.set(row) } else { constraints.law(row).into() });
                rows.extend(std::iter::once(row).chain(own));
            }
            let [offset, tolerance] =
                [&free, &level.tolerance].map(|values| rows.iter().map(|&row| values[row]).collect::<Vec<T>>());
            let (delassus, version) = operator.delassus(g, &rows, |k| level.compliance[rows[k]])?;
            let problem = ContactProblem::of(delassus, &offset, &sets, &tolerance, version);
            lambda.clear();
            lambda.resize(rows.len(), T::zero());
            let solved = contact_solver.solve(&problem, &mut lambda);
            solved.map_err(|failure| contact_error(t, failure, |i| constraints.id_of(rows[i])))?;
            operator.answer(g, (&rows, &lambda), at_contacts, &mut response);
        }
        T::axpy(T::one(), &response, on_interface);
        let mut forces = vec![T::zero(); g.rows()];
        rows.iter().zip(&lambda).for_each(|(&row, &force)| forces[row] = force);
        let noise = contacts.iter().fold(T::zero(), |most, &row: &usize| most.max(level.tolerance[row]));
        Ok((forces, noise))
    }
}
