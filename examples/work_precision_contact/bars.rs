//! Bars: two that collide, one that bounces.

use crate::rows::Row;
use crate::scene::{Errors, Model, Scene, force_errors};
use contact_dynamics::{Result, Simulation};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::masses::Body;
use contact_dynamics_scenes::measure::{impact, try_record_run};
use contact_dynamics_scenes::reference::BouncingBar;
use contact_dynamics_scenes::wall_bar::WallBar;

/// Numbers of elements of a bar; the largest ones are within the budget at large Courant numbers only.
const MESHES: [usize; 8] = [12, 25, 50, 100, 200, 400, 800, 1600];

/// Two bars that collide.
pub(crate) struct Colliding {
    key: &'static str,
    title: &'static str,
    bars: fn(usize) -> Bars,
    until: f64,
}

/// The paper's bars.
pub(crate) const EQUAL: Colliding = Colliding { key: "equal", title: "Two equal bars", bars: Bars::paper, until: 0.4 };

/// Bars of different stiffness: two plateaus of the force.
pub(crate) const DISSIMILAR: Colliding =
    Colliding { key: "dissimilar", title: "Two dissimilar bars", bars: Bars::dissimilar, until: 0.5 };

impl Colliding {
    fn run(&self, Model { row, elements, h }: &Model<'_>, bars: &Bars) -> Result<Simulation<'static, f64>> {
        let body = (self.bars)(*elements).body();
        let transit = [0, 1].map(|bar| transit(bars, bar));
        let stiffness = [0, 1].map(|bar| bars.young[bar] * bars.area / bars.element_size(bar));
        Simulation::builder(bars.system_with(row.mass(&body, *h)?), row.integrator()?, *h)
            .velocity(bars.velocities())
            .constraint(bars.contact_under(row.law(stiffness[0].min(stiffness[1]))))
            .correctors(row.correctors(0.5 * (transit[0] + transit[1]))?)
            .build()
    }
}

/// Time of a wave through an element.
fn transit(bars: &Bars, bar: usize) -> f64 {
    bars.element_size(bar) / (bars.young[bar] / bars.density[bar]).sqrt()
}

impl Scene for Colliding {
    fn key(&self) -> &'static str {
        self.key
    }

    fn title(&self) -> &'static str {
        self.title
    }

    fn budget(&self, _: &Row) -> f64 {
        2.8e6
    }

    fn meshes(&self) -> Vec<usize> {
        MESHES.to_vec()
    }

    fn body(&self, elements: usize) -> Body {
        (self.bars)(elements).body()
    }

    fn transit(&self, elements: usize) -> f64 {
        let bars = (self.bars)(elements);
        transit(&bars, 0).min(transit(&bars, 1))
    }

    fn simulation(&self, model: &Model<'_>, phase: f64) -> Result<(Simulation<'static, f64>, f64)> {
        let bars = (self.bars)(model.elements).delayed(phase, model.h);
        Ok((self.run(model, &bars)?, self.until))
    }

    fn errors(&self, model: &Model<'_>, phase: f64) -> Result<Errors> {
        let bars = (self.bars)(model.elements).delayed(phase, model.h);
        let record = try_record_run(&bars, &mut self.run(model, &bars)?, self.until)?;
        let impact = impact(&bars, &record, model.h, model.row.load());
        let energy = (1.0 - record.energy(record.t.len() - 1) / record.start_energy).abs();
        Ok(Errors { force: impact.force_l1, rms: impact.force_l2, energy })
    }
}

/// The bar that bounces, for two periods: four impacts.
pub(crate) struct Bouncing;

const PERIODS: f64 = 2.0;

impl Bouncing {
    /// The run, its time step, and the weights of the dofs: the step is a little smaller than asked for, so that the
    /// first touch comes so far into a step.
    fn run(model: &Model<'_>, phase: f64) -> Result<(Simulation<'static, f64>, f64, Vec<f64>)> {
        let Model { row, elements, h } = model;
        let (bar, touch) = (WallBar::bouncing(*elements), BouncingBar::doyen().events()[0]);
        let h = touch / ((touch / h).ceil() + phase);
        let mass = row.mass(&bar.body(), h)?;
        let weights = mass.row_sums();
        let run = Simulation::builder(bar.system_with(mass), row.integrator()?, h)
            .constraint(bar.contact_under(row.law(bar.young / bar.element_size())))
            .correctors(row.correctors(bar.element_size() / bar.wave_speed())?)
            .build()?;
        Ok((run, h, weights))
    }
}

impl Scene for Bouncing {
    fn key(&self) -> &'static str {
        "bouncing"
    }

    fn title(&self) -> &'static str {
        "A bar that bounces, four impacts"
    }

    fn budget(&self, _: &Row) -> f64 {
        2.8e6
    }

    fn meshes(&self) -> Vec<usize> {
        MESHES.to_vec()
    }

    fn body(&self, elements: usize) -> Body {
        WallBar::bouncing(elements).body()
    }

    fn transit(&self, elements: usize) -> f64 {
        let bar = WallBar::bouncing(elements);
        bar.element_size() / bar.wave_speed()
    }

    fn simulation(&self, model: &Model<'_>, phase: f64) -> Result<(Simulation<'static, f64>, f64)> {
        Ok((Self::run(model, phase)?.0, PERIODS * BouncingBar::doyen().period()))
    }

    fn errors(&self, model: &Model<'_>, phase: f64) -> Result<Errors> {
        let (mut run, h, weights) = Self::run(model, phase)?;
        let (bar, exact) = (WallBar::bouncing(model.elements), BouncingBar::doyen());
        let (period, late) = (exact.period(), (model.row.load() - 1.0) * h);
        let mut forces = Vec::new();
        while run.time() < PERIODS * period {
            run.step()?;
            forces.push((run.time() + late, run.state().contacts().forces()[0]));
        }
        let jumps: Vec<f64> =
            [0.0, period].iter().flat_map(|start| exact.events().map(|event| start + event)).collect();
        let largest = exact.contact_force(exact.events()[1] - 1e-9);
        let window = 0.0..PERIODS * period;
        // Between the impacts nothing is to be wrong: means over the flight too would only scale the error.
        let near = |t: f64| jumps.chunks(2).any(|contact| t > contact[0] - 0.1 && t < contact[1] + 0.1);
        forces.retain(|(t, _)| near(*t));
        let [force, rms] = force_errors(&forces, |t| exact.contact_force(t), window, &jumps, h, largest);
        let total = bar.total_energy_with(&weights, run.energy().total(), run.state().displacement());
        let start = weights.iter().sum::<f64>() * bar.gravity * bar.height;
        Ok(Errors { force, rms, energy: (1.0 - total / start).abs() })
    }
}
