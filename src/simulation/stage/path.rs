//! The force along a path: its internal work over a step is the change of the potential.

use crate::error::Result;
use crate::real::Real;
use crate::rounding::rounding;
use crate::simulation::stage::Host;
use crate::system::{Path, System};

/// How the force along a path was computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PathForm {
    /// By the system itself.
    Own,
    /// The force in the middle, for systems without a potential.
    Middle,
    /// Simpson's mean, or the mean nearest to it that conserves energy.
    Simpson,
}

/// Memory for forces along paths.
#[derive(Debug)]
pub(crate) struct PathWork<T> {
    /// The potential where the step starts.
    start: Option<T>,
    pub(crate) form: PathForm,
    load: Vec<T>,
    scratch: Vec<T>,
}

impl<T: Real> PathWork<T> {
    pub(crate) fn new(dofs: usize) -> Self {
        Self { start: None, form: PathForm::Own, load: vec![T::zero(); dofs], scratch: vec![T::zero(); dofs] }
    }

    /// Begins a stage that starts at `from`.
    pub(crate) fn begin(&mut self, system: &mut dyn System<T>, from: &[T]) {
        self.start = system.potential_energy(from);
    }

    /// `out =` the system's own force along the path, or a mean of the forces at its start, middle and end, a f(u₀) +
    /// b f(ū) + c f(u₁) with a + b + c = 1, whose internal work is the change of the potential: the mean nearest to
    /// Simpson's rule. Each of the three internal forces has no resultant, hence neither has the mean.
    pub(crate) fn force(
        &mut self,
        host: &mut Host<'_, T>,
        t: f64,
        path: Path<'_, T>,
        v: &[T],
        out: &mut [T],
    ) -> Result<()> {
        let Host { system, together } = host;
        let Path { from, to, mean } = path;
        if let Some(own) = system.path_force() {
            self.form = PathForm::Own;
            return own.force_along(t, path, v, out);
        }
        let Self { start, form, load, scratch } = self;
        system.force(t, mean, v, out)?;
        let (Some(before), Some(after)) = (*start, system.potential_energy(to)) else {
            *form = PathForm::Middle;
            return Ok(());
        };
        *form = PathForm::Simpson;
        let work = |force: &[T]| together.part_of_work([from, to], |dof| force[dof]);
        // The external part, loads and damping, is the same in all three.
        system.external_load(t, load)?;
        if let Some(damping) = system.damping_force() {
            damping.evaluate(mean, v, scratch)?;
            T::axpy(-T::one(), scratch, load);
        }
        let other = work(load);
        system.force(t, from, v, scratch)?;
        system.force(t, to, v, load)?;
        let works = [other, work(scratch), work(out), work(load)];
        let [other, works @ ..] = together.sum(Ok(works.map(T::value)))?.map(T::of);
        let simpson = [1.0, 4.0, 1.0].map(|weight| T::of(weight / 6.0));
        let miss = other - (after - before) - works.iter().zip(simpson).map(|(&work, weight)| work * weight).sum::<T>();
        let center = works.iter().copied().sum::<T>() / T::of(3.0);
        let apart = works.map(|work| work - center);
        let square = apart.iter().map(|&x| x * x).sum::<T>();
        let rounded = rounding(before.abs() + after.abs() + other.abs());
        let share = if miss.abs() > rounded && miss * miss <= square { miss / square } else { T::zero() };
        let [a, b, c]: [T; 3] = std::array::from_fn(|k| simpson[k] + share * apart[k]);
        for ((out, &start), &end) in out.iter_mut().zip(scratch.iter()).zip(load.iter()) {
            *out = a * start + b * *out + c * end;
        }
        Ok(())
    }
}
