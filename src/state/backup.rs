//! Undoes a failed step: its rotations of the history, and its edits, from a copy of the past made at the first edit.

use super::Motion;
use crate::error::{Error, Result};
use crate::real::Real;

/// The past before the step, copied when a corrector first edits it.
#[derive(Debug)]
pub(crate) struct Backup<T> {
    /// Whether a step has begun and not ended: state and history then belong to its present stage.
    pub(crate) underway: bool,
    /// Number of times the step has rotated the history, once per stage.
    pub(crate) rotations: usize,
    /// The value of `rotations` when the copy was made, if there is one.
    kept: Option<usize>,
    /// The copy; no slots if no corrector edits the past.
    slots: Vec<Motion<T>>,
}

impl<T: Real> Backup<T> {
    /// Memory for `slots` past states.
    pub(crate) fn new(slots: usize, dofs: usize) -> Self {
        Self { underway: false, rotations: 0, kept: None, slots: vec![Motion::zero(dofs); slots] }
    }

    /// Discards the copy at the beginning of a step.
    pub(crate) fn begin(&mut self) {
        (self.rotations, self.kept) = (0, None);
    }

    /// Rejects edits that could not be undone.
    pub(crate) fn check(&self) -> Result<()> {
        match self.slots.is_empty() {
            false => Ok(()),
            true => Err(Error::Incompatible {
                part: "a corrector that projects the past".into(),
                reason: "its `edits` does not say so, and no room was kept to undo a failed step",
            }),
        }
    }

    /// The motion at the start of the step, before any edit; `past` is rotated by the stages.
    pub(crate) fn start<'p>(&'p self, past: &'p [Motion<T>]) -> &'p Motion<T> {
        let copy = self.kept.and_then(|rotations| self.slots.get(rotations.checked_sub(1)?));
        copy.unwrap_or(&past[self.rotations - 1])
    }

    /// The past states that the step may have edited.
    pub(crate) fn edited<'p>(&self, past: &'p [Motion<T>]) -> &'p [Motion<T>] {
        match self.kept {
            Some(_) => past,
            None => &[],
        }
    }

    /// Makes the copy if the step has none yet.
    pub(crate) fn keep(&mut self, past: &[Motion<T>]) {
        if self.kept.is_none() {
            for (copy, original) in self.slots.iter_mut().zip(past) {
                copy.copy_from(original);
            }
            self.kept = Some(self.rotations);
        }
    }

    /// Undoes all stages of a failed step: rotations and edits of the past.
    pub(crate) fn undo(&mut self, slots: &mut [Motion<T>]) {
        let kept = self.kept.take();
        slots.rotate_left(self.rotations - kept.unwrap_or(0));
        if let Some(rotations) = kept {
            for (original, copy) in slots[1..].iter_mut().zip(&self.slots) {
                original.copy_from(copy);
            }
            slots.rotate_left(rotations);
        }
    }
}
