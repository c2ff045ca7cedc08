//! A simulation, its steps and its state.

use crate::arrays::{ANY, floats, indices};
use crate::callback::{detached, infallible};
use crate::error::{Result, refused};
use crate::record::{Recorder, Watch};
use crate::{contact, named, system};
use contact_dynamics::contact::ContactId;
use contact_dynamics::gradient::{RecordedStep, Scales, Seed};
use contact_dynamics::{InitialOverclosure, Outcome, Simulation, StepControl};
use numpy::{IntoPyArray, PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The compiled part of `contact_dynamics.Simulation`, which documents it.
#[pyclass(module = "contact_dynamics._core")]
pub(crate) struct Run {
    /// Behind a lock for Python's sake alone: every method has the run for itself.
    run: Mutex<Simulation<'static, f64>>,
    recorder: Recorder,
}

/// The keywords of `contact_dynamics.Simulation`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Options<'py> {
    step: f64,
    scheme: Bound<'py, PyAny>,
    correction: Bound<'py, PyAny>,
    linear_solver: Bound<'py, PyAny>,
    start_time: f64,
    displacement: Option<Bound<'py, PyAny>>,
    velocity: Option<Bound<'py, PyAny>>,
    smallest_step: Option<f64>,
    local_error: Option<f64>,
    overlap: Bound<'py, PyAny>,
    start_at_rest: bool,
    check_stability: bool,
    energy: String,
    dofs: Bound<'py, PyAny>,
    differentiable: bool,
    resume: Option<Vec<u8>>,
}

/// Constraint, feature, candidate, status, gap, force, friction, slip, position, normal.
type Contact = (usize, usize, usize, String, f64, f64, Vec<f64>, Vec<f64>, Option<[f64; 3]>, Option<[f64; 3]>);

#[pymethods]
impl Run {
    #[new]
    fn new(
        py: Python<'_>,
        system: &Bound<'_, PyAny>,
        contacts: Vec<Bound<'_, PyAny>>,
        options: Options<'_>,
    ) -> Result<Self> {
        let system = system::build(system)?;
        let (count, recorded) = (system.dofs(), indices(&options.dofs, "the list of recorded dofs", &[ANY])?);
        if let Some(dof) = recorded.iter().find(|&&dof| dof >= count) {
            return Err(refused(format!("the list of recorded dofs names dof {dof} of {count}")).into());
        }
        let (integrator, of_preset) = named::scheme(&options.scheme)?;
        let mut builder = Simulation::builder(system, integrator, options.step)
            .start_time(options.start_time)
            .linear_solver(named::linear_solver(&options.linear_solver)?)
            .initial_overclosure(overclosure(&options.overlap)?);
        if let Some(correctors) = named::correctors(&options.correction)?.or(of_preset) {
            builder = builder.correctors(correctors);
        }
        for contact in &contacts {
            builder = builder.constraints(contact::build(contact)?);
        }
        if let Some(u) = &options.displacement {
            builder = builder.displacement(floats(u, "the displacement", &[count])?);
        }
        if let Some(v) = &options.velocity {
            builder = builder.velocity(floats(v, "the velocity", &[count])?);
        }
        if let Some(smallest) = options.smallest_step {
            let control = StepControl::halving(smallest)?;
            let error = options.local_error.map(|error| control.local_error(error));
            builder = builder.step_control(error.unwrap_or(Ok(control))?);
        } else if options.local_error.is_some() {
            return Err(refused("local_error is given without smallest_step, to which steps may be halved").into());
        }
        if options.start_at_rest {
            builder = builder.start_at_rest();
        }
        if !options.check_stability {
            builder = builder.unchecked_stability();
        }
        match &*options.energy {
            "none" | "state" => {}
            "balance" => builder = builder.energy_balance(),
            other => return Err(refused(format!("energy is \"{other}\", expected none, state or balance")).into()),
        }
        if let Some(bytes) = options.resume {
            let read =
                postcard::from_bytes(&bytes).map_err(|error| refused(format!("this is no checkpoint: {error}")))?;
            builder = builder.resume_from(read);
        }
        let mut run = detached(py, || builder.build())?;
        if options.differentiable {
            run.record_checkpoints()?;
        }
        Ok(Self { run: Mutex::new(run), recorder: Recorder::new(recorded, options.energy != "none") })
    }

    fn step(&mut self, py: Python<'_>) -> Result<()> {
        let run = self.run();
        detached(py, || run.step())
    }

    /// Takes steps until a time, or until some seconds have passed; returns whether the time was reached.
    fn advance(&mut self, py: Python<'_>, until: f64, seconds: f64, record: bool) -> Result<bool> {
        let Self { run, recorder } = self;
        let run = run.get_mut().unwrap_or_else(PoisonError::into_inner);
        detached(py, || {
            if record {
                recorder.begin(run)?;
            }
            let pause = Instant::now() + Duration::try_from_secs_f64(seconds).unwrap_or_default();
            let mut watch = Watch { recorder: record.then_some(recorder), pause };
            Ok(run.run_until(until, &mut watch)? == Outcome::Reached)
        })
    }

    /// The recorded columns.
    fn record<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.recorder.columns(py)
    }

    #[getter]
    fn time(&mut self) -> f64 {
        self.run().time()
    }

    /// A vector of the state by its name.
    fn vector<'py>(&mut self, py: Python<'py>, name: &str) -> Result<Bound<'py, PyArray1<f64>>> {
        let run = self.run();
        let values = match name {
            "displacement" => run.state().displacement(),
            "velocity" => run.state().velocity(),
            "acceleration" => run.state().acceleration(),
            "contact_impulses" => run.impulses_on_dofs(),
            "reactions" => return Ok(detached(py, || run.reactions())?.into_pyarray(py)),
            "contact_forces" => {
                let mut forces = vec![0.0; run.system().dofs()];
                for contact in run.contact_forces() {
                    contact.forces().for_each(|(dof, force)| forces[dof] += force);
                }
                return Ok(forces.into_pyarray(py));
            }
            _ => return Err(refused(format!("there is no vector {name}")).into()),
        };
        Ok(PyArray1::from_slice(py, values))
    }

    fn contacts(&mut self) -> Vec<Contact> {
        let contact = |contact: contact_dynamics::ContactForce<f64>| {
            let (id, status) = (contact.id, format!("{:?}", contact.status).to_lowercase());
            let contact_dynamics::ContactForce { gap, force, friction, slip, position, normal, .. } = contact;
            (id.constraint, id.feature, id.candidate, status, gap, force, friction, slip, position, normal)
        };
        self.run().contact_forces().map(contact).collect()
    }

    /// The value of an objective, and its derivatives by name. `term` gets time, step size, number, last number; the
    /// vectors of a state; and vectors of zeros, to which it adds the derivatives of the value that it returns.
    fn gradient<'py>(&mut self, py: Python<'py>, term: Py<PyAny>) -> Result<Bound<'py, PyDict>> {
        let mut objective = |step: &RecordedStep<'_, f64>, seed: &mut Seed<'_, f64>| {
            infallible(f64::NAN, |py| {
                let (state, contacts) = (step.state, step.state.contacts());
                let fields = [state.displacement(), state.velocity(), state.acceleration()];
                let values = fields.into_iter().chain([contacts.forces(), contacts.impulses()]);
                let values: Vec<_> = values.map(|values| PyArray1::from_slice(py, values)).collect();
                let Seed { displacement, velocity, acceleration, force, impulse, .. } = seed;
                let own: [&mut [f64]; 5] = [displacement, velocity, acceleration, force, impulse];
                let added: Vec<_> = own.iter().map(|own| PyArray1::<f64>::zeros(py, own.len(), false)).collect();
                let numbers = (state.time(), step.h, step.step, step.steps);
                let value = term.bind(py).call1((numbers, values, &added))?.extract()?;
                for (own, added) in own.into_iter().zip(added) {
                    own.iter_mut().zip(added.readonly().as_array()).for_each(|(own, added)| *own += added);
                }
                Ok(value)
            })
        };
        let (mut scales, run) = (Scales::default(), self.run());
        let found = detached(py, || run.gradient(&mut objective, &mut scales))?;
        let by_contact = |values: Vec<(ContactId, f64)>| -> BTreeMap<_, _> {
            values.into_iter().map(|(id, value)| ((id.constraint, id.feature, id.candidate), value)).collect()
        };
        let columns = PyDict::new(py);
        columns.set_item("displacement", found.displacement.into_pyarray(py))?;
        columns.set_item("velocity", found.velocity.into_pyarray(py))?;
        columns.set_item("gaps", by_contact(found.gaps))?;
        columns.set_item("friction", by_contact(found.friction))?;
        let Scales { mass, damping, stiffness, load, contact, .. } = scales;
        let names = ["value", "mass", "damping", "stiffness", "load", "contact"];
        for (name, value) in names.into_iter().zip([found.value, mass, damping, stiffness, load, contact]) {
            columns.set_item(name, value)?;
        }
        Ok(columns)
    }

    fn __repr__(&mut self) -> String {
        format!("{:?}", self.run())
    }

    fn checkpoint<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let stored = postcard::to_stdvec(&self.run().checkpoint());
        Ok(PyBytes::new(py, &stored.map_err(|error| refused(format!("the checkpoint is not stored: {error}")))?))
    }
}

impl Run {
    fn run(&mut self) -> &mut Simulation<'static, f64> {
        self.run.get_mut().unwrap_or_else(PoisonError::into_inner)
    }
}

/// "refused", "adjusted", or the time over which overlaps are removed.
fn overclosure(overlap: &Bound<'_, PyAny>) -> PyResult<InitialOverclosure> {
    match overlap.extract::<String>().as_deref() {
        Ok("refused") => Ok(InitialOverclosure::Refused),
        Ok("adjusted") => Ok(InitialOverclosure::AdjustedGaps),
        Ok(other) => Err(refused(format!("overlap is \"{other}\", expected refused, adjusted or a time"))),
        Err(_) => Ok(InitialOverclosure::RemovedOver(overlap.extract()?)),
    }
}
