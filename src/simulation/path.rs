//! The force of a path: the one whose internal work over a step is the change of the potential.

use crate::error::Result;
use crate::real::Real;
use crate::system::{Damping, Path, PathForce, System};

/// Memory for forces along paths.
#[derive(Debug)]
pub(super) struct PathWork<T> {
    /// The potential where the step starts.
    start: Option<T>,
    load: Vec<T>,
    scratch: Vec<T>,
}

impl<T: Real> PathWork<T> {
    pub(super) fn new(dofs: usize) -> Self {
        Self { start: None, load: vec![T::zero(); dofs], scratch: vec![T::zero(); dofs] }
    }

    /// Begins a stage that starts at `from`.
    pub(super) fn begin(&mut self, system: &mut dyn System<T>, from: &[T]) {
        self.start = system.potential_energy(from);
    }

    /// `out =` the system's own force along the path, or a blend of the forces of the midpoint and the trapezoidal rule,
    /// `(1 − θ) f(ū) + θ ½ (f(u₀) + f(u₁))`, with the θ for which the internal work is the change of the potential. Both
    /// rules sum to no net force, hence the blend does; on a short path it is Simpson's rule, θ = ⅓.
    pub(super) fn force(
        &mut self,
        system: &mut dyn System<T>,
        t: f64,
        [from, to, mean]: [&[T]; 3],
        v: &[T],
        out: &mut [T],
    ) -> Result<()> {
        if system.force_along(t, Path { from, to, mean }, v, out)? == PathForce::Present {
            return Ok(());
        }
        let Self { start, load, scratch } = self;
        system.force(t, mean, v, out)?;
        let (Some(before), Some(after)) = (*start, system.potential_energy(to)) else { return Ok(()) };
        system.external_load(t, load);
        if system.damping_force(mean, v, scratch) == Damping::Present {
            T::axpy(-T::one(), scratch, load);
        }
        let work = |force: &dyn Fn(usize) -> T| (0..to.len()).map(|i| force(i) * (to[i] - from[i])).sum::<T>();
        let internal = work(&|i| out[i] - load[i]);
        let miss = (after - before) + internal;
        system.force(t, from, v, scratch)?;
        system.force(t, to, v, load)?;
        let half = T::of(0.5);
        for ((trapezoidal, &end), &middle) in scratch.iter_mut().zip(load.iter()).zip(out.iter()) {
            *trapezoidal = half * (*trapezoidal + end) - middle;
        }
        let difference = work(&|i| scratch[i]);
        let rounding = T::of(64.0) * T::epsilon() * (before.abs() + after.abs() + internal.abs());
        let theta = -miss / difference;
        let theta = match difference.abs() > rounding && theta.abs() <= T::of(10.0) {
            true => theta,
            false => T::of(1.0 / 3.0),
        };
        T::axpy(theta, scratch, out);
        Ok(())
    }
}
