//! Drops a part on a plane, a ball or another part: from a Gmsh mesh to a series for ParaView.
//!
//! A host as others would write it: mesh ([`gmsh`], [`mesh`]), elements and assembly ([`body`]), scene ([`scene`],
//! [`placement`]), results ([`series`], [`history`]), restart ([`restart`]). Time and contact are the crate's.

mod body;
mod gmsh;
mod history;
mod material;
mod mesh;
mod options;
mod placement;
mod restart;
mod scene;
mod series;

use clap::Parser;
use contact_dynamics::{ContactStatus, Simulation};
use history::{History, Record};
use indicatif::{ProgressBar, ProgressStyle};
use options::{Model, Options};
use restart::Saved;
use scene::Scene;
use series::{Picture, Series};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// Errors are sentences for the user.
type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Beyond this rotation (degrees) linear strains of a body that turns are off by a percent and more.
const LINEAR_ROTATION: f64 = 3.0;

/// Wall time by phases.
struct Phases {
    last: Instant,
    list: Vec<(&'static str, f64)>,
}

impl Phases {
    fn new() -> Self {
        Self { last: Instant::now(), list: Vec::new() }
    }

    /// Books the time since the last call.
    fn done(&mut self, phase: &'static str) {
        let now = Instant::now();
        let seconds = (now - self.last).as_secs_f64();
        self.last = now;
        match self.list.iter_mut().find(|(name, _)| *name == phase) {
            Some((_, sum)) => *sum += seconds,
            None => self.list.push((phase, seconds)),
        }
    }
}

fn main() -> ExitCode {
    match run(Options::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(mut options: Options) -> Result<()> {
    let mut phases = Phases::new();
    let saved = options.restart.as_deref().map(Saved::read).transpose()?;
    let (mut history, mut pictures, mut checkpoint) = (History::default(), Vec::new(), None);
    if let Some(saved) = saved {
        let Options { steps, frames, output, restart, .. } = options;
        options = Options { steps, frames, output, restart, quick: false, ..saved.options };
        (history, pictures, checkpoint) = (saved.history, saved.pictures, Some(saved.checkpoint));
    }
    if options.quick {
        (options.steps, options.frames) = (60, 3);
    }
    options.check()?;
    let directory = options.output.clone();
    std::fs::create_dir_all(&directory)
        .map_err(|error| format!("the directory {} cannot be made: {error}", directory.display()))?;

    let scene = Scene::new(&options, &mut phases)?;
    let simulation = scene.simulation(&options, checkpoint)?;
    phases.done("order and factor");
    describe(&options, &scene);
    let shown = (&scene.mesh, scene.surface.as_slice());
    let series = Series::new(&directory, shown, scene.elements, std::mem::take(&mut pictures))?;
    let first = history.0.len();
    let mut recording = Recording { options: &options, scene, simulation, series, history, phases, stress: 0.0 };
    let outcome = recording.advance();
    let Recording { scene, simulation, series, history, mut phases, stress, .. } = recording;

    // Of a run that failed what it has reached is kept as well.
    history.write(&directory)?;
    let file = directory.join("checkpoint.bin");
    Saved::new(&options, history.clone(), series.list, simulation.checkpoint())?.write(&file)?;
    phases.done("results");
    outcome.map_err(|error| format!("{error}\n(what was reached is in {})", directory.display()))?;
    summarize(&options, &scene, &simulation, &history.0[first..], stress, &phases);
    println!("\nresults: {}", directory.join("series.pvd").display());
    println!("further steps: --restart {}", file.display());
    Ok(())
}

/// A run and what is recorded of it.
struct Recording<'o> {
    options: &'o Options,
    scene: Scene,
    simulation: Simulation<'static, f64>,
    series: Series,
    history: History,
    phases: Phases,
    /// Largest von Mises stress of all pictures.
    stress: f64,
}

impl Recording<'_> {
    /// Takes the steps.
    fn advance(&mut self) -> Result<()> {
        let Options { steps, frames, .. } = *self.options;
        let style = "{bar:30} {pos}/{len} steps, {eta} left   {msg}";
        let bar = ProgressBar::new(steps).with_style(ProgressStyle::with_template(style)?);
        let begin = self.simulation.time();
        let friction = self.history.0.last().map_or(0.0, |record| record.friction);
        if self.history.0.is_empty() {
            let forces = self.record(friction);
            self.picture(&forces)?;
        }
        for step in 1..=steps {
            // Steps that fail are halved: several may make up one of the grid.
            let end = begin + (step as f64 - 0.5) * self.scene.step;
            while self.simulation.time() < end {
                self.simulation.step()?;
            }
            self.phases.done("steps");
            let forces = self.record(friction);
            if step * frames / steps > (step - 1) * frames / steps {
                self.picture(&forces)?;
            }
            if let Some(last) = self.history.0.last() {
                bar.set_message(format!(
                    "t = {:.4} ms, {} contacts, {:.4} J",
                    1e3 * last.time,
                    last.contacts,
                    last.total()
                ));
            }
            bar.inc(1);
            self.phases.done("output");
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// Adds the state to the history; `friction` was lost by friction before this run. Returns the contact forces on
    /// all dofs.
    fn record(&mut self, friction: f64) -> Vec<f64> {
        let forces = self.forces();
        let mut force = [0.0; 3];
        for (dof, value) in forces[..3 * self.scene.nodes].iter().enumerate() {
            force[dof % 3] += value;
        }
        let pressing = |contact: usize| {
            !matches!(self.simulation.state().contacts().status(contact), ContactStatus::Open | ContactStatus::Touching)
        };
        let contacts = (0..self.simulation.gaps().len()).filter(|&contact| pressing(contact)).count();
        let u = self.simulation.state().displacement();
        let heights = self.scene.body.masses().iter().zip(u).skip(2).step_by(3);
        let weight = self.options.gravity * heights.map(|(mass, u)| mass * u).sum::<f64>();
        let time = self.simulation.time();
        let energy = self.simulation.energy();
        self.history.0.push(Record::new(time, force, contacts, &energy, weight, friction));
        forces
    }

    /// Contact forces on all dofs.
    fn forces(&self) -> Vec<f64> {
        let mut forces = vec![0.0; self.simulation.state().displacement().len()];
        for contact in self.simulation.contact_forces().filter(|contact| contact.force != 0.0) {
            contact.forces().for_each(|(dof, force)| forces[dof] += force);
        }
        forces
    }

    fn picture(&mut self, force: &[f64]) -> Result<()> {
        let state = self.simulation.state();
        let u = state.displacement();
        let stress = self.scene.body.von_mises(u, self.options.model == Model::Linear);
        self.stress = stress.iter().copied().fold(self.stress, f64::max);
        let picture = Picture { displacement: u, velocity: state.velocity(), force, von_mises: &stress };
        self.series.add(state.time(), &self.scene.mesh, &picture)
    }
}

/// Says what will be run.
fn describe(options: &Options, scene: &Scene) {
    let shown = |path: PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let target = match &options.onto {
        options::Target::Plane if options.slope == 0.0 => "a plane".to_owned(),
        options::Target::Plane => format!("a plane with a slope of {}°", options.slope),
        options::Target::Ball => "a ball".to_owned(),
        options::Target::Part(path) => shown(path.clone()),
    };
    println!(
        "{} of {} falls on {target}: {} elements, {} degrees of freedom, {} facets; h = {:.3e} s, {:?}",
        shown(scene::part(options)),
        options.material,
        scene.mesh.elements.len(),
        3 * scene.mesh.nodes.len(),
        scene.surface.len(),
        scene.step,
        options.scheme,
    );
    println!("the run begins at t = {:.4} ms with a speed of {:.4} m/s", 1e3 * scene.start, scene.speed);
}

/// Says what has happened, and what it took.
fn summarize(
    options: &Options,
    scene: &Scene,
    simulation: &Simulation<'_, f64>,
    records: &[Record],
    stress: f64,
    phases: &Phases,
) {
    let largest = records.iter().max_by(|a, b| a.size().total_cmp(&b.size()));
    let (Some(first), Some(last), Some(largest)) = (records.first(), records.last(), largest) else { return };
    let masses = &scene.body.masses()[..3 * scene.nodes];
    let velocity = simulation.state().velocity();
    let momentum: f64 = masses.iter().zip(velocity).skip(2).step_by(3).map(|(m, v)| m * v).sum();
    let mass: f64 = masses.iter().skip(2).step_by(3).sum();
    println!("\n| what | value |\n| --- | ---: |");
    println!("| mass of the part | {mass:.4e} kg |");
    println!("| largest contact force, at {:.4} ms | {:.4e} N |", 1e3 * largest.time, largest.size());
    println!("| most contacts that pressed at once | {} |", records.iter().map(|r| r.contacts).max().unwrap_or(0));
    println!("| largest von Mises stress of the pictures | {stress:.4e} Pa |");
    println!("| mean vertical velocity at the end | {:.4} m/s |", momentum / mass);
    println!("| energy at the end over that at the start | {:.4} |", last.total() / first.total());
    println!("| lost by friction, of that at the start | {:.4} |", (last.friction - first.friction) / first.total());
    println!("\n| phase | seconds |\n| --- | ---: |");
    phases.list.iter().for_each(|(phase, seconds)| println!("| {phase} | {seconds:.2} |"));

    if largest.size() == 0.0 {
        let gap = simulation.gaps().iter().copied().fold(f64::INFINITY, f64::min);
        let above = if gap.is_finite() { format!("{gap:.2e} m away") } else { "far away".into() };
        eprintln!(
            "\nwarning: nothing has touched in {} steps, the part is still {above}: take more --steps",
            options.steps
        );
    }
    let rotation = scene.body.rotation(simulation.state().displacement(), 0..scene.elements).to_degrees();
    if options.model == Model::Linear && rotation > LINEAR_ROTATION {
        eprintln!(
            "\nwarning: the part has turned by {rotation:.1}° at the end; linear strains take a rotation for a strain, \
             and are wrong beyond {LINEAR_ROTATION}°: take --model neo-hookean"
        );
    }
}
