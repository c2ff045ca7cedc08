//! A solved stage on the tape of a recorded run.

use crate::contact::{ContactLaw, GapRates};
use crate::corrector::Gaps;
use crate::error::Result;
use crate::real::Real;
use crate::rounding::half_digits;
use crate::simulation::rows::slip::{Source, source};
use crate::simulation::stage::StageSolve;
use crate::state::{Compliance, Held, Motion, NoDerivative, Rule, StageRecord, Tape};
use std::sync::Arc;

impl<T: Real> StageSolve<'_, '_, T> {
    /// Records a solved stage before corrections; its solution is d, or the increment. `impulse` is the impulse of a unit
    /// multiplier.
    pub(super) fn record(&mut self, tape: &mut Tape<T>, d: Option<&[T]>, impulse: T) -> Result<()> {
        let balance = self.balance(d.unwrap_or(&self.vectors.increment));
        let mut readings = Vec::new();
        let (mut held, mut refused) = (Vec::new(), None);
        let mut refuse = |what, reason| {
            refused.get_or_insert(NoDerivative { what, reason });
        };
        for row in 0..self.constraints.len() {
            let (law, force) = (self.constraints.law(row), self.contact.trial.lambda_raw[row]);
            if force == T::zero() && !law.is_equality() {
                continue;
            }
            let compliance = match law {
                ContactLaw::Rigid | ContactLaw::Equality => None,
                ContactLaw::Penalty { .. }
                | ContactLaw::PowerLaw { .. }
                | ContactLaw::KelvinVoigt { .. }
                | ContactLaw::HuntCrossley { .. } => {
                    if readings.is_empty() {
                        readings = self.readings(&balance)?;
                    }
                    let (gap, rate) = readings[row];
                    Some(compliance(law, [gap, rate + self.g.product(row, &balance.v)], force))
                }
                _ => {
                    refuse("this contact law", "its derivative is not implemented");
                    continue;
                }
            };
            if compliance.is_some_and(|known: Compliance<T>| known.lag != T::zero()) && !self.constraints.is_affine() {
                refuse("damped contact along rows that turn", "its derivative is not implemented");
            }
            let id = self.constraints.ids[row];
            let (normal, rule) = (held.len(), Rule::Closed);
            held.push(Held { row, id, rule, force, is_slip: false, compliance });
            let (tangents, raw) = (self.constraints.tangents(), &self.contact.trial.lambda_raw);
            let (own, bound) = (tangents.of(row), T::of(tangents.friction(row)) * force);
            let rules = Rule::of_friction(normal, force, &raw[own.clone()], (bound, self.slip(row)));
            for (row, rule) in own.zip(rules) {
                held.push(Held { row, id, rule, force: raw[row], is_slip: true, compliance: None });
            }
        }
        if held.iter().any(|held: &Held<T>| self.constraints.offsets.keeps(held.row)) {
            refuse("penetration that is not recovered in one step", "its derivative is not implemented");
        }
        let rows = tape.rows(self.g, self.constraints.version());
        let curved = &self.contact.rows.curved;
        let forces = if curved.apart { Arc::new(curved.forces(self.g).clone()) } else { Arc::clone(&rows) };
        if !self.constraints.is_affine() && held.iter().any(|held: &Held<T>| held.is_slip) {
            refuse("friction along rows that turn", "its derivative is not implemented");
        }
        let stage = StageRecord { balance, rows, forces, held, impulse, changes: Vec::new(), solved: None };
        tape.push(stage, refused);
        Ok(())
    }

    /// The length of the slip of a contact as the conditions of the stage measure it.
    fn slip(&self, row: usize) -> T {
        let Self { stage, clock, constraints, contact, .. } = self;
        let (tangents, h) = (constraints.tangents(), T::of(clock.h));
        let first = tangents.all().start;
        let slip = tangents.of(row).fold(T::zero(), |size, k| size.hypot(contact.trial.slip[k - first]));
        slip * match (source(stage, false).0, &stage.contact) {
            (Source::Velocity(scale), _) => scale,
            (Source::WayAhead, Some(ahead)) => T::of(ahead.at - stage.end) * h,
            (Source::Target | Source::WayAhead | Source::Way, _) => h,
        }
    }

    /// Gap of each row, and the part of its rate that does not come from velocities, where the balance holds.
    fn readings(&mut self, balance: &Motion<T>) -> Result<Vec<(T, T)>> {
        let rows = self.constraints.len();
        let (mut gaps, mut rates) = (vec![T::zero(); rows], vec![GapRates::default(); rows]);
        self.constraints.finite_gaps(balance.t, &balance.u, &mut gaps)?;
        self.constraints.finite_rates(balance.t, &balance.u, &balance.v, &mut rates)?;
        Ok(gaps.into_iter().zip(rates.into_iter().map(|rates| rates.rate)).collect())
    }

    /// The motion at which the balance of the stage holds.
    fn balance(&self, d: &[T]) -> Motion<T> {
        let Self { stage, clock, new, past, vectors, .. } = self;
        let rows = stage.balanced();
        let mut motion = Motion::zero(d.len());
        motion.t = clock.at(stage.load);
        rows.predict(past, &mut [&mut motion.u, &mut motion.v, &mut motion.a]);
        for (field, weight) in rows.weights().into_iter().enumerate() {
            T::axpy(weight, d, motion.field_mut(field));
        }
        let (solved, supports) = (vectors.balanced(stage, new), &vectors.supports);
        let given = if stage.balance.is_some() { &supports.balance } else { &supports.state };
        for (&dof, support) in supports.dofs.iter().zip(given) {
            (motion.u[dof], motion.v[dof], motion.a[dof]) = (solved.u[dof], solved.v[dof], support[2]);
        }
        motion
    }
}

/// A compliant law linearized at the force of a row with this gap and rate.
fn compliance<T: Real>(law: ContactLaw, [gap, rate]: [T; 2], force: T) -> Compliance<T> {
    let known = Compliance { by_force: T::zero(), lag: T::zero(), law, gap, rate };
    // A dashpot that begins to press bears a part of its force at a gap of zero: it is rigid then.
    let begins = (law.force(gap, -rate) - force).abs() > half_digits::<T>().sqrt() * force;
    if begins && matches!(law, ContactLaw::KelvinVoigt { .. }) {
        return known;
    }
    let [by_depth, by_rate] = law.slopes(force.value(), -gap.value()).map(T::of);
    Compliance { by_force: by_depth.recip(), lag: by_rate / by_depth, ..known }
}
