//! Advances a run: by a step, by whole steps until a time, by steps that land on it.

use crate::error::{Error, Result};
use crate::observer::{Control, Observer, StepView, Wants};
use crate::ranks::check_alike;
use crate::real::Real;
use crate::rounding::{TIME_SHARE, time_resolution};
use crate::simulation::run::Simulation;
use crate::simulation::run::results::Outcome;

impl<T: Real> Simulation<'_, T> {
    /// Takes one step. Under [`step_control`](crate::SimulationBuilder::step_control) smaller sizes are tried until
    /// one succeeds.
    ///
    /// # Errors
    ///
    /// [`Error::StepNotFinite`], [`Error::ContactNotFinite`], [`Error::ContradictoryContacts`], [`Error::Contact`],
    /// [`Error::NewtonNotConverged`], [`Error::IndefiniteTangent`], [`Error::ContactLost`], [`Error::PassedThrough`],
    /// [`Error::LinearNotConverged`], [`Error::TimeNotAdvancing`], or errors of the host's own parts; instead
    /// [`Error::StepRefused`] if smaller steps were tried. State and history are then unchanged. [`Error::Poisoned`]
    /// after a panic of the host that was caught.
    pub fn step(&mut self) -> Result<()> {
        self.guarded(|run| match run.monitors.judge {
            Some(_) => run.controlled_step(),
            None => run.attempt().map(drop),
        })
    }

    /// Takes whole steps and stops at the first grid time ≥ `t` − 1e-9 h, or when the observer stops the run. A grid
    /// time whose distance from `t` is rounding counts as `t`.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if `t` is not finite, and errors of [`step`](Self::step). After the step itself has been
    /// taken: [`Error::EnergyNotFinite`] if an observer requests an energy that is NaN or infinite, and errors of an
    /// observer.
    pub fn run_until(&mut self, t: f64, observer: &mut dyn Observer<T>) -> Result<Outcome> {
        if !t.is_finite() {
            return Err(Error::Parameter { name: "the end time", value: t, range: "finite" });
        }
        check_alike(&self.parts.together, ["the end time"], [t])?;
        while !self.history.clock.has_reached(t) {
            if self.observed_step(observer)? == Control::Stop {
                return Ok(Outcome::Stopped);
            }
        }
        Ok(Outcome::Reached)
    }

    /// Takes a step and passes it to the observer.
    fn observed_step(&mut self, observer: &mut dyn Observer<T>) -> Result<Control> {
        self.step()?;
        // Energies are sums over all ranks, which take part even if only an observer elsewhere needs them.
        let [wanted] = self.parts.together.sum(Ok([f64::from(u8::from(observer.wants() == Wants::Energy))]))?;
        let energy = (wanted > 0.0).then(|| self.energy());
        energy.map_or(Ok(()), |energy| energy.check(self.time()))?;
        let view = StepView { state: &self.state, energy, h: self.history.made_with, statistics: &self.statistics };
        let observed = observer.observe(&view);
        if self.parts.together.is_alone() {
            return observed;
        }
        let stops = observed.map(|control| [f64::from(u8::from(control == Control::Stop))]);
        let stops = self.parts.together.sum(stops);
        self.parts.together.caught();
        Ok(if stops? == [0.0] { Control::Continue } else { Control::Stop })
    }

    /// Takes whole steps as long as they end before `t`, then one that ends there, and restores the step size.
    ///
    /// This costs two factorizations, if `t` is not on the grid.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{GeneralizedAlpha, LinearSystem, Simulation};
    ///
    /// let k = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 1.0)])?;
    /// let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], k)?, GeneralizedAlpha::default(), 0.03)
    ///     .displacement(vec![1.0])
    ///     .build()?;
    /// run.land_on(1.0, &mut ())?;
    /// assert!((run.time() - 1.0).abs() < 1e-14 && run.step_size() == 0.03);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Errors of [`run_until`](Self::run_until) and [`set_step_size`](Self::set_step_size).
    pub fn land_on(&mut self, t: f64, observer: &mut dyn Observer<T>) -> Result<Outcome> {
        let nominal = self.history.pace.nominal;
        if !t.is_finite() {
            return self.run_until(t, observer);
        }
        // Times closer than this count as the same.
        let tolerance = (TIME_SHARE * nominal).max(time_resolution(t));
        while self.history.clock.h <= self.history.clock.until(t) + tolerance.min(0.5 * self.history.clock.h) {
            if self.observed_step(observer)? == Control::Stop {
                return Ok(Outcome::Stopped);
            }
        }
        let rest = self.history.clock.until(t);
        if rest <= tolerance {
            return Ok(Outcome::Reached);
        }
        self.set_step_size(rest)?;
        let outcome = self.run_until(t, observer);
        let back = self.set_step_size(nominal);
        back.and(outcome)
    }
}
