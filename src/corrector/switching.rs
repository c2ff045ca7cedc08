//! Contacts on dofs without mass that close or open in a step: what they exert less than the mean of their forces, and
//! the impulses that return what is left.

use crate::real::Real;
use crate::state::ContactState;
use std::ops::Range;

/// What has closed or opened on dofs without mass.
#[derive(Debug)]
pub(crate) struct Switching<T> {
    /// Gaps and raw multipliers where the stage starts, one a candidate; none without a corrector that asks.
    pub(super) start: Option<[Vec<T>; 2]>,
    /// What contacts exert less than their mean forces in this stage, one a row.
    pub(super) excess: Vec<Excess<T>>,
    /// Rows that have closed or opened in this stage.
    pub(super) rows: Vec<usize>,
    /// Those of this step.
    pub(super) switches: Vec<Switch<T>>,
    /// A change of v, and M times it.
    pub(super) change: Vec<T>,
    pub(super) momentum: Vec<T>,
}

/// A force that a contact does not exert over a stage, and the work that it does not do.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Excess<T> {
    pub(crate) force: T,
    pub(crate) work: T,
    /// What the force missed before it was changed last.
    miss: T,
}

/// The parts of a miss by which an excess may move.
const SMALLEST_PART: f64 = 0.05;
const LARGEST_PART: f64 = 4.0;

/// The most directions in which a contact rubs.
const TANGENTS: usize = 2;

/// A contact that has closed or opened in this step.
#[derive(Debug)]
pub(super) struct Switch<T> {
    pub(super) row: usize,
    /// The most that its impulse can have been too large by, h λ.
    pub(super) most: T,
    /// The most by which it may have been too small, for less was exerted already.
    pub(super) least: T,
    /// Friction over the force of the gap: it is there as long as that is.
    friction: [T; TANGENTS],
    /// The impulse that gives back what the contact has taken, J, and what the bodies get by it alone.
    pub(super) impulse: T,
    pub(super) returned: T,
    /// What its friction, smaller as well, does to them.
    pub(super) by_friction: T,
}

impl<T: Real> Switch<T> {
    /// A contact that has closed or opened, with its friction over the force of its gap.
    pub(super) fn new(row: usize, [most, least]: [T; 2], along: impl Iterator<Item = T>) -> Self {
        let mut friction = [T::zero(); TANGENTS];
        for (share, own) in friction.iter_mut().zip(along) {
            *share = own;
        }
        Self { row, most, least, friction, impulse: T::zero(), returned: T::zero(), by_friction: T::zero() }
    }

    /// J along the row of the gap, and its share along those of friction.
    pub(super) fn impulses(&self, tangents: Range<usize>) -> impl Iterator<Item = (usize, T)> + use<T> {
        let (impulse, friction) = (self.impulse, self.friction);
        let along = tangents.zip(friction).map(move |(tangent, share)| (tangent, share * impulse));
        std::iter::once((self.row, impulse)).chain(along)
    }
}

impl<T: Real> Switching<T> {
    /// For so many rows of a system of so many dofs, if a corrector asks for it.
    pub(super) fn new(rows: usize, dofs: Option<usize>) -> Self {
        let vector = || dofs.map_or(Vec::new(), |dofs| vec![T::zero(); dofs]);
        let rows = if dofs.is_some() { rows } else { 0 };
        Self {
            start: dofs.map(|_| [Vec::with_capacity(rows), Vec::with_capacity(rows)]),
            excess: Vec::with_capacity(rows),
            rows: Vec::with_capacity(rows),
            switches: Vec::with_capacity(2 * rows),
            change: vector(),
            momentum: vector(),
        }
    }

    /// Room for so many rows.
    pub(super) fn make_room(&mut self, rows: usize) {
        let Some(start) = &mut self.start else { return };
        for values in start {
            values.reserve(rows.saturating_sub(values.len()));
        }
        self.excess.reserve(rows.saturating_sub(self.excess.len()));
        self.rows.reserve(rows.saturating_sub(self.rows.len()));
        self.switches.reserve((2 * rows).saturating_sub(self.switches.len()));
    }

    /// Whether a corrector asks for it.
    pub(crate) fn is_on(&self) -> bool {
        self.start.is_some()
    }

    /// Notes the contacts where a stage starts, the first of its step or another one.
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

    /// The gap of a row where the stage starts.
    pub(crate) fn gap(&self, row: usize) -> T {
        self.start.as_ref().map_or(T::zero(), |[gaps, _]| gaps[row])
    }

    /// The force of a row where the stage starts, and where it ends, and what of their mean is not exerted.
    pub(crate) fn forces(&mut self, row: usize, contacts: &ContactState<T>) -> (T, T, &mut Excess<T>) {
        let before = self.start.as_ref().map_or(T::zero(), |[_, forces]| forces[row]);
        (before, contacts.lambda_raw[row], &mut self.excess[row])
    }

    /// Whether a row may close or open in the stage, or exerts less.
    pub(crate) fn switches(&self, contacts: &ContactState<T>) -> bool {
        let Some([_, forces]) = &self.start else { return false };
        let mut rows = self.excess.iter().zip(forces).zip(&contacts.lambda_raw);
        rows.any(|((excess, &before), &after)| excess.force != T::zero() || (before > T::zero()) != (after > T::zero()))
    }

    /// Moves the excess of all rows by a part of what it misses, that of Irons and Tuck (Int. J. Numer. Meth. Eng. 1,
    /// 1969) behind another one: a contact that opens and presses less comes out farther and asks for less, one that
    /// closes and presses less goes in farther and asks for more. Says which part.
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

    /// Lets all rows exert what they have.
    pub(crate) fn forget_excess(&mut self) {
        self.excess.fill(Excess::default());
    }

    /// What rows exert less, with the friction that belongs to it.
    pub(crate) fn excess_forces<'s>(&'s self, contacts: &'s ContactState<T>) -> impl Iterator<Item = (usize, T)> + 's {
        let rows = self.excess.iter().enumerate().filter(|(_, excess)| excess.force != T::zero());
        rows.flat_map(move |(row, excess)| {
            let after = &contacts.lambda_raw;
            let all = match &self.start {
                Some([_, before]) if after[row] <= T::zero() => before,
                _ => after,
            };
            // (A row that has come to exert nothing at all has no friction either.)
            let share = if all[row] > T::zero() { excess.force / all[row] } else { T::zero() };
            let along = contacts.tangents.of(row).map(move |tangent| (tangent, share * all[tangent]));
            std::iter::once((row, excess.force)).chain(along)
        })
    }

    /// Books what rows exert less over a time, and the work that they have given back so.
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

    /// Notes a row on dofs without mass after the contact of a stage was solved.
    pub(crate) fn note(&mut self, row: usize, contacts: &ContactState<T>) {
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
