//! The tape of a run: what each stage leaves for the gradient. Empty boxes in runs that are not recorded.

use super::{History, Motion, State, slides};
use crate::contact::{ContactId, ContactJacobian, ContactLaw};
use crate::real::Real;
use std::sync::Arc;

/// The records of the steps since the start of a run.
#[derive(Debug)]
pub(crate) struct Tape<T> {
    pub(crate) start: State<T>,
    /// The contacts that press there, or hold in both directions.
    pub(crate) held: Vec<usize>,
    /// The past at the start that the first step reads.
    pub(crate) past: StartingPast,
    pub(crate) steps: Vec<StepRecord<T>>,
    /// Only these instead of the steps, if memory is to be saved.
    pub(crate) checkpoints: Option<Checkpoints<T>>,
    /// The stages of the step that is being tried, and why it has no derivative.
    stages: Vec<StageRecord<T>>,
    refused: Option<NoDerivative>,
    /// The rows recorded last, and their version.
    rows: Option<(u64, Arc<ContactJacobian<T>>)>,
    pub(crate) refusal: Option<NoDerivative>,
}

/// States from which the steps between them are taken again. There are at most twice as many as steps between two.
#[derive(Debug)]
pub(crate) struct Checkpoints<T> {
    /// States at steps 0, `every`, 2 `every`, …
    pub(crate) list: Vec<(State<T>, History<T>)>,
    pub(crate) every: usize,
    /// The sizes of all steps.
    pub(crate) sizes: Vec<f64>,
}

impl<T: Real> Checkpoints<T> {
    pub(crate) fn new(state: State<T>, history: History<T>) -> Self {
        Self { list: vec![(state, history)], every: 1, sizes: Vec::new() }
    }

    /// Adds a step of size h, and the state at its end if it is to be kept.
    fn push(&mut self, h: f64, state: &State<T>, history: &History<T>) {
        self.sizes.push(h);
        if !self.sizes.len().is_multiple_of(self.every) {
            return;
        }
        self.list.push((state.clone(), history.clone()));
        if self.list.len() > 2 * self.every + 1 {
            let mut number = 0;
            self.list.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.every *= 2;
        }
    }
}

/// The past states at the start of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StartingPast {
    /// None is known.
    Unknown,
    /// u − k h v, v, 0.
    Straight,
    /// Taylor's expansion.
    Expanded,
}

/// Something that happened in a run and has no derivative.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NoDerivative {
    pub(crate) what: &'static str,
    pub(crate) reason: &'static str,
}

/// An accepted step.
#[derive(Debug)]
pub(crate) struct StepRecord<T> {
    pub(crate) h: f64,
    /// Whether its stages are those of the one-step scheme with which a multistep scheme starts.
    pub(crate) starts: bool,
    pub(crate) stages: Vec<StageRecord<T>>,
    /// The state at its end.
    pub(crate) state: State<T>,
    /// Whether v and a of the state are extrapolated from the stored ones.
    pub(crate) extrapolates: bool,
}

/// A solved and corrected stage.
#[derive(Debug)]
pub(crate) struct StageRecord<T> {
    /// The motion at which the balance holds.
    pub(crate) balance: Motion<T>,
    /// The rows where contact is imposed, and those along which forces act where the balance holds.
    pub(crate) rows: Arc<ContactJacobian<T>>,
    pub(crate) forces: Arc<ContactJacobian<T>>,
    /// The rows that carried a force in the solution.
    pub(crate) held: Vec<Held<T>>,
    /// Impulse of a unit multiplier.
    pub(crate) impulse: T,
    /// In the order in which they were made.
    pub(crate) changes: Vec<Change<T>>,
    /// The corrected state of a stage before the last, if rows turn.
    pub(crate) solved: Option<Motion<T>>,
}

/// What a row obeys.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Rule<T> {
    /// Its gap, slip or jump is zero, or that of its law.
    Closed,
    /// It has no multiplier.
    Unloaded,
    /// Its multiplier is `share` times that of the row at the place `normal` of the list. In space the direction of
    /// friction turns: the multiplier falls by `turn` times the changes of two slips, or rises by it times those of
    /// two impulses. They belong to the two rows behind the normal one.
    Slides { normal: usize, share: T, turn: [T; 2], by: Guide },
}

/// What gives the direction of friction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Guide {
    /// The slip, or the jump that is left, of the same conditions.
    Slip,
    /// The total impulses of the velocity jumps.
    Impulse,
}

impl<T: Real> Rule<T> {
    /// The rules of the tangential rows of a contact with the multiplier `force` that may stick, by their multipliers
    /// and by the length of the slip. `bound` is the largest friction.
    pub(crate) fn of_friction(
        normal: usize,
        force: T,
        friction: &[T],
        (bound, slip): (T, T),
    ) -> impl Iterator<Item = Self> {
        let size = friction.iter().fold(T::zero(), |size, &f| size.hypot(f));
        let slides = bound > T::zero() && slides(size, bound) && (friction.len() == 1 || slip > T::zero());
        let turn = if friction.len() > 1 { bound / slip } else { T::zero() };
        (0..friction.len()).map(move |k| match slides {
            true => {
                Self::Slides { normal, share: friction[k] / force, turn: across(friction, k, turn), by: Guide::Slip }
            }
            false if bound <= T::zero() => Self::Unloaded,
            false => Self::Closed,
        })
    }

    /// The rules of tangential rows of a contact with the multiplier `force` and the friction `direction` per unit of
    /// it, which is along impulses of this size.
    pub(crate) fn along(normal: usize, force: T, direction: &[T], impulse: T) -> impl Iterator<Item = Self> {
        let size = direction.iter().fold(T::zero(), |size, &f| size.hypot(f));
        let turn = if direction.len() > 1 && size > T::zero() { size * force / impulse } else { T::zero() };
        (0..direction.len()).map(move |k| Self::Slides {
            normal,
            share: direction[k],
            turn: across(direction, k, turn),
            by: Guide::Impulse,
        })
    }
}

/// Row k of c (1 − d dᵀ) with the direction d of some friction; zero in the plane.
fn across<T: Real>(friction: &[T], k: usize, c: T) -> [T; 2] {
    let square = friction.iter().map(|&f| f * f).sum::<T>();
    let entry = |j: usize| match friction.get(j) {
        Some(&other) if c != T::zero() => {
            c * (if j == k { T::one() } else { T::zero() } - friction[k] * other / square)
        }
        _ => T::zero(),
    };
    [entry(0), entry(1)]
}

/// A row that carried a force. Tangential rows follow the row of their contact.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Held<T> {
    pub(crate) row: usize,
    pub(crate) id: ContactId,
    pub(crate) rule: Rule<T>,
    pub(crate) force: T,
    /// Whether it is tangential.
    pub(crate) is_slip: bool,
    /// If its law is compliant.
    pub(crate) compliance: Option<Compliance<T>>,
}

/// A force that is a function of the gap, and of its rate, where the balance holds: δg + `lag` δġ + `by_force` δλ = 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Compliance<T> {
    pub(crate) by_force: T,
    pub(crate) lag: T,
    pub(crate) law: ContactLaw,
    pub(crate) gap: T,
    pub(crate) rate: T,
}

/// A change along rows, x ← x + M⁻¹ Gᵀ m, with which the rows obey rules: their jump vanishes, or their total
/// multiplier, m and `share` times the raw one.
#[derive(Clone, Debug)]
pub(crate) struct Change<T> {
    /// 0 for the state of the stage, k for past state k.
    pub(crate) state: usize,
    /// 0, 1, 2: u, v, a.
    pub(crate) field: usize,
    pub(crate) rows: Vec<usize>,
    pub(crate) rules: Vec<Rule<T>>,
    /// m, and the total multipliers.
    pub(crate) multipliers: Vec<T>,
    pub(crate) totals: Vec<T>,
    pub(crate) share: T,
    /// Reported force and impulse per unit of m.
    pub(crate) force: T,
    pub(crate) impulse: T,
    /// Whether damping forces follow.
    pub(crate) damps: bool,
}

impl<T: Real> Change<T> {
    /// A change without rows.
    pub(crate) fn new(state: usize, field: usize) -> Self {
        Self {
            state,
            field,
            rows: Vec::new(),
            rules: Vec::new(),
            multipliers: Vec::new(),
            totals: Vec::new(),
            share: T::zero(),
            force: T::zero(),
            impulse: T::zero(),
            damps: false,
        }
    }
}

/// The changes of a stage, as corrections make them.
#[derive(Debug, Default)]
pub(crate) struct Changes<T> {
    pub(crate) list: Vec<Change<T>>,
    /// The jumps of v and a that are solved, and not removed yet.
    pub(crate) solved: [Option<Change<T>>; 2],
    pub(crate) refusal: Option<NoDerivative>,
}

impl<T: Real> Changes<T> {
    /// The length of the total impulse along the tangents of a contact in the velocity jumps solved last.
    pub(crate) fn impulse(&self, contact: usize) -> T {
        let velocity = |change: &&Change<T>| change.state == 0 && change.field == 1;
        let solved = self.solved[0].as_ref().or_else(|| self.list.iter().rev().find(velocity));
        let Some(Change { rows, rules, totals, .. }) = solved else { return T::zero() };
        let Some(normal) = rows.iter().position(|&row| row == contact) else { return T::zero() };
        let own = rules[normal + 1..].iter().zip(&totals[normal + 1..]);
        let tangential = own.take_while(|(rule, _)| matches!(rule, Rule::Slides { normal: at, .. } if *at == normal));
        tangential.fold(T::zero(), |size, (_, &total)| size.hypot(total))
    }
}

impl<T: Real> Tape<T> {
    /// An empty tape.
    pub(crate) fn new(start: State<T>, held: Vec<usize>, past: StartingPast) -> Self {
        let (steps, stages) = (Vec::new(), Vec::new());
        Self { start, held, past, steps, checkpoints: None, stages, refused: None, rows: None, refusal: None }
    }

    /// Forgets the stages of an attempt that was undone.
    pub(crate) fn begin_step(&mut self) {
        self.stages.clear();
        self.refused = None;
    }

    /// Adds a solved stage of the step that is being tried, or why it has no derivative.
    pub(crate) fn push(&mut self, stage: StageRecord<T>, refused: Option<NoDerivative>) {
        self.stages.push(stage);
        self.refused = self.refused.take().or(refused);
    }

    /// Refuses a gradient of this run, for the first reason given.
    pub(crate) fn refuse(&mut self, what: &'static str, reason: &'static str) {
        self.refusal.get_or_insert(NoDerivative { what, reason });
    }

    /// A copy of the rows, shared by all stages with the same version.
    pub(crate) fn rows(&mut self, rows: &ContactJacobian<T>, version: u64) -> Arc<ContactJacobian<T>> {
        match &self.rows {
            Some((known, shared)) if *known == version => Arc::clone(shared),
            _ => {
                let shared = Arc::new(rows.clone());
                self.rows = Some((version, Arc::clone(&shared)));
                shared
            }
        }
    }

    /// Adds the corrections of the stage recorded last, and its corrected state if it is wanted.
    pub(crate) fn correct(&mut self, changes: &mut Changes<T>, solved: Option<&Motion<T>>) {
        if let Some(stage) = self.stages.last_mut() {
            stage.changes.append(&mut changes.list);
            stage.solved = solved.cloned();
        }
        let refused = changes.refusal.take();
        self.refused = self.refused.take().or(refused);
    }

    /// Makes the stages recorded last an accepted step, which ends with a state and a history.
    pub(crate) fn end_step(&mut self, (starts, extrapolates): (bool, bool), state: &State<T>, history: &History<T>) {
        let (stages, h) = (std::mem::take(&mut self.stages), history.made_with);
        let refused = self.refused.take();
        self.refusal = self.refusal.take().or(refused);
        match &mut self.checkpoints {
            Some(checkpoints) => checkpoints.push(h, state, history),
            None => self.steps.push(StepRecord { h, starts, stages, state: state.clone(), extrapolates }),
        }
    }

    /// Number of steps recorded.
    pub(crate) fn len(&self) -> usize {
        self.checkpoints.as_ref().map_or(self.steps.len(), |checkpoints| checkpoints.sizes.len())
    }
}
