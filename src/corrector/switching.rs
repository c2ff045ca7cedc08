//! Contacts on dofs without mass that close or open in a step: the reduction of their mean forces, and the impulses
//! that return the remaining work.

use crate::real::Real;
use crate::state::ContactState;
use std::ops::Range;

/// Contacts on dofs without mass that have closed or opened.
#[derive(Debug)]
pub(crate) struct Switching<T> {
    /// Gaps and raw multipliers at the start of the stage, one entry per candidate; `None` if no corrector needs
    /// them.
    pub(super) start: Option<[Vec<T>; 2]>,
    /// Reductions of the mean contact forces in this stage, one per row.
    pub(super) excess: Vec<Excess<T>>,
    /// Rows that have closed or opened in this stage.
    pub(super) rows: Vec<usize>,
    /// Contacts that have closed or opened in this step.
    pub(super) switches: Vec<Switch<T>>,
    /// A change of v, and M times it.
    pub(super) change: Vec<T>,
    pub(super) momentum: Vec<T>,
}

/// The part of the mean force that a contact does not exert over a stage, and the work that it thereby does not do.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Excess<T> {
    pub(crate) force: T,
    pub(crate) work: T,
    /// Error of the force before its last change.
    miss: T,
}

/// Bounds of the fraction of a miss by which an excess may change.
const SMALLEST_PART: f64 = 0.05;
const LARGEST_PART: f64 = 4.0;

/// Largest number of tangential rows of a contact.
const TANGENTS: usize = 2;

/// A contact that has closed or opened in this step.
#[derive(Debug)]
pub(super) struct Switch<T> {
    pub(super) row: usize,
    /// Largest impulse that the contact may have exerted in excess.
    pub(super) most: T,
    /// Largest impulse that the contact may have exerted too little, because its force was already reduced.
    pub(super) least: T,
    /// Friction divided by the normal force; it acts as long as the normal force does.
    friction: [T; TANGENTS],
    /// The impulse J that returns the work taken by the contact, and the energy that this impulse alone returns.
    pub(super) impulse: T,
    pub(super) returned: T,
    /// Work of the corresponding friction impulse.
    pub(super) by_friction: T,
}

impl<T: Real> Switch<T> {
    /// A contact that has closed or opened, with the ratio of its friction to its normal force.
    pub(super) fn new(row: usize, [most, least]: [T; 2], along: impl Iterator<Item = T>) -> Self {
        let mut friction = [T::zero(); TANGENTS];
        for (share, own) in friction.iter_mut().zip(along) {
            *share = own;
        }
        Self { row, most, least, friction, impulse: T::zero(), returned: T::zero(), by_friction: T::zero() }
    }

    /// J along the normal row, and the friction impulses along the tangential rows.
    pub(super) fn impulses(&self, tangents: Range<usize>) -> impl Iterator<Item = (usize, T)> + use<T> {
        let (impulse, friction) = (self.impulse, self.friction);
        let along = tangents.zip(friction).map(move |(tangent, share)| (tangent, share * impulse));
        std::iter::once((self.row, impulse)).chain(along)
    }
}

impl<T: Real> Switching<T> {
    /// For a system of `dofs` dofs; `None` if no corrector needs it.
    pub(super) fn new(dofs: Option<usize>) -> Self {
        let vector = || dofs.map_or(Vec::new(), |dofs| vec![T::zero(); dofs]);
        Self {
            start: dofs.map(|_| [Vec::new(), Vec::new()]),
            excess: Vec::new(),
            rows: Vec::new(),
            switches: Vec::new(),
            change: vector(),
            momentum: vector(),
        }
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
        self.excess.clear();
        self.excess.resize(contacts.gap.len(), Excess::default());
        self.rows.clear();
        if is_first {
            self.switches.clear();
        }
    }

    /// The gap of a row at the start of the stage.
    pub(crate) fn gap(&self, row: usize) -> T {
        self.start.as_ref().map_or(T::zero(), |[gaps, _]| gaps[row])
    }

    /// The force of a row at the start and at the end of the stage, and the reduction of their mean.
    pub(crate) fn forces(&mut self, row: usize, contacts: &ContactState<T>) -> (T, T, &mut Excess<T>) {
        let before = self.start.as_ref().map_or(T::zero(), |[_, forces]| forces[row]);
        (before, contacts.lambda_raw[row], &mut self.excess[row])
    }

    /// Whether a row closes or opens in the stage, or has a reduced force.
    pub(crate) fn switches(&self, contacts: &ContactState<T>) -> bool {
        let Some([_, forces]) = &self.start else { return false };
        let mut rows = self.excess.iter().zip(forces).zip(&contacts.lambda_raw);
        rows.any(|((excess, &before), &after)| excess.force != T::zero() || (before > T::zero()) != (after > T::zero()))
    }

    /// Adds a fraction of each row's miss to its excess: one half in the first iteration (`before` is `None`), then
    /// the factor of Irons and Tuck (Int. J. Numer. Meth. Eng. 1, 1969) from the last fraction. A reduced force lets
    /// an opening contact open farther, so that it needs a smaller reduction; it lets a closing contact penetrate
    /// deeper, so that it needs a larger one. Returns the fraction.
    pub(crate) fn move_excess(&mut self, misses: &[T], before: Option<T>) -> T {
        let mut part = T::of(0.5);
        if let Some(before) = before {
            let (mut along, mut square) = (T::zero(), T::zero());
            for (excess, &miss) in self.excess.iter().zip(misses) {
                let change = miss - excess.miss;
                along += excess.miss * change;
                square += change * change;
            }
            part = (before * along / square).abs().min(T::of(LARGEST_PART)).max(T::of(SMALLEST_PART));
        }
        for (excess, &miss) in self.excess.iter_mut().zip(misses) {
            excess.force += part * miss;
            excess.miss = miss;
        }
        part
    }

    /// Removes all reductions, so that all rows exert their full forces.
    pub(crate) fn forget_excess(&mut self) {
        self.excess.fill(Excess::default());
    }

    /// Force reductions of all rows, with the corresponding friction.
    pub(crate) fn excess_forces<'s>(&'s self, contacts: &'s ContactState<T>) -> impl Iterator<Item = (usize, T)> + 's {
        let rows = self.excess.iter().enumerate().filter(|(_, excess)| excess.force != T::zero());
        rows.flat_map(move |(row, excess)| {
            let after = &contacts.lambda_raw;
            let all = match &self.start {
                Some([_, before]) if after[row] <= T::zero() => before,
                _ => after,
            };
            // A row whose force has become zero has no friction either.
            let share = if all[row] > T::zero() { excess.force / all[row] } else { T::zero() };
            let along = contacts.tangents.of(row).map(move |tangent| (tangent, share * all[tangent]));
            std::iter::once((row, excess.force)).chain(along)
        })
    }

    /// Subtracts the impulses of the force reductions over a time, and books the work that they return.
    pub(crate) fn book_excess(&self, time: T, contacts: &mut ContactState<T>) {
        for (row, excess) in self.excess.iter().enumerate() {
            contacts.dissipated[row] += excess.work;
        }
        let mut impulses = std::mem::take(&mut contacts.impulse);
        for (row, force) in self.excess_forces(contacts) {
            impulses[row] -= time * force;
        }
        contacts.impulse = impulses;
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
