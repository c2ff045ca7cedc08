//! Curved rows in the contact of a stage: linearized again at its result, and compared with the rows solved for.

use crate::contact::{Candidates, ContactJacobian};
use crate::corrector::Gaps;
use crate::error::Result;
use crate::real::Real;
use crate::rounding::{ROUNDING_OF_ROWS, rounding};
use crate::simulation::operator::interface::keep;
use crate::simulation::rows::contact_rows::ContactRowsWork;
use crate::simulation::rows::curved_rows::{Miss, Worst};
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::ContactWork;

impl<T: Real> StageSolve<'_, '_, T> {
    /// Extrapolates gaps along the force rows F, not G, from the last linearization of Newton's method to d without
    /// contact, because contact forces move gaps back along F. Otherwise each iteration would begin with the
    /// difference between G and F as an error.
    pub(crate) fn extrapolate_along_forces(&mut self) {
        if !self.contact.rows.curved.apart {
            return;
        }
        let ContactWork { rows, interface, .. } = &mut *self.contact;
        let values = if self.stage.contact.is_some() { &rows.target.values } else { &self.new.u };
        let from = self.constraints.interface().iter().zip(&interface.linearized_at);
        for ((&dof, &from), difference) in from.zip(&mut interface.tried) {
            *difference = values[dof] - from;
        }
        for row in 0..self.constraints.len() {
            let along = |g: &ContactJacobian<T>| g.interface_product(row, &interface.tried);
            rows.y[row] += along(&rows.curved.rows) - along(self.g);
        }
    }

    /// Returns to d without contact, and extrapolates y to it from the newest linearization.
    pub(crate) fn extrapolate_without_contact(&mut self) -> Result<()> {
        let interface = &mut self.contact.interface;
        interface.tried.copy_from_slice(&interface.increment);
        interface.increment.copy_from_slice(&interface.free);
        interface.forces.fill(T::zero());
        self.evaluate_laws(|stage| {
            stage.extrapolate_balance_gaps();
            Ok(())
        })?;
        let [rigid, ..] = self.weights();
        let ContactWork { rows, interface, .. } = &mut *self.contact;
        for (tried, &d) in interface.tried.iter_mut().zip(&interface.increment) {
            *tried = d - *tried;
        }
        let forces = rows.curved.forces(self.g);
        let mut extrapolate = |row: usize, weight: T| {
            rows.y[row] += weight * forces.interface_product(row, &interface.tried);
            rows.tolerance[row] += rounding(weight.abs() * forces.interface_magnitude(row, &interface.tried));
        };
        for row in 0..self.constraints.len() {
            // A predictive law reads the gap that the scheme constrains.
            extrapolate(row, if self.constraints.law(row).is_predictive() { rigid } else { rows.weight[row] });
        }
        self.constraints.tangents().all().for_each(|row| extrapolate(row, rows.weight[row]));
        Ok(())
    }

    /// Extrapolates the gaps of the balance from the last tried d to d.
    fn extrapolate_balance_gaps(&mut self) {
        let [_, balance_u, _] = self.weights();
        let ContactWork { rows, interface, .. } = &mut *self.contact;
        let forces = rows.curved.forces(self.g);
        for row in 0..self.constraints.len() {
            let change =
                forces.interface_product(row, &interface.increment) - forces.interface_product(row, &interface.tried);
            rows.laws.balance_gap[row] = rows.curved.gaps[row] + balance_u * change;
        }
    }

    /// Stores the gaps and slips that this linearization predicts at the resulting d.
    pub(crate) fn predict_gaps(&mut self, has_response: bool) {
        let [_, balance_u, _] = self.weights();
        let (constraints, g) = (&*self.constraints, &*self.g);
        let ContactWork { rows, interface, .. } = &mut *self.contact;
        let ContactRowsWork { y, weight, curved, .. } = rows;
        for row in (0..constraints.len()).chain(constraints.tangents().all()) {
            let compliant = !g.is_tangential(row) && constraints.law(row).is_compliant();
            let (start, weight) = if compliant { (curved.predicted[row], balance_u) } else { (y[row], weight[row]) };
            let change = match has_response {
                true => weight * curved.forces(g).interface_product(row, &interface.response),
                false => T::zero(),
            };
            curved.predicted[row] = start + change;
        }
    }

    /// Linearizes the rows at the resulting d: G where contact is imposed, F where the balance holds. Returns whether
    /// any row has changed.
    pub(crate) fn linearize_rows(&mut self) -> Result<Candidates> {
        if self.level().is_velocity() {
            return Ok(Candidates::Unchanged);
        }
        self.add_increment();
        let Self { stage, clock, constraints, g, new, vectors, contact, .. } = self;
        let version = constraints.version();
        let (t, balanced) = (clock.at(stage.load), vectors.balanced(stage, new));
        let ContactWork { rows, interface, .. } = &mut **contact;
        let curved = &mut rows.curved;
        let (compliant, apart) = (constraints.laws().compliant, stage.balance.is_some() || stage.contact.is_some());
        if apart {
            constraints.follow(t, &balanced.u, g)?;
            if compliant {
                constraints.finite_gaps(t, &balanced.u, &mut curved.gaps)?;
            }
            curved.apart = false;
            curved.hold(g, constraints);
        }
        let (at, values) = match &stage.contact {
            None => (new.t, &new.u),
            Some(target) => (clock.at(target.at), &rows.target.values),
        };
        constraints.follow(at, values, g)?;
        keep(constraints.interface(), values, &mut interface.linearized_at);
        if apart {
            curved.release(constraints);
        } else if compliant {
            constraints.finite_gaps(t, &new.u, &mut curved.gaps)?;
        }
        Ok(match constraints.version() == version {
            true => Candidates::Unchanged,
            false => Candidates::Changed,
        })
    }

    /// Compares gaps and forces of the rows linearized at d with the gaps and forces solved for. Leaves y of the rows
    /// at this d.
    pub(crate) fn measure_miss(&mut self) -> Result<Miss> {
        self.evaluate_rows()?;
        let ContactWork { rows, trial, interface, .. } = &mut *self.contact;
        let forces = rows.curved.forces(self.g);
        interface.response.fill(T::zero());
        let own = (0..self.constraints.len()).filter(|&row| rows.massless.contains(row));
        for row in own.chain(self.constraints.tangents().all()) {
            forces.interface_scatter(row, trial.lambda_raw[row], &mut interface.response);
        }
        let (mut worst, mut undone) = (((0, "the gap"), 0.0_f64), 0.0_f64);
        for row in (0..self.constraints.len()).filter(|&row| self.contact.rows.massless.contains(row)) {
            let [share, of_undone] = self.gap_miss(row);
            undone = undone.max(of_undone);
            if share > worst.1 {
                worst = ((row, "the gap"), share);
            }
        }
        for row in self.constraints.tangents().all() {
            let share = self.slip_miss(row);
            undone = undone.max(share);
            if share > worst.1 {
                worst = ((self.constraints.tangents().owner(row), "the slip"), share);
            }
        }
        let ContactWork { rows, interface, .. } = &mut *self.contact;
        let change = interface.response.iter().zip(&interface.forces).map(|(&new, &old)| (new - old).value().powi(2));
        let size = interface.forces.iter().map(|force| force.value().powi(2)).sum::<f64>();
        let force = if size > 0.0 { (change.sum::<f64>() / size).sqrt() } else { 0.0 };
        let miss = Miss { gap: worst.1, undone, force };
        rows.curved.worst = Worst::of(miss, worst.0);
        Ok(miss)
    }

    /// The difference between the gap of a row and the gap solved for, beyond its tolerance, relative to the change of
    /// the gap by d, and to the displacement that contact undoes if this is larger.
    fn gap_miss(&self, row: usize) -> [f64; 2] {
        let ContactWork { rows, trial, interface, .. } = &*self.contact;
        let (forces, law) = (rows.curved.forces(self.g), self.constraints.law(row));
        let weight = rows.weight[row].abs();
        let mut scale = weight * forces.interface_magnitude(row, &interface.increment);
        let (mut y, mut tolerance) = (rows.y[row], rows.tolerance[row]);
        if law.is_compliant() {
            y = rows.curved.gaps[row];
            tolerance = self.constraints.gap_rounding(row, self.g.magnitude(row, &self.new.u), y);
            scale = scale.max(y.abs());
        }
        // Rounding of the displacement undone by the force, which no other term contains at zero gap and coordinates.
        let undone = weight * forces.interface_magnitude(row, &interface.free);
        tolerance += rounding(undone);
        let miss = match trial.lambda_raw[row] > T::zero() || law.is_equality() {
            true => (y - rows.curved.predicted[row]).abs(),
            false if rows.state[row].is_enabled() => -y,
            false => T::zero(),
        };
        [scale, scale.max(undone)].map(|scale| share_beyond(miss, tolerance, scale))
    }

    /// The difference between a slip of a closed contact and the slip solved for, beyond its tolerance and relative to
    /// its change by d.
    fn slip_miss(&self, row: usize) -> f64 {
        let ContactWork { rows, trial, interface, .. } = &*self.contact;
        let (forces, owner, weight) =
            (rows.curved.forces(self.g), self.constraints.tangents().owner(row), rows.weight[row]);
        if trial.lambda_raw[owner] <= T::zero() || weight <= T::zero() {
            return 0.0;
        }
        // A contact under normal force alone slips only by the rounding of its normal.
        let along = |row: usize| forces.interface_magnitude(row, &interface.increment);
        let scale = (weight * (along(row) + along(owner))).max(rows.y[row].abs());
        // The slip of a sticking contact is the rounding of the displacement that friction has undone.
        let undone = rounding(weight * forces.interface_magnitude(row, &interface.free));
        let miss = (rows.y[row] - rows.curved.predicted[row]).abs() - undone;
        share_beyond(miss, rows.tolerance[row], scale)
    }
}

/// A miss beyond its tolerance, relative to a scale. Where d moves nothing, the tolerance is the only scale left.
fn share_beyond<T: Real>(miss: T, tolerance: T, scale: T) -> f64 {
    let beyond = miss - tolerance;
    if beyond > T::zero() { (beyond / (scale + T::of(ROUNDING_OF_ROWS) * tolerance)).value() } else { 0.0 }
}
