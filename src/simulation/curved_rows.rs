//! Curved gaps within a stage: the gap is met where contact is imposed, the force acts along the rows where the balance
//! holds.
//!
//! Contact is solved with rows that are linear on the interface. Afterwards rows are linearized again, at the
//! displacements that came out, and the problem is solved once more, until they fit. W = F A⁻¹ Fᵀ is made of the force
//! rows F alone, which keeps it symmetric; gaps are evaluated as they are, so that the point that is reached is that of
//! the unsymmetric G A⁻¹ Fᵀ.

use super::Workspace;
use super::constraints::Constraints;
use super::contact_step::{ContactRowsWork, ContactStep, Level, keep};
use super::operator::Operator;
use crate::contact::{Candidates, ContactJacobian};
use crate::corrector::{Gaps, rounding};
use crate::error::Result;
use crate::real::Real;
use crate::state::Motion;

/// Linearizations of curved rows in a contact problem, at most, and those after which forces that go to and fro are
/// borne with.
pub(super) const FOLLOWED: usize = 40;
const LONG: usize = 12;

/// The relative miss of gaps and forces at which rows fit, in roundings, and that which is accepted where it falls no
/// more.
const FIT: f64 = 64.0;
const NEAR: f64 = 1e-8;

/// Tolerances of a gap that it may miss, where nothing gets better.
const NOISE: f64 = 8.0;

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
    rows: ContactJacobian<T>,
    /// Version of the constraints' rows that F is a copy of.
    version: u64,
    /// Whether F is not G.
    apart: bool,
    /// Gaps where the balance holds, with the rows of that place; one a candidate.
    gaps: Vec<T>,
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

impl<T: Real> ContactStep<'_, '_, T> {
    /// Makes gaps at d without contact those by the force rows, along which contact will answer, from where the last
    /// iteration of Newton's method has left them; else each iteration would begin again with what G and F differ by.
    pub(super) fn extrapolate(&self, new: &Motion<T>, work: &mut Workspace<T>) {
        let Workspace { rows, interface, .. } = work;
        if !rows.curved.apart {
            return;
        }
        let level = Level { target: self.stage.contact.as_ref(), clock: self.clock };
        let (_, values) = level.place(new, &rows.target);
        let way = self.constraints.interface().iter().zip(&interface.followed);
        for ((&dof, &from), way) in way.zip(&mut interface.tried) {
            *way = values[dof] - from;
        }
        for row in 0..self.constraints.len() {
            let along = |g: &ContactJacobian<T>| g.interface_product(row, &interface.tried);
            rows.y[row] += along(&rows.curved.rows) - along(self.g);
        }
    }

    /// Goes back to d without contact: what rows constrain there, from where the last linearization was made.
    pub(super) fn step_back(
        &mut self,
        operator: &mut Operator<T>,
        new: &Motion<T>,
        work: &mut Workspace<T>,
    ) -> Result<()> {
        let interface = &mut work.interface;
        interface.tried.copy_from_slice(&interface.increment);
        interface.increment.copy_from_slice(&interface.free);
        interface.forces.fill(T::zero());
        if self.constraints.has_compliant() {
            self.balance_gaps_from_tried(work);
            self.add_inertia(new, work)?;
            if self.press_without_coupling(operator, work)? {
                self.balance_gaps_from_tried(work);
                self.add_inertia(new, work)?;
            }
        }
        let [rigid, ..] = self.weights();
        let Workspace { rows, interface, .. } = work;
        for (tried, &d) in interface.tried.iter_mut().zip(&interface.increment) {
            *tried = d - *tried;
        }
        let forces = rows.curved.forces(self.g);
        for row in 0..self.constraints.len() {
            // (A law that predicts reads the gap that the scheme constrains.)
            let weight = if self.constraints.law(row).is_predictive() { rigid } else { rows.weight[row] };
            rows.y[row] += weight * forces.interface_product(row, &interface.tried);
            rows.tolerance[row] += rounding(weight.abs() * forces.interface_magnitude(row, &interface.tried));
        }
        Ok(())
    }

    /// Gaps of the balance at d, by the rows at the d that was tried.
    fn balance_gaps_from_tried(&self, work: &mut Workspace<T>) {
        let [_, balance_u, _] = self.weights();
        let Workspace { rows, interface, .. } = work;
        let forces = rows.curved.forces(self.g);
        for row in 0..self.constraints.len() {
            let way =
                forces.interface_product(row, &interface.increment) - forces.interface_product(row, &interface.tried);
            rows.balance_gap[row] = rows.curved.gaps[row] + balance_u * way;
        }
        rows.keep_balance_gaps();
    }

    /// Keeps what the rows of this linearization make of the gaps at the d that it has led to.
    pub(super) fn foresee(&self, needed: bool, work: &mut Workspace<T>) {
        let [_, balance_u, _] = self.weights();
        let ContactRowsWork { y, weight, curved, .. } = &mut work.rows;
        for row in 0..self.constraints.len() {
            let compliant = self.constraints.law(row).is_compliant();
            let (start, weight) = if compliant { (curved.foreseen[row], balance_u) } else { (y[row], weight[row]) };
            let way = match needed {
                true => curved.forces(self.g).interface_product(row, &work.interface.response),
                false => T::zero(),
            };
            curved.foreseen[row] = start + weight * way;
        }
    }

    /// Linearizes the rows where d ends: G where contact is imposed, F where the balance holds. Says whether any moved.
    pub(super) fn follow(&mut self, new: &mut Motion<T>, work: &mut Workspace<T>) -> Result<Candidates> {
        let level = Level { target: self.stage.contact.as_ref(), clock: self.clock };
        if level.is_velocity() {
            return Ok(Candidates::Unchanged);
        }
        self.place(new, work);
        let version = self.constraints.version();
        let elsewhere = self.stage.balance.is_some() || self.stage.contact.is_some();
        let (t, balanced) = self.balanced(new, work.balance.as_ref());
        let curved = &mut work.rows.curved;
        let compliant = self.constraints.has_compliant();
        if elsewhere {
            self.constraints.follow(t, &balanced.u, self.g)?;
            if compliant {
                self.constraints.finite_gaps(t, &balanced.u, &mut curved.gaps)?;
            }
            curved.apart = false;
            curved.hold(self.g, self.constraints);
        }
        let (at, values) = level.place(new, &work.rows.target);
        self.constraints.follow(at, values, self.g)?;
        keep(self.constraints.interface(), values, &mut work.interface.followed);
        let curved = &mut work.rows.curved;
        if compliant && !elsewhere {
            self.constraints.finite_gaps(t, &new.u, &mut curved.gaps)?;
        }
        if elsewhere {
            curved.release(self.constraints);
        }
        Ok(match self.constraints.version() == version {
            true => Candidates::Unchanged,
            false => Candidates::Changed,
        })
    }

    /// How much gaps and forces by the rows that follow d differ from those that were solved with. Leaves y of the rows
    /// where d is placed.
    pub(super) fn miss(&mut self, new: &Motion<T>, work: &mut Workspace<T>) -> Result<Miss> {
        self.evaluate(new, work)?;
        let Self { constraints, g, part, .. } = self;
        let Workspace { rows, trial, interface, .. } = work;
        let forces = rows.curved.forces(g);
        let (mut worst, mut largest) = ((0, T::zero()), 0.0_f64);
        interface.response.fill(T::zero());
        for row in (0..constraints.len()).filter(|&row| part.takes(&rows.on_massless, row)) {
            let (law, lambda) = (constraints.law(row), trial.lambda_raw[row]);
            forces.interface_scatter(row, lambda, &mut interface.response);
            let mut scale = rows.weight[row].abs() * forces.interface_magnitude(row, &interface.increment);
            let (mut y, mut tolerance) = (rows.y[row], rows.tolerance[row]);
            if law.is_compliant() {
                y = rows.curved.gaps[row];
                tolerance = constraints.gap_rounding(row, g.magnitude(row, &new.u), y);
                scale = scale.max(y.abs());
            }
            let pressed = lambda > T::zero() || law.is_equality();
            let miss = match pressed {
                true => (y - rows.curved.foreseen[row]).abs(),
                false if rows.enabled[row] => -y,
                false => T::zero(),
            };
            let beyond = miss - tolerance;
            if beyond > T::zero() {
                // (Where nothing moves what is missed is noise, beside a share of tolerances.)
                largest = largest.max((beyond / (scale + T::of(NOISE / NEAR) * tolerance)).value());
            }
            if miss > worst.1 {
                worst = (row, miss);
            }
        }
        let moved = interface.response.iter().zip(&interface.forces).map(|(&new, &old)| (new - old).value().powi(2));
        let size = interface.forces.iter().map(|force| force.value().powi(2)).sum::<f64>();
        let force = if size > 0.0 { (moved.sum::<f64>() / size).sqrt() } else { 0.0 };
        rows.curved.worst = worst;
        Ok(Miss { gap: largest, force })
    }
}
