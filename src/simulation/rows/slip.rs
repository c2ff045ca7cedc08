//! The quantity that tangential rows of contacts with friction constrain in a stage: the slip, as a length.
//!
//! Coulomb's law does not change when the slip is scaled by a positive number. The slip is computed from the velocity
//! at the end of the stage, scaled so that the unknown has the same weight as in the gap; W is symmetric then. It is
//! the displacement in the stage instead where velocities do not contain the unknown, dofs have no mass, or
//! corrections remove contact forces from the accelerations. It is measured along the rows along which friction acts.

use crate::contact::{ContactJacobian, GapRates};
use crate::corrector::slides;
use crate::error::Result;
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::build::program::{CompiledStage, ContactTarget};
use crate::simulation::rows::constraints::Constraints;
use crate::simulation::rows::contact_rows::{ContactRowsWork, Slips};
use crate::simulation::stage::StageSolve;
use crate::simulation::stage::contact::ContactWork;
use crate::state::{Clock, Motion};

/// The source of the slip of a stage.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Source<T> {
    /// The velocity of the state, times this factor.
    Velocity(T),
    /// The target of contact: h times a velocity.
    Target,
    /// The displacement from the state to where contact is imposed.
    WayAhead,
    /// The displacement from the start of the stage to its state.
    Way,
}

/// The source of a slip, and the weight of d in it.
pub(crate) fn source<T: Real>(stage: &CompiledStage<T>, by_displacement: bool) -> (Source<T>, T) {
    let [by_u, by_v, _] = stage.recovery.weights();
    match &stage.contact {
        Some(target) if target.forecast.is_some() => (Source::Target, target.row.weight),
        Some(target) => (Source::WayAhead, target.row.weight - by_u),
        None if by_v > T::zero() && !by_displacement => (Source::Velocity(by_u / by_v), by_u),
        None => (Source::Way, by_u),
    }
}

/// The time at which the slip reads the velocity of an obstacle: the time t of the state, the time of the target, or
/// the middle between both.
fn time_of_slip<T: Real>(stage: &CompiledStage<T>, clock: Clock, t: f64) -> f64 {
    match &stage.contact {
        None => t,
        Some(target) if target.forecast.is_some() => clock.at(target.at),
        Some(target) => 0.5 * (clock.at(target.at) + t),
    }
}

impl<T: Real> StageSolve<'_, '_, T> {
    /// Sets the weights of d in the slips of the contacts in the problem.
    pub(crate) fn set_slip_weights(&mut self) {
        let tangents = self.constraints.tangents();
        let rows = &mut self.contact.rows;
        for row in tangents.contacts() {
            let is_static = rows.massless.has_static_slip(tangents, self.g, row);
            let (_, weight) = source(self.stage, rows.slips.by_displacement || is_static);
            // Explicit schemes know the force of a spring, but its friction is unknown.
            let is_known = self.constraints.laws()[row].is_compliant() && rows.massless.contains(row);
            let has_normal_force = rows.weight[row] > T::zero() || is_known;
            let solved = rows.massless.solves_friction(tangents, self.g, row, has_normal_force);
            rows.weight[tangents.of(row)].fill(if solved { weight } else { T::zero() });
            // After a change of candidates these indices belong to other rows.
            rows.laws.compliance[tangents.of(row)].fill(T::zero());
            rows.laws.shift[tangents.of(row)].fill(T::zero());
        }
    }

    /// Evaluates y of the tangential rows at the d that was [added](Self::add_increment).
    pub(crate) fn evaluate_slips(&mut self) -> Result<()> {
        let Self { stage, clock, constraints, g, new, past, vectors, contact, .. } = self;
        if constraints.tangents().is_empty() {
            return Ok(());
        }
        let (ContactWork { rows, interface, .. }, iterate) = (&mut **contact, vectors.iterate());
        let ContactRowsWork { y, tolerance, target, slips, curved, massless, .. } = rows;
        let (forces, target) = (curved.forces(g), &target.values);
        if slips.rates.len() < constraints.tangents().len() {
            slips.rates.resize(constraints.tangents().len(), GapRates::default());
        }
        let h = T::of(clock.h);
        constraints.finite_slip_rates(time_of_slip(stage, *clock, new.t), &new.u, &new.v, &mut slips.rates)?;
        let tangents = constraints.tangents();
        for row in tangents.contacts() {
            let (source, weight) = source(stage, slips.by_displacement || massless.has_static_slip(tangents, g, row));
            // Directions are rounded: a motion along the normal contributes rounding to the slip.
            for k in tangents.of(row) {
                let own = slips.rates[k - tangents.all().start].rate;
                (y[k], tolerance[k]) = match source {
                    Source::Velocity(scale) => {
                        let slip = forces.product(k, &new.v) + own;
                        let size = forces.magnitude(k, &new.v) + forces.magnitude(row, &new.v) + own.abs();
                        // Velocities computed as differences of displacements have the rounding of the displacements.
                        let known = if stage.recovery.subtracts(1) { forces.magnitude(k, &new.u) } else { T::zero() };
                        let d = &interface.increment;
                        let added = weight * forces.interface_magnitude(k, d);
                        (scale * slip + weight * forces.interface_product(k, d), scale * size + known + added)
                    }
                    Source::Target => {
                        let size = forces.magnitude(k, target) + forces.magnitude(row, target) + (h * own).abs();
                        (forces.product(k, target) + h * own, size)
                    }
                    Source::WayAhead | Source::Way => {
                        let ahead = stage.contact.as_ref();
                        let time = T::of(ahead.map_or(stage.end - stage.start, |target| target.at - stage.end)) * h;
                        let ends = match ahead {
                            Some(_) => [&new.u, target],
                            None => [past.first().map_or(&new.u, |start| &start.u), &new.u],
                        };
                        // The terms of the scheme do not have the rounding of displacements, which would make
                        // sticking contacts creep. Supports and dofs in static balance use their displacements.
                        let part = |dof: usize| {
                            let free = constraints.place(dof).zip(stage.way.past_at(past, dof));
                            let Some((place, past)) = free else {
                                return (ends[1][dof] - ends[0][dof], ends[1][dof].abs());
                            };
                            let known = iterate.map_or(T::zero(), |d| d[dof]);
                            (past + stage.way.weight * (known + interface.increment[place]), T::zero())
                        };
                        let (mut way, mut size) = (T::zero(), T::zero());
                        for (dof, weight) in forces.row(k) {
                            let (part, known) = part(dof);
                            way += weight * part;
                            size += weight.abs() * (known + part.abs());
                        }
                        size += forces.row(row).map(|(dof, weight)| (weight * part(dof).0).abs()).sum::<T>();
                        let terms = (time * own).abs() + weight * forces.interface_magnitude(k, &interface.increment);
                        (way + time * own, size + terms)
                    }
                };
                tolerance[k] = rounding(tolerance[k]);
            }
        }
        Ok(())
    }

    /// Stores which contacts slide in a finished stage, and the slips (length/time) that decide it. These are mean
    /// slips where contact is imposed ahead of the state, and for dofs without mass.
    pub(crate) fn store_slips(&mut self) -> Result<()> {
        let Self { stage, clock, constraints, g, new, past, contact, .. } = self;
        let ContactWork { trial, rows, .. } = &mut **contact;
        let ContactRowsWork { slips: Slips { rates: slips, .. }, curved, target, massless, .. } = rows;
        if constraints.tangents().is_empty() {
            return Ok(());
        }
        slips.resize(slips.len().max(constraints.tangents().len()), GapRates::default());
        constraints.finite_slip_rates(time_of_slip(stage, *clock, new.t), &new.u, &new.v, slips)?;
        let (forces, tangents) = (curved.forces(g), constraints.tangents());
        let (h, first) = (T::of(clock.h), tangents.all().start);
        for row in tangents.contacts() {
            // Ends of the displacement, and its time; a target at velocity level is h times a velocity.
            let start = past.first().filter(|_| massless.has_static_slip(tangents, g, row));
            let (ends, time) = match (start, &stage.contact) {
                (Some(start), _) => ([Some(&start.u), Some(&new.u)], T::of(stage.end - stage.start) * h),
                (None, None) => ([None, None], T::one()),
                (None, Some(ahead)) if ahead.forecast.is_some() => ([None, Some(&target.values)], h),
                (None, Some(ahead)) => ([Some(&new.u), Some(&target.values)], T::of(ahead.at - stage.end) * h),
            };
            let (mut length, mut noise) = (T::zero(), T::zero());
            for k in tangents.of(row) {
                let at = |end: Option<&Vec<T>>, dof: usize| end.map_or(T::zero(), |end| end[dof]);
                let way = |(dof, weight): (usize, T)| weight * (at(ends[1], dof) - at(ends[0], dof));
                // A velocity of zero has the rounding of the terms it is the sum of.
                let (slip, size) = if let [None, None] = ends {
                    (forces.product(k, &new.v), forces.magnitude(k, &new.v) + h * forces.magnitude(k, &new.a))
                } else {
                    let size = ends.into_iter().flatten().map(|end| forces.magnitude(k, end)).sum::<T>();
                    (forces.row(k).map(way).sum::<T>() / time, size / time)
                };
                let own = slips[k - first].rate;
                trial.slip[k - first] = slip + own;
                (length, noise) = (length.hypot(slip + own), noise.max(rounding(size + own.abs())));
            }
            let bound = T::of(tangents.friction(row)) * trial.lambda_raw[row];
            trial.sliding[row] = slides(trial.tangential(row, &trial.lambda_raw), bound) && length > noise;
        }
        tangents.turn([forces, &**g], &mut trial.slip);
        Ok(())
    }
}

/// Stores the slips of the velocities of a state after corrections. In a stage that imposes contact `ahead` of its
/// state, and for dofs without mass, slips are means over a displacement. These means stay where a contact stops
/// sliding or reverses, as its friction belongs to them.
pub(crate) fn store_slips_of_state<T: Real>(
    (constraints, g): (&mut Constraints<'_, T>, &ContactJacobian<T>),
    new: &Motion<T>,
    ahead: Option<&ContactTarget<T>>,
    contact: &mut ContactWork<T>,
) -> Result<()> {
    if constraints.tangents().is_empty() {
        return Ok(());
    }
    let ContactWork { trial, rows, .. } = contact;
    let ContactRowsWork { slips: Slips { rates: slips, .. }, massless, .. } = rows;
    constraints.finite_slip_rates(new.t, &new.u, &new.v, slips)?;
    let tangents = constraints.tangents();
    let first = tangents.all().start;
    for row in tangents.contacts() {
        let slip = |k: usize| g.product(k, &new.v) + slips[k - first].rate;
        let along = tangents.of(row).map(|k| trial.lambda[k] * slip(k)).sum::<T>();
        let is_mean = ahead.is_some() || tangents.act_on(g, row, &massless.dofs);
        if !is_mean || trial.sliding[row] && along <= T::zero() {
            tangents.of(row).for_each(|k| trial.slip[k - first] = slip(k));
        }
    }
    Ok(())
}
