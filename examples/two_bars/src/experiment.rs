//! The experiment itself: which integrators and corrections are compared, and what is measured of a run.

use contact_dynamics::{Composite, Newmark, PersistencyCorrection, Result, Simulation, TimeIntegrator};
use contact_dynamics_bars::Bars;
use contact_dynamics_bars::measure::{Figures, Record, figures, record_run};
use contact_dynamics_bars::reference::{CollidingBars, Side};
use std::time::Instant;

/// End of every run; the bars touch from 0.1 s to 0.3 s.
pub(crate) const END: f64 = 0.4;

/// The integrators compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scheme {
    Composite,
    Newmark,
}

impl Scheme {
    pub(crate) const ALL: [Self; 2] = [Self::Composite, Self::Newmark];

    /// The integrator, chosen at run time.
    fn integrator(self) -> Box<dyn TimeIntegrator> {
        match self {
            Self::Composite => Box::new(Composite),
            Self::Newmark => Box::new(Newmark::trapezoidal()),
        }
    }

    /// Name in options and file names.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Composite => "composite",
            Self::Newmark => "newmark",
        }
    }

    /// Name in tables and figures.
    pub(crate) fn title(self) -> &'static str {
        match self {
            Self::Composite => "Composite",
            Self::Newmark => "Newmark (trapezoidal)",
        }
    }
}

/// The corrections compared, from none to the most complete one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Correction {
    None,
    Corrected,
    History,
}

impl Correction {
    pub(crate) const ALL: [Self; 3] = [Self::None, Self::Corrected, Self::History];

    fn corrector(self) -> Option<PersistencyCorrection> {
        match self {
            Self::None => None,
            Self::Corrected => Some(PersistencyCorrection::new()),
            Self::History => Some(PersistencyCorrection::with_history_projection()),
        }
    }

    /// Name in options and files.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Corrected => "corrected",
            Self::History => "history",
        }
    }

    /// Name in tables and figures.
    pub(crate) fn title(self) -> &'static str {
        match self {
            Self::None => "raw",
            Self::Corrected => "corrected",
            Self::History => "corrected + history",
        }
    }
}

/// Two bars about to collide, and the exact solution of their impact.
pub(crate) struct Experiment {
    bars: Bars,
    step: f64,
    exact: CollidingBars,
}

/// What was measured of one integrator with one correction.
pub(crate) struct Run {
    pub(crate) scheme: Scheme,
    pub(crate) correction: Correction,
    pub(crate) record: Record,
    pub(crate) figures: Figures,
    /// Median over repeated runs, in microseconds.
    pub(crate) time_per_step: f64,
}

/// What the figures show of one instant; pairs are the contact nodes of the left and the right bar.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub(crate) t: f64,
    pub(crate) u: [f64; 2],
    pub(crate) v: [f64; 2],
    pub(crate) force: f64,
    pub(crate) kinetic: f64,
    pub(crate) elastic: f64,
}

impl Sample {
    pub(crate) fn energy(&self) -> f64 {
        self.kinetic + self.elastic
    }
}

impl Run {
    /// One sample a step.
    pub(crate) fn samples(&self) -> impl Iterator<Item = Sample> {
        let Record { t, u, v, force, kinetic, elastic, .. } = &self.record;
        (0..t.len()).map(|i| Sample {
            t: t[i],
            u: u[i],
            v: v[i],
            force: force[i],
            kinetic: kinetic[i],
            elastic: elastic[i],
        })
    }
}

/// Of one integrator's runs, the one without correction and the one with the most complete correction.
pub(crate) fn before_and_after(runs: &[Run]) -> [Option<&Run>; 2] {
    let before = runs.iter().find(|run| run.correction == Correction::None);
    let after = runs.iter().rfind(|run| run.correction != Correction::None);
    [before, after]
}

impl Experiment {
    /// The paper's bars of `elements` elements each, whose impact comes `phase` of a step after a grid time.
    pub(crate) fn new(elements: usize, step: f64, phase: f64) -> Self {
        let bars = Bars::paper(elements).delayed(phase, step);
        // The last step may end a step after END.
        let exact = bars.exact(END + step);
        Self { bars, step, exact }
    }

    /// The data in words.
    pub(crate) fn data(&self) -> String {
        format!("{} elements each, h = {} s", self.bars.elements[0], self.step)
    }

    /// The exact solution.
    pub(crate) fn exact(&self, t: f64) -> Sample {
        let (exact, end) = (&self.exact, self.bars.length[0]);
        Sample {
            t,
            u: [exact.displacement(Side::Left, end, t), exact.displacement(Side::Right, 0.0, t)],
            v: [exact.velocity(Side::Left, end, t), exact.velocity(Side::Right, 0.0, t)],
            force: exact.contact_force(t),
            kinetic: exact.kinetic_energy(t),
            elastic: exact.strain_energy(t),
        }
    }

    /// Times of impact and release.
    pub(crate) fn contact(&self) -> (f64, f64) {
        self.exact.contact_intervals()[0]
    }

    /// The exact contact force, constant while the bars touch.
    pub(crate) fn plateau(&self) -> f64 {
        let (impact, release) = self.contact();
        self.exact.contact_force(0.5 * (impact + release))
    }

    /// Measures one integrator with one correction.
    pub(crate) fn run(&self, scheme: Scheme, correction: Correction, repetitions: usize) -> Result<Run> {
        let record = record_run(&self.bars, &mut self.simulation(scheme, correction)?, END);
        let figures = figures(&self.bars, &record, self.step);
        let time_per_step = self.time_per_step(scheme, correction, repetitions)?;
        Ok(Run { scheme, correction, record, figures, time_per_step })
    }

    fn simulation(&self, scheme: Scheme, correction: Correction) -> Result<Simulation<'static, f64>> {
        let builder = Simulation::builder(self.bars.system(), scheme.integrator(), self.step)
            .velocity(self.bars.velocities())
            .constraint(self.bars.contact());
        match correction.corrector() {
            Some(corrector) => builder.corrector(corrector).build(),
            None => builder.uncorrected().build(),
        }
    }

    /// Median time of a step in microseconds, over whole runs that nobody observes.
    #[allow(clippy::cast_precision_loss)]
    fn time_per_step(&self, scheme: Scheme, correction: Correction, repetitions: usize) -> Result<f64> {
        let mut times = Vec::with_capacity(repetitions);
        for _ in 0..repetitions {
            let mut simulation = self.simulation(scheme, correction)?;
            let start = Instant::now();
            simulation.run_until(END, &mut ())?;
            times.push(start.elapsed().as_secs_f64() * 1e6 / simulation.statistics().steps as f64);
        }
        times.sort_by(f64::total_cmp);
        Ok(times[times.len() / 2])
    }
}
