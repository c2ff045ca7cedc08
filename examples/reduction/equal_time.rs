//! Blocks that fall on a rigid plane: error of the force, beside a fine mesh, over the time of a run, of coarser meshes
//! and of modes.

use crate::blocks::Block;
use contact_dynamics::reduction::{Boundary, Modes, Reduction};
use contact_dynamics::{LinearSystem, Result, Simulation};
use example_support::output::decimal;
use example_support::plot::{Axis, BLUE, Curve, DARK, Panel, RGBColor, SKY, VERMILION, page};
use std::error::Error;
use std::fmt::Write;
use std::time::Instant;

/// Runs of each model, of which the fastest counts.
const REPETITIONS: usize = 3;

/// What falls: cells of the reference, of the whole models, and of the parent of the modes.
struct Scene {
    name: &'static str,
    make: fn(usize) -> Result<Block>,
    until: f64,
    reference: usize,
    whole: &'static [usize],
    parent: usize,
    modes: &'static [usize],
}

fn edge() -> ([f64; 3], f64) {
    ([0.0, 1.0, 0.0], 0.1)
}

const SCENES: [Scene; 4] = [
    Scene {
        name: "square, flat",
        make: |cells| Block::plane(cells, 0.0),
        until: 0.3,
        reference: 96,
        whole: &[4, 6, 8, 12, 16, 24, 32, 48],
        parent: 48,
        modes: &[20, 50, 100, 200],
    },
    Scene {
        name: "square, tilted by 0.02",
        make: |cells| Block::plane(cells, 0.02),
        until: 0.3,
        reference: 96,
        whole: &[4, 6, 8, 12, 16, 24, 32, 48],
        parent: 48,
        modes: &[20, 50, 100, 200],
    },
    Scene {
        name: "cube, flat",
        make: |cells| Block::cube(cells, ([0.0, 1.0, 0.0], 0.0)),
        until: 0.35,
        reference: 16,
        whole: &[2, 3, 4, 6, 8, 10],
        parent: 10,
        modes: &[20, 50, 100, 200],
    },
    Scene {
        name: "cube, on an edge, 0.1",
        make: |cells| Block::cube(cells, edge()),
        until: 0.35,
        reference: 16,
        whole: &[2, 3, 4, 6, 8, 10],
        parent: 10,
        modes: &[20, 50, 100, 200],
    },
];

/// A run: times and total forces, seconds of the steps, and with what came before.
struct Course {
    forces: Vec<[f64; 2]>,
    unknowns: usize,
    run: f64,
    both: f64,
}

impl Course {
    /// The fastest of several runs.
    fn of(repetitions: usize, until: f64, build: impl Fn() -> Result<Simulation<'static, f64>>) -> Result<Self> {
        let mut best = Self { forces: Vec::new(), unknowns: 0, run: f64::INFINITY, both: f64::INFINITY };
        for _ in 0..repetitions {
            let (begin, mut forces) = (Instant::now(), Vec::new());
            let mut run = build()?;
            let start = Instant::now();
            while run.time() < until {
                run.step()?;
                forces.push([run.time(), run.state().contacts().forces().iter().sum()]);
            }
            let (run_time, both) = (start.elapsed().as_secs_f64(), begin.elapsed().as_secs_f64());
            best.unknowns = run.state().displacement().len();
            (best.run, best.both) = (best.run.min(run_time), best.both.min(both));
            best.forces = forces;
        }
        Ok(best)
    }

    /// The force between steps.
    fn at(&self, t: f64) -> f64 {
        let next = self.forces.partition_point(|point| point[0] < t);
        let [after, force] = self.forces[next.min(self.forces.len() - 1)];
        let [before, last] = if next == 0 { [0.0, 0.0] } else { self.forces[next - 1] };
        let share = if after > before { ((t - before) / (after - before)).min(1.0) } else { 1.0 };
        last + share * (force - last)
    }

    /// Σ |F − F_ref| / Σ F_ref at the times of the reference.
    fn error(&self, reference: &Self) -> f64 {
        let miss: f64 = reference.forces.iter().map(|&[t, force]| (self.at(t) - force).abs()).sum();
        miss / reference.forces.iter().map(|point| point[1]).sum::<f64>()
    }
}

/// The models of a scene, by kind: meshes, tapered, untapered; each a name and a run.
type Kinds = [Vec<(String, Course)>; 3];

fn courses(scene: &Scene, quick: bool) -> Result<(Course, Kinds)> {
    let coarser = |cells: usize| if quick { (cells / 3).max(2) } else { cells };
    let whole = |repetitions: usize, cells: usize| {
        let block = (scene.make)(cells)?;
        Course::of(repetitions, scene.until, || {
            let system = LinearSystem::new(block.mass.clone(), block.stiffness.clone())?;
            block.run(system, &block.contact, block.velocity.clone())
        })
    };
    let reference = whole(1, coarser(scene.reference))?;
    let mut kinds: Kinds = Default::default();
    for &cells in scene.whole.iter().take(if quick { 3 } else { usize::MAX }) {
        kinds[0].push((format!("{cells} cells a side"), whole(REPETITIONS, cells)?));
    }
    let parent = (scene.make)(coarser(scene.parent))?;
    for &count in scene.modes.iter().take(if quick { 1 } else { usize::MAX }) {
        for (kind, boundary) in [(1, Boundary::Tapered), (2, Boundary::Untapered)] {
            // (The build, which takes longest, is timed once.)
            let begin = Instant::now();
            let modes = Modes::lowest(parent.plain.as_ref(), parent.stiffness.as_ref(), &[], count)?;
            let reduction = Reduction::new(parent.plain.as_ref(), parent.stiffness.as_ref(), &parent.contact);
            let body = reduction.boundary(boundary).with_modes(&modes)?;
            let build = begin.elapsed().as_secs_f64();
            let contact: Vec<usize> = body.contact_dofs().collect();
            let velocity = body.velocity(&parent.velocity)?;
            let h = parent.h.max(1.0 / body.accuracy().cutoff);
            let run = || parent.run_in(h, body.system()?, &contact, velocity.clone());
            let mut course = Course::of(REPETITIONS, scene.until, run)?;
            course.both += build;
            kinds[kind].push((format!("{count} modes, {}", ["", "tapered", "untapered"][kind]), course));
        }
    }
    Ok((reference, kinds))
}

/// The tables, and the page of figures.
pub(crate) fn tables(quick: bool) -> std::result::Result<(String, String), Box<dyn Error>> {
    let mut text = String::from(
        "Blocks on a rigid plane, error of the force over time beside a finer mesh (mean difference over mean force); \
         time of the steps (best of three runs), and with the build\n\n\
         | falls | model | unknowns | error | steps | run, ms | with build, ms |\n\
         | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let mut panels = Vec::new();
    for scene in &SCENES {
        let (reference, kinds) = courses(scene, quick)?;
        for (name, course) in kinds.iter().flatten() {
            writeln!(
                text,
                "| {} | {name} | {} | {} | {} | {} | {} |",
                scene.name,
                course.unknowns,
                decimal(course.error(&reference), 3),
                course.forces.len(),
                decimal(1e3 * course.run, 2),
                decimal(1e3 * course.both, 1)
            )?;
        }
        panels.push(panel(scene.name, &reference, &kinds));
    }
    let panels: [Panel; 4] = panels.try_into().map_err(|_| "four panels")?;
    let title = "Error of the contact force over the time of a run";
    let subtitle = "Blocks that fall on a rigid plane: coarser meshes, and 20 to 200 modes of a fine one.";
    Ok((text, page(title, subtitle, &panels)?))
}

fn panel(name: &str, reference: &Course, [whole, tapered, untapered]: &Kinds) -> Panel {
    let curve = |label: &str, color: RGBColor, runs: &[(String, Course)], time: fn(&Course) -> f64| Curve {
        label: Some(label.into()),
        color,
        width: 7,
        points: runs.iter().map(|(_, run)| ((1e3 * time(run)).log10(), run.error(reference).log10())).collect(),
    };
    Panel {
        title: name.into(),
        x: Axis::decades("time (ms)", -1, 5, 1),
        y: Axis::decades("error", -2, 0, 1),
        curves: vec![
            curve("meshes", DARK, whole, |run| run.both),
            curve("untapered", VERMILION, untapered, |run| run.run),
            curve("tapered", BLUE, tapered, |run| run.run),
            curve("tapered, with build", SKY, tapered, |run| run.both),
        ],
        note: None,
    }
}
