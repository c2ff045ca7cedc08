//! The end of the contact of a stage: which contacts are closed, which have opened, and their forces and impulses.

use crate::contact::ContactLaw;
use crate::corrector::{Buffers, Gaps};
use crate::error::{Error, Result};
use crate::real::Real;
use crate::rounding::touching;
use crate::simulation::rows::contact_rows::Level;
use crate::simulation::rows::contact_rows::RowState;
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::ContactWork;

/// The position of a stage in its step, for the impulses of its contacts.
pub(crate) struct Booking {
    /// Impulse of a unit multiplier over a step, divided by h.
    pub(crate) impulse_weight: f64,
    /// Whether the stage is the first of its step, or the last.
    pub(crate) is_first: bool,
    pub(crate) is_last: bool,
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Decides which contacts are closed, and sets the reported force and impulse of each before corrections.
    pub(crate) fn close(&mut self, booking: &Booking, buffers: &mut Buffers<T>) -> Result<()> {
        self.evaluate_end(booking)?;
        let Self { clock, constraints, g, contact, .. } = self;
        let ContactWork { trial, impulses, rows, was_closed, was_sticking, closed_at_start, .. } = &mut **contact;
        let massless = &rows.massless.dofs;
        let impulse_weight = T::of(clock.h * booking.impulse_weight);
        was_closed.clear();
        was_closed.extend_from_slice(&trial.closed);
        was_sticking.clear();
        was_sticking.extend(trial.sliding.iter().zip(&trial.closed).map(|(&slides, &closed)| closed && !slides));
        buffers.rows.closed.clear();
        buffers.rows.opened.clear();
        buffers.rows.released.clear();
        trial.lambda.copy_from_slice(&trial.lambda_raw);
        trial.lambda_v.fill(T::zero());
        trial.lambda_a.fill(T::zero());
        if booking.is_first {
            trial.impulse.fill(T::zero());
        }
        for (row, &was_closed) in was_closed.iter().enumerate() {
            let raw = trial.lambda_raw[row];
            let law = constraints.law(row);
            let closed = rows.is_closed(row, &law, raw);
            trial.closed[row] = closed;
            // Compliant contacts, and contacts on dofs without mass, leave no jump to correct. Impulses do not reach
            // such dofs: friction there would be taken from one side only.
            let is_static = !massless.is_empty() && g.acts_on(row, massless);
            let has_mass = !is_static && !constraints.tangents().act_on(g, row, massless);
            if law.rebounds() && is_static {
                return Err(Error::Incompatible {
                    part: format!("{law:?} of contact {} on dofs without mass", constraints.ids[row]),
                    reason: "such dofs stop and start at once; choose `ContactLaw::Rigid`, or give them a mass",
                });
            }
            if !law.is_compliant() && has_mass {
                match (closed, was_closed) {
                    (true, _) => buffers.rows.closed.push(row),
                    (false, true) => buffers.rows.opened.push(row),
                    (false, false) => {}
                }
                if booking.is_last && !closed && (was_closed || closed_at_start[row]) {
                    buffers.rows.released.push(row);
                }
            }
            let is_balanced = law == ContactLaw::Rigid && buffers.switching.is_on() && is_static;
            if is_balanced {
                buffers.switching.record(row, trial);
            }
            // A contact on dofs without mass may return dissipated energy when it opens, or closes again.
            if closed && !was_closed && !closed_at_start[row] && !is_balanced {
                trial.dissipated[row] = T::zero();
            }
            if raw != T::zero() {
                trial.impulse[row] += impulse_weight * raw;
            }
        }
        for row in constraints.tangents().all() {
            trial.impulse[row] += impulse_weight * trial.lambda_raw[row];
        }
        impulses.note(trial);
        self.store_slips()
    }

    /// Evaluates gaps and slips at the end of the stage, with the rows linearized there, and books the impulses.
    fn evaluate_end(&mut self, booking: &Booking) -> Result<()> {
        let Self { stage, clock, constraints, g, new, contact, .. } = self;
        let ContactWork { trial, impulses, rows, .. } = &mut **contact;
        let level = Level { target: stage.contact.as_ref(), clock: *clock };
        rows.evaluate(&level, constraints, g, new, true)?;
        if level.target.is_none() {
            trial.gap.copy_from_slice(&rows.y[..constraints.len()]);
        } else {
            // The reported gaps are evaluated at the displacements of the state.
            rows.curved.hold(g, constraints);
            constraints.follow(new.t, &new.u, g)?;
            rows.curved.release(constraints);
            constraints.finite_gaps(new.t, &new.u, &mut trial.gap)?;
        }
        impulses.push(rows.curved.forces(g), &trial.lambda_raw, T::of(clock.h * booking.impulse_weight));
        if rows.curved.apart {
            // Turns multipliers from the rows of the balance to the rows of the state, which are used from here on.
            let tangents = constraints.tangents();
            tangents.turn([&rows.curved.rows, g], &mut trial.lambda_raw[tangents.all()]);
        }
        rows.measure(stage, clock.h, constraints, g, new, None)?;
        if !rows.massless.is_whole() && level.target.is_some() {
            // Rows on dofs without mass constrain the gaps of the state.
            for row in (0..constraints.len()).filter(|&row| rows.massless.acts[row]) {
                let rate = g.product(row, &new.v) + rows.rates[row].rate;
                let rounded = constraints.gap_rounding(row, g.magnitude(row, &new.u), trial.gap[row]);
                (rows.y[row], rows.state[row]) = (trial.gap[row], RowState::Open);
                rows.tolerance[row] = rounded + touching(T::of(clock.h) * rate.abs());
            }
        }
        Ok(())
    }
}
