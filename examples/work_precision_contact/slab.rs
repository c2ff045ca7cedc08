//! A slab that strikes a rough wall obliquely, and sticks to it while its waves of pressure and shear run.

use crate::rows::Row;
use crate::scene::{Errors, Model, Scene, force_errors};
use contact_dynamics::{Result, Simulation};
use contact_dynamics_scenes::masses::Body;
use contact_dynamics_scenes::slabs::Slab;

const MESHES: [usize; 8] = [12, 25, 50, 100, 200, 400, 800, 1600];
/// Speed along the wall: friction of .2 to .3 of the pressure holds it.
const ALONG: f64 = 0.02;
/// Steps before the one of the impact.
const FLIGHT: f64 = 2.0;

/// The scene.
pub(crate) struct Sticking;

fn transit(slab: &Slab) -> f64 {
    slab.length / slab.elements as f64 / slab.speeds[0]
}

impl Sticking {
    /// The run, the slab, and when it touches.
    fn run(model: &Model<'_>, phase: f64) -> Result<(Simulation<'static, f64>, Slab, f64)> {
        let Model { row, elements, h } = *model;
        let slab = Slab::thrown(elements, ALONG);
        let touch = (FLIGHT + phase) * h;
        let body = slab.body();
        let system = row.mass(&body, h)?.system(body.stiffness)?;
        let element = slab.density * slab.speeds[0] / transit(&slab);
        let run = Simulation::builder(system, row.integrator()?, h)
            .velocity(slab.velocities().collect())
            .constraint(slab.wall(row.law(element), touch * slab.velocity[0]))
            .correctors(row.correctors(transit(&slab))?)
            .build()?;
        Ok((run, slab, touch))
    }
}

/// The time until which it runs: the slab has left the wall.
fn until(slab: &Slab, touch: f64) -> f64 {
    touch + 1.25 * slab.contact_time()
}

impl Scene for Sticking {
    fn key(&self) -> &'static str {
        "sticking"
    }

    fn title(&self) -> &'static str {
        "A slab on a rough wall, friction"
    }

    fn budget(&self, _: &Row) -> f64 {
        2.8e6
    }

    fn meshes(&self) -> Vec<usize> {
        MESHES.to_vec()
    }

    fn body(&self, elements: usize) -> Body {
        Slab::thrown(elements, ALONG).body()
    }

    fn transit(&self, elements: usize) -> f64 {
        transit(&Slab::thrown(elements, ALONG))
    }

    fn simulation(&self, model: &Model<'_>, phase: f64) -> Result<(Simulation<'static, f64>, f64)> {
        let (run, slab, touch) = Self::run(model, phase)?;
        Ok((run, until(&slab, touch)))
    }

    fn errors(&self, model: &Model<'_>, phase: f64) -> Result<Errors> {
        let (mut run, slab, touch) = Self::run(model, phase)?;
        let (start, late) = (run.energy().total(), (model.row.load() - 1.0) * model.h);
        let end = until(&slab, touch);
        let mut frictions = Vec::new();
        while run.time() < end {
            run.step()?;
            frictions.push((run.time() + late, -run.state().contacts().friction_forces(0)[0]));
        }
        let jumps = [touch, touch + slab.contact_time()];
        let [_, largest] = slab.forces();
        let exact = |t: f64| if t > jumps[0] && t < jumps[1] { largest } else { 0.0 };
        let [force, rms] = force_errors(&frictions, exact, 0.0..end, &jumps, model.h, largest);
        // It sticks: no energy is lost.
        Ok(Errors { force, rms, energy: (1.0 - run.energy().total() / start).abs() })
    }
}
