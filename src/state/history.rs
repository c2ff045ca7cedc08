//! The past of a run.

use super::{Clock, Motion, Overclosures, Pace};
use crate::error::{Error, Result};
use crate::real::Real;

/// The past states that a multistep scheme reads, and the clock of the run.
#[derive(Clone, Debug)]
pub struct History<T> {
    /// Slot 0 is spare between steps; past state k (k ≥ 1) is slot k.
    pub(crate) slots: Vec<Motion<T>>,
    /// Number of known states, including the current one.
    pub(crate) known: usize,
    /// Number of newest states since the motion last jumped because a contact closed or opened, or because of
    /// friction; includes the first state after the jump.
    pub(crate) smooth: usize,
    pub(crate) clock: Clock,
    pub(crate) pace: Pace,
    /// Step size that led to the current state.
    pub(crate) made_with: f64,
    /// The computed motions, from which changes of the step size resample; empty until it first changes.
    pub(crate) computed: ComputedMotions<T>,
    /// v and a of the current state as computed, if a change of the step size has moved the stored ones to another
    /// time.
    pub(crate) unshifted: [Vec<T>; 2],
    /// (u_n − u_{n−1})/h on the dofs without mass: their velocity is a difference over two steps.
    pub(crate) slopes: Vec<T>,
    /// Name of the integrator: another one would interpret the same states differently.
    pub(crate) scheme: String,
    /// Offsets added to the gaps because bodies overlapped at the start.
    pub(crate) overclosures: Option<Overclosures<T>>,
}

/// Motions before the current one as computed, newest first, with any spacing.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(bound = "T: Real"))]
pub(crate) struct ComputedMotions<T> {
    /// Each motion with the step size that led to it; entries beyond `known` are spare.
    states: Vec<(Motion<T>, f64)>,
    pub(super) known: usize,
}

impl<T: Real> ComputedMotions<T> {
    /// Memory for `length` states, the newest of which are `known`.
    pub(crate) fn new(length: usize, dofs: usize, known: &[(&Motion<T>, f64)]) -> Self {
        let mut computed = Self { states: vec![(Motion::zero(dofs), 0.0); length], known: 0 };
        for (motion, h) in known.iter().rev() {
            computed.push(motion, *h);
        }
        computed
    }

    /// Capacity in states.
    #[cfg(feature = "serde")]
    pub(crate) fn room(&self) -> usize {
        self.states.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Adds a motion at the front without allocating; the oldest is dropped.
    pub(crate) fn push(&mut self, motion: &Motion<T>, h: f64) {
        self.states.rotate_right(1);
        if let Some((front, made_with)) = self.states.first_mut() {
            front.copy_from(motion);
            *made_with = h;
            self.known = (self.known + 1).min(self.states.len());
        }
    }

    /// The newest motion, mutable.
    pub(crate) fn front(&mut self) -> Option<&mut Motion<T>> {
        self.states.first_mut().map(|(motion, _)| motion)
    }

    /// All motions, including spare ones.
    #[cfg(feature = "serde")]
    pub(crate) fn all(&mut self) -> impl Iterator<Item = &mut Motion<T>> {
        self.states.iter_mut().map(|(motion, _)| motion)
    }

    /// The known motions.
    pub(crate) fn known(&self) -> impl Iterator<Item = (&Motion<T>, f64)> {
        self.states[..self.known].iter().map(|(motion, h)| (motion, *h))
    }
}

impl<T: Real> History<T> {
    /// Step size for building a simulation that continues this run. Under [`StepControl`](crate::StepControl) it is
    /// the nominal one; the next step ([`Simulation::step_size`](crate::Simulation::step_size)) may be this size
    /// halved repeatedly.
    pub fn step_size(&self) -> f64 {
        self.pace.nominal
    }

    /// Number of known past states, without the current one.
    pub fn len(&self) -> usize {
        self.known - 1
    }

    /// Whether no past state is known.
    pub fn is_empty(&self) -> bool {
        self.known <= 1
    }

    /// Displacement, velocity and acceleration of past state k = 1 (before the current one), 2, …, as later steps
    /// read them: after a history projection they differ from the values shown to observers.
    pub fn past(&self, k: usize) -> Option<(&[T], &[T], &[T])> {
        let motion = self.slots.get(k).filter(|_| (1..self.known).contains(&k))?;
        Some((&motion.u, &motion.v, &motion.a))
    }

    /// Number of states that steps and changes of the step size read, including the current one. One-step schemes read
    /// no past; if they store v or a at another time (`is_shifted`), a first change of the step size reads one.
    #[cfg(feature = "serde")]
    pub(super) fn read(&self, is_shifted: bool) -> usize {
        self.known.max(if is_shifted { self.smooth.min(2) } else { 1 })
    }

    /// All motions, and whether they are read.
    #[cfg(feature = "serde")]
    pub(super) fn motions(&mut self, is_shifted: bool) -> impl Iterator<Item = (bool, &mut Motion<T>)> {
        let (past, known) = (1..self.read(is_shifted), self.computed.known);
        let slots = self.slots.iter_mut().enumerate().map(move |(slot, motion)| (past.contains(&slot), motion));
        slots.chain(self.computed.all().enumerate().map(move |(state, motion)| (state < known, motion)))
    }

    /// The motion of the stage that is being solved, and the states before it.
    pub(crate) fn new_and_past(&self) -> (&Motion<T>, &[Motion<T>]) {
        (&self.slots[0], &self.slots[1..])
    }

    /// Adds the state before an accepted step, in slot 1, to the past of a scheme that reads `depth` states; `u` are
    /// the displacements at the end of the step. `jumps`: the motion is not smooth in the step.
    pub(crate) fn extend(&mut self, u: &[T], massless: &[usize], depth: usize, jumps: bool) {
        self.known = (self.known + 1).min(depth);
        self.smooth = if jumps { 1 } else { self.smooth + 1 };
        if !self.computed.is_empty() {
            self.computed.push(&self.slots[1], self.made_with);
            for (field, unshifted) in (1..).zip(&mut self.unshifted) {
                if let Some(front) = self.computed.front().filter(|_| !unshifted.is_empty()) {
                    std::mem::swap(front.field_mut(field), unshifted);
                    unshifted.clear();
                }
            }
        }
        for (slope, &dof) in self.slopes.iter_mut().zip(massless) {
            *slope = (u[dof] - self.slots[1].u[dof]) / T::of(self.clock.h);
        }
        self.made_with = self.clock.h;
        self.clock.steps += 1;
    }

    /// Rejects a history that does not fit a system of this size, with `slots` motions and `massless` dofs without
    /// mass.
    pub(crate) fn check(&self, dofs: usize, slots: usize, massless: usize) -> Result<()> {
        let wrong = |what, expected, found| Err(Error::Dimension { what, expected, found });
        if self.slopes.len() != massless {
            return wrong("the history (dofs without mass)", massless, self.slopes.len());
        }
        if self.slots.len() != slots {
            return wrong("the history (states)", slots, self.slots.len());
        }
        for motion in &self.slots {
            for found in (0..3).map(|field| motion.field(field).len()) {
                if found != dofs {
                    return wrong("a state of the history", dofs, found);
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (Made by hand: a simulation would be compiled once more for this test.)
    #[test]
    fn pasts_that_do_not_fit_are_refused() {
        let history = History::<f64> {
            slots: vec![Motion::zero(2); 3],
            known: 1,
            smooth: 1,
            clock: Clock::new(0.0, 0.1),
            pace: Pace::new(0.1),
            made_with: 0.1,
            computed: ComputedMotions::default(),
            unshifted: [Vec::new(), Vec::new()],
            slopes: Vec::new(),
            scheme: "BDF2".into(),
            overclosures: None,
        };
        let slots = history.slots.len();
        history.check(2, slots, 0).unwrap();
        assert!(history.check(2, slots + 1, 0).is_err() && history.check(2, slots, 1).is_err());
        for slot in 0..slots {
            for field in 0..3 {
                let mut short = history.clone();
                let Motion { u, v, a, .. } = &mut short.slots[slot];
                [u, v, a][field].truncate(1);
                let error = short.check(2, slots, 0).unwrap_err();
                assert!(matches!(error, Error::Dimension { expected: 2, found: 1, .. }), "{error}");
            }
        }
    }
}
