//! Contacts on dofs without mass that close or open in a step, and the impulses that return their work.

use crate::real::Real;
use crate::state::ContactState;
use std::ops::Range;

/// Contacts on dofs without mass that have closed or opened.
#[derive(Debug)]
pub(crate) struct Switching<T> {
    /// Gaps and raw multipliers at the start of the stage, one entry per candidate; `None` if no corrector needs
    /// them.
    pub(super) start: Option<[Vec<T>; 2]>,
    /// Rows that have closed or opened in this stage.
    pub(super) rows: Vec<usize>,
    /// Contacts that have closed or opened in this step.
    pub(super) switches: Vec<Switch<T>>,
    /// A change of v, and M times it.
    pub(super) change: Vec<T>,
    pub(super) momentum: Vec<T>,
}

/// Largest number of tangential rows of a contact.
const TANGENTS: usize = 2;

/// A contact that has closed or opened in this step.
#[derive(Debug)]
pub(super) struct Switch<T> {
    pub(super) row: usize,
    /// Largest impulse that the contact may have exerted in excess.
    pub(super) most: T,
    /// Friction divided by the normal force; it acts as long as the normal force does.
    friction: [T; TANGENTS],
    /// The impulse J that returns the work taken by the contact, and the energy that this impulse alone returns.
    pub(super) impulse: T,
    pub(super) returned: T,
}

impl<T: Real> Switch<T> {
    /// A contact that has closed or opened, with the ratio of its friction to its normal force.
    pub(super) fn new(row: usize, most: T, along: impl Iterator<Item = T>) -> Self {
        let mut friction = [T::zero(); TANGENTS];
        for (share, own) in friction.iter_mut().zip(along) {
            *share = own;
        }
        Self { row, most, friction, impulse: T::zero(), returned: T::zero() }
    }

    /// J along the normal row, and the friction impulses along the tangential rows.
    pub(super) fn impulses(&self, tangents: Range<usize>) -> impl Iterator<Item = (usize, T)> + use<T> {
        let (impulse, friction) = (self.impulse, self.friction);
        let along = tangents.zip(friction).map(move |(tangent, share)| (tangent, share * impulse));
        std::iter::once((self.row, impulse)).chain(along)
    }
}

impl<T: Real> Switching<T> {
    /// Memory for `rows` rows of a system of `dofs` dofs; `None` if no corrector needs it.
    pub(super) fn new(rows: usize, dofs: Option<usize>) -> Self {
        let vector = || dofs.map_or(Vec::new(), |dofs| vec![T::zero(); dofs]);
        let rows = if dofs.is_some() { rows } else { 0 };
        Self {
            start: dofs.map(|_| [Vec::with_capacity(rows), Vec::with_capacity(rows)]),
            rows: Vec::with_capacity(rows),
            switches: Vec::with_capacity(2 * rows),
            change: vector(),
            momentum: vector(),
        }
    }

    /// Reserves memory for this many rows.
    pub(super) fn make_room(&mut self, rows: usize) {
        let Some(start) = &mut self.start else { return };
        for values in start {
            values.reserve(rows.saturating_sub(values.len()));
        }
        self.rows.reserve(rows.saturating_sub(self.rows.len()));
        self.switches.reserve((2 * rows).saturating_sub(self.switches.len()));
    }

    /// Whether a corrector needs these data.
    pub(crate) fn is_on(&self) -> bool {
        self.start.is_some()
    }

    /// Stores the contacts at the start of a stage; `is_first` marks the first stage of a step.
    pub(crate) fn begin(&mut self, contacts: &ContactState<T>, is_first: bool) {
        let Some([gaps, forces]) = &mut self.start else { return };
        gaps.clone_from(&contacts.gap);
        forces.clone_from(&contacts.lambda_raw);
        self.rows.clear();
        if is_first {
            self.switches.clear();
        }
    }

    /// Checks a row on dofs without mass after the contact problem of a stage: stores it if it has closed or opened.
    pub(crate) fn record(&mut self, row: usize, contacts: &ContactState<T>) {
        let Some([gaps, forces]) = &self.start else { return };
        let (gap, force) = match (forces[row] > T::zero(), contacts.lambda_raw[row] > T::zero()) {
            (false, true) => (gaps[row], contacts.lambda_raw[row]),
            (true, false) => (contacts.gap[row], forces[row]),
            _ => return,
        };
        if gap > T::zero() && (gap * force).is_finite() {
            self.rows.push(row);
        }
    }

    /// Whether there is something to correct.
    pub(crate) fn is_pending(&self) -> bool {
        !self.rows.is_empty() || !self.switches.is_empty()
    }
}
