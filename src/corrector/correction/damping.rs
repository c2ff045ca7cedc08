//! Damping: the effect of velocity corrections on the accelerations, and the limit of forces that a step does not
//! resolve.

use super::{Bodies, Correction};
use crate::corrector::buffers::Damping;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::system::Linearity;

impl<T: Real> Correction<'_, T> {
    /// Adds to a the effect of the damping forces after a change of v.
    pub(in crate::corrector) fn damp_change(&mut self, change: &[T]) -> Result<()> {
        if !self.buffers.spreads() {
            return Ok(());
        }
        self.buffers.damping.change.copy_from_slice(change);
        self.damp()
    }

    /// [`damp_change`](Self::damp_change) with the change already in its buffer, which is overwritten.
    pub(super) fn damp(&mut self) -> Result<()> {
        if self.evaluate_damping()? { self.accelerate_by_damping() } else { Ok(()) }
    }

    /// Evaluates the change of the damping forces caused by the velocity change in `change`, into `force`. Returns
    /// whether there is damping.
    fn evaluate_damping(&mut self) -> Result<bool> {
        let Self { buffers, new, bodies, .. } = self;
        let Damping { change, force, before, .. } = &mut buffers.damping;
        let linearity = bodies.system.0.linearity();
        let Some(law) = bodies.system.0.damping_force() else { return Ok(false) };
        match linearity {
            Linearity::Linear => law.evaluate(&new.u, change, force)?,
            // Forces that are nonlinear in v are evaluated twice.
            Linearity::Nonlinear => {
                law.evaluate(&new.u, &new.v, force)?;
                for (change, &v) in change.iter_mut().zip(&new.v) {
                    *change = v - *change;
                }
                law.evaluate(&new.u, change, before)?;
                T::axpy(-T::one(), before, force);
            }
        }
        Ok(true)
    }

    /// Adds to a the effect of the change of the damping force.
    fn accelerate_by_damping(&mut self) -> Result<()> {
        let Self { buffers, projection, new, scheme, bodies: Bodies { operator, massless, prescribed, .. }, .. } = self;
        let Damping { force: change, on_massless, .. } = &mut buffers.damping;
        // The choice must not depend on the change itself: it may reach massless dofs by rounding only.
        if !*on_massless && (scheme.keeps_balance || !scheme.reads_acceleration) {
            projection.apply_inverse(change)?;
            T::axpy(-T::one(), change, &mut new.a);
            return Ok(());
        }
        // Dofs without mass respond too, so that internal damping conserves momentum, but they have no acceleration.
        for &dof in *prescribed {
            change[dof] = T::zero();
        }
        operator.solve(change)?;
        for &dof in *massless {
            change[dof] = T::zero();
        }
        T::axpy(-T::of(scheme.balance / (scheme.h * scheme.h)), change, &mut new.a);
        Ok(())
    }

    /// Reduces the forces that remove acceleration jumps if the step does not resolve the damping. The part that
    /// cancels `given` times the raw multipliers is kept.
    ///
    /// All groups of rows that S couples are tested together. Groups that pass are set aside and the others are
    /// tested again without them, so that damping that the step resolves reduces no force, whichever groups it
    /// couples.
    pub(super) fn limit_forces(&mut self, rows: &[usize], forces: &mut [T], given: T) -> Result<()> {
        if !self.buffers.spreads() || !self.scheme.reads_acceleration {
            return Ok(());
        }
        let Self { buffers, contacts, .. } = self;
        let limited = &mut buffers.damping.limited;
        limited.clear();
        limited.extend(rows.iter().zip(&*forces).map(|(&row, &force)| {
            let raw = given * contacts.lambda_raw[row];
            force + if force < T::zero() { raw.max(T::zero()).min(-force) } else { raw.min(T::zero()).max(-force) }
        }));
        // Change of velocity per change of acceleration in a step.
        let [_, by_v, by_a] = self.scheme.response;
        let time = T::of(self.scheme.h * by_v / by_a);
        while self.buffers.damping.limited.iter().any(|&force| force != T::zero()) {
            let Self { buffers, projection, g, .. } = self;
            let Damping { change, limited, moved, .. } = &mut buffers.damping;
            change.fill(T::zero());
            projection.push(g, (rows, limited), time, change)?;
            moved.clear();
            moved.extend(rows.iter().map(|&row| g.product(row, change) / time));
            if !self.evaluate_damping()? {
                return Ok(());
            }
            if !self.set_aside_resolved(rows)? {
                let Damping { limited, moved: part, .. } = &self.buffers.damping;
                for ((force, &limited), &part) in forces.iter_mut().zip(limited).zip(part) {
                    *force -= (T::one() - part * part) * limited;
                }
                self.refuse_gradient(
                    "damping in corrected contacts",
                    "a step does not resolve it: choose smaller steps",
                );
                return Ok(());
            }
        }
        Ok(())
    }

    /// Sets the forces of the groups whose inertia is at least the resistance of their damping to zero, and returns
    /// whether there are any. For the other groups, the accelerations of their rows are replaced by the ratio of
    /// inertia to resistance.
    fn set_aside_resolved(&mut self, rows: &[usize]) -> Result<bool> {
        let Self { buffers, projection, g, new, scheme, .. } = self;
        let Damping { force, limited, moved, .. } = &mut buffers.damping;
        projection.apply_inverse(force)?;
        let mut found = false;
        // The groups belong to the problem that gave the forces.
        let groups = projection.groups();
        for group in (0..groups.len()).map(|group| groups.group(group)) {
            let largest = group.iter().fold(T::zero(), |largest, &position| limited[position].abs().max(largest));
            if largest == T::zero() {
                for &position in group {
                    moved[position] = T::one();
                }
                continue;
            }
            let [mut inertia, mut resistance] = [T::zero(); 2];
            for &position in group {
                let resisted = g.product(rows[position], force);
                if !resisted.is_finite() {
                    let (what, dof) = ("the damping force", g.row(rows[position]).next().map_or(0, |(dof, _)| dof));
                    return Err(Error::StepNotFinite {
                        t: new.t - scheme.h,
                        h: scheme.h,
                        what,
                        dof,
                        value: resisted.value(),
                    });
                }
                inertia += limited[position] / largest * moved[position];
                resistance += limited[position] / largest * resisted;
            }
            let is_resolved = resistance <= inertia;
            found |= is_resolved;
            for &position in group {
                if is_resolved {
                    limited[position] = T::zero();
                }
                moved[position] = inertia.max(T::zero()) / resistance;
            }
        }
        Ok(found)
    }
}
