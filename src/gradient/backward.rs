//! A run back: the derivatives by the states, from the last step to the first.

use super::changes::ChangesBack;
use super::products::Tangents;
use super::stage::StageBack;
use super::turning::Turning;
use super::{Gradient, Objective, Parameters, RecordedStep, Seed, replay, start};
use crate::contact::{ContactId, ContactJacobian};
use crate::corrector::JumpProjection;
use crate::dense::DenseCholesky;
use crate::error::{Error, Result};
use crate::real::Real;
use crate::simulation::{At, Parts, Program, Simulation, projection};
use crate::state::{Checkpoints, Motion, State, StepRecord, Tape};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Versions of rows of a run back begin here: those of a run are smaller.
const VERSIONS: u64 = 1 << 62;

/// What a run back adds up, and its memory.
pub(super) struct Back<'b, T: Real> {
    pub(super) parameters: &'b mut dyn Parameters<T>,
    pub(super) gaps: BTreeMap<ContactId, T>,
    pub(super) friction: BTreeMap<ContactId, T>,
    pub(super) tangents: Tangents<T>,
    /// S = G M⁻¹ Gᵀ of the rows recorded.
    pub(super) projection: JumpProjection<T>,
    pub(super) prescribed: Vec<usize>,
    /// The rows that operators and projection belong to, and their version.
    rows: Option<Arc<ContactJacobian<T>>>,
    version: u64,
    /// W of a stage, and its version if it is factorized.
    pub(super) factor: DenseCholesky<T>,
    pub(super) factorized: Option<u64>,
    /// Vectors that are used again.
    spare: Vec<Vec<T>>,
}

impl<T: Real> Back<'_, T> {
    /// Makes rows those of operators and projection; returns their version.
    pub(super) fn follow(&mut self, rows: &Arc<ContactJacobian<T>>) -> u64 {
        if !self.rows.as_ref().is_some_and(|known| Arc::ptr_eq(known, rows)) {
            self.rows = Some(Arc::clone(rows));
            self.version += 1;
            self.projection.reset();
            self.factorized = None;
        }
        self.version
    }

    /// A vector of zeros.
    pub(super) fn zeros(&mut self, entries: usize) -> Vec<T> {
        let mut values = self.spare.pop().unwrap_or_default();
        values.clear();
        values.resize(entries, T::zero());
        values
    }

    /// A motion of zeros.
    pub(super) fn zero_motion(&mut self, dofs: usize) -> Motion<T> {
        Motion { t: 0.0, u: self.zeros(dofs), v: self.zeros(dofs), a: self.zeros(dofs) }
    }

    /// Takes vectors back that are not needed any more.
    pub(super) fn give(&mut self, values: impl IntoIterator<Item = Vec<T>>) {
        self.spare.extend(values);
    }

    /// Sets prescribed dofs, which do not depend on anything, to zero.
    pub(super) fn hold(&self, motion: &mut Motion<T>) {
        for field in 0..3 {
            let values = motion.field_mut(field);
            self.prescribed.iter().for_each(|&dof| values[dof] = T::zero());
        }
    }
}

/// The derivatives by the values of a state that an objective reads, one entry a dof or a candidate.
pub(super) struct Seeds<T> {
    pub(super) rates: [Vec<T>; 2],
    pub(super) force: Vec<T>,
    pub(super) impulse: Vec<T>,
}

/// Goes back through a recorded run.
pub(super) fn run_backward<T: Real>(
    run: &mut Simulation<'_, T>,
    tape: &Tape<T>,
    objective: &mut dyn Objective<T>,
    parameters: &mut dyn Parameters<T>,
) -> Result<Gradient<T>> {
    refuse(tape)?;
    let dofs = run.parts.system.dofs();
    let Parts { system, linear_solver, together, .. } = &run.parts;
    let mut back = Back {
        parameters,
        gaps: BTreeMap::new(),
        friction: BTreeMap::new(),
        projection: projection(&**system, &run.constraints, (together, &**linear_solver))?,
        prescribed: run.parts.system.prescribed().to_vec(),
        tangents: Tangents::of(&mut *run.parts.system),
        rows: None,
        version: VERSIONS,
        factor: DenseCholesky::default(),
        factorized: None,
        spare: Vec::new(),
    };
    // The derivatives by the newest state, and by the states before it.
    let states = (0..=run.scheme.slots()).map(|_| Motion::zero(dofs)).collect();
    let mut way = Way { objective, value: T::zero(), steps: tape.len(), states, starter: None };
    match &tape.checkpoints {
        None => way.steps_back(run, &mut back, (&tape.steps, 0), &tape.start)?,
        Some(Checkpoints { list, every, sizes }) => {
            for (number, from) in list.iter().enumerate().rev() {
                let first = number * every;
                let sizes = &sizes[first..sizes.len().min(first + every)];
                let segment = replay::take_again(run, tape, from, sizes)?;
                way.steps_back(run, &mut back, (&segment.steps, first), &from.0)?;
            }
        }
    }
    let h = match &tape.checkpoints {
        None => tape.steps.first().map(|step| step.h),
        Some(checkpoints) => checkpoints.sizes.first().copied(),
    };
    let h = h.unwrap_or(run.history.clock.h);
    let seeds = way.seed((0, h), &tape.start, &mut back);
    let [displacement, velocity] = start::start_back((run, tape, h), &mut back, seeds, way.states)?;
    let [gaps, friction] = [back.gaps, back.friction].map(|map| map.into_iter().collect());
    Ok(Gradient { value: way.value, displacement, velocity, gaps, friction })
}

/// Refuses a run in which something happened that has no derivative.
pub(super) fn refuse<T: Real>(tape: &Tape<T>) -> Result<()> {
    let Some(refusal) = &tape.refusal else { return Ok(()) };
    let part = format!("the gradient through {}", refusal.what);
    Err(Error::Incompatible { part, reason: refusal.reason })
}

/// The way back.
struct Way<'w, T: Real> {
    objective: &'w mut dyn Objective<T>,
    value: T,
    steps: usize,
    states: Vec<Motion<T>>,
    /// The scheme of the first steps.
    starter: Option<Program<T>>,
}

impl<T: Real> Way<'_, T> {
    /// Goes back through some steps, the first of which has the number `first` + 1 and starts from a state.
    fn steps_back(
        &mut self,
        run: &mut Simulation<'_, T>,
        back: &mut Back<'_, T>,
        (steps, first): (&[StepRecord<T>], usize),
        start: &State<T>,
    ) -> Result<()> {
        for (place, step) in steps.iter().enumerate().rev() {
            let seeds = self.seed((first + place + 1, step.h), &step.state, back);
            let [shares, past] = rate_shares(&run.scheme.shifts, step.extrapolates);
            for field in 0..2 {
                T::axpy(shares[field], &seeds.rates[field], self.states[0].field_mut(field + 1));
                if past[field] != T::zero() {
                    T::axpy(past[field], &seeds.rates[field], self.states[1].field_mut(field + 1));
                }
            }
            let from = place.checked_sub(1).map_or(start, |before| &steps[before].state);
            step_back((run, &mut self.starter), back, (from, step), &seeds, &mut self.states)?;
            back.give(seeds.rates.into_iter().chain([seeds.force, seeds.impulse]));
        }
        Ok(())
    }

    /// Asks the objective for its term of a state.
    fn seed(&mut self, (step, h): (usize, f64), state: &State<T>, back: &mut Back<'_, T>) -> Seeds<T> {
        let motion = &mut self.states[0];
        let (dofs, rows) = (motion.u.len(), state.contacts.lambda.len());
        let mut zeros = |entries: usize| back.zeros(entries);
        let mut seeds = Seeds { rates: [zeros(dofs), zeros(dofs)], force: zeros(rows), impulse: zeros(rows) };
        let [velocity, acceleration] = &mut seeds.rates;
        let mut seed = Seed {
            displacement: &mut motion.u,
            velocity,
            acceleration,
            force: &mut seeds.force,
            impulse: &mut seeds.impulse,
        };
        self.value += self.objective.term(&RecordedStep { state, h, step, steps: self.steps }, &mut seed);
        seeds
    }
}

/// Shares of the stored v and a in those at the time of the state, and of the state before.
fn rate_shares<T: Real>(shifts: &[f64; 2], extrapolates: bool) -> [[T; 2]; 2] {
    let shifts = if extrapolates { *shifts } else { [0.0; 2] };
    [shifts.map(|shift| T::of(1.0 - shift)), shifts.map(T::of)]
}

/// Finds the candidates of a step again, from its start and with its size.
pub(super) fn find_candidates<T: Real>(
    run: &mut Simulation<'_, T>,
    (start, h): (&Motion<T>, f64),
    expected: &[ContactId],
) -> Result<()> {
    run.constraints.search(start, run.scheme.ahead() * h, &mut run.g)?;
    if run.constraints.ids != expected {
        let part = "the gradient through rows that turn".into();
        return Err(Error::Incompatible { part, reason: "a search from a state of the run finds other contacts" });
    }
    Ok(())
}

/// Goes back through a step. On entry `states` holds the derivatives by the state at its end and by older ones, on
/// return by the state at its start and by older ones.
fn step_back<T: Real>(
    (run, starter): (&mut Simulation<'_, T>, &mut Option<Program<T>>),
    back: &mut Back<'_, T>,
    (from, step): (&State<T>, &StepRecord<T>),
    seeds: &Seeds<T>,
    states: &mut Vec<Motion<T>>,
) -> Result<()> {
    run.compile_for(step.h)?;
    if step.starts && starter.is_none() {
        *starter = Some(run.compiled_starter(step.h, &step.state.motion)?);
    }
    let dofs = run.parts.system.dofs();
    let (count, rows) = (step.stages.len(), seeds.force.len());
    // States between the stages are read within the step only.
    for _ in 1..count {
        states.insert(1, back.zero_motion(dofs));
    }
    let no_force = back.zeros(rows);
    let turns = !run.constraints.is_affine() && step.stages.iter().any(|stage| !stage.held.is_empty());
    if turns {
        find_candidates(run, (&from.motion, step.h), &step.state.contacts.ids)?;
    }
    let Simulation { parts, compiled, constraints, g, .. } = run;
    let program = starter.as_mut().filter(|_| step.starts).unwrap_or(&mut compiled.program);
    for (place, (stage, record)) in program.stages.iter().zip(&step.stages).enumerate().rev() {
        let mut new = states.remove(0);
        let force = if place + 1 == count { &seeds.force } else { &no_force };
        let operator = &mut program.operators[stage.operator];
        back.follow(&record.rows);
        let system = &mut *parts.system;
        let Motion { t, u, v, .. } = &record.balance;
        back.tangents.evaluate(system, (*t, u, v))?;
        if operator.varies() {
            operator.factorize(system, step.h, At::state(&record.balance))?;
            back.factorized = None;
        }
        let turning = turns.then_some(Turning { constraints: &mut *constraints, g: &mut *g, h: step.h });
        let mut changes = ChangesBack { system, operator, stage, h: step.h, step, turning, back };
        let raw = changes.undo(record, (force, &seeds.impulse), &mut new, states)?;
        back.hold(&mut new);
        let turning = turns.then_some(Turning { constraints: &mut *constraints, g: &mut *g, h: step.h });
        operator.follow(back.follow(&record.forces));
        let mut solved = StageBack { system: &mut *parts.system, operator, stage, record, turning, back };
        solved.undo((&raw, &seeds.impulse), &mut new, states)?;
        back.give([raw, new.u, new.v, new.a]);
    }
    back.give([no_force]);
    states.push(back.zero_motion(dofs));
    Ok(())
}
