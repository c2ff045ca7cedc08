//! Bars that collide or bounce and a disc that falls, run by a combination, and what is measured of them over the
//! phases of the impact within a step.

use contact_dynamics::{Result, Simulation};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::combinations::Combination;
use contact_dynamics_scenes::disc::SoftDisc;
use contact_dynamics_scenes::measure::{Record, figures, impact, try_record_run};
use contact_dynamics_scenes::wall_bar::WallBar;
use std::time::Instant;

/// A number that was measured, and what it should be.
#[derive(Clone, Copy, Debug)]
pub struct Figure {
    pub name: &'static str,
    pub value: f64,
    pub exact: f64,
}

const fn figure(name: &'static str, value: f64, exact: f64) -> Figure {
    Figure { name, value, exact }
}

/// A number over the phases of the impact: its mean, and the one farthest from what it should be.
#[derive(Clone, Copy, Debug)]
pub struct Swept {
    pub name: &'static str,
    pub mean: f64,
    pub worst: f64,
}

/// Runs a scene for all phases.
pub fn sweep(phases: &[f64], run: impl Fn(f64) -> Result<Vec<Figure>>) -> Result<Vec<Swept>> {
    let runs: Vec<Vec<Figure>> = phases.iter().map(|&phase| run(phase)).collect::<Result<_>>()?;
    let of = |k: usize| {
        let values = || runs.iter().map(|figures| figures[k]);
        let farther = |x: Figure, y: Figure| {
            let miss = |figure: Figure| (figure.value - figure.exact).abs();
            if miss(y) > miss(x) { y } else { x }
        };
        let mean = values().map(|figure| figure.value).sum::<f64>() / runs.len() as f64;
        let Figure { name, value: worst, .. } = values().reduce(farther)?;
        Some(Swept { name, mean, worst })
    };
    let count = runs.first().map_or(0, Vec::len);
    Ok((0..count).filter_map(of).collect())
}

/// Two bars with a step.
#[derive(Clone, Copy, Debug)]
pub struct Collision {
    pub bars: Bars,
    pub h: f64,
    pub until: f64,
}

impl Collision {
    /// The paper's bars of `elements` elements each.
    pub fn paper(elements: usize, h: f64) -> Self {
        Self { bars: Bars::paper(elements), h, until: 0.4 }
    }

    /// Bars of different stiffness: two plateaus of the force.
    pub fn dissimilar(elements: usize, h: f64) -> Self {
        Self { bars: Bars::dissimilar(elements), h, until: 0.5 }
    }

    /// Bars of different lengths: after the first plateau they touch without force.
    pub fn unequal(elements: usize, h: f64) -> Self {
        Self { bars: Bars::unequal(elements), h, until: 0.7 }
    }

    /// With the step that a combination can take, and the impact within it.
    pub fn prepared(self, combination: &Combination, phase: f64) -> Result<Self> {
        let h = combination.step(&self.bars.body(), self.h)?;
        Ok(Self { bars: self.bars.delayed(phase, h), h, ..self })
    }

    /// A run of it, ready to begin.
    pub fn simulation(&self, combination: &Combination) -> Result<Simulation<'static, f64>> {
        let Self { bars, h, .. } = self;
        let transit = |bar: usize| bars.element_size(bar) / (bars.young[bar] / bars.density[bar]).sqrt();
        Simulation::builder(bars.system_with(combination.mass(&bars.body(), *h)?), combination.integrator()?, *h)
            .velocity(bars.velocities())
            .constraint(bars.contact_under(combination.law(&bars.body(), *h)?))
            .correctors(combination.correctors(0.5 * (transit(0) + transit(1)))?)
            .build()
    }

    /// What such a run leaves behind, and its solves a step.
    pub fn record(&self, combination: &Combination) -> Result<(Record, f64)> {
        let mut run = self.simulation(combination)?;
        let record = try_record_run(&self.bars, &mut run, self.until)?;
        let statistics = run.statistics();
        Ok((record, statistics.linear_solves as f64 / statistics.steps as f64))
    }

    /// Equal bars.
    pub fn measure(self, combination: &Combination, phases: &[f64]) -> Result<Vec<Swept>> {
        sweep(phases, |phase| {
            let scene = self.prepared(combination, phase)?;
            let (record, solves) = scene.record(combination)?;
            let figures = figures(&scene.bars, &record, scene.h);
            let impact = impact(&scene.bars, &record, scene.h, combination.load());
            Ok(vec![
                figure("force_in", figures.force_rms, 0.0),
                figure("force_l1", impact.force_l1, 0.0),
                figure("force_l2", impact.force_l2, 0.0),
                figure("force_max", figures.force_max, 1.0),
                figure("force_variation", figures.variation, 2.0),
                figure("velocity_l2", figures.velocity_rms, 0.0),
                figure("energy_loss", 1.0 - figures.energy, 0.0),
                figure("energy_max", figures.energy_max, 1.0),
                figure("touch", impact.touch, 0.0),
                figure("release", impact.release, 0.0),
                figure("penetration", impact.penetration, 0.0),
                figure("changes", impact.changes as f64, 2.0),
                figure("closure", figures.closure, 0.0),
                figure("drift", figures.drift, 0.0),
                figure("solves", solves * self.h / scene.h, 0.0),
            ])
        })
    }

    /// Dissimilar bars: the two plateaus, the release, the speeds after it.
    pub fn measure_plateaus(self, combination: &Combination, phases: &[f64]) -> Result<Vec<Swept>> {
        sweep(phases, |phase| {
            let scene = self.prepared(combination, phase)?;
            let (record, _) = scene.record(combination)?;
            let (bars, h, load) = (&scene.bars, scene.h, combination.load());
            let (start, exact) = (bars.impact_time(), bars.exact(scene.until + h));
            let plateau = |from: f64, to: f64| {
                let expected = exact.contact_force(start + 0.5 * (from + to));
                record.mean_force((load - 1.0) * h, start + from..start + to) / expected - 1.0
            };
            let mass = |bar: usize| bars.density[bar] * bars.area * bars.length[bar];
            let speed = |bar: usize| record.momentum[1][bar] / mass(bar);
            let impact = impact(bars, &record, h, load);
            Ok(vec![
                figure("force_l1", impact.force_l1, 0.0),
                figure("plateau_1", plateau(0.03, 0.17), 0.0),
                figure("plateau_2", plateau(0.23, 0.27), 0.0),
                figure("release", impact.release, 0.0),
                figure("speed_1", speed(0), 0.011_418_685),
                figure("speed_2", speed(1), 0.088_581_315),
                figure("restitution", (speed(1) - speed(0)) / 0.1, 0.771_626_3),
                figure("changes", impact.changes as f64, 2.0),
                figure("energy_loss", energy_loss(&record), 0.0),
            ])
        })
    }

    /// Unequal bars: what happens while they touch without force, and the rebound.
    pub fn measure_touching(self, combination: &Combination, phases: &[f64]) -> Result<Vec<Swept>> {
        sweep(phases, |phase| {
            let scene = self.prepared(combination, phase)?;
            let (record, _) = scene.record(combination)?;
            let (bars, start) = (&scene.bars, scene.bars.impact_time());
            let mass = |bar: usize| bars.density[bar] * bars.area * bars.length[bar];
            let speed = |bar: usize| record.momentum[1][bar] / mass(bar);
            let touching = start + 0.2..start + 0.4;
            let gaps = record.t.iter().zip(&record.gap).filter(|(t, _)| touching.contains(*t));
            let widest = gaps.fold(0.0_f64, |widest, (_, gap)| widest.max(*gap));
            let impact = impact(bars, &record, scene.h, combination.load());
            let between = start + 0.22..start + 0.38;
            let forces = record.t.iter().zip(&record.force).filter(|(t, _)| between.contains(*t));
            let largest = forces.fold(0.0_f64, |largest, (_, force)| largest.max(*force)) / 0.05;
            Ok(vec![
                figure("force_l1", impact.force_l1, 0.0),
                figure("changes", record.changes(touching) as f64, 0.0),
                figure("touching_force", largest, 0.0),
                figure("widest_gap", widest / (bars.velocity[0] * 0.1), 0.0),
                figure("restitution", (speed(1) - speed(0)) / bars.velocity[0], 0.5),
                figure("impulse", record.total_impulse / (mass(0) * bars.velocity[0]) - 1.0, 0.0),
                figure("energy_loss", energy_loss(&record), 0.0),
            ])
        })
    }

    /// Seconds for a time h: the fastest of several runs that nobody observes.
    pub fn time_per_step(self, combination: &Combination, repetitions: usize) -> Result<f64> {
        let scene = self.prepared(combination, 0.45)?;
        let mut fastest = f64::INFINITY;
        for _ in 0..repetitions {
            let mut run = scene.simulation(combination)?;
            let begin = Instant::now();
            run.run_until(scene.until, &mut ())?;
            fastest = fastest.min(begin.elapsed().as_secs_f64() * self.h / scene.until);
        }
        Ok(fastest)
    }
}

fn energy_loss(record: &Record) -> f64 {
    1.0 - record.energy(record.t.len() - 1) / record.start_energy
}

/// The bar that bounces for six periods.
pub fn bounces(combination: &Combination, elements: usize, courant: f64) -> Result<Vec<Swept>> {
    let bar = WallBar::bouncing(elements);
    let transit = bar.element_size() / bar.wave_speed();
    let h = combination.step(&bar.body(), courant * transit)?;
    let mass = combination.mass(&bar.body(), h)?;
    let masses = mass.row_sums();
    let mut run = Simulation::builder(bar.system_with(mass), combination.integrator()?, h)
        .constraint(bar.contact_under(combination.law(&bar.body(), h)?))
        .correctors(combination.correctors(transit)?)
        .build()?;
    let bounces = bar.bounces(&masses, &mut run, h, combination.load())?;
    sweep(&[0.0], |_| {
        let energy = bounces.energy;
        let [first, last, second, end] = bounces.events;
        Ok(vec![
            figure("energy_1", energy[0], 1.0),
            figure("energy_2", energy[1], 1.0),
            figure("energy_3", energy[2], 1.0),
            figure("energy_4", energy[3], 1.0),
            figure("energy_5", energy[4], 1.0),
            figure("energy_6", energy[5], 1.0),
            figure("force_in", bounces.force, 0.0),
            figure("ramp", bounces.ramp, 0.0),
            figure("force_max", bounces.force_max, 1.0),
            figure("touch_1", first, 0.0),
            figure("release_1", last, 0.0),
            figure("touch_2", second, 0.0),
            figure("release_2", end, 0.0),
            figure("changes", bounces.changes as f64, 4.0),
        ])
    })
}

/// The soft disc.
pub fn disc(combination: &Combination, disc: &SoftDisc, until: f64) -> Result<Vec<Swept>> {
    let body = disc.body();
    let h = combination.step(&body, 0.05)?;
    let mass = combination.mass(&body, h)?;
    let transit = h / body.courant(h)?;
    let correctors = combination.correctors(transit)?;
    let law = combination.law(&body, h)?;
    let mut run = disc.simulation(mass.clone(), combination.integrator()?, correctors, law, h)?;
    let figures = disc.run(&mass, &mut run, h, until)?;
    sweep(&[0.0], |_| {
        Ok(vec![
            figure("energy_loss", -figures.energy, 0.0),
            figure("energy_rise", figures.energy_max, 0.0),
            figure("force_max", figures.force_max, 0.0),
            figure("force_variation", figures.variation, 2.0),
            figure("pressure_ratio", figures.pressure_ratio, 1.0),
            figure("penetration", figures.penetration, 0.0),
            figure("changes", figures.changes, 2.0),
        ])
    })
}
