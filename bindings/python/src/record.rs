//! Recorded columns of a run, and the pauses of a run.

use contact_dynamics::observer::{ContactRecorder, EnergyRecorder, Wants};
use contact_dynamics::{Control, Energy, Observer, Result, Simulation, StepView, Works};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};
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
        Self {
            dofs,
            has_energy,
            contact: ContactRecorder::new(),
            energy: EnergyRecorder::new(),
            motion: <_>::default(),
        }
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
        let (contact, energies, [u, v, a]) = (&self.contact, self.energy.energies(), &self.motion);
        let energy = |of: fn(&Energy<f64>) -> f64| energies.iter().map(of).collect::<Vec<_>>();
        let work =
            |of: fn(&Works<f64>) -> f64| energies.iter().filter_map(|energy| energy.works.as_ref().map(of)).collect();
        let columns = [
            ("times", contact.times().to_vec()),
            ("contact_force", contact.forces().to_vec()),
            ("contact_impulse", contact.impulses().to_vec()),
            ("friction_force", contact.friction().to_vec()),
            ("kinetic", energy(|energy| energy.kinetic)),
            ("potential", energy(|energy| energy.potential.unwrap_or(0.0))),
            ("work_load", work(|works| works.load)),
            ("work_supports", work(|works| works.supports)),
            ("work_damping", work(|works| works.damping)),
            ("work_contact", work(|works| works.contact)),
            ("work_friction", work(|works| works.friction)),
            ("work_impacts", work(|works| works.impacts)),
            ("work_corrections", work(|works| works.corrections)),
            ("work_remainder", work(|works| works.remainder)),
            ("displacement", u.clone()),
            ("velocity", v.clone()),
            ("acceleration", a.clone()),
        ];
        columns.map(|(name, values)| (name, values.into_pyarray(py))).into_py_dict(py)
    }
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
