//! What a scene is, and how error and work of a row are measured in it.

use crate::rows::Row;
use contact_dynamics::{Result, Simulation};
use contact_dynamics_scenes::masses::Body;
use std::ops::Range;
use std::time::Instant;

/// Errors of a run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Errors {
    /// Mean error of the force without the points within a step of its jumps, and RMS error with them.
    pub(crate) force: f64,
    pub(crate) rms: f64,
    /// Energy lost or won.
    pub(crate) energy: f64,
}

/// A mesh with a step, before the impact is placed inside the step.
pub(crate) struct Model<'a> {
    pub(crate) row: &'a Row,
    pub(crate) elements: usize,
    pub(crate) h: f64,
}

/// A scene with a known answer.
pub(crate) trait Scene {
    fn key(&self) -> &'static str;
    fn title(&self) -> &'static str;
    /// Dof-steps a run may have.
    fn budget(&self, row: &Row) -> f64;
    /// Numbers of elements, ascending.
    fn meshes(&self) -> Vec<usize>;
    fn body(&self, elements: usize) -> Body;
    /// Time of a wave through an element.
    fn transit(&self, elements: usize) -> f64;
    /// A run with the impact so far into a step, and the time until which to run.
    fn simulation(&self, model: &Model<'_>, phase: f64) -> Result<(Simulation<'static, f64>, f64)>;
    fn errors(&self, model: &Model<'_>, phase: f64) -> Result<Errors>;
}

/// How much is run.
pub(crate) struct Extent {
    pub(crate) courants: Vec<f64>,
    pub(crate) phases: Vec<f64>,
    /// At least so many runs are timed, more while they take less than this together.
    pub(crate) repetitions: usize,
    pub(crate) timing: f64,
    /// Share of the scenes' budgets.
    pub(crate) share: f64,
}

/// A row on a mesh with a step: error in the mean over the phases, work of one run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub(crate) elements: usize,
    pub(crate) courant: f64,
    pub(crate) dofs: usize,
    pub(crate) steps: u64,
    pub(crate) solves: u64,
    pub(crate) seconds: f64,
    pub(crate) errors: Errors,
}

impl Point {
    /// Solves times dofs: work that meshes have in common.
    pub(crate) fn work(&self) -> f64 {
        self.solves as f64 * self.dofs as f64
    }
}

/// Measures a row on all meshes at all Courant numbers.
pub(crate) fn measure(scene: &dyn Scene, row: &Row, extent: &Extent) -> Vec<Point> {
    let mut points = Vec::new();
    for elements in scene.meshes() {
        let body = scene.body(elements);
        for &asked in &extent.courants {
            let wanted = asked * scene.transit(elements);
            let Ok(h) = row.step(&body, wanted) else { continue };
            // An explicit scheme so far beyond its limit has had this step already: Courant numbers double.
            if h < 0.5 * wanted {
                continue;
            }
            let model = Model { row, elements, h };
            let Ok((_, until)) = scene.simulation(&model, 0.5) else { continue };
            if until / h * body.consistent.nrows() as f64 > extent.share * scene.budget(row) {
                continue;
            }
            points.extend(point(scene, &model, asked * h / wanted, extent));
        }
    }
    points
}

/// Measures one mesh with one step; `None` if a run breaks off.
fn point(scene: &dyn Scene, model: &Model<'_>, courant: f64, extent: &Extent) -> Option<Point> {
    let errors: Vec<Errors> =
        extent.phases.iter().map(|&phase| scene.errors(model, phase)).collect::<Result<_>>().ok()?;
    let mean = |of: fn(&Errors) -> f64| errors.iter().map(of).sum::<f64>() / errors.len() as f64;
    let errors = Errors { force: mean(|e| e.force), rms: mean(|e| e.rms), energy: mean(|e| e.energy) };
    // The fastest of several runs that nobody observes: others were disturbed.
    let (mut seconds, mut total, mut done) = (f64::INFINITY, 0.0, None);
    let mut count = 0;
    while count < extent.repetitions || (total < extent.timing && count < 50) {
        count += 1;
        let (mut run, until) = scene.simulation(model, 0.5).ok()?;
        let begin = Instant::now();
        run.run_until(until, &mut ()).ok()?;
        let elapsed = begin.elapsed().as_secs_f64();
        (seconds, total) = (seconds.min(elapsed), total + elapsed);
        done = Some((run.state().displacement().len(), *run.statistics()));
    }
    let (dofs, statistics) = done?;
    let finite = [errors.force, errors.rms, errors.energy].iter().all(|error| error.is_finite());
    let (steps, solves) = (statistics.steps, statistics.linear_solves);
    finite.then_some(Point { elements: model.elements, courant, dofs, steps, solves, seconds, errors })
}

/// Mean and RMS of the differences of forces and exact ones within a window, over `largest`; the mean leaves points out
/// that are within `h` of a jump.
pub(crate) fn force_errors(
    forces: &[(f64, f64)],
    exact: impl Fn(f64) -> f64,
    window: Range<f64>,
    jumps: &[f64],
    h: f64,
    largest: f64,
) -> [f64; 2] {
    let inside = || forces.iter().filter(|(t, _)| window.contains(t));
    let error = |&(t, force): &(f64, f64)| (force - exact(t)) / largest;
    let smooth = || inside().filter(|(t, _)| jumps.iter().all(|jump| (t - jump).abs() > h));
    let mean = smooth().map(|x| error(x).abs()).sum::<f64>() / smooth().count() as f64;
    let square = inside().map(|x| error(x).powi(2)).sum::<f64>() / inside().count() as f64;
    [mean, square.sqrt()]
}
