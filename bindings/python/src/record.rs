//! What is kept of the steps of a run, and when a run pauses.

use contact_dynamics::observer::{ContactRecorder, EnergyRecorder, Wants};
use contact_dynamics::{Control, Observer, Result, Simulation, StepView, Works};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::time::Instant;

/// Contact forces, energies, and the motion of some dofs, at the start and after every step.
pub(crate) struct Recorder {
    dofs: Vec<usize>,
    has_energy: bool,
    contact: ContactRecorder<f64>,
    energy: EnergyRecorder<f64>,
    /// Displacements, velocities and accelerations, step by step.
    motion: [Vec<f64>; 3],
}

impl Recorder {
    pub(crate) fn new(dofs: Vec<usize>, has_energy: bool) -> Self {
        let (contact, energy, motion) = (ContactRecorder::new(), EnergyRecorder::new(), Default::default());
        Self { dofs, has_energy, contact, energy, motion }
    }

    /// Keeps the state from which a run starts, once.
    pub(crate) fn begin(&mut self, run: &mut Simulation<'_, f64>) -> Result<()> {
        if !self.contact.times().is_empty() {
            return Ok(());
        }
        let energy = self.has_energy.then(|| run.energy());
        let view = StepView::new(run.state(), run.step_size(), run.statistics());
        self.keep(&energy.map_or(view, |energy| view.with_energy(energy)))
    }

    fn keep(&mut self, step: &StepView<'_, f64>) -> Result<()> {
        self.contact.observe(step)?;
        self.energy.observe(step)?;
        let state = step.state;
        for (kept, field) in self.motion.iter_mut().zip([state.displacement(), state.velocity(), state.acceleration()])
        {
            kept.extend(self.dofs.iter().map(|&dof| field[dof]));
        }
        Ok(())
    }

    /// The columns as arrays.
    pub(crate) fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        let set = |name: &str, values: Vec<f64>| columns.set_item(name, values.into_pyarray(py));
        set("times", self.contact.times().to_vec())?;
        set("contact_force", self.contact.forces().to_vec())?;
        set("contact_impulse", self.contact.impulses().to_vec())?;
        set("friction_force", self.contact.friction().to_vec())?;
        let energies = self.energy.energies();
        set("kinetic", energies.iter().map(|energy| energy.kinetic).collect())?;
        set("potential", energies.iter().map(|energy| energy.potential.unwrap_or(0.0)).collect())?;
        for (number, (name, _)) in works_by_name(&Works::default()).into_iter().enumerate() {
            let work = |works| works_by_name(&works)[number].1;
            set(&format!("work_{name}"), energies.iter().filter_map(|energy| energy.works).map(work).collect())?;
        }
        for (name, kept) in ["displacement", "velocity", "acceleration"].into_iter().zip(&self.motion) {
            set(name, kept.clone())?;
        }
        Ok(columns)
    }
}

/// The lines of the energy balance.
pub(crate) fn works_by_name(works: &Works<f64>) -> [(&'static str, f64); 8] {
    [
        ("load", works.load),
        ("supports", works.supports),
        ("damping", works.damping),
        ("contact", works.contact),
        ("friction", works.friction),
        ("impacts", works.impacts),
        ("corrections", works.corrections),
        ("remainder", works.remainder),
    ]
}

/// Keeps the steps, and stops a run when it is time to look at signals and progress.
pub(crate) struct Watch<'a> {
    pub(crate) recorder: Option<&'a mut Recorder>,
    pub(crate) pause: Instant,
}

impl Observer<f64> for Watch<'_> {
    fn observe(&mut self, step: &StepView<'_, f64>) -> Result<Control> {
        if let Some(recorder) = &mut self.recorder {
            recorder.keep(step)?;
        }
        Ok(if Instant::now() < self.pause { Control::Continue } else { Control::Stop })
    }

    fn wants(&self) -> Wants {
        match &self.recorder {
            Some(recorder) if recorder.has_energy => Wants::Energy,
            _ => Wants::State,
        }
    }
}
