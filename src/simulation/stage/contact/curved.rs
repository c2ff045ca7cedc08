//! Curved rows in the contact of a stage: linearized again at its result, and compared with the rows solved for.

use crate::contact::{Candidates, ContactJacobian};
use crate::corrector::Gaps;
use crate::error::Result;
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::operator::Operator;
use crate::simulation::operator::interface::keep;
use crate::simulation::rows::contact_rows::{ContactRowsWork, Level};
use crate::simulation::rows::curved_rows::{Miss, NEAR, NOISE, Worst};
use crate::simulation::stage::contact::{ContactStep, ContactWork};
use crate::simulation::stage::vectors::StageVectors;
use crate::state::Motion;

impl<T: Real> ContactStep<'_, '_, T> {
    /// Extrapolates gaps along the force rows F, not G, from the last linearization of Newton's method to d without
    /// contact, because contact forces move gaps back along F. Otherwise each iteration would begin with the
    /// difference between G and F as an error.
    pub(crate) fn extrapolate(&self, new: &Motion<T>, contact: &mut ContactWork<T>) {
        let ContactWork { rows, interface, .. } = contact;
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

    /// Returns to d without contact, and extrapolates y to it from the newest linearization.
    pub(crate) fn step_back(
        &mut self,
        operator: &mut Operator<T>,
        new: &Motion<T>,
        vectors: &StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        let interface = &mut contact.interface;
        interface.tried.copy_from_slice(&interface.increment);
        interface.increment.copy_from_slice(&interface.free);
        interface.forces.fill(T::zero());
        if self.constraints.laws().compliant {
            self.balance_gaps_from_tried(contact);
            self.add_inertia(new, vectors, contact)?;
            self.approach(new, vectors, contact)?;
            if self.press_without_coupling(operator, contact)? {
                self.balance_gaps_from_tried(contact);
                self.add_inertia(new, vectors, contact)?;
                self.approach(new, vectors, contact)?;
            }
        }
        let [rigid, ..] = self.weights();
        let ContactWork { rows, interface, .. } = contact;
        for (tried, &d) in interface.tried.iter_mut().zip(&interface.increment) {
            *tried = d - *tried;
        }
        let forces = rows.curved.forces(self.g);
        for row in 0..self.constraints.len() {
            // A predictive law reads the gap that the scheme constrains.
            let weight = if self.constraints.law(row).is_predictive() { rigid } else { rows.weight[row] };
            rows.y[row] += weight * forces.interface_product(row, &interface.tried);
            rows.tolerance[row] += rounding(weight.abs() * forces.interface_magnitude(row, &interface.tried));
        }
        for row in self.constraints.tangents().all() {
            let weight = rows.weight[row];
            rows.y[row] += weight * forces.interface_product(row, &interface.tried);
            rows.tolerance[row] += rounding(weight.abs() * forces.interface_magnitude(row, &interface.tried));
        }
        Ok(())
    }

    /// Extrapolates the gaps of the balance from the last tried d to d.
    fn balance_gaps_from_tried(&self, contact: &mut ContactWork<T>) {
        let [_, balance_u, _] = self.weights();
        let ContactWork { rows, interface, .. } = contact;
        let forces = rows.curved.forces(self.g);
        for row in 0..self.constraints.len() {
            let way =
                forces.interface_product(row, &interface.increment) - forces.interface_product(row, &interface.tried);
            rows.balance_gap[row] = rows.curved.gaps[row] + balance_u * way;
        }
        rows.keep_balance_gaps();
    }

    /// Stores the gaps that this linearization predicts at the resulting d.
    pub(crate) fn foresee(&self, needed: bool, contact: &mut ContactWork<T>) {
        let [_, balance_u, _] = self.weights();
        let ContactRowsWork { y, weight, curved, .. } = &mut contact.rows;
        for row in 0..self.constraints.len() {
            let compliant = self.constraints.law(row).is_compliant();
            let (start, weight) = if compliant { (curved.foreseen[row], balance_u) } else { (y[row], weight[row]) };
            let way = match needed {
                true => curved.forces(self.g).interface_product(row, &contact.interface.response),
                false => T::zero(),
            };
            curved.foreseen[row] = start + weight * way;
        }
        for row in self.constraints.tangents().all() {
            let way = match needed {
                true => curved.forces(self.g).interface_product(row, &contact.interface.response),
                false => T::zero(),
            };
            curved.foreseen[row] = y[row] + weight[row] * way;
        }
    }

    /// Linearizes the rows at the resulting d: G where contact is imposed, F where the balance holds. Returns whether
    /// any row has changed.
    pub(crate) fn follow(
        &mut self,
        new: &mut Motion<T>,
        vectors: &mut StageVectors<T>,
        contact: &mut ContactWork<T>,
    ) -> Result<Candidates> {
        let level = Level { target: self.stage.contact.as_ref(), clock: self.clock };
        if level.is_velocity() {
            return Ok(Candidates::Unchanged);
        }
        self.place(new, vectors, contact);
        let version = self.constraints.version();
        let elsewhere = self.stage.balance.is_some() || self.stage.contact.is_some();
        let (t, balanced) = self.balanced(new, vectors.balance.as_ref());
        let curved = &mut contact.rows.curved;
        let compliant = self.constraints.laws().compliant;
        if elsewhere {
            self.constraints.follow(t, &balanced.u, self.g)?;
            if compliant {
                self.constraints.finite_gaps(t, &balanced.u, &mut curved.gaps)?;
            }
            curved.apart = false;
            curved.hold(self.g, self.constraints);
        }
        let (at, values) = level.place(new, &contact.rows.target);
        self.constraints.follow(at, values, self.g)?;
        keep(self.constraints.interface(), values, &mut contact.interface.followed);
        let curved = &mut contact.rows.curved;
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

    /// Compares gaps and forces of the rows linearized at d with the gaps and forces solved for. Leaves y of the rows
    /// at the d that was placed.
    pub(crate) fn miss(&mut self, new: &Motion<T>, past: &[Motion<T>], contact: &mut ContactWork<T>) -> Result<Miss> {
        self.evaluate(new, contact)?;
        self.evaluate_slips(new, past, contact)?;
        let Self { constraints, g, part, .. } = self;
        let ContactWork { rows, trial, interface, .. } = contact;
        let forces = rows.curved.forces(g);
        let (mut worst, mut largest) = ((0, "the gap"), 0.0_f64);
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
            // Rounding of the displacement undone by the force, which no other term contains at zero gap and
            // coordinates.
            tolerance += rounding(rows.weight[row].abs() * forces.interface_magnitude(row, &interface.free));
            let pressed = lambda > T::zero() || law.is_equality();
            let miss = match pressed {
                true => (y - rows.curved.foreseen[row]).abs(),
                false if rows.enabled[row] => -y,
                false => T::zero(),
            };
            let beyond = miss - tolerance;
            if beyond > T::zero() {
                // Where d moves nothing, the tolerance is the only scale left.
                let share = (beyond / (scale + T::of(NOISE / NEAR) * tolerance)).value();
                if share > largest {
                    (worst, largest) = ((row, "the gap"), share);
                }
            }
        }
        for row in constraints.tangents().all() {
            let lambda = trial.lambda_raw[row];
            forces.interface_scatter(row, lambda, &mut interface.response);
            let owner = constraints.tangents().owner(row);
            if trial.lambda_raw[owner] > T::zero() && rows.weight[row] > T::zero() {
                // A contact under normal force alone slips only by the rounding of its normal.
                let along = |row: usize| forces.interface_magnitude(row, &interface.increment);
                let scale = rows.weight[row] * (along(row) + along(owner));
                // The slip of a sticking contact is the rounding of the displacement that friction has undone.
                let taken = rounding(rows.weight[row] * forces.interface_magnitude(row, &interface.free));
                let beyond = (rows.y[row] - rows.curved.foreseen[row]).abs() - rows.tolerance[row] - taken;
                if beyond > T::zero() {
                    let noise = T::of(NOISE / NEAR) * rows.tolerance[row];
                    let share = (beyond / (scale.max(rows.y[row].abs()) + noise)).value();
                    if share > largest {
                        (worst, largest) = ((owner, "the slip"), share);
                    }
                }
            }
        }
        let moved = interface.response.iter().zip(&interface.forces).map(|(&new, &old)| (new - old).value().powi(2));
        let size = interface.forces.iter().map(|force| force.value().powi(2)).sum::<f64>();
        let force = if size > 0.0 { (moved.sum::<f64>() / size).sqrt() } else { 0.0 };
        let miss = Miss { gap: largest, force };
        rows.curved.worst = Worst::of(miss, worst);
        Ok(miss)
    }
}
