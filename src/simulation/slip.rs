//! What the tangential rows of contacts with friction constrain in a stage: the slip, as a length.
//!
//! Coulomb's law does not change when the slip is scaled by a positive number. It is taken from the velocity that the
//! stage ends with, scaled so that the unknown has the same weight as in the gap; W is symmetric then. Where velocities
//! do not contain the unknown, dofs have no mass, or corrections take contact forces out of the accelerations, it is
//! the way made in the stage. It is measured along the rows along which friction acts.

use super::contact_rows::{ContactRowsWork, Part};
use super::contact_step::{ContactStep, ContactWork};
use super::program::CompiledStage;
use crate::contact::{ContactJacobian, GapRates, Tangents};
use crate::corrector::rounding;
use crate::error::Result;
use crate::real::Real;
use crate::state::Motion;

/// What the slip of a stage is taken from.
#[derive(Clone, Copy, Debug)]
enum Source<T> {
    /// The velocity of the state, times this.
    Velocity(T),
    /// What contact constrains: h times a velocity.
    Target,
    /// The way from the state to where contact is imposed.
    WayAhead,
    /// The way from where the stage starts to its state.
    Way,
}

/// The source of a slip, and the weight of d in it.
fn source<T: Real>(stage: &CompiledStage<T>, by_way: bool) -> (Source<T>, T) {
    let [by_u, by_v, _] = stage.recovery.weights();
    match &stage.contact {
        Some(target) if target.forecast.is_some() => (Source::Target, target.row.weight),
        Some(target) => (Source::WayAhead, target.row.weight - by_u),
        None if by_v > T::zero() && !by_way => (Source::Velocity(by_u / by_v), by_u),
        None => (Source::Way, by_u),
    }
}

/// Whether the slip of a contact is that of dofs without mass. (Where these are solved for with the others, it is that
/// of a contact on such dofs.)
fn is_static<T: Real>(
    part: Part,
    (tangents, g): (&Tangents, &ContactJacobian<T>),
    massless: &[usize],
    row: usize,
) -> bool {
    match part {
        Part::All => tangents.act_on(g, row, massless),
        Part::Massless | Part::Massive => tangents.rub_on(g, row, massless),
    }
}

impl<T: Real> ContactStep<'_, '_, T> {
    /// Sets the weights of d in the slips: those of contacts that the problem is about.
    pub(super) fn weigh_slips(&self, rows: &mut ContactRowsWork<T>) {
        let tangents = self.constraints.tangents();
        for row in tangents.contacts() {
            let is_static = is_static(self.part, (tangents, &*self.g), &rows.massless, row);
            let (_, weight) = source(self.stage, rows.slides_by_way || is_static);
            // (Explicit schemes know the force of a spring, and its friction is solved for all the same.)
            let knows = self.constraints.laws()[row].is_compliant() && self.part.takes(&rows.on_massless, row);
            let rubs = match self.rubs_later(rows, row) {
                true => self.part == Part::Massive,
                false => rows.weight[row] > T::zero() || knows,
            };
            rows.weight[tangents.of(row)].fill(if rubs { weight } else { T::zero() });
            // (Candidates may have come and gone: these were other rows before.)
            rows.compliance[tangents.of(row)].fill(T::zero());
            rows.shift[tangents.of(row)].fill(T::zero());
        }
    }

    /// Whether the friction of a contact on dofs without mass acts on dofs with mass alone. In an explicit stage it is
    /// no part of the static balance, in which nothing would answer to it: it is found after that, when its normal
    /// force is known.
    fn rubs_later(&self, rows: &ContactRowsWork<T>, row: usize) -> bool {
        let tangents = (self.constraints.tangents(), &*self.g);
        self.part != Part::All && rows.on_massless[row] && !is_static(self.part, tangents, &rows.massless, row)
    }

    /// Evaluates y of the tangential rows at the d that was [placed](Self::place).
    pub(super) fn evaluate_slips(
        &mut self,
        new: &Motion<T>,
        past: &[Motion<T>],
        contact: &mut ContactWork<T>,
    ) -> Result<()> {
        let Self { stage, clock, constraints, g, iterate, part, .. } = self;
        if constraints.tangents().is_empty() {
            return Ok(());
        }
        let ContactWork { rows, interface, .. } = contact;
        let ContactRowsWork { y, tolerance, target, slips, curved, massless, slides_by_way, .. } = rows;
        let forces = curved.forces(g);
        if slips.len() < constraints.tangents().len() {
            slips.resize(constraints.tangents().len(), GapRates::default());
        }
        let target_time = stage.contact.as_ref().map(|target| clock.at(target.at));
        let h = T::of(clock.h);
        // The motion of the obstacle in the middle of the way.
        let t = match target_time {
            Some(t) if stage.contact.as_ref().is_some_and(|target| target.forecast.is_some()) => t,
            Some(t) => 0.5 * (t + new.t),
            None => new.t,
        };
        constraints.finite_slip_rates(t, &new.u, &new.v, slips)?;
        let tangents = constraints.tangents();
        for row in tangents.contacts() {
            let (source, weight) = source(stage, *slides_by_way || is_static(*part, (tangents, g), massless, row));
            for k in tangents.of(row) {
                let own = slips[k - tangents.all().start].rate;
                (y[k], tolerance[k]) = match source {
                    Source::Velocity(scale) => {
                        let slip = forces.product(k, &new.v) + own;
                        let size = forces.magnitude(k, &new.v) + own.abs();
                        // Velocities that are differences of displacements have the rounding of those.
                        let known = if stage.recovery.subtracts(1) { forces.magnitude(k, &new.u) } else { T::zero() };
                        let d = &interface.increment;
                        let added = weight * forces.interface_magnitude(k, d);
                        (scale * slip + weight * forces.interface_product(k, d), scale * size + known + added)
                    }
                    Source::Target => {
                        let size = forces.magnitude(k, target) + (h * own).abs();
                        (forces.product(k, target) + h * own, size)
                    }
                    Source::WayAhead | Source::Way => {
                        let ahead = stage.contact.as_ref();
                        let time = T::of(ahead.map_or(stage.end - stage.start, |target| target.at - stage.end)) * h;
                        let ends = match ahead {
                            Some(_) => [&new.u, &*target],
                            None => [past.first().map_or(&new.u, |start| &start.u), &new.u],
                        };
                        // From the terms of the scheme, which have not the rounding of displacements: what sticks must
                        // not creep by that. (Supports, and dofs that follow statically, are where they are.)
                        let (mut way, mut size) = (T::zero(), T::zero());
                        for (dof, weight) in forces.row(k) {
                            let free = constraints.place(dof).zip(stage.way.past_at(past, dof));
                            let part = if let Some((place, past)) = free {
                                let known = iterate.map_or(T::zero(), |d| d[dof]);
                                past + stage.way.weight * (known + interface.increment[place])
                            } else {
                                size += (weight * ends[1][dof]).abs();
                                ends[1][dof] - ends[0][dof]
                            };
                            way += weight * part;
                            size += (weight * part).abs();
                        }
                        let terms = (time * own).abs() + weight * forces.interface_magnitude(k, &interface.increment);
                        (way + time * own, size + terms)
                    }
                };
                tolerance[k] = rounding(tolerance[k]);
            }
        }
        Ok(())
    }
}
