//! The time step a second time, slowly: dense matrices, contact by trying every state of every contact, written from
//! the formulas of `docs/theory.md`. Runs of the crate are compared with it. Of the crate it takes tableaux and plain
//! data alone.

mod against;
mod chance;
mod correct;
mod dense;
mod history;
mod problem;
mod rows;
mod scene;
mod stage;
mod start;

pub(crate) use against::{Compared, Outcome, compare};
pub(crate) use chance::{Bodies, Kind, Setting};
pub(crate) use scene::Scene;

use contact_dynamics::tableau::{Stage, Tableau};
use contact_dynamics::{Newmark, TimeIntegrator};
use contact_dynamics_scenes::combinations::Correction;
use history::Reads;
use std::rc::Rc;

/// One state.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    pub(crate) t: f64,
    pub(crate) u: Vec<f64>,
    pub(crate) v: Vec<f64>,
    pub(crate) a: Vec<f64>,
}

/// What is known of the contacts; multipliers have the normal rows first, the tangents behind them.
#[derive(Clone, Debug)]
pub(crate) struct Contacts {
    /// As the contact problem of the last stage left them.
    pub(crate) raw: Vec<f64>,
    /// As reported.
    pub(crate) forces: Vec<f64>,
    pub(crate) closed: Vec<bool>,
    pub(crate) slides: Vec<bool>,
    /// Kinetic energy that corrections have taken since the contact closed.
    pub(crate) taken: Vec<f64>,
    /// Gaps at the displacements of the state.
    pub(crate) gaps: Vec<f64>,
}

/// A run.
#[derive(Debug)]
pub(crate) struct Truth {
    /// With the present step size.
    scene: Scene,
    tableau: Rc<Tableau>,
    /// How many states it reads, and what later rows read after each of its stages.
    depth: usize,
    reads: Rc<[Reads]>,
    correction: Correction,
    /// The states that are known, the newest first.
    past: Vec<Motion>,
    contacts: Contacts,
    /// Displacement of the last step over its size, of dofs without mass.
    slopes: Vec<f64>,
    /// The size of the step that has made the newest state.
    made_with: f64,
    /// Time until the present step size, and steps taken since.
    since: f64,
    steps: u32,
}

/// A stage as the steps go through them.
struct Place<'p> {
    stage: &'p Stage,
    /// What later rows read of the past behind it.
    reads: &'p Reads,
    /// Whether no row of a velocity of the scheme reads an acceleration, and none the step before.
    by_velocities: bool,
    /// Whether the trapezoidal rule makes the past of another scheme.
    starts: bool,
    t: f64,
    is_first: bool,
    is_last: bool,
    /// States made in this step, this one included: behind them comes the state that the step starts from.
    made: usize,
    closed_at_start: &'p [bool],
    slopes: &'p [f64],
    made_with: f64,
}

impl Truth {
    pub(crate) fn new(scene: &Scene, scheme: &dyn TimeIntegrator, correction: Correction) -> Self {
        let tableau = scheme.tableau();
        let (past, contacts) = start::begin(scene, &tableau, correction);
        let slopes = past[0].v.clone();
        let depth = history::depth(&tableau);
        let reads = (0..tableau.stages.len()).map(|s| history::reads_after(&tableau, s)).collect();
        let (scene, made_with) = (scene.clone(), scene.h);
        Self {
            scene,
            tableau: Rc::new(tableau),
            depth,
            reads,
            correction,
            past,
            contacts,
            slopes,
            made_with,
            since: 0.0,
            steps: 0,
        }
    }

    /// Changes the size of later steps, of schemes that read no past and store all at the time of the state.
    pub(crate) fn set_step_size(&mut self, h: f64) {
        self.since += f64::from(self.steps) * self.scene.h;
        (self.scene.h, self.steps) = (h, 0);
    }

    /// The newest state.
    pub(crate) fn motion(&self) -> &Motion {
        &self.past[0]
    }

    pub(crate) fn contacts(&self) -> &Contacts {
        &self.contacts
    }

    /// One step.
    pub(crate) fn step(&mut self) {
        let starts = self.past.len() < self.depth;
        // The trapezoidal rule makes the past that a multistep scheme needs. What is edited, and what damping does, is
        // already that of the scheme itself.
        let tableau = if starts { Rc::new(Newmark::trapezoidal().tableau()) } else { Rc::clone(&self.tableau) };
        let reads = Rc::clone(&self.reads);
        let (stages, last) = (tableau.stages.len(), reads.len() - 1);
        let by_velocities = (starts || self.depth == 1)
            && !(starts && reads[last].iter().any(|[.., a]| *a))
            && tableau.stages.iter().all(|stage| stage.recovery.v.a.iter().all(|a| a.abs() < 1e-12));
        let closed_at_start = self.contacts.closed.clone();
        let before = self.contacts.forces.clone();
        let mut reported = before[..self.scene.rows.len()].to_vec();
        let slopes = self.slopes.clone();
        for (s, stage) in tableau.stages.iter().enumerate() {
            let place = Place {
                stage,
                reads: &reads[if starts { last } else { s }],
                by_velocities,
                starts,
                t: self.since + f64::from(self.steps) * self.scene.h,
                is_first: s == 0,
                is_last: s + 1 == stages,
                made: s + 1,
                closed_at_start: &closed_at_start,
                slopes: &slopes,
                made_with: self.made_with,
            };
            if !place.is_first {
                // A contact that opens within the step keeps the last force that was reported of it.
                for (i, reported) in reported.iter_mut().enumerate().filter(|(i, _)| self.contacts.closed[*i]) {
                    *reported = self.contacts.forces[i];
                }
            }
            self.stage(&place, &reported);
        }
        // States between stages are forgotten.
        self.past.drain(1..stages);
        let ways = self.past[0].u.iter().zip(&self.past[1].u);
        self.slopes = ways.map(|(now, before)| (now - before) / self.scene.h).collect();
        self.made_with = self.scene.h;
        self.past.truncate(self.depth);
        self.steps += 1;
    }

    fn stage(&mut self, place: &Place<'_>, reported: &[f64]) {
        let was_closed = self.contacts.closed.clone();
        let stuck: Vec<bool> =
            self.contacts.slides.iter().zip(&was_closed).map(|(slides, closed)| *closed && !slides).collect();
        let solved = stage::solve(&self.scene, place, &self.past, &self.contacts, self.correction);
        self.past.insert(0, solved.motion);
        self.contacts.raw.clone_from(&solved.raw);
        self.contacts.forces = solved.raw;
        self.contacts.gaps = solved.gaps;
        self.contacts.slides = solved.slides;
        for (i, closed) in solved.closed.iter().enumerate() {
            if *closed && !was_closed[i] && !place.closed_at_start[i] {
                self.contacts.taken[i] = 0.0;
            }
        }
        self.contacts.closed = solved.closed;
        correct::correct(
            &self.scene,
            self.correction,
            place,
            correct::Before { was_closed: &was_closed, stuck: &stuck, reported, matrix: &solved.matrix },
            (&mut self.past, &mut self.contacts),
        );
    }
}
