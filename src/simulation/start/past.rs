//! Past states of a multistep scheme, computed from the motion at the start: a straight line, or Taylor's expansion.

use crate::error::Result;
use crate::real::Real;
use crate::rounding::{half_digits, rounding};
use crate::simulation::start::Start;
use crate::sparse::scattered_signed;
use crate::state::Motion;
use crate::tableau::StartUp;

/// u + τ v + ½ τ² a, v + τ a, a.
pub(crate) fn taylor<T: Real>(motion: &Motion<T>, tau: f64, out: &mut Motion<T>) {
    out.t = motion.t + tau;
    out.u.copy_from_slice(&motion.u);
    T::axpy(T::of(tau), &motion.v, &mut out.u);
    T::axpy(T::of(0.5 * tau * tau), &motion.a, &mut out.u);
    out.v.copy_from_slice(&motion.v);
    T::axpy(T::of(tau), &motion.a, &mut out.v);
    out.a.copy_from_slice(&motion.a);
}

impl<T: Real> Start<'_, '_, T> {
    /// Fills the past states with the straight line u − k h v, v, 0, which is exact in free flight, or else with
    /// Taylor's expansion if it is chosen. Returns whether the past is known.
    pub(super) fn fill_past(&mut self, motion: &Motion<T>, past: &mut [Motion<T>]) -> Result<bool> {
        let h = self.h;
        let fill = |motion: &Motion<T>, past: &mut [Motion<T>]| {
            for (k, out) in (1_u32..).zip(past) {
                taylor(motion, -f64::from(k) * h, out);
            }
        };
        let straight = Motion { a: vec![T::zero(); motion.a.len()], ..motion.clone() };
        fill(&straight, past);
        let expands = self.scheme.start_up == StartUp::Taylor;
        if past.is_empty() || self.is_free_flight(motion, past)? {
            return Ok(true);
        }
        if expands {
            fill(motion, past);
        }
        Ok(expands)
    }

    /// Whether the straight line through the start is the past motion of the system: the accelerations at the start
    /// and at the past states do not change a velocity beyond rounding within a step.
    fn is_free_flight(&mut self, motion: &Motion<T>, past: &[Motion<T>]) -> Result<bool> {
        let rounding = rounding(T::one()).value();
        let speed = self.largest(&motion.v)?;
        let (mut at, mut accelerations) = (motion, Some(motion.a.clone()));
        let mut past = past.iter();
        while let Some(a) = accelerations {
            let change = self.h * self.largest(&a)?;
            // The rounding of forces that cancel matters only where there are such forces.
            if change > rounding * speed {
                let sensitivity = self.sensitivity(at)?;
                if !sensitivity.is_some_and(|most| change <= rounding * (speed + self.h * most)) {
                    return Ok(false);
                }
            }
            let Some(motion) = past.next() else { return Ok(true) };
            at = motion;
            accelerations = self.smooth_acceleration(at.t, &at.u, &at.v)?;
        }
        Ok(false)
    }

    /// The largest magnitude of an entry of a vector, infinite if an entry is not finite.
    fn largest(&self, x: &[T]) -> Result<f64> {
        let own = if T::all_finite(x) { T::largest(x) } else { T::infinity() };
        self.together.max(Ok([own.value()])).map(|[largest]| largest)
    }

    /// The accelerations of free dofs without contact. None where the host does not admit the state.
    fn smooth_acceleration(&mut self, t: f64, u: &[T], v: &[T]) -> Result<Option<Vec<T>>> {
        let mut a = vec![T::zero(); u.len()];
        match self.system.force(t, u, v, &mut a) {
            Err(error) if error.is_recoverable() => {
                self.together.caught();
                Ok(None)
            }
            other => {
                other?;
                self.projection.apply_inverse(&mut a)?;
                Ok(Some(a))
            }
        }
    }

    /// The change of accelerations by changes of displacements and velocities of their own magnitude and with
    /// scattered signs. ε times this is the rounding of accelerations where forces cancel, as for stiff springs in
    /// rigid motions. None where the host does not admit the state.
    fn sensitivity(&mut self, motion: &Motion<T>) -> Result<Option<f64>> {
        let share = half_digits::<T>();
        let mut moved = [motion.u.clone(), motion.v.clone()];
        for values in &mut moved {
            let size = share * T::of(self.largest(values)?);
            values.iter_mut().enumerate().for_each(|(dof, x)| *x += size * T::of(scattered_signed(dof)));
            self.together.share(values)?;
        }
        let there = self.smooth_acceleration(motion.t, &moved[0], &moved[1])?;
        let here = self.smooth_acceleration(motion.t, &motion.u, &motion.v)?;
        let Some((mut there, here)) = there.zip(here) else { return Ok(None) };
        there.iter_mut().zip(&here).for_each(|(there, &here)| *there -= here);
        let most = self.largest(&there)? / share.value();
        Ok(most.is_finite().then_some(most))
    }
}
