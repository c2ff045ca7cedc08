//! Pounding: runs of structures that collide, under any contact law, and what is measured of their impacts.

use crate::damped_contact::{DampedContact, DampedLaw};
use contact_dynamics::{ContactLaw, Corrector, LinearRows, LinearSystem, Result, Simulation, TimeIntegrator};
use std::time::Instant;

/// How two structures meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pounding {
    /// Never: they pass through each other.
    None,
    /// A law of the crate.
    Law(ContactLaw),
    /// A compliant law with damping.
    Damped(DampedLaw),
}

/// A system, and pairs of dofs with their gaps: the first pushes the second where u[first] − u[second] reaches the gap.
#[derive(Debug)]
pub struct Scene {
    pub system: LinearSystem<'static, f64>,
    pub pairs: Vec<([usize; 2], f64)>,
}

impl Scene {
    /// Runs from rest with steps h until a time.
    ///
    /// # Errors
    ///
    /// Those of the builder and of the steps.
    pub fn run(
        self,
        pounding: Pounding,
        scheme: Box<dyn TimeIntegrator>,
        correctors: Vec<Box<dyn Corrector<f64>>>,
        h: f64,
        until: f64,
    ) -> Result<Record> {
        let Self { system, pairs } = self;
        match pounding {
            Pounding::Damped(law) => {
                let mut system = DampedContact::new(system, law, &pairs)?;
                let run = Simulation::builder(&mut system, scheme, h).build()?;
                let mut record = recorded(run, pairs.len(), h, until)?;
                record.forces = system.history().to_vec();
                let before = std::iter::repeat_n(&0.0, pairs.len()).chain(&record.forces);
                record.impulses = before.zip(&record.forces).map(|(a, b)| 0.5 * h * (a + b)).collect();
                Ok(record)
            }
            Pounding::Law(law) => {
                let row = |rows: LinearRows<'static, f64>, &([i, j], gap): &([usize; 2], f64)| {
                    rows.row(law, &[(i, -1.0), (j, 1.0)], gap)
                };
                let rows = pairs.iter().fold(LinearRows::new(), row);
                let builder = Simulation::builder(system, scheme, h).constraint(rows).correctors(correctors);
                recorded(builder.build()?, pairs.len(), h, until)
            }
            Pounding::None => recorded(Simulation::builder(system, scheme, h).build()?, 0, h, until),
        }
    }
}

fn recorded(mut run: Simulation<'_, f64>, pairs: usize, h: f64, until: f64) -> Result<Record> {
    let steps = (until / h).round() as usize;
    let mut record = Record { h, dofs: run.state().displacement().len(), pairs, ..Record::default() };
    record.displacements.reserve(steps * record.dofs);
    let start = Instant::now();
    for _ in 0..steps {
        run.step()?;
        let state = run.state();
        record.displacements.extend_from_slice(state.displacement());
        record.forces.extend_from_slice(state.contacts().forces());
        record.impulses.extend_from_slice(state.contacts().impulses());
    }
    record.seconds = start.elapsed().as_secs_f64() / steps as f64;
    Ok(record)
}

/// What a run leaves: the states of its steps one after the other.
#[derive(Clone, Debug, Default)]
pub struct Record {
    pub h: f64,
    /// Seconds a step.
    pub seconds: f64,
    dofs: usize,
    pairs: usize,
    displacements: Vec<f64>,
    forces: Vec<f64>,
    impulses: Vec<f64>,
}

/// What is measured of the impacts of a run.
#[derive(Clone, Copy, Debug, Default)]
pub struct Impacts {
    /// Runs of steps in which a pair pushes, of all pairs.
    pub count: usize,
    /// Largest contact force of a pair.
    pub force: f64,
    /// Sum of the impulses of all pairs.
    pub impulse: f64,
    /// The largest impulse of an impact.
    pub hardest: f64,
}

impl Record {
    /// Times and displacements.
    pub fn displacements(&self) -> impl Iterator<Item = (f64, &[f64])> {
        self.displacements.chunks_exact(self.dofs).zip(1..).map(|(u, step)| (f64::from(step) * self.h, u))
    }

    /// Times and forces of the contacts, from the lowest level on.
    pub fn forces(&self) -> impl Iterator<Item = (f64, &[f64])> {
        self.forces.chunks_exact(self.pairs.max(1)).zip(1..).map(|(force, step)| (f64::from(step) * self.h, force))
    }

    /// What is measured of its impacts.
    pub fn impacts(&self) -> Impacts {
        let mut impacts = Impacts {
            force: self.forces.iter().fold(0.0, |peak, &force| force.max(peak)),
            impulse: self.impulses.iter().sum(),
            ..Impacts::default()
        };
        for pair in 0..self.pairs {
            let mut own = 0.0;
            for &impulse in self.impulses.iter().skip(pair).step_by(self.pairs) {
                impacts.count += usize::from(own == 0.0 && impulse > 0.0);
                own = if impulse > 0.0 { own + impulse } else { 0.0 };
                impacts.hardest = impacts.hardest.max(own);
            }
        }
        impacts
    }
}
