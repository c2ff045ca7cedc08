//! A solved stage on the tape of a recorded run.

use crate::contact::ContactLaw;
use crate::corrector::Gaps;
use crate::real::Real;
use crate::simulation::stage::StageSolve;
use crate::state::{Held, Motion, StageRecord, Tape};

impl<T: Real> StageSolve<'_, '_, T> {
    /// Records the solution d of the stage, before corrections. `impulse` is the impulse of a unit multiplier.
    pub(super) fn record(&self, tape: &mut Tape<T>, d: &[T], impulse: T) {
        let mut held = Vec::new();
        for (row, &force) in self.contact.trial.lambda_raw.iter().enumerate().take(self.constraints.len()) {
            let law = self.constraints.law(row);
            if force == T::zero() && !law.is_equality() {
                continue;
            }
            match compliance(&law, force) {
                Some(compliance) => held.push(Held { row, id: self.constraints.ids[row], compliance }),
                None => tape.refuse(
                    "contact under a law other than `Rigid`, `Equality`, `Penalty` and `PowerLaw`",
                    "its derivative is not implemented",
                ),
            }
        }
        let rows = tape.rows(self.g, self.constraints.version());
        let balance = self.balance(d);
        tape.stages.push(StageRecord { balance, rows, held, impulse, changes: Vec::new() });
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

/// The change of the gap per change of the force of a law; none inside for a rigid law, none at all for a law without
/// derivative.
fn compliance<T: Real>(law: &ContactLaw, force: T) -> Option<Option<T>> {
    match *law {
        ContactLaw::Rigid | ContactLaw::Equality => Some(None),
        ContactLaw::Penalty { stiffness } => Some(Some(T::of(stiffness).recip())),
        ContactLaw::PowerLaw { stiffness, exponent } => {
            let depth = (force / T::of(stiffness)).powf(T::of(exponent.recip()));
            Some(Some(depth / (T::of(exponent) * force)))
        }
        _ => None,
    }
}
