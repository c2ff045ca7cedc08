//! What a run writes: forces of the contacts, motion of the dofs, energies, and a summary for the screen.

use crate::contacts::Contact;
use crate::refusal::{Refusal, Result};
use contact_dynamics::{ContactState, ContactStatus, Energy, State};
use std::fmt::{Display, Formatter};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A number with all its digits and no more.
fn number(x: f64) -> String {
    format!("{x:?}")
}

/// A table that is being written.
struct Sheet {
    path: PathBuf,
    writer: csv::Writer<File>,
}

impl Sheet {
    fn create(directory: &Path, name: &str, columns: &[&str]) -> Result<Self> {
        let path = directory.join(name);
        let writer = csv::Writer::from_path(&path);
        let writer = writer.map_err(|error| Refusal::of(&path, format!("cannot be written: {error}")))?;
        let mut sheet = Self { path, writer };
        sheet.line(columns.iter().map(ToString::to_string).collect())?;
        Ok(sheet)
    }

    fn line(&mut self, cells: Vec<String>) -> Result<()> {
        let written = self.writer.write_record(cells);
        written.map_err(|error| Refusal::of(&self.path, format!("cannot be written: {error}")))
    }

    fn finish(&mut self) -> Result<()> {
        self.writer.flush().map_err(|error| Refusal::of(&self.path, format!("cannot be written: {error}")))
    }
}

/// The three tables of a run.
pub(crate) struct Sheets {
    forces: Sheet,
    motion: Sheet,
    energy: Sheet,
    recorded: Vec<usize>,
}

impl Sheets {
    /// Begins the tables in a directory, which is made if it is missing; `recorded` are the dofs of motion.csv.
    pub(crate) fn create(directory: &Path, recorded: Vec<usize>) -> Result<Self> {
        std::fs::create_dir_all(directory)
            .map_err(|error| Refusal::of(directory, format!("the directory cannot be made: {error}")))?;
        let forces = [
            "time",
            "contact",
            "normal_force",
            "friction",
            "gap",
            "status",
            "impulse",
            "force_1",
            "force_2",
            "force_3",
        ];
        let energy = [
            "time",
            "kinetic",
            "elastic",
            "load",
            "supports",
            "damping",
            "contact",
            "friction",
            "impacts",
            "corrections",
            "scheme",
        ];
        Ok(Self {
            forces: Sheet::create(directory, "forces.csv", &forces)?,
            motion: Sheet::create(directory, "motion.csv", &["time", "dof", "u", "v", "a"])?,
            energy: Sheet::create(directory, "energy.csv", &energy)?,
            recorded,
        })
    }

    /// Writes an instant; `impulses` are those of the contacts since the last one that was written.
    pub(crate) fn write(
        &mut self,
        state: &State<f64>,
        energy: Energy<f64>,
        contacts: &[Contact],
        impulses: &[f64],
    ) -> Result<()> {
        let time = number(state.time());
        let results = state.contacts();
        for (index, contact) in contacts.iter().enumerate() {
            let (normal, friction) = (results.forces()[index], results.friction_forces(index));
            let mut cells = vec![time.clone(), contact.name.clone()];
            cells.extend([normal, friction_size(results, index), results.gaps()[index]].map(number));
            cells.extend([status(results, index).to_string(), number(impulses[index])]);
            cells.extend(contact.force(normal, friction).into_iter().map(number));
            cells.resize(10, String::new());
            self.forces.line(cells)?;
        }
        for &dof in &self.recorded {
            let [u, v, a] = [state.displacement(), state.velocity(), state.acceleration()].map(|x| number(x[dof]));
            self.motion.line(vec![time.clone(), (dof + 1).to_string(), u, v, a])?;
        }
        let works = energy.works.unwrap_or_default();
        let mut cells = vec![time, number(energy.kinetic), energy.potential.map_or(String::new(), number)];
        let works = [
            works.load,
            works.supports,
            works.damping,
            works.contact,
            works.friction,
            works.impacts,
            works.corrections,
            works.remainder,
        ];
        cells.extend(works.map(number));
        self.energy.line(cells)
    }

    pub(crate) fn finish(&mut self) -> Result<()> {
        [&mut self.forces, &mut self.motion, &mut self.energy].into_iter().try_for_each(Sheet::finish)
    }
}

/// Size of the friction force of a contact.
pub(crate) fn friction_size(contacts: &ContactState<f64>, index: usize) -> f64 {
    contacts.friction_forces(index).iter().fold(0.0, |size: f64, f| size.hypot(*f))
}

fn status(contacts: &ContactState<f64>, index: usize) -> &'static str {
    match contacts.status(index) {
        ContactStatus::Open => "open",
        ContactStatus::Touching => "touching",
        ContactStatus::Closed => "closed",
        ContactStatus::Sticking => "sticking",
        ContactStatus::Sliding => "sliding",
        _ => "other",
    }
}

/// The largest normal force of a contact.
#[derive(Clone, Debug, PartialEq)]
pub struct Peak {
    pub force: f64,
    pub time: f64,
    pub contact: String,
}

/// What a run says on the screen.
#[derive(Clone, Debug)]
pub struct Summary {
    pub scheme: String,
    pub dofs: usize,
    pub contacts: usize,
    pub step: f64,
    pub steps: u64,
    pub end: f64,
    /// How often contacts closed, and opened.
    pub impacts: u64,
    pub releases: u64,
    pub peak: Option<Peak>,
    /// Σ of the normal impulses of all contacts.
    pub impulse: f64,
    pub energies: [Energy<f64>; 2],
    pub is_unsymmetric: bool,
    pub elapsed: Duration,
    pub directory: PathBuf,
    /// Times, and the sums of normal and friction forces, as written.
    pub forces: Vec<(f64, [f64; 2])>,
}

impl Display for Summary {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { scheme, dofs, contacts, step, steps, end, impacts, releases, impulse, .. } = self;
        writeln!(
            f,
            "{dofs} dofs, {contacts} contact{}; {scheme}, {steps} steps of {step:?} to t = {end:.6}",
            plural(*contacts)
        )?;
        if self.is_unsymmetric {
            writeln!(f, "K or C is not symmetric: factorized by LU")?;
        }
        write!(f, "impacts: contacts closed {impacts} times and opened {releases} times")?;
        match &self.peak {
            Some(Peak { force, time, contact }) => {
                writeln!(
                    f,
                    "; largest force {force:.6e} at node {contact}, t = {time:.6}; normal impulse {impulse:.6e}"
                )?;
            }
            None => writeln!(f, "; no contact force")?,
        }
        let [start, end] = &self.energies;
        let works = end.works.unwrap_or_default();
        writeln!(f, "energy: {:.6e} at the start, {:.6e} at the end; what changed it:", start.total(), end.total())?;
        for (name, work) in [
            ("load", works.load),
            ("supports", works.supports),
            ("damping", works.damping),
            ("contact forces", works.contact),
            ("friction", works.friction),
            ("impacts", works.impacts),
            ("corrections", works.corrections),
            ("the scheme itself", works.remainder),
        ] {
            // (What is left is rounding.)
            if work.abs() > 1e-12 * start.total().abs().max(end.total().abs()) {
                writeln!(f, "  {name}: {work:+.3e}")?;
            }
        }
        let microseconds = self.elapsed.as_secs_f64() * 1e6 / (*steps).max(1) as f64;
        writeln!(f, "time: {:.3} s, {microseconds:.1} µs a step with output", self.elapsed.as_secs_f64())?;
        write!(f, "wrote forces.csv, motion.csv and energy.csv to {}", self.directory.display())
    }
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}
